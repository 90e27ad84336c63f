"""A sheet before its test: measurements that a fit gives back, and what they tell by hand."""

import numpy as np
import pytest

from kolsky.bodies.sheet import Sheet
from kolsky.bodies.sheet_fit import FieldData, FieldProblem, fit_field
from kolsky.bodies.sheet_reading import MeasuredField, plan_sheet, simulate_sheet
from tests.unit.bodies.sheets import PAD, constants, made, small_mesh


def _problem(**start: float) -> FieldProblem:
    sheet = Sheet(small_mesh(), "plane_stress", 1e-3, "moving", "rest")
    return made(sheet, noise=2e-6, force_noise=1e-4, start=constants(**start))


def _measured(problem: FieldProblem) -> MeasuredField:
    points = problem.sheet.mesh.points
    nothing = np.zeros((len(PAD), *points.shape))
    return MeasuredField(problem, points, np.zeros(len(points), dtype=bool), nothing, (7, 9), {})


def test_simulated_data_have_their_constants_and_noise() -> None:
    problem = _problem()
    found = simulate_sheet(_measured(problem))
    noisy = simulate_sheet(_measured(problem), seed=2)
    apart = (noisy.displacements - found.displacements) / 2e-6
    assert apart.std() == pytest.approx(1.0, abs=5.0 / np.sqrt(2.0 * apart.size))
    again = simulate_sheet(_measured(problem), seed=2)
    np.testing.assert_array_equal(again.displacements, noisy.displacements)
    # `project` at the nodes smooths by quadratics; the force does not pass it
    data = problem.data
    exact = FieldData(
        data.pad, found.force, found.displacements, data.cells, 2e-6, data.sigma_force, data.area
    )
    fitted = fit_field(FieldProblem(problem.sheet, exact, constants(E=2.5e4)))
    assert fitted.values == pytest.approx([3.0e4, 0.3], rel=0.02)
    columns = found.point_columns
    assert set(columns["frame"]) == {7, 9}
    assert columns["x (mm)"][len(found.points)] == 1e3 * found.points[0, 0]
    np.testing.assert_allclose(found.pad_columns["pad (mm)"], 1e3 * data.pad)


def test_what_field_and_force_tell() -> None:
    problem = _problem()
    cost = problem.cost(problem.constants.start)
    assert not isinstance(cost, str)
    found = {one.tests: one for one in plan_sheet(problem)}
    # by hand: with E alone in the force and nu in both, information adds and is inverted
    data, slopes = problem.data, cost.state.force_by_constants
    of_field = cost.curvature_displacement / (data.area * data.sigma_displacement**2)
    of_force = slopes.T @ slopes / data.sigma_force**2
    for tests, information in ((("field", "force"), of_field + of_force), (("force",), of_force)):
        expected = np.sqrt(np.diag(np.linalg.inv(information))) / problem.constants.start
        np.testing.assert_allclose(found[tests].relative, expected, rtol=1e-5)
    # prescribed displacements: Young's modulus moves none of them, nu is known from the field alone
    alone = found[("field",)]
    assert alone.relative[0] == np.inf
    assert alone.relative[1] == pytest.approx(1.0 / np.sqrt(of_field[1, 1]) / 0.3, rel=1e-5)
    assert alone.criterion == np.inf
    wanted = {one.tests: one.criterion for one in plan_sheet(problem, wanted=("poisson",))}
    assert wanted[("field",)] == alone.relative[1]
