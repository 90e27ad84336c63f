"""The body of a model: internal forces, stiffness, derivatives by the constants, mixed formulation.

Mixed formulation: volume ratio and pressure are fields. They are eliminated in each element. The monomials
phi_m of degree n in the element's coordinates are 1, or 1 and the coordinates. The functional int W(F) +
U(theta) + p (J - theta) dV is stationary if theta is the projection of J, and p that of U'(theta) (Simo,
Taylor and Pister 1985):

    theta = phi . M^-1 int phi J dV,   p = phi . M^-1 int phi U'(theta) dV,   M = int phi phi dV.     (M.1)

Its stiffness is that of P and p d2J/dF2, plus C^T M^-1 (int U'' phi phi dV) M^-1 C with C = int phi dJ/dF :
grad N dV. One constant phi gives the mean dilatation of the 8-node hexahedron. The 27-node hexahedron with
four phi and the 9-node quadrilateral with three are Q2/P1. Both are inf-sup stable.
"""

from copy import copy
from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from kolsky.equilibrium.elements import complete
from kolsky.equilibrium.linear.base import Pattern
from kolsky.equilibrium.meshes import components
from kolsky.equilibrium.model import Model
from kolsky.equilibrium.points import Points, PointState, element_forces
from kolsky.equilibrium.solid import Volumetric


class MixedField:
    """Volume ratio and pressure of all elements."""

    def __init__(self, points: Points, parameters: FloatArray) -> None:
        model = points.model
        form = model.solid.volumetric
        degree = model.mesh.element.pressure_degree
        assert form is not None  # the model was checked
        assert degree is not None
        self.geometry, self.regions = points.geometry, model.cell_regions
        exponents = complete(degree, model.mesh.element.dimension)
        self.phi = (self.geometry.points[:, None, :] ** exponents[None]).prod(axis=-1)  # [g, n]
        weighted = self.geometry.volumes[..., None] * self.phi  # [m, g, n]
        self.weighted = weighted
        self.inverse = np.linalg.inv(np.matmul(np.swapaxes(weighted, 1, 2), self.phi))
        count = len(form.values)
        self.n_law = parameters.shape[1] - count
        self.forms: list[Volumetric] = [form.of(row[-count:]) for row in parameters]

    def _projected(self, values: FloatArray) -> FloatArray:
        """Projection of point values [m, g] onto phi, at the points."""
        integral = np.matmul(np.swapaxes(self.weighted, 1, 2), values[..., None])
        return np.matmul(np.matmul(self.inverse, integral)[..., 0], self.phi.T)

    def _by_region(self, name: str, theta: FloatArray) -> FloatArray:
        found = np.empty_like(theta)
        for r, form in enumerate(self.forms):
            inside = self.regions == r
            found[inside] = getattr(form, name)(theta[inside])
        return found

    def pressures(self, J: FloatArray) -> tuple[FloatArray, FloatArray]:
        """p and U''(theta) at the points [Pa], each of shape [m, g]."""
        theta = self._projected(J)
        return self._projected(self._by_region("slope", theta)), self._by_region("curvature", theta)

    def energy(self, J: FloatArray) -> float:
        """int U(theta) dV [J]."""
        theta = self._projected(J)
        return float((self._by_region("energy", theta) * self.geometry.volumes).sum())

    def stiffness(self, H: FloatArray, curvature: FloatArray) -> FloatArray:
        """The part of the element stiffness from the volume ratio [N/m], shape [m, k d, k d]."""
        T, m = self.geometry.T, len(H)
        C = np.stack(
            [
                element_forces(T, H * self.weighted[..., n, None]).reshape(m, -1)
                for n in range(self.phi.shape[1])
            ],
            axis=1,
        )
        middle = np.matmul(np.swapaxes(self.weighted * curvature[..., None], 1, 2), self.phi)
        solved = np.matmul(self.inverse, C)
        return np.asarray(np.matmul(np.swapaxes(solved, 1, 2), np.matmul(middle, solved)))

    def stress_by_parameters(self, points: PointState) -> FloatArray:
        """dP/d(constants) by the pressure, shape [m, g, d D, n_parameters]; 0 for the law's constants."""
        theta = self._projected(points.J)
        count = len(self.forms[0].values)
        slopes = np.zeros((*theta.shape, self.n_law + count))
        for r, form in enumerate(self.forms):
            inside = self.regions == r
            for j, by in enumerate(form.slope_by_constants(theta[inside])):
                slopes[inside, :, self.n_law + j] = by
        p = np.stack([self._projected(slopes[..., j]) for j in range(slopes.shape[-1])], axis=-1)
        return np.asarray(points.H[..., None] * p[:, :, None, :])


@dataclass(frozen=True)
class BodyState:
    """Internal forces of one state."""

    u: FloatArray
    """Displacements [m], shape [n d]."""
    forces: FloatArray
    """Internal forces of the points [N], shape [n d]."""
    points: PointState

    @property
    def inverted(self) -> bool:
        """True if J <= 0 or J is not a number at a Gauss point."""
        return not bool((self.points.J > 0.0).all() and np.isfinite(self.forces).all())


class Body:
    """Evaluates the body of a model. It is created once per solution."""

    def __init__(self, model: Model, parameters: FloatArray) -> None:
        self.model, self.parameters = model, parameters
        self.points = Points(model)
        self.rows = self.points.rows(parameters)
        dofs = components(model.mesh.cells, model.dimension)
        self.pattern = Pattern(dofs, model.unknowns.index, model.unknowns.count)
        self.field = MixedField(self.points, parameters) if self.points.mixed else None

    def with_parameters(self, parameters: FloatArray) -> "Body":
        """The body with other constants. Geometry and pattern are shared."""
        changed = copy(self)
        changed.parameters, changed.rows = parameters, self.points.rows(parameters)
        changed.field = MixedField(self.points, parameters) if self.points.mixed else None
        return changed

    def evaluate(self, u: FloatArray, *, start: BodyState | None = None) -> BodyState:
        """Internal forces at displacements [m] of shape [n d]; `start`: a state near it. If the body is
        inverted at a point, the forces are NaN and `BodyState.inverted` is True."""
        at = u.reshape(-1, self.model.dimension)
        pressure = None
        if self.field is not None:
            J = self.points.volume_ratios(at)
            if not (J > 0.0).all():
                return self._inverted(u, J)
            pressure = self.field.pressures(J)[0]
        thickness = None if start is None or start.inverted else start.points.thickness
        state = self.points.evaluate(at, self.rows, tangent=False, pressure=pressure, thickness=thickness)
        if not (state.J > 0.0).all():
            return self._inverted(u, state.J)
        return BodyState(u, self.pattern.vector(state.forces), state)

    def stiffness(self, state: BodyState, *, single: bool = False) -> FloatArray:
        """Element stiffness of a state [N/m], shape [m, k d, k d]. `single`: in single precision."""
        at = state.u.reshape(-1, self.model.dimension)
        pressure, curvature = None, None
        if self.field is not None:
            pressure, curvature = self.field.pressures(state.points.J)
        thickness = state.points.thickness
        points = self.points.evaluate(
            at, self.rows, tangent=True, forces=False, single=single, pressure=pressure, thickness=thickness
        )
        stiffness = points.stiffness
        assert stiffness is not None
        if self.field is not None and curvature is not None:
            stiffness += self.field.stiffness(points.H, curvature)
        return stiffness

    def _inverted(self, u: FloatArray, J: FloatArray) -> BodyState:
        nothing = np.zeros(0)
        state = PointState(nothing, nothing, None, nothing, J, nothing, nothing)
        return BodyState(u, np.full(len(u), np.nan), state)

    def energy(self, state: BodyState) -> float:
        """Strain energy [J]."""
        total = float((state.points.energy * self.points.geometry.volumes).sum())
        if self.field is not None:
            total += self.field.energy(state.points.J)
        return total

    def forces_by_parameters(self, state: BodyState) -> FloatArray:
        """d(internal forces)/d(constants) at fixed displacements [N per unit], [n_regions n_parameters, n d].
        The rows are ordered by region."""
        model, pattern = self.model, self.pattern
        elements = self.element_forces_by_parameters(state)
        regions = model.cell_regions
        found = []
        for r in range(model.n_regions):
            inside = np.where(regions == r, 1.0, 0.0)[:, None]
            found += [pattern.vector(elements[:, j] * inside) for j in range(elements.shape[1])]
        return np.array(found)

    def element_forces_by_parameters(self, state: BodyState) -> FloatArray:
        """d(internal forces)/d(constants) of each element and its region, shape [m, n_parameters, k d]."""
        points, T, volumes = self.points, self.points.geometry.T, self.points.geometry.volumes
        at = state.u.reshape(-1, self.model.dimension)
        by_row = points.stress_by_row(at, self.rows, state.points.thickness)
        by_row = _pairs_of_kinematics(by_row, state, self.model.kinematics)
        by_parameter = np.einsum("mgcr,mrp->mgcp", by_row, self._row_jacobians()[self.model.cell_regions])
        if self.field is not None:
            by_parameter = by_parameter + self.field.stress_by_parameters(state.points)
        weighted = np.moveaxis(by_parameter * volumes[..., None, None], 3, 2)
        m, _g, _columns, k = T.shape
        count, d = weighted.shape[2], self.model.dimension
        # constants and components are in one array, which needs one matrix product
        found = element_forces(T, weighted.reshape(*weighted.shape[:2], -1)).reshape(m, k, count, d)
        return np.moveaxis(found, 2, 1).reshape(m, count, k * d)

    def _row_jacobians(self) -> FloatArray:
        """d(row)/d(constants), [n_regions, n_row, n_parameters]; by four points (to 1e-11) if needed."""
        solid = self.model.solid
        found = []
        for values in self.parameters:
            columns = []
            for j, value in enumerate(values):
                h = 1e-3 * max(abs(value), 1e-3)
                shifted = []
                for step in (-2, -1, 1, 2):
                    moved = values.copy()
                    moved[j] += step * h
                    shifted.append(solid.with_parameters(moved).row())
                a, b, c, e = shifted
                columns.append((a - 8.0 * b + 8.0 * c - e) / (12.0 * h))
            found.append(np.stack(columns, axis=-1))
        return np.array(found)


def _pairs_of_kinematics(by_row: FloatArray, state: BodyState, kinematics: str) -> FloatArray:
    """The pairs (i, J) of the kinematics, selected from nine, shape [m, g, d D, n_row]."""
    if kinematics == "3d":
        return by_row
    if kinematics == "plane_strain":
        return by_row[:, :, [0, 1, 3, 4]]
    if kinematics == "axisymmetric":
        kept = by_row[:, :, [0, 1, 8, 3, 4, 2]].copy()
        kept[:, :, 5] = 0.0
        return kept
    # Plane stress: the thickness changes, and P_33 remains 0.
    return by_row[:, :, [0, 1, 3, 4]] - state.points.H[..., None] * by_row[:, :, [8]]
