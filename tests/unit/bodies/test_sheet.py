"""Sheets: forces and mass in closed form; planted constants come back."""

import numpy as np
import pytest

from kolsky.bodies.sheet import Sheet, cells_inside, mass_matrix, sheet_state
from kolsky.bodies.sheet_fit import FieldFit, FieldProblem, fit_field, fit_steps
from kolsky.equilibrium.meshes import Mesh, rectangle
from tests.unit.bodies.sheets import PAD, TRUE, constants, made, small_mesh


def _sheet(**options: object) -> Sheet:
    given = {"kinematics": "plane_stress", "thickness": 1e-3, "moving": "moving", "fixed": "rest", **options}
    return Sheet(small_mesh(), **given)  # type: ignore[arg-type]


def test_mass_of_a_triangle() -> None:
    mesh = Mesh(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]]), np.array([[0, 1, 2]]), "tri3")
    expected = 3.0 / 12.0 * np.array([[2.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 1.0, 2.0]])
    assert mass_matrix(mesh, np.array([True])).toarray() == pytest.approx(expected)
    assert mass_matrix(mesh, np.array([False])).nnz == 0


def test_cells_inside_take_whole_cells() -> None:
    mesh = rectangle((4.0, 1.0), (4, 1), kind="quad4")
    inside = cells_inside(mesh, np.array([0.9, -0.1]), np.array([3.1, 1.1]))
    assert inside.sum() == 2


def test_the_sheet_in_tension_pulls_back() -> None:
    state = sheet_state(_sheet(), constants(), constants().start, -PAD)
    assert not isinstance(state, str)
    assert (state.force < 0.0).all()  # the pad goes to -x and so does the force on the sheet there
    # Under prescribed displacements the force is proportional to E and the field does not see it.
    assert state.force_by_constants[:, 0] == pytest.approx(state.force / TRUE["E"], rel=1e-6)
    assert np.abs(state.by_constants[:, 0]).max() * TRUE["E"] < 1e-6 * np.abs(state.displacements).max()


def test_gradient_is_that_of_the_cost() -> None:
    problem = made(_sheet())
    start = problem.constants.start
    cost = problem.cost(start)
    assert not isinstance(cost, str)
    for j, step in enumerate((2.0, 2e-5)):
        values = []
        for sign in (1.0, -1.0):
            moved = start.copy()
            moved[j] += sign * step
            found = problem.cost(moved)
            assert not isinstance(found, str)
            values.append(found.value)
        slope = (values[0] - values[1]) / (2.0 * step)
        assert cost.gradients.sum(axis=0)[j] == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize("kinematics", ["plane_stress", "plane_strain"])
def test_planted_constants_come_back(kinematics: str) -> None:
    found = fit_field(made(_sheet(kinematics=kinematics)))
    assert found.converged
    assert found.values == pytest.approx([TRUE["E"], TRUE["poisson"]], rel=1e-6)
    assert found.adequate
    assert found.warnings == []
    # Without misfit the second derivatives are those of Gauss and Newton.
    assert found.hessian == pytest.approx(found.cost.gauss_newton, rel=2e-3)


def test_the_wrong_kinematics_is_another_answer() -> None:
    # The field of plane stress fitted in plane strain: the constants of one are not those of the other.
    data = made(_sheet()).data
    other = fit_field(FieldProblem(_sheet(kinematics="plane_strain"), data, constants()))
    assert abs(other.values[1] / TRUE["poisson"] - 1.0) > 0.05


def test_a_held_region_keeps_its_material() -> None:
    mesh = small_mesh()
    regions = (mesh.points[mesh.cells].mean(axis=1)[:, 0] > 0.02).astype(np.int64)
    stiff = constants(E=9e4, poisson=0.2)
    sheet = _sheet(regions=regions, held={1: stiff.solid(stiff.start)})
    found = fit_field(made(sheet))
    assert found.values == pytest.approx([TRUE["E"], TRUE["poisson"]], rel=1e-5)


def test_a_misfit_is_called_a_misfit_and_widens() -> None:
    problem = made(_sheet(), noise=2e-6, force_noise=1e-4)
    clean = fit_field(problem)
    assert clean.adequate
    assert clean.scales[1] < 4.0
    data = problem.data
    bent = data.displacements.copy()
    bent[..., 0] += 3e-4 * np.sin(80.0 * problem.sheet.mesh.points[:, 1])
    wrong = fit_field(
        FieldProblem(problem.sheet, type(data)(**{**vars(data), "displacements": bent}), problem.constants)
    )
    assert not wrong.adequate
    assert "does not explain" in wrong.warnings[0]
    assert wrong.sigma[1] > 5.0 * clean.sigma[1]
    assert len(fit_steps(problem)) == 2


def test_sensitivity_predicts_the_change_of_a_fit() -> None:
    # Eq. (K.19): another measured field, another force, and the fit repeated.
    problem = made(_sheet())
    before = fit_field(problem)
    data = problem.data
    moved = data.displacements.copy()
    moved[1, :, 1] *= 1.0 + 1e-3
    after = fit_field(
        FieldProblem(problem.sheet, type(data)(**{**vars(data), "displacements": moved}), problem.constants)
    )
    told = np.einsum("pai,ai->p", before.by_displacement[1], moved[1] - data.displacements[1])
    assert after.values[1] - before.values[1] == pytest.approx(told[1], rel=0.02)
    force = data.force + np.array([0.0, 1e-3 * data.force[1]])
    pulled = fit_field(
        FieldProblem(problem.sheet, type(data)(**{**vars(data), "force": force}), problem.constants)
    )
    change = before.by_force[1] * (force[1] - data.force[1])
    assert pulled.values[0] - before.values[0] == pytest.approx(change[0], rel=0.01)


def test_a_constant_on_its_bound_is_held_and_said() -> None:
    # A field without any contraction across the pull asks for nu <= 0: the bound holds, E is still known.
    problem = made(_sheet())
    data = problem.data
    flat = data.displacements.copy()
    flat[..., 1] = 0.0
    found = fit_field(
        FieldProblem(problem.sheet, type(data)(**{**vars(data), "displacements": flat}), problem.constants)
    )
    assert found.at_bound == (False, True)
    assert found.converged
    assert found.sigma[0] > 0.0
    assert found.sigma[1] == 0.0
    assert "poisson is at its bound" in found.warnings[0]
    assert (found.relative_by_force(1.0)[:, 1] == 0.0).all()


def test_misfit_noise_and_scales_in_closed_form() -> None:
    # A field that is off by 10 % everywhere has a misfit of 10 %; its scales are sums over sigma and degrees.
    problem = made(_sheet(), start=constants())
    data = problem.data
    off = FieldProblem(
        problem.sheet,
        type(data)(**{**vars(data), "displacements": data.displacements / 1.1, "force": 1.02 * data.force}),
        problem.constants,
    )
    cost = off.cost(constants().start)
    assert not isinstance(cost, str)
    p = len(constants().start)
    zeros = np.zeros((2, p, *data.displacements.shape[1:]))
    found = FieldFit(
        off, constants(), cost, cost.gauss_newton, zeros, np.zeros((2, p)), True, (False, False), 1
    )
    assert found.misfit == pytest.approx([0.1, 0.1])
    assert not found.adequate
    area = float(problem.mass.sum())
    size = [np.einsum("ai,ai->", problem.mass @ one, one) for one in off.data.displacements]
    assert found.noise == pytest.approx(np.sqrt(2.0 * area / np.array(size)) * 1e-6)
    of_field = sum(0.01 * one for one in size) / (1e-5 * 1e-12)
    of_force = float(((0.02 * data.force) ** 2).sum()) / 1e-10
    assert found.scales == pytest.approx((of_field / (2 * 2.0 * area / 1e-5 - 2), max(1.0, of_force / 1.0)))
    inverse = np.linalg.inv(cost.gauss_newton)
    middle = found.scales[0] * cost.curvature_displacement + found.scales[1] * cost.curvature_force
    assert found.covariance == pytest.approx(1e-5 * 1e-12 * inverse @ middle @ inverse)


def test_second_derivatives_are_those_of_the_gradient() -> None:
    # Data far from the model, so that the second derivatives of u and f count; a held region beside.
    mesh = small_mesh()
    regions = (mesh.points[mesh.cells].mean(axis=1)[:, 0] > 0.02).astype(np.int64)
    stiff = constants(E=9e4, poisson=0.2)
    problem = made(_sheet(regions=regions, held={1: stiff.solid(stiff.start)}))
    free, sizes = np.array([2.2e4, 0.2]), np.array([2.2e4, 0.2])
    columns = []
    for j in range(2):
        ends = []
        for sign in (1.0, -1.0):
            moved = free.copy()
            moved[j] += sign * 1e-4 * sizes[j]
            cost = problem.cost(moved)
            assert not isinstance(cost, str)
            ends.append(cost.gradients.sum(axis=0))
        columns.append((ends[0] - ends[1]) / (2e-4 * sizes[j]))
    expected = np.stack(columns) * np.outer(sizes, sizes)
    cost = problem.cost(free)
    assert not isinstance(cost, str)
    found = problem.hessian(free) * np.outer(sizes, sizes)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=1e-5 * scale)  # of the differences
    # without the second derivatives it would be another matrix
    assert np.abs(cost.gauss_newton * np.outer(sizes, sizes) - expected).max() > 0.05 * scale
