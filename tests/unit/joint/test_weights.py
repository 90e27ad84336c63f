"""Data of several shots in one vector: weights, blocks, unknowns of each shot, in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm
from scipy.stats import t as student

from doe.least_squares import Whitening
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.diagnosis import joint_fit, relaxation
from kolsky.inverse.joint_problem import CLOCK, SCATTER, ShotData, Stack, covariance, information
from kolsky.inverse.joint_result import (
    FORCE_SCALE,
    ModelChoice,
    OwnStiffness,
    ShotAgreement,
    ShotCause,
    rate_of,
)
from kolsky.inverse.joint_search import (
    LARGEST,
    between_variance,
    expanded_scatter,
    restricted_deviance,
    restricted_scatter,
    slow_stiffness,
)
from kolsky.inverse.objective import PATTERN_ERROR
from kolsky.inverse.observations import Observations
from kolsky.inverse.result import Estimate, Verdict
from kolsky.joint_identification import _shot_unknown, shot_variances
from kolsky.uncertainty.budgets import declared_parts
from kolsky.uncertainty.mesh_error import MeshChange, mesh_patterns

WIDE = np.array([1e3])  # ranges of the unknowns, far beyond what the data leave


def shot(force: np.ndarray, outline: np.ndarray, *, sigma: float = 0.5, own: Any = None) -> ShotData:
    n, q = len(force), len(outline)
    edges = np.linspace(0.0, 1.0, n + 1)
    bins = ForceBins(edges=edges, mean=force, sigma=np.full(n, sigma), n=np.full(n, 3))
    history = ForceHistory(edges, np.zeros(n + 1), np.ones(n + 1))
    times = np.linspace(0.0, 1.0, q)
    line = CentreLine(times, np.arange(q), np.zeros(q), outline, np.full(q, 0.1))
    seen = Observations(force=history, bins=bins, centre_line=line)
    return ShotData(seen, np.ones(q, bool), np.zeros((0, n + q)), own or {})


def test_the_vector_is_shots_then_slow_tests_then_what_is_known() -> None:
    a, b = shot(np.array([1.0, 2.0]), np.array([3.0])), shot(np.array([4.0]), np.array([5.0, 6.0]))
    b = replace(b, counted=np.array([False, True]))
    stack = Stack((a, b), np.array([7.0]), np.array([0.2]), known=2)
    np.testing.assert_array_equal(stack.data, [1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 0.0, 0.0])
    assert stack.ends == (3, 5)
    # A point that a run does not reach takes its measured value; a run that is lost stays lost.
    vectors = [np.array([[1.5, 2.5, np.nan]]), np.array([[4.5, 0.0, 6.5]])]
    whole = stack.joined(vectors, np.array([[7.5]]), np.zeros((1, 2)))
    np.testing.assert_array_equal(whole, [[1.5, 2.5, 3.0, 4.5, 6.5, 7.5, 0.0, 0.0]])
    lost = stack.joined([vectors[0], np.full((1, 3), np.nan)], np.zeros((1, 1)), np.zeros((1, 2)))
    assert np.isnan(lost[0, 3:5]).all()
    np.testing.assert_array_equal(stack.of_shot(1, np.arange(8.0)), [0, 0, 0, 3, 4, 0, 0, 0])


def test_discrepancies_are_each_shots_and_channels_own() -> None:
    a, b = shot(np.zeros(4), np.zeros(3)), shot(np.zeros(4), np.zeros(3))
    stack = Stack((a, b), np.zeros(1), np.array([0.2]), known=1)
    residual = np.concatenate(
        [np.full(4, 1.5), np.full(3, 0.05), np.full(4, 0.1), np.full(3, 0.3), [9.0, 9.0]]
    )
    weights = stack.weighting(residual)
    # mean square of the residual where it is above the noise, 0.5 and 0.1; slow tests keep their own
    np.testing.assert_allclose(weights.sigma, [*[1.5] * 4, *[0.1] * 3, *[0.5] * 4, *[0.3] * 3, 0.2, 1.0])


def test_patterns_are_a_shots_own_or_go_through_several() -> None:
    late = np.array([0.3, -0.2, 0.0])
    a = shot(np.array([1.0, 2.0]), np.array([3.0]), own={CLOCK: late})
    b = shot(np.array([4.0]), np.array([5.0]))
    common = np.array([[0.1, 0.2, 0.0, 0.4, 0.0]])
    # A slow test of sigma 0.3 hangs together with the first shot by the curve's noise; a prior row with none.
    curve = np.array([[0.2, 0.3, 0.0, 0.0, 0.0, 0.4]])
    own = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.6]])  # the slow test's specimen is another one
    stack = Stack((a, b), np.array([7.0]), np.array([0.3]), 1, common=common, curve=curve, slow_scatter=own)
    whitening = stack.whitening([one.objective for one in stack.shots])
    error = 0.2 * late  # what a pattern itself is off by is independent: PATTERN_ERROR
    c = np.diag(np.array([0.5, 0.5, 0.1, 0.5, 0.1, 0.3, 1.0]) ** 2)
    c[:3, :3] += np.diag(error**2) + np.outer(late, late)
    c[:5, :5] += common.T @ common
    c[:6, :6] += curve.T @ curve + own.T @ own
    np.testing.assert_allclose(whitening.precision(np.eye(7)), np.linalg.inv(c), rtol=1e-9, atol=1e-12)


def test_the_most_likely_amount_of_a_pattern() -> None:
    # One datum of variance 1 + 4 with the pattern 2: amount 2 r / 5, and 1 - 4/5 of its variance is left.
    weights = Whitening(np.array([1.0]), np.array([[2.0]]))
    objective: Any = SimpleNamespace(whitening=lambda: weights)
    amount, left = _shot_unknown(np.array([2.0]), weights.precision(np.array([[-3.0]]))[0], objective)
    assert amount == pytest.approx(2.0 * 3.0 / 5.0)
    assert left == pytest.approx(np.sqrt(0.2))


def test_residuals_that_hang_together_widen_the_interval() -> None:
    n = 64
    stack = Stack((shot(np.zeros(n), np.zeros(0), sigma=1.0),), np.zeros(0), np.zeros(0), known=0)
    slopes, weights = np.ones((n, 1)), Whitening(np.ones(n))
    alternating = np.tile([1.0, -1.0], n // 2)
    # independent at most: the Gauss-Newton variance of a mean, 1 / n
    assert covariance(slopes, alternating, weights, stack, WIDE)[0, 0] == pytest.approx(1.0 / n)
    # blocks of 16 equal residuals: four sums of 16, (4 x 16^2 / n^2) n_blocks / (n_blocks - 1)
    blocks = np.repeat([1.0, -1.0, 1.0, -1.0], 16)
    expected = max(
        (n // length) * length**2 / n**2 * (n // length) / (n // length - 1) for length in (2, 4, 8, 16)
    )
    assert covariance(slopes, blocks, weights, stack, WIDE)[0, 0] == pytest.approx(expected)


def test_an_unknown_that_nothing_sees_keeps_the_width_of_its_range() -> None:
    rows = np.array([[3.0, 4.0], [0.0, 0.0]])
    found = np.linalg.inv(information(rows, np.array([10.0, 6.0])))
    # 1 / 25 of what is seen; the variance of an even distribution over 6 is 36 / 12
    np.testing.assert_allclose(found, np.diag([0.04, 3.0]))
    # Of two unknowns only the sum is seen: what the first has more the second has less, and its variance is
    # that of the way inside both ranges, w^2 / 12 along (1, -1) / sqrt(2).
    sums = np.linalg.inv(information(np.array([[5.0], [5.0]]), np.array([6.0, 6.0])))
    np.testing.assert_allclose(sums @ [1.0, 1.0], [0.02, 0.02])
    np.testing.assert_allclose(np.array([1.0, -1.0]) @ sums @ [1.0, -1.0], 2.0 * 3.0)


def test_discrepancies_of_what_free_patterns_leave() -> None:
    stack = Stack((shot(np.zeros(64), np.zeros(0), sigma=0.1),), np.zeros(0), np.zeros(0), known=0)
    ramp, alternating = np.linspace(-1.0, 1.0, 64), np.tile([1.0, -1.0], 32)
    ramp -= alternating * (ramp @ alternating) / 64.0
    found = stack.weighed_beside(5.0 * ramp + alternating, ramp[None])[0]
    assert found.force_discrepancy == pytest.approx(np.sqrt(1.0 - 0.01))


def test_two_shots_are_not_one_block() -> None:
    pair = (shot(np.zeros(8), np.zeros(0)), shot(np.zeros(8), np.zeros(0)))
    stack = Stack(pair, np.zeros(2), np.ones(2), known=1)
    for label in stack.blocks:
        assert len(label) == 19
        assert not set(label[:8].tolist()) & set(label[8:16].tolist())
        assert len(set(label[16:].tolist())) == 3  # slow tests and prior rows stand alone


VALUES = np.array([1.02, 1.10, 1.05, 1.13, 0.98])
SIGMA = 0.02


def problem(values: np.ndarray, sigma: float = SIGMA):  # type: ignore[no-untyped-def]
    """Shots that measure m itself: data m_k, slope 1, pattern of the k-th shot its own entry times m = 1."""
    n = len(values)

    def weights(more: np.ndarray) -> Whitening:
        return Whitening(np.full(n, sigma), more)

    return 1.0 - values, np.ones((n, 1)), np.eye(n), weights


def test_the_deviance_of_a_mean_is_that_of_the_textbook() -> None:
    residual, slopes, patterns, weights = problem(VALUES)
    # n equal variances v: (n - 1) ln v + ln n + sum (y - mean)^2 / v
    for s in (0.0, 0.03):
        v = SIGMA**2 + s**2
        squares = ((VALUES - VALUES.mean()) ** 2).sum()
        expected = 4.0 * np.log(v) + np.log(5.0) + squares / v
        found = restricted_deviance(residual, slopes, weights(s * patterns))
        assert found == pytest.approx(expected, rel=1e-12)


def test_the_scatter_is_what_is_left_of_the_variance() -> None:
    found = restricted_scatter(*problem(VALUES))
    # restricted maximum likelihood of a balanced design: s^2 = variance (n - 1) less sigma^2
    assert found.value == pytest.approx(np.sqrt(VALUES.var(ddof=1) - SIGMA**2), rel=1e-3)
    squares, least = ((VALUES - VALUES.mean()) ** 2).sum(), VALUES.var(ddof=1)
    for end in found.interval:
        v = SIGMA**2 + end**2
        rise = 4.0 * np.log(v / least) + squares * (1.0 / v - 1.0 / least)
        assert rise == pytest.approx(3.84, abs=1e-3)
    assert found.interval[0] < found.value < found.interval[1] < LARGEST


def test_shots_that_agree_have_none() -> None:
    close = 1.05 + 0.5 * SIGMA * np.array([-1.0, 1.0, 0.0, 1.0, -1.0])
    found = restricted_scatter(*problem(close))
    assert found.value == 0.0
    assert found.interval[0] == 0.0
    v, squares = SIGMA**2 + found.interval[1] ** 2, ((close - close.mean()) ** 2).sum()
    rise = 4.0 * np.log(v / SIGMA**2) + squares * (1.0 / v - 1.0 / SIGMA**2)
    assert rise == pytest.approx(3.84, abs=1e-3)


def test_few_shots_widen_the_interval_by_students_t() -> None:
    level = norm.cdf(2.0)
    assert expanded_scatter(0.03, 0.0, 3) == pytest.approx(0.06)
    assert expanded_scatter(0.03, 0.03, 3) == pytest.approx(0.03 * student.ppf(level, 2))
    # half of the variance between the shots: (n - 1) (sigma / between)^4 = 2 x 4 degrees of freedom
    assert expanded_scatter(0.03, 0.03 / np.sqrt(2.0), 3) == pytest.approx(0.03 * student.ppf(level, 8))
    assert expanded_scatter(0.0, 0.0, 3) == 0.0


def test_an_interval_with_scatter_is_never_the_narrower() -> None:
    # Weights with the scatter: 9 of which 4 are the scatter's. Without it the same residuals leave 7, or 12.
    whole, plain, without = (np.array([v, v]) for v in (9.0, 8.0, 4.0))
    np.testing.assert_allclose(between_variance(whole, plain, without, np.array([7.0, 12.0])), [4.0, 7.0])


ASKED = ModelChoice(-8.0, -2.0, {}, 20.0, 1e-3, 1e-4, asked_for=True, sentence="the data ask for it")


class TwoShots:
    """Data of two shots with unit noise, two entries each."""

    data = np.zeros(4)
    shots = (0, 1)

    def of_each(self, *rows: np.ndarray) -> np.ndarray:
        return np.array([np.where(np.arange(4) // 2 == k, row, 0.0) for row in rows for k in self.shots])

    def weighed_beside(self, residual: np.ndarray, patterns: np.ndarray) -> None:
        assert not np.isnan(residual).any()

    def whitening(self, objectives: None, patterns: np.ndarray) -> Whitening:
        return Whitening(np.ones(4), patterns)


def strength(value: float, noise: float, mesh: float) -> Any:
    size = SimpleNamespace(name="prony_strength_1", value=value, sigma=float(np.hypot(noise, mesh)))
    return {"prony_strength_1": size}


def test_a_strength_that_the_mesh_may_feign_is_not_asked_for() -> None:
    assert relaxation.choice_with_mesh_error(ASKED, strength(0.3, 0.06, 0.08)) is ASKED  # 3 of 0.1
    doubtful = relaxation.choice_with_mesh_error(ASKED, strength(0.19, 0.06, 0.08))
    assert not doubtful.asked_for
    assert "its strength, 0.19 with a standard uncertainty of 0.1, mesh included" in doubtful.sentence
    assert relaxation.choice_with_mesh_error(ASKED, {}) is ASKED  # held, not found


def test_a_time_at_a_bound_is_no_relaxation() -> None:
    strong = strength(0.3, 0.06, 0.08)
    inside, at_bound = (SimpleNamespace(outcome=v) for v in (Verdict.IDENTIFIED, Verdict.AT_BOUND))
    assert relaxation.choice_with_mesh_error(ASKED, {**strong, "prony_time_1": inside}) is ASKED
    said = relaxation.choice_with_mesh_error(ASKED, {**strong, "prony_time_1": at_bound})
    assert not said.asked_for
    assert "prony_time_1 ends at a bound" in said.sentence
    assert rate_of("prony_strength_2") == "prony_time_2"
    assert rate_of("creep_ratio") == "creep_resistance"


def test_a_weak_branch_leaves_the_ringing_in_step() -> None:
    """The bulk modulus, with m (1 + c) / (1 - 2 nu), is what it was; where nu is held nothing moves."""
    points = np.array([[1.2, 0.4985, 0.1], [1.2, 0.499, 0.1]])
    moved = relaxation.points_in_step(["stiffness_factor", "poisson", "prony_strength_1"], points, 0.1)
    np.testing.assert_allclose(1.1 / (1.0 - 2.0 * moved[:, 1]), 1.0 / (1.0 - 2.0 * points[:, 1]))
    np.testing.assert_array_equal(moved[:, [0, 2]], points[:, [0, 2]])
    held = relaxation.points_in_step(["stiffness_factor", "damping", "prony_strength_1"], points, 0.1)
    np.testing.assert_array_equal(held, points)


def test_an_error_of_the_mesh_is_each_shots_own_and_of_known_size() -> None:
    stack: Any = TwoShots()
    change = MeshChange(coarser=np.array([1.0, 2.0, 3.0, 4.0]), element=np.full(4, 8.0), ratio=4.0)
    rows = mesh_patterns(stack, change)
    # Richardson's extrapolation with order 3.2: 4^3.2 - 1 = 83.449; elements come together as 4^-1.5 = 1/8
    np.testing.assert_allclose(rows[:2], np.array([[1, 2, 0, 0], [0, 0, 3, 4]]) / 83.449, rtol=1e-4)
    np.testing.assert_allclose(rows[2:], [[1, 1, 0, 0], [0, 0, 1, 1]])
    assert len(mesh_patterns(stack, MeshChange(change.coarser, None, 4.0))) == 2


def test_what_a_mesh_error_explains_speaks_against_no_model() -> None:
    stack: Any = TwoShots()
    pattern = np.array([[3.0, 0.0, 0.0, 0.0]])
    # variance 1 + 9 of the first entry; a point that is not reached adds nothing
    found = relaxation.deviance_with_mesh_patterns(stack, np.array([2.0, 1.0, np.nan, 0.0]), pattern)
    assert found == pytest.approx(4.0 / 10.0 + 1.0 + np.log(10.0))


def test_the_choice_otherwise() -> None:
    assert relaxation.choice_in_words(-8.0, 1e-4, asked=True).startswith(
        "the data need relaxation (AIC -8.0; 0.01 %"
    )
    assert relaxation.choice_in_words(2.0, 0.3, asked=False).startswith(
        "the data do not need relaxation (AIC +2.0; 30 %"
    )


# Fit and agreement of the shots


NOTHING = float("nan")


def asks(values: list[float], sigma: list[float], scale: list[float] | None = None) -> list[OwnStiffness]:
    """What shots ask for by all data and by the force; no scale is seen unless given."""
    rows = zip(values, sigma, scale or [NOTHING] * len(values), strict=True)
    return [OwnStiffness(0.0, s, a, s, NOTHING, NOTHING, g, s) for a, s, g in rows]


def test_a_shot_of_half_the_sensitivity_is_named_with_its_channel() -> None:
    # The outline decides the answer of all data: there nothing is seen.
    found = joint_fit.shot_agreement(
        ["a", "b", "c"], asks([0.02, -0.46, 0.0], [0.01, 0.03, 0.01]), scatter=True
    )
    assert (found.shots, found.channel, found.freedom) == (("b",), "force", 2)
    w = np.array([1e4, 1.0 / 9e-4, 1e4])
    a = np.array([0.02, -0.46, 0.0])
    assert found.chi2 == pytest.approx(float(w @ (a - w @ a / w.sum()) ** 2))
    assert found.probability == pytest.approx(chi2.sf(found.chi2, 2), rel=1e-9)
    assert found.ratio == pytest.approx(1.02 / 0.54)
    assert "b contradicts the other shots by the force alone" in found.sentence
    pair = joint_fit.shot_agreement(["a", "b"], asks([0.02, -0.46], [0.01, 0.03]), scatter=True)
    assert pair.shots == ("a", "b")
    # Two estimates: the square of their difference over the sum of their variances.
    assert pair.chi2 == pytest.approx(0.48**2 / (0.01**2 + 0.03**2))
    assert "a and b contradict each other" in pair.sentence


def test_what_specimens_scatter_by_contradicts_only_without_a_scatter() -> None:
    for scatter in (True, False):
        found = joint_fit.shot_agreement(["a", "b", "c"], asks([0.1, 0.0, -0.1], [0.01] * 3), scatter=scatter)
        assert found.chi2 == pytest.approx(200.0)
        assert found.apart is not scatter
    agree = joint_fit.shot_agreement(["a", "b"], asks([0.1, -0.4], [0.2, 0.2]), scatter=False)
    assert not agree.apart  # chi2 3.1 of one degree of freedom, 0.08
    assert joint_fit.shot_agreement(["a"], asks([0.1], [0.2]), scatter=False) is None


def test_the_scale_of_the_force_does_not_scatter_between_specimens() -> None:
    names, sigma = ["a", "b", "c"], [0.01] * 3
    # Specimens that scatter by a tenth, with forces of one scale.
    alike = joint_fit.shot_agreement(names, asks([0.1, 0.0, -0.1], sigma, [0.0, 0.0, 0.0]), scatter=True)
    assert not alike.apart
    # A sensitivity that is a tenth off.
    found = joint_fit.shot_agreement(names, asks([0.1, 0.0, -0.1], sigma, [0.0, 0.1, 0.0]), scatter=True)
    assert (found.shots, found.channel) == (("b",), FORCE_SCALE)
    # Scales 0, 0.1, 0 of the variance 0.01^2: sum of squares 2/3 of 0.01.
    assert found.chi2 == pytest.approx(0.01 * 2.0 / 3.0 / 1e-4)
    assert found.sentence.startswith(
        "b contradicts the other shots by the scale of the force: the largest scale of a force is 1.1 times "
    )


def test_the_noticeable_error_of_a_sensitivity_in_closed_form() -> None:
    # Two shots: the difference of their scales over its sigma is normal. Its two-sided limit z has a quarter
    # of the probability 2.7e-3; an error is beyond it in nine of ten cases if it is 1.28 sigma larger.
    z = norm.isf(2.7e-3 / 8.0) + norm.isf(0.1)
    for found in joint_fit.noticeable_scales(np.array([0.03, 0.04])):
        assert found == pytest.approx(0.05 * z, rel=1e-4)
    # Five exact others: a scale of 0.02 is compared with their mean. In draws with this error, nine of ten
    # chi-squares exceed the limit of four degrees of freedom.
    sigma = np.array([0.02, 1e-6, 1e-6, 1e-6, 1e-6])
    least = joint_fit.noticeable_scales(sigma)[0]
    draws = (least / 0.02 + np.random.default_rng(4).standard_normal(20000)) ** 2
    draws += chi2.rvs(3, size=20000, random_state=6)
    share = float(np.mean(draws > chi2.isf(2.7e-3 / 4.0, 4)))
    assert share == pytest.approx(0.9, abs=0.007)  # three standard deviations of 20000 draws
    # Scales known well: their ratio must still exceed 1.05, with a probability of 0.9.
    least = joint_fit.noticeable_scales(np.array([0.001, 0.001]))[0]
    assert least == pytest.approx(0.05 + norm.isf(0.1) * 0.001 * np.sqrt(2.0), rel=1e-9)
    # A shot without force has no scale, and a single scale is compared with none.
    assert joint_fit.noticeable_scales(np.array([0.03, NOTHING, 0.04]))[1] == np.inf
    assert joint_fit.noticeable_scales(np.array([0.03, NOTHING])) == (np.inf, np.inf)


def test_an_agreement_states_what_it_would_detect() -> None:
    found = joint_fit.shot_agreement(["a", "b"], asks([0.0, 0.0], [0.03, 0.04], [0.0, 0.0]), scatter=True)
    assert found.noticeable == joint_fit.noticeable_scales(np.array([0.03, 0.04]))
    assert found.sentence.endswith("; an error of one shot's sensitivity above 23 % would be detected")
    # That of the shot with the least known scale.
    assert replace(found, noticeable=(0.06, 0.08, 0.07)).power.endswith("above 8 % would be detected")
    blind = joint_fit.shot_agreement(["a", "b"], asks([0.0, 0.0], [0.3, 0.4], [0.0, 0.0]), scatter=True)
    assert blind.sentence.endswith("; an error of one shot's sensitivity would not be detected")
    force = joint_fit.shot_agreement(["a", "b"], asks([0.0, 0.0], [0.3, 0.4]), scatter=True)
    assert force.power == "an error of one shot's sensitivity would not be detected"


def test_the_scale_of_a_force_with_its_stiffness_free_in_closed_form() -> None:
    # Two changes u and p of 40 values of noise 0.5: r = -(0.1 u + 0.2 p), the variance of the second amount
    # is that of p less what u explains of it.
    u, p = np.linspace(1.0, 30.0, 40), 10.0 + np.cos(np.arange(40.0))
    one = shot(0.1 * u + 0.2 * p, np.zeros(0))
    value, sigma = joint_fit.own_amount(one, -0.1 * u - 0.2 * p, np.stack([u, p]), np.zeros((0, 40)), "joint")
    assert value == pytest.approx(0.2, rel=1e-9)
    assert sigma == pytest.approx(0.5 / np.sqrt(p @ p - (u @ p) ** 2 / (u @ u)), rel=1e-6)


def test_agreeing_shots_seldom_contradict() -> None:
    rng = np.random.default_rng(3)
    sigma = [0.05, 0.08, 0.1, 0.06]
    draws = rng.standard_normal((2000, 2, 4)) * sigma
    found = [
        joint_fit.shot_agreement(list("abcd"), asks(force.tolist(), sigma, scale.tolist()), scatter=False)
        for force, scale in draws
    ]
    # Two tests with a quarter of 0.27 % of 2000 each are 3; more than 10 come with a probability of 0.02 %.
    assert sum(one is not None and one.apart for one in found) <= 10


WAVE = 10.0 + 8.0 * np.sin(np.linspace(0.0, 25.0, 60))


def faulty(key: str) -> tuple[Stack, np.ndarray]:
    """Three shots of one force and outline and their prediction, the second with one input wrong."""
    rng = np.random.default_rng(8)
    outline = np.linspace(4.0, 6.0, 40)
    shots = []
    for k in range(3):
        gain = 2.0 if (key, k) == ("sensitivity", 1) else 1.0
        scale = 1.05 if (key, k) == ("lengths of the outline", 1) else 1.0
        stiff = 1.2 if (key, k) == ("material", 1) else 1.0
        force, seen = gain * stiff * WAVE, scale * outline * stiff**-0.25
        if (key, k) == ("clock_offset", 1):
            centres = (np.arange(60) + 0.5) / 60.0
            force = np.interp(centres - 0.05, centres, WAVE)
        noise = 0.05 * rng.standard_normal(60), 0.01 * rng.standard_normal(40)
        shots.append(shot(force + noise[0], seen + noise[1], sigma=0.05))
    stack = Stack(tuple(shots), np.zeros(0), np.zeros(0), known=0)
    return stack, np.tile(np.concatenate([WAVE, outline]), 3)


def causes_of(stack: Stack, vector: np.ndarray, errors: np.ndarray) -> tuple[ShotCause, ...]:
    stiffer = np.tile(np.concatenate([WAVE, -0.25 * np.linspace(4.0, 6.0, 40)]), 3)
    names = [SimpleNamespace(name=name) for name in "abc"]
    unknowns = SimpleNamespace(names=("stiffness_factor",), nodes=0, relative_stiffness=lambda *_: stiffer)
    problem: Any = SimpleNamespace(stack=stack, unknowns=unknowns, shots=names)
    optimum: Any = SimpleNamespace(x=np.ones(1), vector=vector, slopes=stiffer[:, None])
    return joint_fit.shot_causes(problem, optimum, errors)


def test_an_error_of_the_mesh_is_not_an_input() -> None:
    # The mesh makes every outline a twentieth too long, which any shot's lengths explain.
    stack, vector = faulty("sensitivity")
    vector = vector + np.tile(np.concatenate([np.zeros(60), 0.05 * np.linspace(4.0, 6.0, 40)]), 3)
    errors = np.tile(np.concatenate([np.zeros(60), 0.05 * np.linspace(4.0, 6.0, 40)]), 3)[None]
    keys = ("lengths of the outline", "sensitivity")
    without, known = (
        {one.shot: one.gain for one in causes_of(stack, vector, rows) if one.key == keys[0]}
        for rows in (errors[:0], errors)
    )
    assert min(without.values()) > 100.0
    assert max(known.values()) < 16.0
    first = causes_of(stack, vector, errors)[0]
    assert (first.shot, first.key) == ("b", keys[1])


@pytest.mark.parametrize(
    ("key", "amount"),
    [("sensitivity", 1.0), ("clock_offset", 0.05), ("lengths of the outline", 0.05), ("material", 0.2)],
)
def test_the_input_and_the_shot_that_are_wrong_are_named(key: str, amount: float) -> None:
    stack, vector = faulty(key)
    causes = causes_of(stack, vector, np.zeros((0, len(vector))))
    assert (causes[0].shot, causes[0].key) == ("b", key)
    # Linear about the lag of the nearest half bin, and for 1.2^-0.25 = 0.955 instead of 0.95.
    assert causes[0].amount == pytest.approx(amount, rel=0.05)
    assert causes[0].share > 0.9
    assert [one.gain for one in causes] == sorted((one.gain for one in causes), reverse=True)
    assert joint_fit.cause_sentence(causes).startswith(f"the likeliest cause is {causes[0].words} (explains ")


def test_the_size_of_an_input_in_closed_form() -> None:
    # Noise 0.5, one shared unknown and one input: two lines through 40 values, the second u = t beside 1.
    t = np.linspace(-1.0, 1.0, 40)
    stack = Stack((shot(np.zeros(40), np.zeros(0)),), np.zeros(0), np.zeros(0), known=0)
    small = 0.1 * np.tile([1.0, -1.0], 20)
    small -= t * (small @ t) / (t @ t)
    residual = 3.0 + 2.0 * t + small
    amount, sigma, deviance, left = joint_fit.explained_by(
        stack, residual, np.stack([np.ones(40), t]), np.zeros((0, 40))
    )
    assert amount == pytest.approx(-2.0, rel=1e-9)
    assert sigma == pytest.approx(0.5 / np.sqrt(t @ t), rel=1e-9)
    np.testing.assert_allclose(left, small, atol=1e-9)
    assert deviance == pytest.approx(float(small @ small) / 0.25 + 40.0 * np.log(0.25), rel=1e-9)


def test_shares_are_those_of_the_channel_that_is_explained() -> None:
    one = shot(np.zeros(2), np.zeros(2))
    before, after = np.array([3.0, 1.0, 2.0, 0.0]), np.array([3.0, 1.0, 1.0, 0.0])
    assert joint_fit.explained_share(before, after, one) == pytest.approx(0.75)
    assert joint_fit.explained_share(before[:2], after[:2], shot(np.zeros(2), np.zeros(0))) == 0.0


def test_no_cause_is_named_that_explains_little() -> None:
    weak = ShotCause("a", "sensitivity", 0.1, 0.03, gain=15.0, share=0.9)
    partial = replace(weak, gain=300.0, share=0.4)
    strong = replace(weak, key="clock_offset", amount=2e-5, sigma=1e-6, gain=200.0, share=0.8)
    assert joint_fit.cause_sentence([weak]).startswith("no single input of one shot explains the misfit")
    assert joint_fit.cause_sentence([partial, weak]).endswith(
        "by 300); most of the misfit remains: identify a alone, which tries every input"
    )
    # What explains most of a channel comes before a larger gain that explains little of any.
    assert joint_fit.cause_sentence([partial, strong]).startswith(f"the likeliest cause is {strong.words} ")
    # Of two shots, one may be the stiffer or the other the softer: likelihoods within exp(5) are equal.
    pair = [replace(strong, key="material"), replace(strong, shot="b", key="material", gain=190.0)]
    assert f"is {pair[0].words}; or {pair[1].words} (explains 80 %" in joint_fit.cause_sentence(pair)
    other = replace(pair[1], gain=189.9)
    assert f"; next: {other.words} (190)" in joint_fit.cause_sentence([pair[0], other])
    assert joint_fit.cause_sentence([strong, replace(weak, gain=16.0)]) == (
        "the likeliest cause is the force record of a, 20 ± 2 us late: check its clock (explains 80 % of a "
        "squared residual; -2 ln L falls by 200); next: the force of a, 1.1 ± 0.06 times what all data "
        "predict: multiply its sensitivity by this (16)"
    )


def test_a_fit_without_drawn_noise_has_a_rough_limit() -> None:
    good = joint_fit.slow_fit("ramp", np.full(8, 9.0), {}, peak=1.0, judged=False)
    assert good.explained
    assert not joint_fit.slow_fit("ramp", np.full(8, 114.0), {}, peak=1.0, judged=False).explained
    assert not joint_fit.roughly_judged(replace(good, residual=10.1, limit=np.inf)).explained
    assert joint_fit.roughly_judged(replace(good, residual=9.9, slow_residual=3.0, limit=np.inf)).explained


def test_the_stiffness_that_a_shot_asks_for_in_closed_form() -> None:
    # Data c (1 + a) of noise 0.5 with a = 0.1: r = -0.1 c, and the variance 0.5^2 / sum c^2.
    c = np.linspace(1.0, 30.0, 40)
    one = shot(1.1 * c, np.zeros(0))
    value, sigma = joint_fit.own_amount(one, c - 1.1 * c, c[None], np.zeros((0, 40)), "joint")
    assert value == pytest.approx(0.1, rel=1e-9)
    assert sigma == pytest.approx(0.5 / np.sqrt(c @ c), rel=1e-6)
    # An error of the mesh that is a twentieth of c is as large in a.
    value, sigma = joint_fit.own_amount(one, c - 1.1 * c, c[None], 0.05 * c[None], "force")
    assert value == pytest.approx(0.1, rel=1e-9)
    assert sigma == pytest.approx(np.hypot(0.05, 0.5 / np.sqrt(c @ c)), rel=1e-6)
    assert np.isnan(joint_fit.own_amount(one, c - 1.1 * c, c[None], np.zeros((0, 40)), "outline")).all()


def test_a_foreign_slow_test_is_not_explained() -> None:
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(64)
    right = joint_fit.slow_fit("relaxation", noise, {}, peak=50.0, judged=True)
    assert right.explained
    assert right.excess == pytest.approx(np.sqrt(np.mean(noise**2)))
    # Eight means of eight values: noise of 1 / sqrt(8).
    assert right.slow_expected == pytest.approx(1.0 / np.sqrt(8.0))
    foreign = joint_fit.slow_fit("relaxation", noise + 20.0, {}, peak=50.0, judged=True)
    assert not foreign.explained
    # The curve is uncertain by 20 sigma there: a correct model leaves as much.
    known = joint_fit.slow_fit(
        "relaxation", noise + 20.0, {"material curve": np.full((1, 64), 20.0)}, peak=50.0, judged=True
    )
    assert known.explained
    assert known.expected == pytest.approx(np.hypot(1.0, 20.0))


def test_the_verdict_on_a_shared_value() -> None:
    e = Estimate("poisson", "1", 0.499, 1e-4, 0.0, 0.0, {}, outcome=Verdict.IDENTIFIED)
    good = joint_fit.slow_fit("ramp", np.ones(8), {}, peak=1.0, judged=True)
    bad = joint_fit.slow_fit("ramp", np.full(8, 9.0), {}, peak=1.0, judged=True)
    apart = ShotAgreement(99.0, 1, 0.0, 2.0, ("a", "b"), "force")
    assert joint_fit.joint_verdict(e, [good], None).outcome is e.outcome
    assert joint_fit.joint_verdict(e, [good, bad], apart).outcome is Verdict.UNEXPLAINED
    assert joint_fit.joint_verdict(e, [good], apart).outcome is Verdict.SHOTS_CONTRADICT
    assert not Verdict.SHOTS_CONTRADICT.identified


def test_each_slow_tests_specimen_scatters_too() -> None:
    rows = slow_stiffness(np.array([9.0, 9.0, 1.0, 2.0, 0.0]), [slice(2, 4), slice(4, 5)])
    np.testing.assert_array_equal(rows, [[0.0, 0.0, 1.0, 2.0, 0.0]])  # the second does not see it


@pytest.mark.parametrize("scatter", [0.0, 0.03, 0.2])
def test_equal_shots_and_slow_tests_with_a_scatter(scatter: float) -> None:
    """Two shots and one slow test see ln m with the variances v: u^2 = (v + s^2) / 3."""
    v = 0.01**2
    pair = tuple(shot(np.ones(4), np.zeros(0), sigma=2.0 * 0.01) for _ in range(2))
    stack = Stack(pair, np.ones(1), np.array([0.01]), known=0)
    slow = slow_stiffness(np.ones(9), [slice(8, 9)])
    patterns = np.concatenate([[stack.of_shot(k, np.ones(9)) for k in range(2)], slow])
    objectives = [one.objective for one in stack.shots]
    within, between = (
        np.linalg.inv(information(stack.whitening(objectives, s * patterns).apply(np.ones((1, 9))), WIDE))[
            0, 0
        ]
        for s in (0.0, scatter)
    )
    assert within == pytest.approx(v / 3.0)
    assert between == pytest.approx((v + scatter**2) / 3.0)
    # Half widths: with a scatter never narrower than without, the same where there is none.
    wide = expanded_scatter(float(np.sqrt(between)), float(np.sqrt(max(between - within, 0.0))), 3)
    assert wide >= expanded_scatter(float(np.sqrt(within)), 0.0, 3) * (1.0 - 1e-9)
    if scatter == 0.0:
        assert wide == pytest.approx(2.0 * np.sqrt(within))
    # A slow test of a thousandth of the noise does not pin what scatters from specimen to specimen.
    sharp = replace(stack, slow_sigma=np.array([1e-5]))
    pinned = np.linalg.inv(
        information(sharp.whitening(objectives, scatter * patterns).apply(np.ones((1, 9))), WIDE)
    )[0, 0]
    assert pinned >= 0.999 * scatter**2 / 3.0


@pytest.mark.parametrize("n", [2, 5])
def test_the_interval_of_equal_shots_in_closed_form(n: int) -> None:
    """Shots that see m with the variance v and scatter by s: u^2 = (v + s^2) / n, scatter s^2 / n."""
    s, change = 0.03, np.full(40, 20.0)
    v = 0.5**2 / (40.0 * 20.0**2)
    # Every other shot is softer by the scatter. The rest is less than the noise and not correlated in time.
    left = [0.1 * np.tile([1.0, -1.0], 20) + s * change * (-1.0) ** k for k in range(n)]

    def variances(size: float) -> tuple[float, ...]:
        own = {SCATTER: size * change} if size else {}
        shots = tuple(shot(np.zeros(40), np.zeros(0), own=own) for _ in range(n))
        stack = Stack(shots, np.zeros(0), np.zeros(0), known=0)
        problem: Any = SimpleNamespace(stack=stack, unknowns=SimpleNamespace(widths=WIDE))
        found: Any = SimpleNamespace(vector=np.concatenate(left), slopes=np.tile(change, n)[:, None])
        return tuple(float(one.item()) for one in shot_variances(problem, found))

    # A fifth of a pattern is independent from entry to entry.
    between = s**2 * (1.0 + PATTERN_ERROR**2 / 40.0) / n
    assert variances(s) == pytest.approx((v / n + between, v / n, between), rel=1e-6)
    # Without a scatter in the weights, the residuals are a discrepancy. No interval with it is shorter.
    whole, same, none = variances(0.0)
    assert (same, none) == (whole, 0.0)
    for size in (1e-3 * s, 0.1 * s, s):
        assert sum(variances(size)[1:]) >= whole * (1.0 - 1e-9)
    assert sum(variances(1e-3 * s)[1:]) == pytest.approx(whole, rel=1e-9)


def test_the_weights_follow_a_declared_error() -> None:
    """Residuals of 3 in the force and 5 in the outline, in turn up and down; an error of 6 in the outline.

    If the unknown follows by -1, the mean squares are 10 and 50 and the outline has a sixth of the weight
    (`test_input_directions`). The weights before give -6 * 9 / 34.
    """
    left, change = np.repeat([3.0, 5.0], 10) * np.tile([1.0, -1.0], 10), np.repeat([0.0, 6.0], 10)
    stack = Stack((shot(np.zeros(10), np.zeros(10)),), np.zeros(0), np.zeros(0), known=0)
    of_shot = SimpleNamespace(uncertainty={"Z_offset": 1e-5})
    problem: Any = SimpleNamespace(
        stack=stack, shots=[of_shot], unknowns=SimpleNamespace(names=("poisson",), widths=WIDE)
    )
    found: Any = SimpleNamespace(vector=left, slopes=np.ones((20, 1)), x=np.ones(1))
    (part,) = declared_parts(problem, found, {"Z_offset": np.stack([change, change])}).values()
    # Two independent errors. The iterations leave a seventh of the difference of 0.59.
    assert part[0] == pytest.approx(np.sqrt(2.0), rel=0.1)
