"""Intervals, correlations and verdicts of fitted constants, from small problems by hand."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from module_files import module_at
from scipy.stats import chi2, t

from kolsky.bodies.actuator_bending import Direction, relative_bend, warnings_of
from kolsky.bodies.actuator_model import Pneunet, Touching, smallest_gap
from kolsky.bodies.errors_in_variables import (
    Linearised,
    Reduced,
    Samples,
    best_displacement,
    chi_square,
    reduce,
    search,
)
from kolsky.bodies.specimen_fit import ConstantVerdict, intervals
from kolsky.material.fits.fit import inflation, neighbour_correlation

FREE = (np.array([0.0, 0.0]), np.array([np.inf, np.inf]))
J = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [1.0, 3.0], [1.0, 4.0], [1.0, 5.0]])
"""A straight line: (J^T J)^-1 = [[55, -15], [-15, 6]] / 105."""
ALTERNATING = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def _found(residual: np.ndarray, jacobian: np.ndarray = J, **options: object) -> object:
    given = {"at_bound": (False, False), "bounds": FREE, **options}
    return intervals(("a", "b"), np.array([10.0, 8.0]), Reduced(residual, jacobian), (residual,), **given)  # type: ignore[arg-type]


def test_covariance_of_a_line_with_declared_noise() -> None:
    found = _found(0.5 * ALTERNATING)  # chi2 = 1.5 on 4 degrees: the declared noise holds
    assert found.scale == 1.0
    assert found.covariance == pytest.approx(np.array([[55.0, -15.0], [-15.0, 6.0]]) / 105.0)
    half = t.ppf(0.975, 4) * np.sqrt(6.0 / 105.0)
    assert (found.estimates[1].low, found.estimates[1].high) == pytest.approx((8.0 - half, 8.0 + half))
    assert found.correlation[0, 1] == pytest.approx(-15.0 / np.sqrt(330.0))
    assert found.probability == pytest.approx(chi2.sf(1.5, 4))
    assert found.explained


def test_larger_residuals_widen_it() -> None:
    found = _found(4.0 * ALTERNATING)  # chi2 = 96 on 4 degrees
    assert found.scale == pytest.approx(24.0)
    assert found.covariance[1, 1] == pytest.approx(24.0 * 6.0 / 105.0)
    assert not found.explained


def test_like_neighbours_widen_it() -> None:
    residual = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    assert neighbour_correlation(residual) == pytest.approx(3.0 / 6.0)
    assert inflation(0.5) == pytest.approx(3.0)
    assert inflation(-0.8) == 1.0
    assert _found(residual).scale == pytest.approx(1.5 * 3.0)


def test_a_correlation_is_said() -> None:
    # Nearly parallel columns; correlation of a and b is -0.998.
    rho = 0.998
    jacobian = np.linalg.cholesky(np.array([[1.0, rho], [rho, 1.0]])).T
    stacked = np.concatenate([jacobian] * 50) * 3.0
    found = _found(np.zeros(100), stacked)
    assert found.correlation[0, 1] == pytest.approx(-rho)
    assert found.estimates[0].verdict is ConstantVerdict.TOGETHER
    assert "b (correlation -0.998)" in found.estimates[0].sentence


def test_limit_of_a_correlation() -> None:
    for rho, verdict in ((0.94, ConstantVerdict.IDENTIFIED), (0.96, ConstantVerdict.TOGETHER)):
        jacobian = np.linalg.cholesky(np.array([[1.0, rho], [rho, 1.0]])).T
        # sigma^2 = 1 / (30 s^2 (1 - rho^2)): a half width of 1.5, 0.15 of the value, takes s = sigma_1 /
        # 0.75.
        size = t.ppf(0.975, 58) / 1.5 / np.sqrt(30.0 * (1.0 - rho**2))
        assert _found(np.zeros(60), np.concatenate([jacobian] * 30) * size).estimates[0].verdict is verdict
        narrow = _found(np.zeros(60), np.concatenate([jacobian] * 30) * 1.6 * size).estimates[0]
        assert narrow.verdict is ConstantVerdict.IDENTIFIED


def test_constants_at_a_bound_have_no_interval_and_do_not_blur_the_rest() -> None:
    found = _found(0.5 * ALTERNATING, at_bound=(False, True))
    assert found.estimates[1].verdict is ConstantVerdict.AT_BOUND
    assert found.estimates[1].sigma is None
    assert found.covariance[0, 0] == pytest.approx(1.0 / 6.0)
    assert found.degrees == 5


def test_a_wide_interval_and_an_unseen_direction() -> None:
    wide = _found(0.5 * ALTERNATING, 0.1 * J)
    assert wide.estimates[1].verdict is ConstantVerdict.HARDLY
    assert wide.estimates[1].low == pytest.approx(8.0 - t.ppf(0.975, 4) * np.sqrt(600.0 / 105.0))
    blind = _found(0.5 * ALTERNATING, np.stack([J[:, 0], 2.0 * J[:, 0]], -1))
    assert blind.estimates[0].verdict is ConstantVerdict.NOT_SEEN
    assert np.isnan(blind.covariance).all()


INFINITE = (np.array([0.0]), np.array([np.inf]))


def _spring(stiffness: np.ndarray, x: np.ndarray) -> Linearised:
    """f = p x, one end."""
    p = float(stiffness[0])
    return Linearised(p * x, x[..., None], np.full((*x.shape, 1), p))


def _samples(x: object, force: object, sd: float, sf: float) -> Samples:
    return Samples(np.array(x, dtype=float)[:, None], np.array(force, dtype=float)[:, None], sd, sf)


def test_objective_adds_both_errors() -> None:
    samples = _samples([1.0, 2.0], [3.0, 5.0], 0.1, 0.5)
    x = np.array([[1.1], [1.8]])
    there = Linearised(np.array([[3.5], [4.0]]), np.empty(0), np.empty(0))
    assert chi_square(samples, x, there) == pytest.approx(1.0 + 4.0 + 1.0 + 4.0)
    exact = _samples([1.0, 2.0], [3.0, 5.0], 0.0, 0.5)
    assert chi_square(exact, exact.displacement, there) == pytest.approx(5.0)


def test_eliminated_displacement_of_a_spring() -> None:
    # Minimum of ((x - d)/sd)^2 + ((p x - F)/sf)^2 at one sample: x = (d/sd^2 + p F/sf^2) / (1/sd^2 +
    # p^2/sf^2), and what is left is (p d - F)^2 / (sf^2 + p^2 sd^2).
    p, d, F, sd, sf = 2.0, 1.0, 3.0, 0.3, 0.4
    samples = _samples([d], [F], sd, sf)
    start = np.array([[1.4]])  # wherever it is linearised
    there = _spring(np.array([p]), start)
    found = best_displacement(samples, start, there, np.zeros(1))
    expected = (d / sd**2 + p * F / sf**2) / (1.0 / sd**2 + p**2 / sf**2)
    assert found[0, 0] == pytest.approx(expected)
    left = reduce(samples, start, there).residual
    assert float(left @ left) == pytest.approx((p * d - F) ** 2 / (sf**2 + p**2 * sd**2))


def test_two_ends_are_coupled_through_the_stiffness() -> None:
    K = np.array([[3.0, 1.0], [1.0, 2.0]])
    sd, sf = 0.2, 0.5
    samples = Samples(np.zeros((1, 2)), np.array([[1.0, -1.0]]), sd, sf)
    there = Linearised(np.zeros((1, 2)), np.zeros((1, 2, 1)), K[None])
    left = reduce(samples, np.zeros((1, 2)), there).residual
    V = sf**2 * np.eye(2) + sd**2 * K @ K.T
    r = np.array([-1.0, 1.0])
    assert float(left @ left) == pytest.approx(r @ np.linalg.solve(V, r))
    moved = best_displacement(samples, np.zeros((1, 2)), there, np.zeros(1))[0]
    assert moved == pytest.approx(-(sd**2) * K.T @ np.linalg.solve(V, r))


def test_search_ends_at_the_line_with_errors_in_both() -> None:
    # Deming's slope with lambda = (sf / sd)^2 for a line through the origin.
    rng = np.random.default_rng(3)
    x = np.linspace(1.0, 6.0, 12)
    sd, sf = 0.2, 0.3
    d, F = x + sd * rng.standard_normal(12), 2.0 * x + sf * rng.standard_normal(12)
    ratio = (sf / sd) ** 2
    sxx, syy, sxy = d @ d, F @ F, d @ F
    slope = (syy - ratio * sxx + np.sqrt((syy - ratio * sxx) ** 2 + 4.0 * ratio * sxy**2)) / (2.0 * sxy)
    found = search(
        lambda p, at: (_spring(p, at[0]),),
        (_samples(d, F, sd, sf),),
        np.array([0.7]),
        bounds=INFINITE,
        scales=np.array([1.0]),
    )
    assert found.converged
    assert found.constants[0] == pytest.approx(slope, rel=1e-3 * 0.01)


def test_a_bound_holds_and_is_said() -> None:
    samples = (_samples([1.0, 2.0, 3.0], [2.0, 4.0, 6.0], 0.0, 0.1),)
    bounds = (np.array([0.0]), np.array([1.5]))
    found = search(
        lambda p, at: (_spring(p, at[0]),), samples, np.array([1.0]), bounds=bounds, scales=np.array([1.0])
    )
    assert found.constants[0] == 1.5
    assert found.at_bound == (True,)


def test_a_failed_simulation_shortens_the_step() -> None:
    tried = []

    def respond(p: np.ndarray, at: tuple[np.ndarray, ...]) -> tuple[Linearised, ...]:
        tried.append(float(p[0]))
        if 1.5 < p[0] < 1.9 and len(tried) < 4:
            raise ValueError("it folded")
        return (_spring(p, at[0]),)

    def folded(p: np.ndarray, at: tuple[np.ndarray, ...]) -> tuple[Linearised, ...]:
        raise ValueError("no way")

    samples = (_samples([1.0, 2.0, 3.0], [1.7, 3.4, 5.1], 0.0, 0.1),)
    found = search(respond, samples, np.array([1.0]), bounds=INFINITE, scales=np.array([1.0]))
    assert found.constants[0] == pytest.approx(1.7, rel=1e-4)
    assert found.simulations == len(tried) > 2
    with pytest.raises(ValueError, match="start failed: no way"):
        search(folded, samples, np.array([1.0]), bounds=INFINITE, scales=np.array([1.0]))


ROOT = Path(__file__).resolve().parents[3]


def _moved(shift: float):
    """Two chambers whose second one has moved by `shift` along x."""
    mesh = Pneunet(chambers=2, element="hex8").mesh
    u = np.zeros((1, *mesh.points.shape))
    u[0, mesh.points[:, 0] > 15e-3 - 1e-9, 0] = shift
    solution = SimpleNamespace(
        model=SimpleNamespace(mesh=mesh, solid=SimpleNamespace(shear_modulus=2e4)), displacements=u
    )
    return SimpleNamespace(solution=solution, pressures=np.array([[4e4]]), angle=np.array([0.1]))


def test_gap_is_the_distance_of_the_walls_and_negative_where_they_overlap() -> None:
    assert smallest_gap(_moved(0.5e-3))[0] == pytest.approx(2.5e-3)
    apart, through = _moved(-1.5e-3), _moved(-2.0e-3)
    assert smallest_gap(apart)[0] == pytest.approx(0.5e-3)
    # one point of a wall beyond its partner, the walls as a whole still apart
    mesh = through.solution.model.mesh
    through.solution.displacements[0, mesh.sets["gap_1_right"], 0] = -1.0e-3
    through.solution.displacements[0, mesh.sets["gap_1_right"][-1], 0] = -2.4e-3
    assert smallest_gap(through)[0] == pytest.approx(-0.4e-3)


def test_overlap_is_warned_of_and_its_absence_not() -> None:
    run = _moved(0.0)
    bad = Direction("down", run, None, np.array([0]), np.array([-1e-4]))  # type: ignore[arg-type]
    assert "0.4 bar" in warnings_of([bad])[0]
    assert warnings_of([replace(bad, gap=np.array([1e-4]))]) == []


def test_contact_allows_facing_points_a_tenth_of_the_gap() -> None:
    run = _moved(0.0)
    gap = np.array([2e-3, 1e-3, -1.9e-4, -2.1e-4])
    one = Direction("down", run, None, np.array([0]), gap)  # type: ignore[arg-type]
    assert one.overlapping.tolist() == [False, False, True, True]
    touching = Touching(np.zeros(4), np.zeros(4))
    assert replace(one, touching=touching).overlapping.tolist() == [False, False, False, True]


def test_effect_of_healing_is_that_on_the_bend_from_rest() -> None:
    before = SimpleNamespace(angle=np.array([0.1, 0.3, 0.5]))
    after = SimpleNamespace(angle=np.array([0.2, 0.42, 0.66]))
    one = Direction("down", before, after, np.array([1, 2]), np.zeros(3))  # type: ignore[arg-type]
    assert relative_bend(one) == pytest.approx([0.1, 0.15])


def test_printed_tables_of_the_paper() -> None:
    paper = module_at(ROOT / "runs" / "actuator" / "paper.py")
    rows = {what: follows for what, _, follows in paper.checks()}
    # nu = (3 K - 2 mu) / (2 (3 K + mu)) with mu = 0.218, K = 2 / 1.15 or 2.3 MPa
    assert rows["Poisson's ratio, D1 in 1/MPa"] == pytest.approx(4.78139 / 10.87078, rel=1e-5)
    assert rows["Poisson's ratio, D1 in MPa (Table 3)"] == pytest.approx(6.464 / 14.236)
    assert rows["volume ratio at 130 %, strain across -nu strain"] == pytest.approx(2.3 * 0.428**2)
    assert rows["efficiency of the fracture stress (%)"] == pytest.approx(96.2025, abs=1e-4)
