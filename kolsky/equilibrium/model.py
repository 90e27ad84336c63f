"""A body with its material, supports and loads; it is constant during a solution.

Histories of supports and loads are given by name to the solver.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray, IntArray
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.solid import Solid


@dataclass(frozen=True)
class Fixed:
    """Displacements fixed at zero."""

    where: str
    """Set of points."""
    axes: tuple[int, ...] | None = None
    """Fixed components; None: all."""


@dataclass(frozen=True)
class Prescribed:
    """One displacement component that follows a history."""

    where: str
    """Set of points."""
    axis: int
    """The component."""
    history: str
    """Name of the history [m]."""
    factor: float | FloatArray = 1.0
    """Factor of the history [-], one for all points of the set or one for each, in its order."""


@dataclass(frozen=True)
class Coupled:
    """Points that move together along an axis (a rigid sliding interface), with or without a force.

    This is the coupling of Schumacher and others (2020), Eq. (6): the component is one unknown.
    """

    where: str
    """Set of points."""
    axis: int
    """The component they share."""
    force: str | None = None
    """Name of the history of the force on them [N]; None: no force."""


@dataclass(frozen=True)
class NodalForce:
    """A dead force, distributed equally over the points of a set."""

    where: str
    """Set of points."""
    axis: int
    """Its direction."""
    history: str
    """Name of the history [N]."""


@dataclass(frozen=True)
class Traction:
    """A dead load on the faces whose points all belong to a set, per undeformed area."""

    where: str
    """Set of points."""
    axis: int
    """Its direction."""
    history: str
    """Name of the history [Pa]."""


@dataclass(frozen=True)
class Gravity:
    """Weight (Schumacher and others 2020, Eq. 11)."""

    density: float | tuple[float, ...]
    """In the reference state [kg/m3], one for all or one for each region."""
    acceleration: tuple[float, ...]
    """Acceleration of free fall [m/s2], shape [d]."""
    history: str | None = None
    """Name of a history of its factor [-]; None: it acts from the first step on."""


@dataclass(frozen=True)
class Pressure:
    """A pressure normal to the deformed faces with all points in a set."""

    where: str
    """Set of points."""
    history: str
    """Name of the history [Pa], positive in compression."""


@dataclass(frozen=True)
class RigidSurface:
    """A frictionless rigid plane or sphere that points of a set cannot pass.

    The contact force of a point is the penalty force stiffness * depth plus a multiplier. Augmentation
    increases the multiplier by the penalty force until no point is deeper than the tolerance.
    """

    where: str
    """Set of points that may touch."""
    normal: tuple[float, ...]
    """Direction out of the surface at `position`, towards the body [-], shape [d]; its length does not
    matter."""
    position: tuple[float, ...]
    """A point of the surface at history value 0 [m], shape [d]; of a sphere its apex."""
    history: str | None = None
    """Name of the history of the surface's travel along `normal` [m]; None: it does not move."""
    factor: float = 1.0
    """Travel over the value of the history [-]."""
    radius: float | None = None
    """Radius of a sphere [m]; None: a plane."""
    stiffness: float | None = None
    """Penalty of a point [N/m]; None: from the shear modulus and the spacing of the points."""
    tolerance: float = 1e-6
    """Largest depth, as a share of the mesh's size [-]."""


@dataclass(frozen=True)
class SelfContact:
    """Two surfaces of the body that cannot pass through each other, without friction.

    A penalty force acts on the integration points of each surface that penetrate the other. An equilibrium
    with a point deeper than `depth` is not accepted.
    """

    where: str
    """Set of points of the first surface."""
    other: str
    """Set of points of the second surface."""
    penalty: float = 500.0
    """Pressure over depth, in shear moduli over the size of a face [-]."""
    depth: float | None = None
    """Largest depth of an equilibrium [m]; None: a hundredth of the size of a face."""
    reach: float | None = None
    """Search distance for the other surface [m], less than the thickness of the body behind it; None: the
    size of a face."""

    def __post_init__(self) -> None:
        for name in ("penalty", "depth", "reach"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} of a contact must be > 0, got {value}")


Load = NodalForce | Traction | Gravity | Pressure
Condition = Fixed | Prescribed | Coupled | RigidSurface | SelfContact | Load


def histories_of(conditions: tuple[Condition, ...]) -> tuple[str, ...]:
    """Names of the histories of the conditions, in their order, each once."""
    names: list[str] = []
    for condition in conditions:
        name = condition.force if isinstance(condition, Coupled) else getattr(condition, "history", None)
        if name is not None and name not in names:
            names.append(name)
    return tuple(names)


def unit(normal: tuple[float, ...]) -> FloatArray:
    """A direction of length 1, shape [d]."""
    vector = np.asarray(normal, dtype=float)
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise ValueError("the normal of a rigid surface must not be zero")
    return np.asarray(vector / length)


Kinematics = Literal["3d", "plane_strain", "plane_stress", "axisymmetric"]


@dataclass(frozen=True)
class Model:
    """One specimen."""

    mesh: Mesh
    """Its mesh."""
    solid: Solid
    """Its material, with the default constants of `solve`."""
    conditions: tuple[Condition, ...] = ()
    """Supports and loads; a later condition on the same displacement is an error."""
    kinematics: Kinematics = "3d"
    """Three-dimensional, or the assumption for the third direction of a plane model."""
    thickness: float = 1.0
    """Thickness of a plane model [m]; an axisymmetric model is the full revolution."""
    volumetric: Literal["displacement", "mixed"] = "displacement"
    """ "mixed": the volume ratio and the pressure are separate fields, discontinuous between elements and
    eliminated in each (Simo, Taylor and Pister 1985), for nearly incompressible materials."""
    regions: IntArray | None = None
    """Region of each cell from 0, shape [m]; every region has separate constants. None: one region."""
    others: tuple[Solid, ...] = ()
    """Materials of the regions from 1 on, with the law of `solid`; empty: `solid` for all regions."""
    gauss: int | None = None
    """Gauss points a direction; None: the element's own."""
    device: str = "cpu"
    """Where the element kernels run: "cpu", "cuda", "cuda:1" …"""

    def __post_init__(self) -> None:
        d = 3 if self.kinematics == "3d" else 2
        if self.kinematics not in ("3d", "plane_strain", "plane_stress", "axisymmetric"):
            raise ValueError(
                f"kinematics must be 3d, plane_strain, plane_stress or axisymmetric, got {self.kinematics!r}"
            )
        if self.mesh.dimension != d:
            raise ValueError(f"{self.kinematics} needs a mesh of {d} coordinates, got {self.mesh.dimension}")
        if not self.thickness > 0.0:
            raise ValueError(f"thickness must be > 0 m, got {self.thickness}")
        if self.volumetric not in ("displacement", "mixed"):
            raise ValueError(f'volumetric must be "displacement" or "mixed", got {self.volumetric!r}')
        if self.volumetric == "mixed":
            if self.kinematics == "plane_stress":
                raise ValueError('plane stress has no volumetric locking: take volumetric = "displacement"')
            if self.mesh.element.pressure_degree is None:
                raise ValueError(
                    f"{self.mesh.kind} has no stable pressure: take hexahedra, quadrilaterals or tri6"
                )
            self.solid.isochoric_functions()
        if self.kinematics == "axisymmetric" and (self.mesh.points[:, 0] < 0.0).any():
            raise ValueError("an axisymmetric mesh has radii (first coordinate) >= 0 m")
        if self.regions is not None:
            regions = np.asarray(self.regions)
            if regions.shape != (len(self.mesh.cells),) or regions.min() < 0:
                raise ValueError(f"regions must be one number >= 0 for each of {len(self.mesh.cells)} cells")
        if self.others:
            if len(self.others) != self.n_regions - 1:
                raise ValueError(
                    f"{self.n_regions} regions have as many materials, got {1 + len(self.others)}"
                )
            if any(one.parameter_names != self.solid.parameter_names for one in self.others):
                raise ValueError("the materials of all regions must be of one law")
        for condition in self.conditions:
            for where in (getattr(condition, name, None) for name in ("where", "other")):
                if where is not None:
                    self.mesh.nodes(where)

    @property
    def dimension(self) -> int:
        """Displacement components of a point d."""
        return self.mesh.dimension

    @property
    def n_dofs(self) -> int:
        """Displacement components of all points, held ones included."""
        return int(self.mesh.points.size)

    @property
    def n_regions(self) -> int:
        """Number of regions."""
        return 1 if self.regions is None else int(np.max(self.regions)) + 1

    @cached_property
    def cell_regions(self) -> IntArray:
        """Region of each cell, shape [m]."""
        if self.regions is None:
            return np.zeros(len(self.mesh.cells), dtype=np.int64)
        return np.asarray(self.regions, dtype=np.int64)

    @property
    def histories(self) -> tuple[str, ...]:
        """Names of the histories of its conditions."""
        return histories_of(self.conditions)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the constants; with several regions "name[region]"."""
        names = self.solid.parameter_names
        if self.n_regions == 1:
            return names
        return tuple(f"{name}[{r}]" for r in range(self.n_regions) for name in names)

    def parameters(self, values: ArrayLike | None = None) -> FloatArray:
        """Constants of every region, shape [n_regions, n_parameters]; None: those of the materials.

        Raises
        ------
        ValueError
            If their number is wrong, or the material does not allow them.
        """
        own = self.solid.parameters()
        if values is None:
            if self.others:
                return np.array([own, *(one.parameters() for one in self.others)])
            return np.tile(own, (self.n_regions, 1))
        table = np.asarray(values, dtype=float)
        if table.size != self.n_regions * len(own):
            raise ValueError(
                f"the model has {self.n_regions} regions with the constants {self.solid.parameter_names}, "
                f"got {table.size} values"
            )
        table = table.reshape(self.n_regions, len(own))
        for row in table:
            self.solid.with_parameters(row)
        return table

    @cached_property
    def unknowns(self) -> "Unknowns":
        """Numbering of the unknown displacements."""
        return _number_unknowns(self)


@dataclass(frozen=True)
class Unknowns:
    """Numbering of the unknown displacements."""

    index: IntArray
    """Unknown of each component (point by point); -1: it is fixed or prescribed, shape [n d]."""
    count: int
    """Number of unknowns."""
    prescribed: tuple[tuple[IntArray, str, FloatArray], ...]
    """Components, history and factor of the prescribed displacements."""
    forces: tuple[tuple[int, str], ...]
    """Component of a point, and history, of the forces on coupled points."""


def _number_unknowns(model: Model) -> Unknowns:
    """Number the unknowns of a model."""
    d = model.dimension
    owner = np.full(model.n_dofs, -1)
    master = np.arange(model.n_dofs)
    prescribed, forces = [], []
    for number, condition in enumerate(model.conditions):
        if not isinstance(condition, Fixed | Prescribed | Coupled):
            continue
        nodes = model.mesh.nodes(condition.where)
        axes = (
            (range(d) if condition.axes is None else condition.axes)
            if isinstance(condition, Fixed)
            else (condition.axis,)
        )
        for axis in axes:
            if not 0 <= axis < d:
                raise ValueError(f"axis of {condition} must be in [0, {d - 1}], got {axis}")
            dofs = nodes * d + axis
            taken = owner[dofs] >= 0
            if isinstance(condition, Fixed) and all(
                isinstance(model.conditions[k], Fixed) for k in owner[dofs[taken]]
            ):
                dofs = dofs[~taken]  # an edge of two fixed faces is held once
            elif taken.any():
                other = model.conditions[int(owner[dofs[taken]][0])]
                raise ValueError(f"{condition} and {other} both claim axis {axis} of {taken.sum()} points")
            owner[dofs] = number
            if isinstance(condition, Prescribed):
                factor = np.broadcast_to(np.asarray(condition.factor, dtype=float), dofs.shape).copy()
                prescribed.append((dofs, condition.history, factor))
            elif isinstance(condition, Coupled):
                master[dofs] = dofs[0]
                if condition.force is not None:
                    forces.append((int(dofs[0]), condition.force))
    held = np.array([k >= 0 and not isinstance(model.conditions[k], Coupled) for k in owner], dtype=bool)
    index = np.full(model.n_dofs, -1)
    free = np.flatnonzero(~held & (master == np.arange(model.n_dofs)))
    index[free] = np.arange(len(free))
    index[~held] = index[master[~held]]
    return Unknowns(index, len(free), tuple(prescribed), tuple(forces))
