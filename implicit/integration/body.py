"""The body of a model: internal forces, stiffness, and their derivatives by the constants."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.integration.contraction import element_forces
from implicit.integration.mixed import MixedField
from implicit.integration.pattern import Pattern
from implicit.integration.points import Points, PointState
from implicit.model import Model


@dataclass(frozen=True)
class BodyState:
    """Internal forces of one state."""

    u: FloatArray
    """Displacements [m], shape [n d]."""
    forces: FloatArray
    """Internal forces of the points [N], shape [n d]."""
    points: PointState
    """The Gauss points."""

    @property
    def inverted(self) -> bool:
        """Whether a Gauss point has J <= 0, or no number."""
        return not bool((self.points.J > 0.0).all() and np.isfinite(self.forces).all())


class Body:
    """Evaluates a model's body; made once a solution."""

    def __init__(self, model: Model, parameters: FloatArray) -> None:
        self.model, self.parameters = model, parameters
        self.points = Points(model)
        self.rows = self.points.rows(parameters)
        d = model.dimension
        dofs = (model.mesh.cells[..., None] * d + np.arange(d)).reshape(len(model.mesh.cells), -1)
        self.pattern = Pattern(dofs, model.unknowns.index, model.unknowns.count)
        self.field = MixedField(self.points, parameters) if self.points.mixed else None

    def evaluate(self, u: FloatArray, *, start: BodyState | None = None) -> BodyState:
        """Internal forces at displacements [m] of shape [n d]; `start`: a state near it.

        A body that is inside out at some point has no forces: they are not a number then, and the state says
        `BodyState.inverted`.
        """
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
        """Element stiffness of a state [N/m], shape [m, k d, k d]; `single`: in single precision."""
        at = state.u.reshape(-1, self.model.dimension)
        pressure, curvature = None, None
        if self.field is not None:
            pressure, curvature = self.field.pressures(state.points.J)
        thickness = state.points.thickness
        points = self.points.evaluate(
            at,
            self.rows,
            tangent=True,
            forces=False,
            single=single,
            pressure=pressure,
            thickness=thickness,
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
        """d(internal forces)/d(constants) at fixed displacements [N per unit], region by region, shape
        [n_regions n_parameters, n d]."""
        model, pattern = self.model, self.pattern
        elements = self.element_forces_by_parameters(state)
        regions = model.cell_regions
        found = []
        for r in range(model.n_regions):
            inside = np.where(regions == r, 1.0, 0.0)[:, None]
            found += [pattern.vector(elements[:, j] * inside) for j in range(elements.shape[1])]
        return np.array(found)

    def element_forces_by_parameters(self, state: BodyState) -> FloatArray:
        """The same of each element, by the constants of its region, shape [m, n_parameters, k d]."""
        points, T, volumes = self.points, self.points.geometry.T, self.points.geometry.volumes
        at = state.u.reshape(-1, self.model.dimension)
        by_row = points.stress_by_row(at, self.rows, state.points.thickness)
        by_row = _kept(by_row, state, self.model.kinematics)
        by_parameter = np.einsum("mgcr,mrp->mgcp", by_row, self._row_jacobians()[self.model.cell_regions])
        if self.field is not None:
            by_parameter = by_parameter + self.field.stress_by_parameters(state.points)
        weighted = np.moveaxis(by_parameter * volumes[..., None, None], 3, 2)
        m, _g, _columns, k = T.shape
        count, d = weighted.shape[2], self.model.dimension
        # the constants stand beside the components: one product of matrices for all
        found = element_forces(T, weighted.reshape(*weighted.shape[:2], -1)).reshape(m, k, count, d)
        return np.moveaxis(found, 2, 1).reshape(m, count, k * d)

    def _row_jacobians(self) -> FloatArray:
        """d(kernels' row)/d(constants) of each region, shape [n_regions, n_row, n_parameters].

        The row of most laws is their constants; where a law prepares others the differences of four points
        are exact to 1e-11.
        """
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


def _kept(by_row: FloatArray, state: BodyState, kinematics: str) -> FloatArray:
    """The pairs (i, J) that the kinematics has, out of nine, shape [m, g, d D, n_row]."""
    if kinematics == "3d":
        return by_row
    if kinematics == "plane_strain":
        return by_row[:, :, [0, 1, 3, 4]]
    if kinematics == "axisymmetric":
        kept = by_row[:, :, [0, 1, 8, 3, 4, 2]].copy()
        kept[:, :, 5] = 0.0
        return kept
    # Plane stress: the thickness follows so that P_33 stays 0.
    return by_row[:, :, [0, 1, 3, 4]] - state.points.H[..., None] * by_row[:, :, [8]]
