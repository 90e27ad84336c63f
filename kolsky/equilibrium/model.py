"""A body with its material, supports and loads. It is constant during a solution.

Histories of supports and loads are passed to the solver by name.
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
    axes: tuple[int, ...] | None = None
    """Fixed components; None: all."""


@dataclass(frozen=True)
class Prescribed:
    """One displacement component that follows a history."""

    where: str
    axis: int
    history: str
    """Name of the history [m]."""
    factor: float | FloatArray = 1.0
    """Factor of the history [-]: one for all points of the set, or one for each, in the order of the set."""


@dataclass(frozen=True)
class Coupled:
    """Points that move together along an axis (a rigid sliding interface), with or without a force. This is
    the coupling of Schumacher and others (2020), Eq. (6). The component is one unknown."""

    where: str
    axis: int
    """The component that the points have in common."""
    force: str | None = None
    """Name of the history of the force on them [N]; None: no force."""


@dataclass(frozen=True)
class NodalForce:
    """A dead force, distributed equally over the points of a set."""

    where: str
    axis: int
    history: str
    """Name of the history [N]."""


@dataclass(frozen=True)
class Traction:
    """A dead load per undeformed area on the faces that have all points in a set."""

    where: str
    axis: int
    history: str
    """Name of the history [Pa]."""


@dataclass(frozen=True)
class Gravity:
    """Weight (Schumacher and others 2020, Eq. 11)."""

    density: float | tuple[float, ...]
    """Density in the reference state [kg/m3], one value for all regions or one for each."""
    acceleration: tuple[float, ...]
    """Acceleration of free fall [m/s2], shape [d]."""
    history: str | None = None
    """Name of a history of its factor [-]. None: it acts from the first step on."""


@dataclass(frozen=True)
class Pressure:
    """A pressure normal to the deformed faces with all points in a set."""

    where: str
    history: str
    """Name of the history [Pa], positive in compression."""


@dataclass(frozen=True)
class RigidSurface:
    """A frictionless rigid plane or sphere. Points of a set cannot pass through it. The contact force of a
    point is the penalty force stiffness * depth plus a multiplier. Augmentation increases the multiplier by
    the penalty force until no point is deeper than the tolerance."""

    where: str
    """Set of points that may touch."""
    normal: tuple[float, ...]
    """Direction out of the surface at `position`, toward the body [-], shape [d]. Its length has no
    effect."""
    position: tuple[float, ...]
    """A point of the surface at history value 0 [m], shape [d]. For a sphere, its apex."""
    history: str | None = None
    """Name of the history of the surface's travel along `normal` [m]; None: it does not move."""
    factor: float = 1.0
    """Travel divided by the value of the history [-]."""
    radius: float | None = None
    """Radius of a sphere [m]; None: a plane."""
    tolerance: float = 1e-6
    """Largest depth, as a share of the mesh's size [-]."""


@dataclass(frozen=True)
class SelfContact:
    """Two surfaces of the body that cannot pass through each other. They have no friction. A penalty force
    acts on the integration points of each surface that penetrate the other. An equilibrium with a point
    deeper than `depth` is not accepted."""

    where: str
    other: str
    penalty: float = 500.0
    """Pressure divided by depth, in shear moduli over the size of a face [-]."""
    depth: float | None = None
    """Largest depth of an equilibrium [m]; None: a hundredth of the size of a face."""

    def __post_init__(self) -> None:
        for name in ("penalty", "depth"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} of a contact must be > 0, got {value}")


Load = NodalForce | Traction | Gravity | Pressure
Condition = Fixed | Prescribed | Coupled | RigidSurface | SelfContact | Load


def histories_of(conditions: tuple[Condition, ...]) -> tuple[str, ...]:
    """Names of the histories of the conditions, in their order, without duplicates."""
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
    solid: Solid
    """Its material, with the default constants of `solve`."""
    conditions: tuple[Condition, ...] = ()
    """Supports and loads. Two conditions on the same displacement are an error."""
    kinematics: Kinematics = "3d"
    """Three-dimensional, or the assumption for the third direction of a plane model."""
    thickness: float = 1.0
    """Thickness of a plane model [m]. An axisymmetric model is the full revolution."""
    volumetric: Literal["displacement", "mixed"] = "displacement"
    """"mixed": the volume ratio and the pressure are separate fields, for nearly incompressible materials.
    They are discontinuous between elements and eliminated in each (Simo, Taylor and Pister 1985)."""
    regions: IntArray | None = None
    """Region of each cell from 0, shape [m]. Every region has separate constants. None: one region."""
    others: tuple[Solid, ...] = ()
    """Materials of the regions from 1 on, with the law of `solid`. Empty: `solid` for all regions."""
    gauss: int | None = None
    """Gauss points per direction. None: the default of the element."""
    device: str = "cpu"
    """Device of the element kernels: "cpu", "cuda", "cuda:1" …"""

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
        """Displacement components of all points, including held ones."""
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
        """Names of the constants. With several regions "name[region]"."""
        names = self.solid.parameter_names
        if self.n_regions == 1:
            return names
        return tuple(f"{name}[{r}]" for r in range(self.n_regions) for name in names)

    def parameters(self, values: ArrayLike | None = None) -> FloatArray:
        """Constants of every region, shape [n_regions, n_parameters]. None: those of the materials.

        Raises ValueError if their number is wrong, or if the material does not allow them.
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
    """Unknown of each component (point by point), shape [n d]; -1 for a fixed or prescribed one."""
    count: int
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
