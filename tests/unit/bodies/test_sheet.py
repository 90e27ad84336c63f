"""Sheets: forces and mass in closed form; fits return the known constants."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from kolsky.base.arrays import FloatArray
from kolsky.bodies import sheet_fit
from kolsky.bodies.sheet import Sheet, cells_inside, mass_matrix, sheet_state
from kolsky.bodies.sheet_checks import (
    _force_counts,
    agrees,
    fit_measured,
    interpolated,
    lacking_factor,
    mesh_error,
    one_change,
)
from kolsky.bodies.sheet_fit import (
    Cost,
    FieldData,
    FieldFit,
    FieldProblem,
    before_test,
    fit_field,
    fit_steps,
    parameter_change,
    relative_deviation,
    secant,
    smoothed,
    with_other_starts,
)
from kolsky.bodies.sheet_reading import (
    MeasuredField,
    counterclockwise,
    keeping,
    mesh_scale,
    plan_sheet,
    simulate_sheet,
)
from kolsky.bodies.specimen_constants import LARGEST_POISSON, Constants
from kolsky.equilibrium.meshes import Mesh, rectangle
from tests.unit.bodies.sheets import PAD, TRUE, constants, made, small_mesh

NOWHERE = (np.zeros(2), 1.0)
"""End of a search that was not made."""


def _sheet(**options: object) -> Sheet:
    given = {"kinematics": "plane_stress", "thickness": 1e-3, "moving": "moving", "fixed": "rest", **options}
    return Sheet(small_mesh(), **given)  # type: ignore[arg-type]


def _cost(problem: FieldProblem, values: FloatArray) -> Cost:
    cost = problem.cost(values)
    return cost


def _with(problem: FieldProblem, **data: Any) -> FieldProblem:
    """The problem with other measurements."""
    return FieldProblem(problem.sheet, replace(problem.data, **data), problem.constants)


def half_held() -> Sheet:
    """Half of it is of a known, stiff material."""
    middle, stiff = small_mesh().points[small_mesh().cells].mean(axis=1), constants(E=9e4, poisson=0.2)
    return _sheet(regions=(middle[:, 0] > 0.02).astype(np.int64), held={1: stiff.solid(stiff.start)})


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
    assert (state.force < 0.0).all()  # the pad goes to -x and so does the force on the sheet there
    # Under prescribed displacements the force is proportional to E and the field does not see it.
    assert state.force_by_constants[:, 0] == pytest.approx(state.force / TRUE["E"], rel=1e-6)
    assert np.abs(state.by_constants[:, 0]).max() * TRUE["E"] < 1e-6 * np.abs(state.displacements).max()


def test_gradient_is_that_of_the_cost() -> None:
    problem = made(_sheet())
    start = problem.constants.start
    cost = _cost(problem, start)
    for j, step in enumerate((2.0, 2e-5)):
        values = []
        for sign in (1.0, -1.0):
            moved = start.copy()
            moved[j] += sign * step
            found = _cost(problem, moved)
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
    found = fit_field(made(half_held()))
    assert found.values == pytest.approx([TRUE["E"], TRUE["poisson"]], rel=1e-5)


def test_a_misfit_is_called_a_misfit_and_widens() -> None:
    problem = made(_sheet(), noise=2e-6, force_noise=1e-4)
    clean = fit_field(problem)
    assert clean.adequate
    assert clean.scales[1] < 4.0
    data = problem.data
    bent = data.displacements.copy()
    bent[..., 0] += 3e-4 * np.sin(80.0 * problem.sheet.mesh.points[:, 1])
    wrong = fit_field(_with(problem, displacements=bent))
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
    after = fit_field(_with(problem, displacements=moved))
    told = np.einsum("pai,ai->p", before.by_displacement[1], moved[1] - data.displacements[1])
    assert after.values[1] - before.values[1] == pytest.approx(told[1], rel=0.02)
    force = data.force + np.array([0.0, 1e-3 * data.force[1]])
    pulled = fit_field(_with(problem, force=force))
    change = before.by_force[1] * (force[1] - data.force[1])
    assert pulled.values[0] - before.values[0] == pytest.approx(change[0], rel=0.01)


def test_a_constant_on_its_bound_is_held_and_said() -> None:
    # A field without any contraction across the pull asks for nu <= 0: the bound holds, E is still known.
    problem = made(_sheet())
    data = problem.data
    flat = data.displacements.copy()
    flat[..., 1] = 0.0
    found = fit_field(_with(problem, displacements=flat))
    assert found.at_bound == (False, True)
    assert found.converged
    assert found.sigma[0] > 0.0
    assert found.sigma[1] == 0.0
    assert "poisson is at its bound" in found.warnings[0]
    assert (found.relative_by_force[:, 1] == 0.0).all()


def test_misfit_noise_and_scales_in_closed_form() -> None:
    # A field that is off by 10 % everywhere has a misfit of 10 %; its scales are sums over sigma and degrees.
    problem = made(_sheet(), start=constants())
    data = problem.data
    off = _with(problem, displacements=data.displacements / 1.1, force=1.02 * data.force)
    cost = _cost(off, constants().start)
    p = len(constants().start)
    zeros = np.zeros((2, p, *data.displacements.shape[1:]))
    found = FieldFit(
        off, constants(), cost, cost.gauss_newton, zeros, np.zeros((2, p)), True, (False, False), 1, NOWHERE
    )
    assert found.misfit == pytest.approx([0.1, 0.1])
    assert not found.adequate
    assert found.force_misfit == pytest.approx(0.02 / 1.02)
    assert found.force_noise == pytest.approx(np.sqrt(2.0) * 1e-5 / np.linalg.norm(1.02 * data.force))
    assert found.force_explained
    assert found.force_testable
    assert not found.explained
    area = float(problem.mass.sum())
    size = [np.einsum("ai,ai->", problem.mass @ one, one) for one in off.data.displacements]
    assert found.noise == pytest.approx(np.sqrt(2.0 * area / np.array(size)) * 1e-6)
    of_field = sum(0.01 * one for one in size) / (1e-5 * 1e-12)
    of_force = float(((0.02 * data.force) ** 2).sum()) / 1e-10
    assert found.scales == pytest.approx((of_field / (2 * 2.0 * area / 1e-5 - 2), max(1.0, of_force / 1.0)))
    inverse = np.linalg.inv(cost.gauss_newton)
    middle = found.scales[0] * cost.curvature_displacement + found.scales[1] * cost.curvature_force
    assert found.covariance == pytest.approx(1e-5 * 1e-12 * inverse @ middle @ inverse)


def test_a_field_that_is_explained_does_not_excuse_a_force() -> None:
    problem = made(_sheet(), start=constants())
    off = _with(problem, force=problem.data.force / 0.9)
    cost = _cost(off, constants().start)
    zeros = np.zeros((2, 2, *problem.data.displacements.shape[1:]))
    no = (False, False)
    found = FieldFit(off, constants(), cost, cost.gauss_newton, zeros, np.zeros((2, 2)), True, no, 1, NOWHERE)
    assert found.force_misfit == pytest.approx(0.1)
    assert found.adequate
    assert not found.force_explained
    assert not found.explained


def test_second_derivatives_are_those_of_the_gradient() -> None:
    # Data far from the model, so that the second derivatives of u and f count; a held region beside.
    problem = made(half_held())
    free, sizes = np.array([2.2e4, 0.2]), np.array([2.2e4, 0.2])
    columns = []
    for j in range(2):
        ends = []
        for sign in (1.0, -1.0):
            moved = free.copy()
            moved[j] += sign * 1e-4 * sizes[j]
            cost = _cost(problem, moved)
            ends.append(cost.gradients.sum(axis=0))
        columns.append((ends[0] - ends[1]) / (2e-4 * sizes[j]))
    expected = np.stack(columns) * np.outer(sizes, sizes)
    cost = _cost(problem, free)
    found = problem.hessian(free) * np.outer(sizes, sizes)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=1e-5 * scale)  # of the differences
    # without the second derivatives it would be another matrix
    assert np.abs(cost.gauss_newton * np.outer(sizes, sizes) - expected).max() > 0.05 * scale


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
    cost = _cost(problem, problem.constants.start)
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


A = np.array([[2.0, 1.0], [0.5, -1.0], [1.0, 3.0], [0.0, 0.7]])
"""A model linear in its constants, u = A m: least squares has m = (A^T W A)^-1 A^T W v."""
W = np.diag([1.0, 2.0, 0.5, 3.0])


def test_change_is_that_of_least_squares() -> None:
    # J = 1/2 (A m - v)^T W (A m - v): d2J/dm2 = A^T W A, d2J/dm dv = -A^T W.
    found = parameter_change(A.T @ W @ A, -A.T @ W)
    assert found == pytest.approx(np.linalg.inv(A.T @ W @ A) @ A.T @ W)


def test_variance_adds_squares() -> None:
    change = np.array([[3.0, 4.0], [1.0, -2.0]])
    assert relative_deviation(change, np.array([-5.0, 1.0])) == pytest.approx([1.0, np.sqrt(5.0)])


def test_a_direction_that_is_not_seen_is_refused() -> None:
    with pytest.raises(ValueError, match="not positive definite"):
        parameter_change(np.array([[1.0, 1.0], [1.0, 1.0 - 1e-6]]), np.ones((2, 3)))
    with pytest.raises(ValueError, match="does not depend"):
        parameter_change(np.diag([1.0, 0.0]), np.ones((2, 3)))
    with pytest.raises(ValueError, match="zero"):
        relative_deviation(np.ones((1, 2)), np.array([0.0]))


def test_smoothed_field_integrates_to_the_change() -> None:
    # Linear elements on a line of three nodes, the last node outside the region: M from two half-elements.
    mass = csr_matrix(np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.0]]) / 6.0)
    change = np.array([[0.5, -1.0, 0.0]])
    field = smoothed(mass, change)
    # M^-1 of [[2, 1], [1, 2]] / 6 is [[4, -2], [-2, 4]].
    assert field == pytest.approx(np.array([[4.0, -5.0, 0.0]]))
    disturbance = np.array([0.3, 0.2, 0.9])
    assert disturbance @ (mass @ field[0]) == pytest.approx(disturbance @ change[0])


def test_before_a_test_every_constant_that_displacements_see() -> None:
    mass = diags([1.0, 2.0, 0.5, 3.0]).tocsr()
    constants = np.array([10.0, 0.2])
    found = before_test(A.T, mass, constants)
    relative = A * constants  # du / d(relative constant)
    inverse = np.linalg.inv(relative.T @ W @ relative)
    assert not found.singular
    assert found.change == pytest.approx(inverse @ relative.T @ W)  # Eq. (K.32)
    assert found.field == pytest.approx(inverse @ relative.T)  # Eq. (K.36): M^-1 of the change


def test_eigenvectors_where_a_constant_moves_nothing() -> None:
    # Young's modulus moves no displacement under prescribed displacements; the other one is left.
    slopes = np.stack([np.zeros(4), A[:, 1]])
    found = before_test(slopes, diags([1.0, 2.0, 0.5, 3.0]).tocsr(), np.array([2.8e4, 0.2]))
    own = 0.2 * A[:, 1]
    assert found.singular
    assert found.directions == pytest.approx(np.array([[0.0, 1.0]]))
    assert found.change[0] == pytest.approx(W @ own / (own @ W @ own))  # Eq. (K.35)
    assert found.field[0] == pytest.approx(own / (own @ W @ own))


def test_nothing_moves() -> None:
    with pytest.raises(ValueError, match="force has to be measured"):
        before_test(np.zeros((2, 4)), diags([1.0] * 4).tocsr(), np.ones(2))


@pytest.mark.parametrize("kind", ["tri3", "quad4", "quad9"])
def test_interpolation_is_that_of_the_element(kind: str) -> None:
    mesh = rectangle((4.0, 2.0), (4, 2), kind=kind)
    values = mesh.points @ np.array([[2.0, 1.0], [-1.0, 3.0]])
    points = np.array([[0.3, 0.4], [3.9, 1.9], [4.0, 0.0], [4.2, 1.0]])
    found, cell = interpolated(mesh, values, points)
    assert found[:3] == pytest.approx(points[:3] @ np.array([[2.0, 1.0], [-1.0, 3.0]]), abs=1e-5)
    assert (cell >= 0).tolist() == [True, True, True, False]
    assert np.isnan(found[3]).all()


def test_error_of_a_mesh_over_a_parabola() -> None:
    # u = x^2 on cells 1 x 1: at an inner cell G_a - G = 1 and the longest distance in it sqrt(2).
    mesh = rectangle((5.0, 1.0), (5, 1), kind="quad4")
    found = mesh_error(mesh, mesh.points[:, :1] ** 2)
    assert found[2, 0] == pytest.approx(0.25 * np.sqrt(2.0))
    assert mesh_error(mesh, mesh.points[:, :1]) == pytest.approx(np.zeros((5, 1)), abs=1e-12)


def test_the_factor_that_a_force_lacks() -> None:
    measured, simulated = np.array([3.0, 4.0]), np.array([-6.0, -8.0])
    found = lacking_factor(measured, simulated, np.diag([0.01, 0.04]), 0.5)
    assert found[0] == pytest.approx(-2.0)
    assert found[1] == pytest.approx(np.sqrt(9.0 * 0.01 + 16.0 * 0.04 + 4.0 * 0.25 * 25.0) / 25.0)
    assert agrees(2.0 * 1.049, 0.0, 2.0)  # 5 % of the factor counts as explained
    assert not agrees(2.0 * 1.051, 0.0, 2.0)
    assert agrees(-0.85, 0.08, -1.0)
    assert not agrees(-0.75, 0.08, -1.0)


@pytest.fixture(scope="module")
def two_materials() -> FieldProblem:
    """A sheet of which half is of a known material: its field alone determines both constants."""
    return made(half_held())


@pytest.mark.parametrize(
    ("key", "factor", "words"),
    [
        ("force", -1.0, "field.pad.force times -1"),
        ("force", 1e3, "field.pad.force times 0.001"),
        ("force", 0.5, "field.pad.force times 2"),
        ("force", 1.0 / 9.80665, "it is in kgf or kg, not in N"),
        ("displacements", 1e3, "field.points.ux and uy times 0.001"),
    ],
)
def test_one_wrong_factor_is_named(
    two_materials: FieldProblem, key: str, factor: float, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = _with(two_materials, **{key: factor * getattr(two_materials.data, key)})
    with monkeypatch.context() as short:  # a search that cannot succeed
        short.setattr(sheet_fit, "MOST_RUNS", 10)
        found = fit_field(problem)
    assert not found.explained
    assert any("does not explain the " in one for one in found.warnings)
    assert words in one_change(_measured(problem), found)


def test_a_right_sheet_has_no_change(two_materials: FieldProblem) -> None:
    found = fit_field(two_materials)
    assert found.explained
    assert one_change(_measured(two_materials), found) == ""


@pytest.mark.parametrize(
    ("wrong", "words"), [("uy", "field.points.uy times -1"), ("y", "its axis y is mirrored")]
)
def test_a_wrong_place_is_named(wrong: str, words: str) -> None:
    mesh = small_mesh()
    middle = mesh.points[mesh.cells].mean(axis=1)
    regions = ((middle[:, 0] > 0.02) & (middle[:, 1] > 0.01)).astype(np.int64)
    stiff = constants(E=9e4, poisson=0.2)
    right = made(_sheet(regions=regions, held={1: stiff.solid(stiff.start)}))
    sheet, data = right.sheet, right.data
    x, y = np.meshgrid(np.linspace(0.004, 0.036, 17), np.linspace(0.003, 0.014, 12), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel()])
    nodal = np.moveaxis(data.displacements, 0, 1).reshape(len(mesh.points), -1)
    flat = interpolated(mesh, nodal, points)[0]
    moved = np.moveaxis(flat.reshape(len(points), 2, 2), 1, 0)
    if wrong == "uy":
        moved = moved * [1.0, -1.0]
    if wrong == "y":
        points, moved = points * [1.0, -1.0] + [0.0, 0.02], moved * [1.0, -1.0]
    problem = FieldProblem(sheet, data, right.constants)
    none = np.zeros(len(points), dtype=bool)
    measured = keeping(MeasuredField(problem, points, none, moved, (1, 2), {}, 1e-6), none)
    found = fit_field(measured.problem)
    assert not found.explained
    assert words in one_change(measured, found)


def test_cells_of_either_sense_are_one_body() -> None:
    mesh = small_mesh()
    cells = mesh.cells.copy()
    cells[[1, 5]] = cells[[1, 5]][:, [0, 2, 1]]
    turned, count = counterclockwise(mesh.points, cells)
    assert count == 2
    np.testing.assert_array_equal(turned, mesh.cells)


def test_two_regions_are_free_at_once() -> None:
    values = {**TRUE, "stiff.E": 9e4, "stiff.poisson": 0.2}
    both = Constants("neo_hookean_coupled", values, tuple(values), ("stiff",))
    sheet = _sheet(regions=half_held().regions)
    state = sheet_state(sheet, both, both.start, -PAD)
    cells = np.ones(len(sheet.mesh.cells), dtype=bool)
    data = FieldData(-PAD, state.force, state.displacements, cells, 1e-6, 1e-5, 1e-5)
    start = Constants(
        "neo_hookean_coupled", {**values, "E": 2.2e4, "stiff.E": 6e4}, tuple(values), ("stiff",)
    )
    found = fit_field(FieldProblem(sheet, data, start))
    assert found.values == pytest.approx(list(values.values()), rel=1e-4)
    with pytest.raises(ValueError, match=r"stiff\.E"):
        Constants("neo_hookean_coupled", TRUE, ("E",), ("stiff",))


def test_a_translation_that_is_not_measured_changes_nothing(two_materials: FieldProblem) -> None:
    # u + t for any t has the same cost, gradient and constants; t itself comes back.
    shift = np.array([[[2e-4, -1e-4]], [[5e-4, 3e-4]]])
    problem = _with(two_materials, displacements=two_materials.data.displacements + shift, floating=True)
    data, found = problem.data, fit_field(problem)
    assert found.values == pytest.approx([TRUE["E"], TRUE["poisson"]], rel=1e-5)
    np.testing.assert_allclose(problem.translation(found.cost.state), shift, atol=1e-12)
    still = fit_field(two_materials)
    assert found.misfit == pytest.approx(still.misfit, abs=1e-6)
    assert found.noise == pytest.approx(still.noise, rel=1e-4)  # relative to the same displacements
    assert not two_materials.translation(still.cost.state).any()
    # one mean a step and component is spent: sum of |u - mean|^2 / (n - 1)
    spent = 2.0 * float(problem.mass.sum()) * 2 / data.area - 2.0 * 2
    cost = replace(found.cost, displacement=np.array([5e4, 0.0]) * data.area * data.sigma_displacement**2)
    assert replace(found, cost=cost).scales[0] == pytest.approx(1e5 / (spent - 2.0), rel=1e-12)


def test_a_force_of_the_size_of_its_noise_is_not_testable(two_materials: FieldProblem) -> None:
    found = fit_field(_with(two_materials, sigma_force=float(np.abs(two_materials.data.force).max())))
    assert not found.force_testable
    assert "the force is not testable" in found.warnings[-1]


def test_a_doubted_point_comes_back_if_the_sheet_predicts_it(two_materials: FieldProblem) -> None:
    sheet, data = two_materials.sheet, two_materials.data
    x, y = np.meshgrid(np.linspace(0.006, 0.034, 15), np.linspace(0.002, 0.018, 9), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel()])
    nodal = np.moveaxis(data.displacements, 0, 1).reshape(len(sheet.mesh.points), -1)
    rng = np.random.default_rng(2)
    flat = interpolated(sheet.mesh, nodal, points)[0] + 1e-6 * rng.standard_normal((len(points), 4))
    flat[40, 2] += 5e-4
    doubted = np.isin(np.arange(len(points)), [40, 67, 70])
    moved = np.moveaxis(flat.reshape(len(points), 2, 2), 1, 0)
    measured = MeasuredField(two_materials, points, doubted, moved, (1, 2), {}, 1e-6)
    kept, _ = fit_measured(measured, gate=6.0)
    assert np.flatnonzero(kept.left_out).tolist() == [40]


def test_a_secant_of_the_gradient_is_exact_of_a_parabola() -> None:
    # Of p steps that span the constants the change of rank one makes any symmetric matrix.
    exact = np.array([[4.0, -1.0], [-1.0, -3.0]])
    found = np.zeros((2, 2))
    for step in (np.array([1.0, 0.2]), np.array([-0.3, 1.0])):
        found = secant(found, step, exact @ step, np.ones(2))
    np.testing.assert_allclose(found, exact, atol=1e-12)
    # What is lacking across the step has no bound: nothing is learnt.
    along, across = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    still = secant(found, along, found @ along + across, np.ones(2))
    np.testing.assert_array_equal(still, found)


class _Wells:
    """A cost of E and nu with two minima in nu, at 0.1 and 0.4; the second is higher by 0.003 of 0.001."""

    constants = constants()
    data = None

    @property
    def last(self) -> "_Wells":
        return self

    def cost(self, free: FloatArray, near: object = None) -> Cost:
        young, nu = free[0] / TRUE["E"] - 1.0, free[1]
        value = 1e-3 + young**2 + (nu - 0.1) ** 2 * (nu - 0.4) ** 2 + 1e-5 * (nu - 0.1)
        slope = 2.0 * (nu - 0.1) * (nu - 0.4) * (2.0 * nu - 0.5) + 1e-5
        gradients = np.array([[2.0 * young / TRUE["E"], slope]])
        curvature = np.diag([2.0 / TRUE["E"] ** 2, 0.2])
        state: Any = SimpleNamespace(state=None)
        return Cost(np.array([value]), np.zeros(1), value, gradients, curvature, 0.0 * curvature, state)


def test_another_minimum_is_named() -> None:
    wells: Any = _Wells()
    best = np.array([TRUE["E"], 0.1])
    at = wells.constants.with_free(best)
    none = np.zeros((2, 2))
    fit = FieldFit(
        wells, at, wells.cost(best), none, none, none, True, (False, True), 3, (best, wells.cost(best).value)
    )
    found = with_other_starts(fit, wells.constants.start)
    assert len(found.minima) == 1
    (other,) = found.minima
    assert other.start[1] == pytest.approx(0.9 * LARGEST_POISSON)
    assert other.values == pytest.approx([TRUE["E"], 0.4], rel=1e-2)
    assert other.ratio == pytest.approx(1.003, abs=5e-4)
    assert found.simulations > 3


def test_a_factor_of_the_force_is_tried_where_it_could_matter(two_materials: FieldProblem) -> None:
    assert _force_counts(two_materials)  # a held region gives the force a scale
    alone = made(_sheet())
    assert not _force_counts(alone)
    assert _force_counts(_with(alone, force=-alone.data.force))
    held = replace(alone.constants, free=("poisson",))
    assert _force_counts(FieldProblem(alone.sheet, alone.data, held))


def test_the_scale_at_which_a_mesh_holds_the_points() -> None:
    nodes, points = np.array([[0.0, 0.0], [0.06, 0.03]]), np.array([[0.01, 0.005], [0.05, 0.025]])
    assert mesh_scale(1e3 * nodes, points) == 1e-3
    assert mesh_scale(nodes / 25.4, points) == 25.4
    assert mesh_scale(nodes + 1.0, points) is None
