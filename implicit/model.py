"""A body, its material, and what holds and loads it. It never changes while it is solved."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray, IntArray
from implicit.conditions import Condition, Coupled, Fixed, Prescribed, histories_of
from implicit.laws.solid import Solid
from implicit.meshes import Mesh

Kinematics = Literal["3d", "plane_strain", "plane_stress", "axisymmetric"]


@dataclass(frozen=True)
class Model:
    """One specimen."""

    mesh: Mesh
    """Its mesh."""
    solid: Solid
    """Its material, with the constants taken where `solve` is given none."""
    conditions: tuple[Condition, ...] = ()
    """Supports and loads; a later condition on the same displacement is an error."""
    kinematics: Kinematics = "3d"
    """Three-dimensional, or what the third direction of a plane model does."""
    thickness: float = 1.0
    """Thickness of a plane model [m]; an axisymmetric one is the whole revolution."""
    volumetric: Literal["displacement", "mixed"] = "displacement"
    """ "mixed": the volume ratio and the pressure are fields of their own, discontinuous between elements and
    eliminated in each (Simo, Taylor and Pister 1985), for nearly incompressible materials."""
    regions: IntArray | None = None
    """Region of each cell from 0, shape [m]; every region has constants of its own. None: one region."""
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
        """Names of the histories its conditions ask for."""
        return histories_of(self.conditions)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the constants; with several regions "name[region]"."""
        names = self.solid.parameter_names
        if self.n_regions == 1:
            return names
        return tuple(f"{name}[{r}]" for r in range(self.n_regions) for name in names)

    def parameters(self, values: ArrayLike | None = None) -> FloatArray:
        """Constants of every region, shape [n_regions, n_parameters]; None: the material's own.

        Raises
        ------
        ValueError
            If their number is another, or the material cannot have them.
        """
        own = self.solid.parameters()
        if values is None:
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
        """Which displacements are unknown."""
        return number_unknowns(self)


@dataclass(frozen=True)
class Unknowns:
    """Numbering of the unknown displacements."""

    index: IntArray
    """Unknown of each component (point by point); -1: it is held or prescribed, shape [n d]."""
    count: int
    """Number of unknowns."""
    prescribed: tuple[tuple[IntArray, str, FloatArray], ...]
    """Components, history and factor of what is prescribed."""
    forces: tuple[tuple[int, str], ...]
    """Component of a point, and history, of the forces on coupled points."""


def number_unknowns(model: Model) -> Unknowns:
    """Number the unknowns of a model.

    Raises
    ------
    ValueError
        If two conditions claim one displacement.
    """
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
