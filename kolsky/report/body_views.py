"""Data for the pages of whole specimens and actuators: fits, strains, shapes, inversions, control runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.bodies.actuator_bending import Direction, Inversion
from kolsky.bodies.actuator_control import Closed, Reduction
from kolsky.bodies.actuator_markers import MarkerComparison, StiffnessFit
from kolsky.bodies.sheet import mass_matrix
from kolsky.bodies.sheet_fit import BeforeTest, FieldFit, before_test, smoothed
from kolsky.bodies.sheet_reading import MeasuredField
from kolsky.bodies.specimen_fit import SpecimenFit
from kolsky.bodies.specimen_model import strains
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.solution import Solution

BINS = np.linspace(-0.8, 2.4, 65)
"""Edges of the bins of strain [-]."""


@dataclass(frozen=True)
class StrainShare:
    """Share of a specimen's volume in each bin of strain at the last sample."""

    name: str
    whole: FloatArray
    """Values of the whole specimen, along x, y, z [-], shape [3, bins]."""
    middle: FloatArray
    """Values of the inner half of its free length, along x, y, z [-], shape [3, bins]."""


def strain_share(name: str, solution: Solution, middle: FloatArray) -> StrainShare:
    """Bin the strains of the last sample by volume; `middle` masks the cells of the mid-region."""
    strain, volume = strains(solution, solution.reached - 1)
    inside = np.broadcast_to(middle[:, None], volume.shape)
    return StrainShare(name, _shares(strain, volume), _shares(strain[inside], volume[inside]))


def _shares(strain: FloatArray, volume: FloatArray) -> FloatArray:
    flat, weight = strain.reshape(-1, 3), volume.ravel() / volume.sum()
    return np.stack([np.histogram(flat[:, axis], BINS, weights=weight)[0] for axis in range(3)])


@dataclass(frozen=True)
class SpecimenView:
    """Fits of whole specimens, with the simulations of the last fit."""

    name: str
    fits: tuple[SpecimenFit, ...]
    solutions: dict[str, Solution]
    """Simulation of each fitted test with the constants of the last fit, at the measured displacements."""
    shares: tuple[StrainShare, ...]
    """Strains of each test."""

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests, in the order of the fits."""
        return tuple(dict.fromkeys(one.test.name for found in self.fits for one in found.tests))

    @property
    def warnings(self) -> list[str]:
        """Warnings of all fits."""
        return [said for found in self.fits for said in found.warnings]


def view_of(name: str, fits: Sequence[SpecimenFit]) -> SpecimenView:
    """Simulate the tests of the last fit and bin their strains."""
    last = fits[-1]
    solutions, shares = {}, []
    solid = last.constants.solid(last.constants.start)
    for one in last.tests:
        model = one.test.model
        solution = model.simulate(solid, one.test.samples.displacement)
        if solution.outcome.ok:
            solutions[model.name] = solution
            shares.append(strain_share(model.name, solution, model.shape.mid_region()))
    return SpecimenView(name, tuple(fits), solutions, tuple(shares))


@dataclass(frozen=True)
class SheetView:
    """A fitted sheet with its fields."""

    name: str
    measured: MeasuredField
    """The measured field."""
    fit: FieldFit
    """The fit of all steps."""
    steps: tuple[FieldFit | str, ...]
    """Separate fits of each step; empty if not made."""
    sensitivity: FloatArray
    """dm/du_msr of the last step as a field, relative to the constants [1/m^3], shape [p, nodes, 2]."""
    before: BeforeTest
    """Sensitivity to displacements of the whole sheet before a test."""
    change: str = ""
    """A single change of the data that would explain field and force; empty if no such change was found."""

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        return self.fit.problem.sheet.mesh

    @property
    def fields(self) -> dict[str, FloatArray]:
        """Sensitivities at the nodes by name, for ParaView [1/m^3], shape [nodes, 2] each."""
        named = zip(self.fit.constants.free, self.sensitivity, strict=True)
        fields = {f"sensitivity of {name} (1/m3)": field for name, field in named}
        n = len(self.mesh.points)
        before = {f"before test {k + 1} (1/m3)": f.reshape(2, n).T for k, f in enumerate(self.before.field)}
        return fields | before

    @property
    def warnings(self) -> list[str]:
        """Warnings of the fit and of the points."""
        said = [*self.fit.warnings, *([self.change] if self.change else [])]
        gone = int(self.measured.left_out.sum())
        if gone:
            said.append(
                f"{gone} of {len(self.measured.left_out)} points are left out, because their neighbours "
                "and the fitted sheet do not predict them (field.points.gate)"
            )
        return said


def sheet_view_of(
    name: str, measured: MeasuredField, found: FieldFit, steps: Sequence[FieldFit | str], *, change: str = ""
) -> SheetView:
    """Make the fields of a fitted sheet, Eqs. (K.26-36): the sensitivities, and the map before any test."""
    problem = found.problem
    free = ~np.array(found.at_bound)
    size = np.where(free, np.abs(found.values), 1.0)[:, None, None]
    last = found.by_displacement[-1] / size
    field = np.stack([smoothed(problem.mass, last[..., axis]) for axis in range(2)], axis=-1)
    mesh = problem.sheet.mesh
    whole = mass_matrix(mesh, np.ones(len(mesh.cells), dtype=np.bool_))
    slopes = found.cost.state.by_constants[-1][free]
    p = len(slopes)
    from scipy.sparse import block_diag

    both = block_diag([whole, whole]).tocsr()
    stacked = np.moveaxis(slopes, 2, 1).reshape(p, -1)  # all x, then all y
    return SheetView(
        name, measured, found, tuple(steps), field, before_test(stacked, both, found.values[free]), change
    )


CORNERS = {
    "hypercube": ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    "simplex": ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
}
"""Corners of the faces of a cell in the order of VTK."""


@dataclass(frozen=True)
class ActuatorView:
    """Results of one command on an actuator."""

    name: str
    directions: Sequence[Direction] = ()
    """Bends of every direction of gravity."""
    markers: Sequence[MarkerComparison] = ()
    """Measured and simulated markers."""
    stiffness: StiffnessFit | None = None
    """Factor of all moduli, fitted to the markers."""
    inversions: Mapping[str, Sequence[Inversion]] = field(default_factory=dict)
    """Searches for a pressure, by direction of gravity."""
    closed: Mapping[str, Closed] = field(default_factory=dict)
    """Runs of the loop, by direction of gravity."""
    reductions: Mapping[str, Reduction] = field(default_factory=dict)
    """Their reduced models."""
    warnings: Sequence[str] = ()
    """Warnings for the reader."""


def outer_faces(mesh: Mesh) -> IntArray:
    """Corners of the faces on the boundary of a mesh, shape [f, 3] or [f, 4]."""
    faces = np.concatenate([mesh.cells[:, list(corners)] for corners in CORNERS[mesh.element.shape]])
    keys = np.sort(faces, axis=1)
    _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[counts == 1]], dtype=np.int64)


def side_view(positions: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Faces in the view along +y, in drawing order: the nearest last.

    Returns: corners in x and z [m], shape [f, k, 2]. Returns: cosine between each face's normal and the
    viewing direction, 0 to 1, shape [f].
    """
    corners = positions[faces]
    order = np.argsort(-corners[..., 1].mean(axis=1), kind="stable")
    corners = corners[order]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    return corners[..., [0, 2]], np.abs(normal[:, 1]) / np.where(size > 0.0, size, 1.0)
