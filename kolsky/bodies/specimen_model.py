"""A slow test's specimen as a model: mesh, bonds, symmetry, and forces at its ends with slopes.

A specimen is glued between rigid parts on its top and bottom face, over its whole width and a length at each
end (Schumacher and others 2020, Sec. VI). All points of a bond have the same displacement along the pull and
none across it. This is the coupling of their Eq. (6); its unknown d is prescribed here. Without gravity the
specimen is symmetric about three planes. An eighth of it therefore gives the same displacements and a quarter
of the force.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.bodies.errors_in_variables import Linearised
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.meshes import Mesh, box, cross, dog_bone
from kolsky.equilibrium.model import Condition, Fixed, Gravity, Model, Prescribed, RigidSurface
from kolsky.equilibrium.sensitivity import Sensitivities, direct
from kolsky.equilibrium.solid import Solid
from kolsky.equilibrium.solution import Solution
from kolsky.equilibrium.solve import solve

AXES = "xy"
TIGHT = 1e-9
"""Tolerance for points on a plane, relative to the length."""


@dataclass(frozen=True)
class Shape:
    """Form, bonds and mesh of a specimen."""

    kind: str
    """"strip", "dog_bone", "cross" or "block"."""
    size: tuple[float, float, float]
    """Length, width and thickness [m]. For a cross, length and width are both its whole length."""
    bond: float
    """Bonded length at each end [m]. For a block it is 0: its whole end faces are bonded."""
    elements: tuple[int, int, int]
    """Elements along each edge of the whole specimen."""
    arm: float | None = None
    """Width of the arms of a cross [m]."""
    waist: float | None = None
    """Smallest width of a dog-bone [m]."""
    straight: float | None = None
    """Length over which the arms have this width [m]."""
    element: str = "hex27"
    """Kind of the hexahedral elements."""
    gravity: tuple[float, float, float] | None = None
    """Acceleration of free fall [m/s^2]; None: no gravity."""
    density: float | None = None
    """Mass density [kg/m^3]; needed only with gravity."""
    load: str = "axial"
    """"axial", or "shear" of a block. In shear its end faces move along y."""
    axis: int = 0
    """Axis of the motion; of a cross, that of its first pair of ends."""

    @property
    def ends(self) -> int:
        """Number of independent moving ends: 2 for a cross, otherwise 1."""
        return 2 if self.kind == "cross" else 1

    @property
    def eighth(self) -> bool:
        """True if an eighth is simulated: even numbers of elements, and no gravity."""
        even = all(n % 2 == 0 for n in self.elements)
        return self.gravity is None and self.load == "axial" and even

    def along(self, end: int) -> int:
        """Axis of the motion and of the measured force of an end."""
        return 1 if self.load == "shear" else self.axis + end

    @property
    def free_length(self) -> float:
        """Length over which its ends move apart [m]."""
        return self.size[self.axis] - 2.0 * self.bond

    @property
    def way(self) -> float:
        """Sign of the displacements in the simulation of a test without a file [-]."""
        return 1.0

    @property
    def multiplicity(self) -> float:
        """Force of an end divided by that of its simulated part [-]."""
        return 4.0 if self.eighth else 1.0

    def shortened(self) -> "Shape":
        """The specimen with each bond one element shorter.

        Raises ValueError if the bond has a length of one element.
        """
        step = self.size[0] / self.elements[0]
        if self.bond == 0.0:
            raise ValueError(f"a {self.kind} has no bonded length that could be shorter")
        if self.bond < 1.5 * step:
            raise ValueError(
                f"the bond is {self.bond / step:.1f} elements long; at least 2 are needed to shorten it "
                "by one"
            )
        return replace(self, bond=self.bond - step)

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh, with its middle at the origin and its bonds as sets "bond_x+" and so on."""
        n = self.elements
        if self.kind == "cross":
            corner = tuple(
                round(0.5 * (size - self.arm) / size * count)  # type: ignore[operator]
                for size, count in zip(self.size[:2], n[:2], strict=True)
            )
            mesh = cross(self.size, n, corner, kind=self.element)
        elif self.kind == "dog_bone":
            assert self.waist is not None  # a dog-bone has both
            assert self.straight is not None
            mesh = dog_bone(self.size, n, waist=self.waist, straight=self.straight, kind=self.element)
        else:
            mesh = box(self.size, n, kind=self.element)
        points = mesh.points - 0.5 * np.asarray(self.size)
        cells = mesh.cells
        if self.eighth:
            cells = cells[(points[cells].mean(axis=1) > 0.0).all(axis=1)]
        used, cells = np.unique(cells, return_inverse=True)
        points, cells = points[used], cells.reshape(-1, mesh.cells.shape[1])
        sets = {}
        on_face = np.abs(np.abs(points[:, 2]) - 0.5 * self.size[2]) < TIGHT * self.size[0]
        on_face |= self.kind == "block"
        for axis in range(self.ends):
            for sign, name in ((1.0, "+"), (-1.0, "-")):
                along = sign * points[:, axis] >= 0.5 * self.size[axis] - self.bond - TIGHT * self.size[0]
                if (on_face & along).any():
                    sets[f"bond_{AXES[axis]}{name}"] = np.flatnonzero(on_face & along)
        if self.eighth:
            for axis in range(3):
                sets[f"plane_{axis}"] = np.flatnonzero(np.abs(points[:, axis]) < TIGHT * self.size[0])
        return Mesh(points, cells, mesh.kind, sets)

    def model(self, solid: Solid, *, device: str = "cpu") -> Model:
        """The specimen of a material. Histories "d_x" (and "d_y") are the displacements of its ends [m]. A
        displacement is that of one end relative to the other. Each end moves by half of it."""
        conditions = self.supports()
        if self.gravity is not None and self.density is not None:
            conditions.append(Gravity(self.density, self.gravity))
        return Model(self.mesh, solid, tuple(conditions), device=device)

    def supports(self) -> list[Condition]:
        """Conditions of symmetry, of the bonds and of the motion of the ends."""
        conditions: list[Condition] = []
        if self.eighth:
            conditions += [Fixed(f"plane_{axis}", (axis,)) for axis in range(3)]
        for end in range(self.ends):
            axis = self.along(end)
            others = tuple(other for other in range(3) if other != axis)
            for name, factor in (("+", 0.5), ("-", -0.5)):
                where = f"bond_{AXES[end]}{name}"
                if where in self.mesh.sets:
                    conditions += [Prescribed(where, axis, f"d_{AXES[end]}", factor), Fixed(where, others)]
        return conditions

    def mid_region(self) -> FloatArray:
        """Mid-points of the cells in the inner half of the free length, as a mask, shape [m]."""
        middle = self.mesh.points[self.mesh.cells].mean(axis=1)
        free = 0.5 * self.size[0] - self.bond
        return np.asarray((np.abs(middle[:, : self.ends]) < 0.5 * free).all(axis=1))


@dataclass(frozen=True)
class BodyShape(Shape):
    """A specimen from a mesh file. One group is held, another moves."""

    body: Mesh | None = None
    """The mesh. The moving group is the set "bond_x+", the held group "bond_x-"."""
    frictionless: bool = False
    """True if the points of the moving group slide across that axis, as under a lubricated punch."""
    sphere: float | None = None
    """Radius of a rigid sphere that presses on the moving group without friction [m]; None: no sphere."""

    @property
    def way(self) -> float:
        """For a sphere, its direction toward the body along the axis; otherwise 1 [-]."""
        if self.sphere is None:
            return 1.0
        high, low = (
            float(self.mesh.points[self.mesh.nodes(f"bond_x{end}"), self.axis].mean()) for end in "+-"
        )
        return -1.0 if high > low else 1.0

    @property
    def apex(self) -> FloatArray:
        """First point of the sphere to touch: the middle of the outermost moving points [m], shape [3]."""
        points = self.mesh.points[self.mesh.nodes("bond_x+")]
        height = -self.way * points[:, self.axis]
        outermost = points[height >= height.max() - TIGHT * max(self.size)]
        return np.asarray(0.5 * (outermost.min(axis=0) + outermost.max(axis=0)))

    @property
    def indenter(self) -> RigidSurface | None:
        """The sphere; its travel is the displacement. None without a sphere."""
        if self.sphere is None:
            return None
        normal = tuple(self.way * np.eye(3)[self.axis])
        return RigidSurface("bond_x+", normal, tuple(self.apex), "d_x", self.way, self.sphere)

    @property
    def mesh(self) -> Mesh:  # type: ignore[override]
        """The mesh of the file [m]."""
        assert self.body is not None  # given at the creation
        return self.body

    def supports(self) -> list[Condition]:
        """See `Shape.supports`. The held group stays, and the other group moves by the whole displacement."""
        others = tuple(other for other in range(3) if other != self.axis)
        moving = self.indenter or Prescribed("bond_x+", self.axis, "d_x", 1.0)
        conditions: list[Condition] = [Fixed("bond_x-"), moving]
        if self.sphere is None and not self.frictionless:
            conditions.append(Fixed("bond_x+", others))
        return conditions

    def mid_region(self) -> FloatArray:
        """Cells in the middle half of the body along the motion, as a mask, shape [m]."""
        middle = self.mesh.points[self.mesh.cells].mean(axis=1)[:, self.axis]
        low, high = self.mesh.points[:, self.axis].min(), self.mesh.points[:, self.axis].max()
        return np.asarray(np.abs(middle - 0.5 * (low + high)) < 0.25 * (high - low))


@dataclass(frozen=True)
class SpecimenModel:
    """A specimen that can be simulated with any constants."""

    name: str
    shape: Shape
    device: str = "cpu"

    def simulate(self, solid: Solid, displacement: FloatArray) -> Solution:
        """Equilibria at the displacements of the ends.

        ``solid``: the material. ``displacement``: of one end relative to the other [m], shape [n, ends].
        """
        steps = {f"d_{AXES[axis]}": displacement[:, axis] for axis in range(self.shape.ends)}
        return solve(self.shape.model(solid, device=self.device), steps)

    def force(self, found: Solution | Sensitivities) -> FloatArray:
        """Forces on the ends, tension positive [N], or their derivatives, shape [n, .., ends]."""
        reactions = [
            found.reaction(f"bond_{AXES[end]}+")[..., self.shape.along(end)] for end in range(self.shape.ends)
        ]
        return np.asarray(self.shape.multiplicity * np.stack(reactions, axis=-1))

    def linearised(self, constants: Constants, free: FloatArray, displacement: FloatArray) -> Linearised:
        """Forces and slopes at the displacements.

        ``constants``: the law and its free constants. ``free``: values of the free constants, SI, shape [p].
        ``displacement``: displacements in any order [m], shape [n, ends]. Raises ValueError with the reason
        if the constants are invalid or the simulation fails.
        """
        order = np.argsort(np.abs(displacement).sum(axis=1), kind="stable")
        solution = self.simulate(constants.solid(free), displacement[order])
        if not solution.outcome.ok:
            there = ", ".join(f"{1e3 * value:.4g} mm" for value in displacement[order][solution.reached])
            solution.outcome.require(f"{self.name} at {there}")
        histories = tuple(f"d_{AXES[axis]}" for axis in range(self.shape.ends))
        slopes = direct(solution, histories=histories)
        back = np.argsort(order, kind="stable")
        n_own = slopes.displacements.shape[1] - len(histories)
        by_all = np.swapaxes(self.force(slopes), 1, 2)[back]
        chain = constants.chain(free)
        return Linearised(self.force(solution)[back], by_all[..., :n_own] @ chain, by_all[..., n_own:])


def strains(solution: Solution, step: int) -> tuple[FloatArray, FloatArray]:
    """Normal strains F_ii - 1 along the coordinate axes at the Gauss points [-], shape [m, g, 3]. The volumes
    of the points in the reference state [m^3], shape [m, g], are returned too. ``solution``: equilibria of a
    three-dimensional model. ``step``: which."""
    geometry = solution.equations.body.points.geometry
    moved = solution.displacements[step][solution.model.mesh.cells]
    return np.einsum("mki,mgki->mgi", moved, geometry.E), geometry.volumes
