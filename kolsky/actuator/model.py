"""An actuator of a material, its pressures and its weight, and the equilibria along a history of pressures.

The bending angle is the one through which the chord from the base's clamped end to its free one has turned
towards the base,

    Theta = atan2((t - o) . b, (t - o) . a),                                                   (A.1)

with the positions o and t of these two points, the actuator's axis a at rest and the direction b out of its
base. The angle counted from another direction
in that plane, such as the vertical through the base, differs by the angle between it and the axis at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from implicit.arc_length import ArcPath, follow
from implicit.conditions import Condition, Fixed, Gravity, Pressure, SelfContact
from implicit.laws.solid import Solid
from implicit.meshes import Mesh
from implicit.model import Model
from implicit.newton import Newton
from implicit.sensitivity import direct
from implicit.solution import Solution
from implicit.solve import solve
from kolsky.base.arrays import FloatArray

WEIGHT = "weight"
"""History that lets the weight act, 0 or 1."""
AXIS, BEND = 0, 2
"""Coordinates of the axis a = +x and of b = -z."""


@dataclass(frozen=True)
class Actuator:
    """A mesh with the sets of `kolsky.actuator.geometry.Pneunet.mesh`, and its material."""

    mesh: Mesh
    """The mesh."""
    cavities: tuple[str, ...]
    """Sets of pressurised walls; each has a pressure of its own."""
    solid: Solid
    """The material."""
    density: float
    """Mass density at rest [kg/m^3]."""
    mixed: bool = False
    """Whether volume ratio and pressure are fields of their own (nearly incompressible materials)."""
    device: str = "cpu"
    """Where the element kernels run."""
    contacts: tuple[SelfContact, ...] = ()
    """Walls of neighbouring chambers that may touch."""

    @property
    def histories(self) -> tuple[str, ...]:
        """Names of the pressures in a solution."""
        return tuple(f"pressure of {name}" for name in self.cavities)

    def model(self, gravity: Sequence[float] | FloatArray) -> Model:
        """The model with an acceleration of free fall [m/s^2], shape [3].

        Raises
        ------
        ValueError
            If gravity points across the mirror plane of a half.
        """
        g = tuple(float(value) for value in gravity)
        conditions: list[Condition] = [Fixed("clamp")]
        if "mirror" in self.mesh.sets:
            if g[1] != 0.0:
                raise ValueError("gravity along y needs the whole actuator: set half = false")
            conditions.append(Fixed("mirror", (1,)))
        conditions.append(Gravity(self.density, g, WEIGHT))
        conditions += [Pressure(c, h) for c, h in zip(self.cavities, self.histories, strict=True)]
        conditions += self.contacts
        return Model(
            self.mesh,
            self.solid,
            tuple(conditions),
            volumetric="mixed" if self.mixed else "displacement",
            device=self.device,
        )

    def simulate(
        self,
        gravity: Sequence[float] | FloatArray,
        pressures: FloatArray,
        *,
        solid: Solid | None = None,
        guess: FloatArray | None = None,
        newton: Newton | None = None,
    ) -> "Bending":
        """Equilibria under pressures [Pa] of shape [n] (all cavities alike) or [n, n_cavities].

        `solid` is another material in place of the actuator's own; `guess` as of `implicit.solve.solve`.
        """
        table = np.asarray(pressures, dtype=float)
        table = np.repeat(table[:, None], len(self.cavities), axis=1) if table.ndim == 1 else table
        if table.ndim != 2 or table.shape[1] != len(self.cavities):
            raise ValueError(f"pressures must have shape [n, {len(self.cavities)}], got {table.shape}")
        steps = {WEIGHT: np.ones(len(table)), **dict(zip(self.histories, table.T, strict=True))}
        model = self.model(gravity)
        constants = None if solid is None else solid.parameters()
        return Bending(solve(model, steps, constants, guess=guess, newton=newton), table)

    def follow(
        self,
        gravity: Sequence[float] | FloatArray,
        pressures: FloatArray,
        *,
        first: float,
        steps: int = 200,
        longest: float = 4.0,
        solid: Solid | None = None,
    ) -> tuple["Bending", ArcPath]:
        """Equilibria under rising pressures [Pa] of shape [n], the same in all cavities, past limit points.

        Parameters
        ----------
        gravity, pressures, solid
            As of `simulate`.
        first, steps, longest
            As of `implicit.arc_length.follow`.

        Returns
        -------
        tuple of Bending, ArcPath
            The equilibria that a pressure raised from 0 meets, and the whole path between them.

        Raises
        ------
        ValueError
            If the path ends before the last pressure, with its reason.
        """
        constants = None if solid is None else solid.parameters()
        path = follow(
            self.model(gravity),
            self.histories,
            until=float(pressures[-1]),
            first=first,
            others={WEIGHT: 1.0},
            parameters=constants,
            steps=steps,
            longest=longest,
        )
        if not path.outcome.ok:
            highest = 1e-5 * float(path.load.max())
            turned = ", where the pressure has a limit point" if path.limits.size else ""
            cause, cure = path.outcome.cause, path.outcome.cure
            raise ValueError(f"the path rises to {highest:.3g} bar{turned}: {cause}; {cure}")
        found = self.simulate(gravity, pressures, solid=solid, guess=path.crossings(pressures))
        return found, path


@dataclass(frozen=True)
class Bending:
    """Equilibria of an actuator."""

    solution: Solution
    """Displacements and how it ended."""
    pressures: FloatArray
    """Pressure of each cavity at each step [Pa], shape [n, n_cavities]."""

    @property
    def angle(self) -> FloatArray:
        """Bending angle, Eq. (A.1) [rad], shape [n]; NaN of steps that were not reached."""
        return bend_of(self.chord)

    @property
    def chord(self) -> FloatArray:
        """Vector from the origin to the tip [m], shape [n, 3]."""
        return self.positions("tip") - self.positions("origin")

    def positions(self, where: str) -> FloatArray:
        """Mean position of a set of points [m], shape [n, 3]."""
        mesh = self.solution.model.mesh
        return np.asarray(
            mesh.points[mesh.nodes(where)].mean(axis=0) + self.solution.mean_displacement(where)
        )

    def slopes(self) -> FloatArray:
        """dTheta/dp by the pressure of each cavity [rad/Pa], shape [n, n_cavities]; exact."""
        names = tuple(h for h in self.solution.model.histories if h != WEIGHT)
        found = direct(self.solution, histories=names)
        tip, origin = (found.mean_displacement(where) for where in ("tip", "origin"))
        by = (tip - origin)[:, -len(names) :]  # the constants stand before the histories
        return np.einsum("nd,npd->np", bend_slope(self.chord), by)


def bend_of(chord: FloatArray) -> FloatArray:
    """Eq. (A.1) of chords [m] of shape [..., 3], in rad."""
    return np.asarray(np.arctan2(-chord[..., BEND], chord[..., AXIS]))


def bend_slope(chord: FloatArray) -> FloatArray:
    """Derivative of Eq. (A.1) by the chord [rad/m], shape [..., 3]."""
    x, z = chord[..., AXIS], chord[..., BEND]
    square = x**2 + z**2
    slope = np.zeros_like(chord)
    slope[..., AXIS], slope[..., BEND] = z / square, -x / square
    return slope
