"""A bending actuator of chambers (Pneunet).

Mesh, material, weight, wall contact, equilibria under pressure.

The bending angle is a rotation of the chord from the base's clamped end to its free end. The rotation is
positive toward the base.

    Theta = atan2((t - o) . b, (t - o) . a),                                                   (A.1)

with the positions o and t of these two points, the actuator's axis a at rest and the direction b out of its
base. An angle from another direction in that plane, such as the vertical through the base, differs by a
constant. It is the angle between that direction and the axis at rest.

The actuator lies along x. The origin is the middle of the lower edge of its clamped end. Its base is the side
z = 0 with the chambers on it. A channel along the base connects them and continues through the inlet to the
clamped end. Inside, the parts along x are

    inlet, wall, chamber, wall, gap, wall, chamber, wall, gap, ... , wall, chamber, wall,

and along z the base, the channel, the rest of the chamber and its roof. Between neighbouring chambers, the
gap is open above the channel's roof. Every part is divided into cells with sizes nearest to the requested
one. Walls have at least `through_wall` cells. Without gravity along y, the actuator is symmetric about the
plane y = 0, and half of it is enough.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.equilibrium.loads import faces_on
from kolsky.equilibrium.meshes import Mesh, grid
from kolsky.equilibrium.model import (
    Condition,
    Fixed,
    Gravity,
    Model,
    Pressure,
    RigidSurface,
    SelfContact,
    unit,
)
from kolsky.equilibrium.sensitivity import direct
from kolsky.equilibrium.solid import Solid
from kolsky.equilibrium.solution import Solution
from kolsky.equilibrium.solve import Newton, solve
from kolsky.equilibrium.surface_contact import surface_contacts


@dataclass(frozen=True)
class Part:
    """Cells with other constants of the same law, such as a stiff layer in the base."""

    name: str
    solid: Solid
    density: float
    """Mass density at rest [kg/m^3]."""
    cells: IntArray
    """Numbers of its cells, shape [m]."""


WEIGHT = "weight"
"""Name of the history that switches the weight on, 0 or 1."""
AXIS, BEND = 0, 2
"""Coordinates of the axis a = +x and of b = -z."""


@dataclass(frozen=True)
class Actuator:
    """A mesh with the sets of `kolsky.bodies.actuator_model.Pneunet.mesh`, and its material."""

    mesh: Mesh
    cavities: tuple[str, ...]
    """Sets of pressurised walls. Each set has a separate pressure."""
    solid: Solid
    density: float
    """Mass density at rest [kg/m^3]."""
    mixed: bool = False
    """True if volume ratio and pressure are separate fields (for nearly incompressible materials)."""
    device: str = "cpu"
    contacts: tuple[SelfContact, ...] = ()
    """Walls of neighbouring chambers that may touch."""
    parts: tuple[Part, ...] = ()
    """Parts of other materials. A cell in two parts belongs to the later part."""
    world: tuple[Fixed | RigidSurface, ...] = ()
    """Point sets that are fixed, and rigid planes that the actuator may touch."""

    @property
    def histories(self) -> tuple[str, ...]:
        """Names of the pressures in a solution."""
        return tuple(f"pressure of {name}" for name in self.cavities)

    @property
    def regions(self) -> IntArray | None:
        """Region of each cell: 0 of `solid`, then the parts, shape [m]; None without parts."""
        if not self.parts:
            return None
        regions = np.zeros(len(self.mesh.cells), dtype=np.int64)
        for number, part in enumerate(self.parts, start=1):
            regions[part.cells] = number
        return regions

    @property
    def density_of_regions(self) -> tuple[float, ...]:
        """Mass density of each region [kg/m^3]."""
        return (self.density, *(part.density for part in self.parts))

    def constants(self, factor: float = 1.0, *, body: Solid | None = None) -> FloatArray:
        """Constants of each region with all moduli multiplied by a factor, shape [n_regions, n_parameters].
        `body`: a material that replaces `solid`."""
        solids = (self.solid if body is None else body, *(part.solid for part in self.parts))
        return np.array([one.scaled(factor).parameters() for one in solids])

    def model(self, gravity: Sequence[float] | FloatArray) -> Model:
        """The model with an acceleration of free fall [m/s^2], shape [3].

        Raises ValueError if gravity points across the mirror plane of a half.
        """
        g = tuple(float(value) for value in gravity)
        conditions: list[Condition] = [Fixed("clamp")]
        if "mirror" in self.mesh.sets:
            if g[1] != 0.0:
                raise ValueError("gravity along y needs the whole actuator: set half = false")
            conditions.append(Fixed("mirror", (1,)))
        conditions.append(Gravity(self.density_of_regions, g, WEIGHT))
        conditions += [Pressure(c, h) for c, h in zip(self.cavities, self.histories, strict=True)]
        conditions += [*self.contacts, *self.world]
        return Model(
            self.mesh, self.solid, tuple(conditions), volumetric="mixed" if self.mixed else "displacement",
            regions=self.regions, others=tuple(part.solid for part in self.parts), device=self.device,
        )  # fmt: skip

    def simulate(
        self,
        gravity: Sequence[float] | FloatArray,
        pressures: FloatArray,
        *,
        constants: FloatArray | None = None,
        guess: FloatArray | None = None,
        newton: Newton | None = None,
    ) -> "Bending":
        """Equilibria under pressures [Pa] of shape [n] (all cavities alike) or [n, n_cavities]. `constants`:
        constants of each region that replace the actuator's. `guess`: as for
        `kolsky.equilibrium.solve.solve`."""
        table = np.asarray(pressures, dtype=float)
        table = np.repeat(table[:, None], len(self.cavities), axis=1) if table.ndim == 1 else table
        if table.ndim != 2 or table.shape[1] != len(self.cavities):
            raise ValueError(f"pressures must have shape [n, {len(self.cavities)}], got {table.shape}")
        steps = {WEIGHT: np.ones(len(table)), **dict(zip(self.histories, table.T, strict=True))}
        model = self.model(gravity)
        return Bending(solve(model, steps, constants, guess=guess, newton=newton), table)


@dataclass(frozen=True)
class Bending:
    """Equilibria of an actuator."""

    solution: Solution
    pressures: FloatArray
    """Pressure of each cavity at each step [Pa], shape [n, n_cavities]."""

    @property
    def angle(self) -> FloatArray:
        """Bending angle, Eq. (A.1) [rad], shape [n]; NaN for steps that were not reached."""
        return bend_of(self.chord)

    @property
    def chord(self) -> FloatArray:
        """Vector from the origin to the tip [m], shape [n, 3]."""
        return chord_of(self.solution.model.mesh, self.solution.displacements)

    def slopes(self) -> FloatArray:
        """dTheta/dp by the pressure of each cavity [rad/Pa], shape [n, n_cavities]; exact."""
        return np.einsum("nd,npd->np", bend_slope(self.chord), self.chord_slopes())

    def chord_slopes(self) -> FloatArray:
        """Derivatives of the chord by the pressure of each cavity [m/Pa], shape [n, n_cavities, 3]; exact."""
        names = tuple(h for h in self.solution.model.histories if h != WEIGHT)
        found = direct(self.solution, histories=names)
        tip, origin = (found.mean_displacement(where) for where in ("tip", "origin"))
        return (tip - origin)[:, -len(names) :]  # the constants come before the histories


def chord_of(mesh: Mesh, displacements: FloatArray) -> FloatArray:
    """Vector from the mean origin to the mean tip [m], shape [n, 3].

    ``displacements``: [m], shape [n, n_points, 3].
    """
    sets = [mesh.nodes(where) for where in ("origin", "tip")]
    ends = [mesh.points[own].mean(axis=0) + displacements[:, own].mean(axis=1) for own in sets]
    return np.asarray(ends[1] - ends[0])


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


SOLID, CHANNEL, OUTSIDE = 0, -1, -2
"""Kinds of cells of the grid; chambers are 1, 2, ..."""
TIGHT = 1e-9
"""Tolerance for points on a plane, as a share of the length [-]."""


@dataclass(frozen=True)
class Pneunet:
    """Dimensions of an actuator and the size of its mesh."""

    chambers: int = 6
    wall: float = 2.5e-3
    """Thickness of every wall and of the roofs [m]."""
    base: float = 2.5e-3
    """Thickness of the base below the channel [m]."""
    chamber: tuple[float, float, float] = (3.0e-3, 10.0e-3, 10.0e-3)
    """Inner length (along x), width (y) and height (z) of a chamber [m]."""
    gap: float = 2.0e-3
    """Distance between the walls of neighbouring chambers [m]."""
    channel: tuple[float, float] = (2.0e-3, 2.0e-3)
    """Width and height of the channel that connects the chambers [m]; also of the inlet's bore."""
    inlet: float = 5.0e-3
    """Length of the clamped inlet block [m]."""
    cell: float = 4.0e-3
    """Requested size of the cells [m]."""
    through_wall: int = 1
    """Smallest number of cells through a wall."""
    element: str = "hex27"
    """Element: "hex27", "hex8", "tet10" or "tet4"."""
    half: bool = True
    """True to model half of it, with y = 0 as the symmetry plane."""
    separate: bool = False
    """True if the chambers are separate, without a channel, each with its pressure."""
    heights: tuple[float, ...] = ()
    """Heights z of additional cell faces, such as those of a layer [m]."""

    def __post_init__(self) -> None:
        for what, inner, outer in (
            ("width", self.channel[0], self.chamber[1]),
            ("height", self.channel[1] + self.wall, self.chamber[2]),
        ):
            if not inner < outer:
                raise ValueError(
                    f"the channel's {what} (with its roof) must be below the chamber's, "
                    f"got {inner:g} and {outer:g} m"
                )
        for height in self.heights:
            if not 0.0 <= height <= self.height:
                raise ValueError(f"heights must be in [0, {self.height:g}] m, got {height:g} m")

    @property
    def length(self) -> float:
        """Whole length [m]."""
        each = 2.0 * self.wall + self.chamber[0]
        return self.inlet + self.chambers * each + (self.chambers - 1) * self.gap

    @property
    def width(self) -> float:
        """Outer width [m]."""
        return self.chamber[1] + 2.0 * self.wall

    @property
    def height(self) -> float:
        """Outer height [m]."""
        return self.base + self.chamber[2] + self.wall

    @cached_property
    def _grid(self) -> tuple[tuple[FloatArray, ...], IntArray]:
        parts: list[tuple[float, int]] = [(self.inlet, CHANNEL)]
        for number in range(1, self.chambers + 1):
            parts += [(self.wall, CHANNEL), (self.chamber[0], number)]
            parts += [(self.wall, CHANNEL), (self.gap, OUTSIDE)]
        parts = [*parts[:-2], (self.wall, SOLID)]  # the last chamber ends in a whole wall
        x, of_x = self._cut([length for length, _ in parts])
        kinds = np.array([kind for _, kind in parts])[of_x]
        bore, hollow = 0.5 * self.channel[0], 0.5 * self.chamber[1]
        y, of_y = self._cut([bore, hollow - bore, self.wall])
        if not self.half:
            y, of_y = np.concatenate([-y[:0:-1], y]), np.concatenate([of_y[::-1], of_y])
        roof = self.chamber[2] - self.channel[1] - self.wall
        z, of_z = self._cut([self.base, self.channel[1], self.wall, roof, self.wall])
        for height in self.heights:
            if np.abs(z - height).min() > TIGHT * self.length:
                above = int(np.searchsorted(z, height))
                z, of_z = np.insert(z, above, height), np.insert(of_z, above, of_z[above - 1])
        kx, ky, kz = np.meshgrid(kinds, of_y, of_z, indexing="ij")
        cells = np.full(kx.shape, SOLID)
        cells[(kx == OUTSIDE) & (kz > 2)] = OUTSIDE
        if not self.separate:
            cells[((kx == CHANNEL) | (kx == OUTSIDE)) & (ky == 0) & (kz == 1)] = CHANNEL
        inside = (kx > 0) & (ky < 2) & (kz >= 1) & (kz < 4)
        cells[inside] = kx[inside]
        return (x, y, z), cells

    def _cut(self, lengths: list[float]) -> tuple[FloatArray, IntArray]:
        """Lines of a row of parts [m], and the part of each cell."""
        counts = []
        for length in lengths:
            least = self.through_wall if length in (self.wall, self.base) else 1
            counts.append(max(least, round(length / self.cell)))
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        lines = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True)]
        return np.concatenate([[0.0], *lines]), np.repeat(np.arange(len(lengths)), counts)

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh with its sets.

        Sets: "clamp" (x = 0), "end" (the other end), "mirror" (y = 0, of a half), "cavity" or, for separate
        chambers, "cavity_1" and so on, "origin" and "tip" (ends of the base's middle line), and "line" (all
        of it). Each gap has the sets "gap_1_left" and "gap_1_right", the walls that face each other.
        """
        lines, cells = self._grid
        solid: BoolArray = cells == SOLID
        mesh = grid(lines, solid, kind=self.element)
        tight = TIGHT * self.length
        p = mesh.points
        sets: dict[str, IntArray] = {
            "clamp": np.flatnonzero(p[:, 0] < tight),
            "end": np.flatnonzero(p[:, 0] > self.length - tight),
            "line": np.flatnonzero((np.abs(p[:, 1]) < tight) & (p[:, 2] < tight)),
        }
        if self.half:
            sets["mirror"] = np.flatnonzero(p[:, 1] < tight)
        sets["line"] = sets["line"][np.argsort(p[sets["line"], 0], kind="stable")]
        sets["origin"], sets["tip"] = sets["line"][:1], sets["line"][-1:]
        hollows = [("cavity", (cells > 0) | (cells == CHANNEL))]
        if self.separate:
            hollows = [(f"cavity_{n}", cells == n) for n in range(1, self.chambers + 1)]
        for name, hollow in hollows:
            sets[name] = _touching(p, lines, hollow, tight)
        pitch = (self.length - self.inlet + self.gap) / self.chambers
        rows = self.inlet + np.arange(1, self.chambers) * pitch
        above = p[:, 2] > self.base + self.channel[1] + self.wall - tight
        for number, end in enumerate(rows, start=1):
            for side, at in (("left", end - self.gap), ("right", end)):
                sets[f"gap_{number}_{side}"] = np.flatnonzero(above & (np.abs(p[:, 0] - at) < tight))
        return Mesh(p, mesh.cells, mesh.kind, sets)

    @property
    def cavities(self) -> tuple[str, ...]:
        """Sets of the pressurised walls."""
        return tuple(f"cavity_{n}" for n in range(1, self.chambers + 1)) if self.separate else ("cavity",)


def _touching(points: FloatArray, lines: tuple[FloatArray, ...], hollow: BoolArray, tight: float) -> IntArray:
    """Points of the hollow cells, inside or on their surface."""
    found = np.zeros(len(points), dtype=bool)
    # a point on a line belongs to the cells on both sides of it
    for ways in product((-tight, tight), repeat=3):
        beside = (
            np.clip(np.searchsorted(line, points[:, axis] + way, side="right") - 1, 0, len(line) - 2)
            for axis, (line, way) in enumerate(zip(lines, ways, strict=True))
        )
        found |= hollow[tuple(beside)]
    return np.flatnonzero(found)


def smallest_gap(run: Bending) -> FloatArray:
    """Smallest distance of the facing walls of neighbouring chambers [m], shape [n]. Each pair of facing
    points is taken along the line between the middles of its two walls. It is negative if they have passed
    each other."""
    mesh, u = run.solution.model.mesh, run.solution.displacements
    smallest = np.full(len(u), np.nan)
    number = 1
    while f"gap_{number}_left" in mesh.sets:
        left, right = (
            mesh.points[mesh.sets[f"gap_{number}_{side}"]] + u[:, mesh.sets[f"gap_{number}_{side}"]]
            for side in ("left", "right")
        )
        across = (right - left).mean(axis=1)
        across = across / np.linalg.norm(across, axis=-1, keepdims=True)
        each = np.einsum("npd,nd->np", right - left, across).min(axis=1)
        smallest = np.fmin(smallest, each)
        number += 1
    return smallest


def outside(mesh: Mesh, apart: Sequence[str]) -> IntArray:
    """Points of boundary faces that are not entirely in one of the sets `apart`. Clamped points are left
    out."""
    everything = mesh.with_set("all", np.arange(len(mesh.points)))
    found = []
    for faces in faces_on(everything, "all"):
        nodes = mesh.cells[faces.cells][:, mesh.element.nodes_on(faces.face)]
        inner = [np.isin(nodes, mesh.nodes(name)).all(axis=1) for name in apart if name in mesh.sets]
        found.append(nodes[~np.any(inner, axis=0)].ravel() if inner else nodes.ravel())
    return np.setdiff1d(np.concatenate(found), mesh.nodes("clamp"))


def forces_outside(run: Bending) -> dict[str, FloatArray]:
    """Force of the whole actuator on each fixed set except the clamp, and on each plane [N], shape [n, 3].
    Keys are the names of the point sets."""
    solution, found = run.solution, {}
    half = "mirror" in solution.model.mesh.sets
    planes = iter(solution.contact_forces)
    for condition in solution.model.conditions:
        if isinstance(condition, RigidSurface):
            force = -next(planes).sum(axis=1)[:, None] * unit(condition.normal)
        elif isinstance(condition, Fixed) and condition.where not in ("clamp", "mirror"):
            force = -solution.reaction(condition.where)
            if condition.axes is not None:
                force[:, [axis for axis in range(3) if axis not in condition.axes]] = 0.0
        else:
            continue
        found[condition.where] = (force * np.array([2.0, 0.0, 2.0]) if half else force) + 0.0  # no -0
    return found


@dataclass(frozen=True)
class Touching:
    """Contact of neighbouring chambers over a history."""

    force: FloatArray
    """Sum of the pressures between all walls over their area [N], shape [n]. It is that of the whole
    actuator."""
    depth: FloatArray
    """Largest penetration, caused by the penalty method [m], shape [n]."""


def touching(run: Bending) -> Touching | None:
    """Contact forces and depths of equilibria; None for a model without contact."""
    model = run.solution.model
    contacts = surface_contacts(model)
    if not contacts:
        return None
    share = 2.0 if "mirror" in model.mesh.sets else 1.0
    each = [u.reshape(-1) for u in run.solution.displacements]
    return Touching(
        np.array([share * sum(one.force(u) for one in contacts) for u in each]),
        np.array([max(one.deepest(u) for one in contacts) for u in each]),
    )
