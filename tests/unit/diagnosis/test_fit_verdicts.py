"""Goodness of fit in closed form, its thresholds, and withheld verdicts."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, norm
from synthetic import synthetic

from kolsky.base.records import CentreLine, ForceHistory
from kolsky.diagnosis.fit_quality import (
    LIMITS,
    SLOW_LIMITS,
    block_means,
    block_noise,
    blocks,
    correlated,
    explains,
    fit_quality,
    fit_warnings,
    in_quadrature,
    information_shares,
    left_over,
    mesh_changes,
    near_right,
    neighbours,
    with_verdicts,
)
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import observe
from kolsky.inverse.result import CauseFinding, ClockLag, FitQuality, Identification, RouteDifference, Verdict
from kolsky.uncertainty.mesh_error import ELEMENT_ORDER, GradedChange, MeshChange
from kolsky.uncertainty.warnings import bound_warnings
from populations import fit_thresholds
from populations.fit_thresholds import (
    MARGIN,
    STRONGEST,
    RightShot,
    chosen,
    figures,
    limit,
    strongest,
    table,
    threshold,
    tolerance_factor,
)

# Goodness of fit in closed form: residual, information, whiteness, blocks, the verdict.

FloatArray = NDArray[np.float64]
FRAMES, POINTS = 16, 6
TIME = np.linspace(0.0, 1.6e-3, 1601)


def objective(*, force_sigma: float = 0.5, outline_sigma: float = 1e-6) -> Objective:
    """Sixteen bins of a force of 1e4 N/s, and six points in each of sixteen frames."""
    when = np.repeat((np.arange(FRAMES) + 0.5) * 1e-4, POINTS)
    line = CentreLine(
        when, np.repeat(np.arange(FRAMES), POINTS), np.tile(1e-3 * np.arange(POINTS), FRAMES),
        np.tile(5e-3 + 1e-4 * np.arange(POINTS), FRAMES), np.full(when.size, outline_sigma),
    )  # fmt: skip
    history = ForceHistory(TIME, 1e4 * TIME, np.full(TIME.size, force_sigma))
    seen = observe(history, line, window=(0.0, 1.6e-3), bin_width=1e-4)
    return Objective(seen, np.ones(when.size, dtype=bool))


def judged(
    residual: FloatArray, changes: Mapping[str, FloatArray] | None = None, **more: float
) -> tuple[FitQuality, FitQuality]:
    one = objective(**more)
    jacobian = np.ones((len(one.data), 1))
    nothing = np.zeros((1, len(one.data)))
    force, outline = fit_quality(
        one.with_discrepancy(one.data - residual), one.data - residual, jacobian,
        changes={"flyer motion": nothing, **(changes or {})}, names=("m",),
    )  # fmt: skip
    return force, outline


def test_a_change_that_a_parameter_makes_leaves_nothing() -> None:
    rng = np.random.default_rng(1)
    jacobian, weight = rng.standard_normal((7, 2)), rng.uniform(0.5, 2.0, 7)
    weighted = (weight[:, None] * jacobian).T
    gain: FloatArray = np.linalg.solve(weighted @ jacobian, weighted).astype(np.float64)
    np.testing.assert_allclose(left_over(jacobian @ [2.0, -3.0], jacobian, gain), 0.0, atol=1e-12)
    # What no parameter can make is left whole: it is orthogonal to the Jacobian in the weights.
    other = np.linalg.svd(jacobian.T * weight)[2][-1]
    np.testing.assert_allclose(left_over(np.stack([other, 2.0 * other]), jacobian, gain)[1], 2.0 * other)
    lost = np.array([np.nan, *np.zeros(6)])
    np.testing.assert_array_equal(left_over(lost, jacobian, gain), 0.0)


def test_shares_of_information_are_those_of_the_fisher_matrix() -> None:
    rng = np.random.default_rng(2)
    jacobian, sigma = rng.standard_normal((9, 2)), rng.uniform(0.5, 2.0, 9)
    force = np.arange(9) < 4
    weighted = jacobian / sigma[:, None]
    gain = np.linalg.inv(weighted.T @ weighted) @ (jacobian / sigma[:, None] ** 2).T
    # The information on the first parameter, the other fitted: its column less its projection on the other's.
    a, b = weighted.T
    alone = a - b * (a @ b) / (b @ b)
    shares = information_shares(gain, gain * sigma**2, {"force": force, "outline": ~force})
    assert shares["force"][0] == pytest.approx((alone[force] ** 2).sum() / (alone**2).sum(), rel=1e-12)
    np.testing.assert_allclose(shares["force"] + shares["outline"], 1.0, rtol=1e-12)


def test_an_error_in_common_takes_its_share_of_the_information() -> None:
    """Two data of one quantity, the first with a common error of 3 beside its own of 1: weights 0.1, 1."""
    gain = np.array([[1.0, 10.0]]) / 11.0
    covariance = np.diag([10.0, 1.0])
    found = information_shares(gain, gain @ covariance, {"a": np.array([True, False])})
    assert found["a"][0] == pytest.approx(1.0 / 11.0, rel=1e-12)


def test_a_parameter_that_no_datum_moves_has_no_shares() -> None:
    gain = np.array([[0.0, 0.0], [3.0, 4.0]])
    found = information_shares(gain, gain, {"a": np.array([True, False])})
    np.testing.assert_array_equal(found["a"], [np.nan, 9.0 / 25.0])


def test_correlation_of_neighbours_is_ljung_and_boxs() -> None:
    residual = np.array([1.0, 2.0, -1.0, -2.0, 1.0, 3.0])
    r, probability = correlated(residual, np.arange(5), np.arange(1, 6))
    # Sum of products over sum of squares: (2 - 2 + 2 - 2 + 3) / 20.
    assert r == pytest.approx(3.0 / 20.0, rel=1e-12)
    # Q = n (n + 2) r^2 / (n - 1) of Ljung and Box (1978) with n = 6.
    assert probability == pytest.approx(chi2.sf(6.0 * 8.0 / 5.0 * r**2, 1), rel=1e-12)
    assert np.isnan(correlated(residual, np.arange(1), np.arange(1, 2))[0])


def test_neighbours_stay_in_their_frame() -> None:
    one = objective()
    first, second = neighbours(one, "outline")
    assert first.size == FRAMES * (POINTS - 1)
    np.testing.assert_array_equal(second - first, 1)
    first, second = neighbours(one, "force")
    assert (first.size, first[0], second[-1]) == (15, 0, 15)


def test_blocks_are_eighths_of_the_window_and_thirds_of_a_frame() -> None:
    one = objective()
    np.testing.assert_array_equal(blocks(one, "force"), np.repeat(np.arange(8), 2))
    lowest = blocks(one, "outline")[: 2 * POINTS]
    np.testing.assert_array_equal(lowest, [0, 0, 1, 1, 2, 2] * 2)
    block = np.array([0, 0, 1, 1, 1])
    np.testing.assert_allclose(block_means(np.array([1.0, 3.0, 3.0, 6.0, 9.0]), block), [2.0, 6.0])
    # Of means of two and of three values of sigma 2: variances 4 / 2 and 4 / 3.
    assert block_noise(np.full(5, 2.0), block) == pytest.approx(np.sqrt(0.5 * (2.0 + 4.0 / 3.0)), rel=1e-12)


def test_figures_of_a_residual_by_hand() -> None:
    one = objective()
    n = one.n_force
    sigma = one.noise[0]
    residual = np.zeros(len(one.data))
    residual[:n] = 3.0 * sigma * np.tile([1.0, -1.0], n // 2)
    force, outline = judged(residual)
    assert force.residual == pytest.approx(3.0 * sigma, rel=1e-12)
    assert force.over_noise == pytest.approx(3.0, rel=1e-12)
    assert force.chi2 == pytest.approx(9.0, rel=1e-12)
    assert force.discrepancy_share == pytest.approx(8.0 / 9.0, rel=1e-12)  # tau^2 = (9 - 1) sigma^2
    assert force.peak == pytest.approx(1e4 * 1.55e-3, rel=1e-9)  # the mean of the last bin
    assert force.over_peak == pytest.approx(3.0 * sigma / 15.5, rel=1e-9)
    assert force.excess == pytest.approx(3.0, rel=1e-12)
    assert force.slow_residual == pytest.approx(0.0, abs=1e-12)  # it alternates within each block
    assert force.slow_expected == pytest.approx(sigma / np.sqrt(2.0), rel=1e-12)
    assert force.correlation < -0.9
    assert (outline.residual, outline.values, outline.unit) == (0.0, FRAMES * POINTS, "m")
    assert outline.peak == pytest.approx(1e-4 * (POINTS - 1), rel=1e-9)
    assert outline.discrepancy_share == 0.0


def test_what_is_predicted_adds_up_in_quadrature() -> None:
    one = objective()
    n, sigma = one.n_force, one.noise[0]
    wave = np.zeros(len(one.data))
    wave[:n] = np.tile([1.0, -1.0], n // 2)  # orthogonal to the parameter's column
    draws = np.stack([4.0 * sigma * wave, -4.0 * sigma * wave])
    force, _ = judged(np.zeros(len(one.data)), {"flyer motion": draws, "mesh": 2.0 * sigma * wave})
    assert force.predicted["flyer motion"] == pytest.approx(4.0 * sigma, rel=1e-9)
    assert force.predicted["mesh"] == pytest.approx(2.0 * sigma, rel=1e-9)
    assert force.expected == pytest.approx(np.sqrt(1.0 + 16.0 + 4.0) * sigma, rel=1e-9)


def test_the_verdict_has_two_limits_and_none_without_the_flyers_noise() -> None:
    one = objective()
    n, sigma = one.n_force, one.noise[0]
    fast = np.zeros(len(one.data))
    fast[:n] = sigma * np.tile([1.0, -1.0], n // 2)
    assert judged(0.99 * LIMITS["force"] * fast)[0].explained
    assert not judged(1.01 * LIMITS["force"] * fast)[0].explained
    slow = np.zeros(len(one.data))
    slow[:n] = sigma / np.sqrt(2.0) * np.repeat(np.tile([1.0, -1.0], 4), 2)
    assert judged(0.99 * SLOW_LIMITS["force"] * slow)[0].explained
    assert not judged(1.01 * SLOW_LIMITS["force"] * slow)[0].explained
    nothing = fit_quality(one, one.data - 100.0 * fast, np.ones((len(one.data), 1)), changes={})
    assert nothing[0].explained  # what the flyer's noise leaves is not known, so nothing is judged
    assert nothing[0].limit == np.inf


def test_an_unknown_residual_is_not_explained() -> None:
    assert not replace(judged(np.zeros(112))[0], residual=np.nan).explained


def test_remaining_mesh_error_is_richardsons() -> None:
    coarser, element = np.array([3.0, 0.0]), np.array([0.0, 1.0])
    rows = mesh_changes(MeshChange(coarser, element, ratio=2.0))
    # Of second order a third of the shift is left; the elements come together as they do for the parameters.
    squares = (rows**2).mean(axis=0)
    np.testing.assert_allclose(np.sqrt(squares), [1.0, 2.0**-ELEMENT_ORDER / 3.0**0.5], rtol=1e-12)
    # Where graded meshes tell it, it is what they say: 0.5 of them, and 0.2 less than the refined mesh has.
    graded = GradedChange(np.array([1.5, 0.0]), 2.0, np.array([-0.2, 0.0]))
    rows = mesh_changes(MeshChange(coarser, None, ratio=2.0, graded=graded))
    np.testing.assert_allclose(np.sqrt((rows**2).mean(axis=0)), [0.7, 0.0], rtol=1e-12)
    np.testing.assert_allclose((in_quadrature([coarser]) ** 2).mean(axis=0), coarser**2)


# Thresholds from a population: the tolerance limit of a normal logarithm, the largest value, the margin.


def test_tolerance_factor_is_howes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert tolerance_factor(10**6) == pytest.approx(norm.ppf(0.9875), rel=5e-3)
    # ISO 16269-6, one-sided limits: confidence 95 %, share 99 %, n = 40.
    monkeypatch.setattr(fit_thresholds, "FALSE_ALARMS", 0.01)
    assert tolerance_factor(40) == pytest.approx(2.941, abs=2e-3)


def test_threshold_of_a_lognormal_figure() -> None:
    logs = 0.2 * norm.ppf((np.arange(40) + 0.5) / 40)
    values = np.exp(logs)
    expected = MARGIN * np.exp(logs.mean() + tolerance_factor(40) * logs.std(ddof=1))
    assert threshold(values) == pytest.approx(expected, rel=1e-12)
    assert threshold([*np.ones(39), 9.0]) == pytest.approx(MARGIN * 9.0, rel=1e-9)  # the largest seen counts
    with pytest.raises(ValueError, match="at least 10"):
        threshold(np.ones(9))


def test_figures_of_a_result() -> None:
    found = dict(figures(synthetic(nodes=False)))
    assert found["force: residual over expected"] == pytest.approx(1.0, rel=1e-12)
    assert found["force: slow residual over expected"] == pytest.approx(0.75, rel=1e-12)
    assert found["leading lag in sigmas"] == pytest.approx(0.4, rel=1e-12)


def right(number: int, *, excess: float = 1.0, evidence: float = 0.0, m: float = 1.12) -> RightShot:
    """A made-up result: force residual `excess` times the expected, a cause of some evidence, the truth m."""
    result = synthetic(nodes=False)
    force = replace(result.fit[0], residual=excess * result.fit[0].expected)
    cause = CauseFinding("x", "", "1", 0.0, 5.0, 1.0, 0.5, evidence, 1.0, {}, {}, named=False)
    known = replace(cause, key="y", evidence=999.0, declared_sigma=3.0)  # 5 is within k = 2 of 0 +- 3
    result = replace(result, fit=(force, *result.fit[1:]), causes=(cause, known))
    return RightShot(f"shot-{number}", result, {"stiffness_factor": m})


def test_limits_are_chosen_on_one_population_and_judged_on_the_other() -> None:
    sigma = right(0).result.estimates["stiffness_factor"].sigma
    value = right(0).result.estimates["stiffness_factor"].value
    near, far = value + 5.9 * sigma, value + 6.1 * sigma
    one = [right(n, excess=1.0 + 0.01 * n, evidence=4.0 * n, m=near) for n in range(12)]
    one.append(right(12, excess=50.0, evidence=900.0, m=far))  # its search ended elsewhere
    two = [right(n, excess=1.0, m=value) for n in range(19)] + [right(19, excess=3.0, evidence=56.0, m=value)]
    assert strongest(one[3].result) == 12.0
    said = chosen(one, two, limit)
    rows = said["limits"]
    force, evidence = rows["force: residual over expected"], rows[STRONGEST]
    assert force["chosen"] == pytest.approx(threshold(1.0 + 0.01 * np.arange(12)), rel=1e-12)
    assert evidence["chosen"] == pytest.approx(MARGIN * 44.0, rel=1e-12)
    assert (force["of two above chosen"]["count"], evidence["of two above chosen"]["count"]) == (1, 1)
    assert evidence["of two above in use"]["count"] == 0
    # Clopper and Pearson of 1 in 20: 0.13 to 24.9 %.
    band = force["of two above chosen"]
    assert tuple(band["interval"]) == pytest.approx((0.00127, 0.2487), abs=1e-4)
    assert said["population one"]["search ended elsewhere"] == ["shot-12"]
    text = table(said)
    assert (
        "| strongest evidence of a cause | 100 | 55 | 44 | 56 | 0 of 20 (0.0 to 16.8 %) | 1 of 20 (0.1"
        in text
    )
    assert "population one: 13 shots; the search of 1 ended elsewhere (shot-12)" in text


# Withheld verdicts: each by its cause, and none on a good fit.

M = "stiffness_factor"


def with_fit(*, force: dict[str, Any] | None = None, outline: dict[str, Any] | None = None) -> Identification:
    result = synthetic(nodes=False)
    a, b = result.fit
    return with_verdicts(replace(result, fit=(replace(a, **(force or {})), replace(b, **(outline or {})))))


def outcome(result: Identification) -> Verdict:
    return result.estimates[M].outcome


def said(result: Identification) -> str:
    (text,) = fit_warnings(result)
    assert not text.endswith(".")
    return text


def test_a_good_fit_is_left_alone() -> None:
    assert outcome(with_fit()) is Verdict.IDENTIFIED
    assert list(fit_warnings(with_fit())) == []
    assert Verdict.IDENTIFIED.identified
    assert not Verdict.UNEXPLAINED.identified


@pytest.mark.parametrize(
    ("channel", "change", "number"),
    [
        # Predicted are 0.12 and 0.16 N: 0.2 N in quadrature, and 0.04 N of the slow part.
        ("force", {"residual": 0.402}, "2.01 times the residual expected"),
        ("force", {"slow_residual": 0.1004}, "2.51 times that"),
        ("outline", {"residual": 9e-6}, "9 um rms"),
    ],
)
def test_an_unexplained_channel_withholds(channel: str, change: dict[str, float], number: str) -> None:
    result = with_fit(**{channel: change})
    assert outcome(result) is Verdict.UNEXPLAINED
    text = said(result)
    assert text.startswith(f"the model does not explain the {channel}: ")
    assert number in text


def test_just_below_both_limits_is_explained() -> None:
    assert outcome(with_fit(force={"residual": 0.398, "slow_residual": 0.0996})) is Verdict.IDENTIFIED


@pytest.mark.parametrize(
    ("channel", "change", "near"),
    [
        # Excesses of 1.575 and 1.59, whose squares are 2.48 and 2.53.
        ("force", {"residual": 0.315}, True),
        ("force", {"residual": 0.318}, False),
        ("force", {"slow_residual": 0.0630}, True),
        ("force", {"slow_residual": 0.0636}, False),
        ("outline", {"residual": 9e-6}, False),
        ("outline", {"limit": np.inf}, False),  # without limits nothing is known to be explained
    ],
)
def test_a_fit_is_near_right_where_no_excess_squared_is_beyond_the_search_far_away(
    channel: str, change: dict[str, float], near: bool
) -> None:
    assert near_right(with_fit().fit)
    assert near_right(with_fit(**{channel: change}).fit) is near


def test_a_graver_verdict_stays() -> None:
    result = synthetic(nodes=False)
    e = replace(result.estimates[M], outcome=Verdict.NOT_SEEN)
    bad = replace(result, estimates={M: e}, fit=(replace(result.fit[0], residual=9.0),))
    assert outcome(with_verdicts(bad)) is Verdict.NOT_SEEN


@pytest.mark.parametrize("end", ["lower", "upper"])
@pytest.mark.parametrize(("inside", "verdict"), [(2.01, Verdict.IDENTIFIED), (1.99, Verdict.BOUND_REACHED)])
def test_a_value_not_told_from_a_bound_is_not_identified(end: str, inside: float, verdict: Verdict) -> None:
    """A value so many standard uncertainties inside its design; k = 2 is the interval."""
    result = synthetic(nodes=False)
    bound = getattr(result.design, end)[0]
    parts = {"sigma_noise": 3e-3, "sigma_numerical": 4e-3, "sigma_systematic": 12e-3}  # 13e-3 together
    e = replace(result.estimates[M], **parts)
    value = float(bound) + (1.0 if end == "lower" else -1.0) * inside * 13e-3
    near = replace(result, estimates={M: replace(e, value=value)})
    assert outcome(with_verdicts(near)) is verdict
    assert not Verdict.BOUND_REACHED.identified
    told = [
        text
        for text in bound_warnings(with_verdicts(near))
        if "reaches past the bounds of its design" in text
    ]
    assert len(told) == (verdict is Verdict.BOUND_REACHED)
    # A misfit is graver.
    bad = replace(near, fit=(replace(result.fit[0], residual=9.0),))
    assert outcome(with_verdicts(bad)) is Verdict.UNEXPLAINED


@pytest.mark.parametrize(("margin", "verdict"), [(25.1, Verdict.IDENTIFIED), (24.9, Verdict.OTHER_VALLEY)])
def test_a_valley_not_told_from_another_is_not_identified(margin: float, verdict: Verdict) -> None:
    result = synthetic(nodes=False)
    e = result.estimates[M]
    design = replace(result.design, names=(M, "poisson"), lower=np.zeros(2), upper=np.full(2, 9.0))
    both = {M: e, "poisson": replace(e, name="poisson")}
    surrogate = {**result.surrogate, "valley_margin": margin}
    near = with_verdicts(replace(result, estimates=both, surrogate=surrogate, design=design))
    assert near.estimates["poisson"].outcome is verdict
    assert near.estimates[M].outcome is Verdict.IDENTIFIED
    assert not Verdict.OTHER_VALLEY.identified


def shared(force: float, sigmas: tuple[float, float] = (9.0, 9.0), *, end: bool = False) -> Identification:
    """The force's share of the information, and what force and outline alone have of the answer's sigma.

    With `end` the outline's optimum lies at an edge of what was searched.
    """
    result = with_fit(force={"weight": {M: force}}, outline={"weight": {M: 1.0 - force}})
    of = {"joint": 1.0, "force only": sigmas[0], "shape only": sigmas[1]}
    routes = [replace(r, sigma={M: 0.002 * of[r.name]}) for r in result.routes if r.name in of]
    if end:
        routes[-1] = replace(routes[-1], parameters={M: float(result.curves[0].x[-1])}, correction={})
    e = replace(result.estimates[M], outcome=Verdict.IDENTIFIED)
    return with_verdicts(replace(result, routes=tuple(routes), estimates={M: e}))


@pytest.mark.parametrize(("share", "verdict"), [(0.101, Verdict.IDENTIFIED), (0.099, Verdict.OUTLINE_ALONE)])
def test_a_channel_of_a_tenth_of_the_information(share: float, verdict: Verdict) -> None:
    result = shared(share)
    assert outcome(result) is verdict
    if verdict is Verdict.OUTLINE_ALONE:
        # The verdict says it; where the value has another verdict a warning does.
        assert not list(fit_warnings(result))
        e = replace(result.estimates[M], outcome=Verdict.CONDITIONAL)
        told = said(replace(result, estimates={M: e}))
        assert "the force carries 9.9 % of the information on stiffness_factor: the answer comes from" in told
    assert (outcome(shared(1.0 - share)) is Verdict.FORCE_ALONE) == (share < 0.1)


@pytest.mark.parametrize(
    ("sigmas", "end", "checks"),
    [
        ((1.1, 1.99), False, True),
        ((1.1, 2.01), False, False),
        ((9.0, 1.99), False, True),  # the other one's is what counts
        ((1.1, 0.0), False, False),  # a route without a budget
        ((1.1, 1.5), True, False),
    ],
)
def test_a_channel_without_a_share_checks_a_value_that_it_tells_by_itself(
    sigmas: tuple[float, float], end: bool, checks: bool
) -> None:
    """By itself its standard uncertainty is at most twice the answer's, and inside what was searched."""
    result = shared(0.95, sigmas, end=end)
    assert outcome(result) is (Verdict.IDENTIFIED if checks else Verdict.FORCE_ALONE)
    conditional = replace(result.estimates[M], outcome=Verdict.CONDITIONAL)
    assert len(list(fit_warnings(replace(result, estimates={M: conditional})))) == (0 if checks else 1)
    if not end:
        assert (outcome(shared(0.05, (sigmas[1], sigmas[0]))) is Verdict.IDENTIFIED) == checks


@pytest.mark.parametrize(
    ("difference", "verdict"), [(0.0399, Verdict.IDENTIFIED), (-0.0401, Verdict.CONTRADICTED)]
)
def test_routes_that_contradict_each_other(difference: float, verdict: Verdict) -> None:
    apart = RouteDifference({M: difference}, {M: 0.01}, ())
    result = with_verdicts(replace(synthetic(nodes=False), route_difference=apart))
    assert outcome(result) is verdict
    if verdict is Verdict.CONTRADICTED:
        assert "further apart than 4 standard uncertainties" in said(result)


def test_a_route_at_the_edge_of_what_was_searched_contradicts_nothing() -> None:
    result = synthetic(nodes=False)
    curve = result.curves[0]
    end = float(curve.x[-1])
    routes = tuple(
        replace(r, parameters={M: end}, correction={}) if r.name == "shape only" else r for r in result.routes
    )
    apart = RouteDifference({M: 1.0}, {M: 0.01}, ())
    assert (
        outcome(with_verdicts(replace(result, routes=routes, route_difference=apart))) is Verdict.IDENTIFIED
    )


def lag(recording: str, lag: float, *, evidence: float, explains: bool = True) -> ClockLag:
    return ClockLag(recording, lag, 1e-6, evidence, explains, f"{recording}.csv", f"{recording}.key")


def test_the_leading_lag_beyond_three_sigma_is_named() -> None:
    result = synthetic(nodes=False)
    late = lag("force", 3.1e-6, evidence=50.0)
    text = said(replace(result, clocks=(late, lag("flyer", -9e-6, evidence=40.0))))
    assert text == (
        "the force was recorded 3.1 +- 2 us (k = 2) too late against the motion: check the times of force.csv"
        " and force.key"
    )
    assert "too early" in said(replace(result, clocks=(lag("flyer", -3.1e-6, evidence=1.0),)))
    for quiet in (lag("force", 2.9e-6, evidence=50.0), lag("force", 3.1e-6, evidence=50.0, explains=False)):
        assert list(fit_warnings(replace(result, clocks=(quiet,)))) == []
    assert replace(late, sigma=float("nan")).significance == 0.0


def test_nothing_is_explained_without_limits() -> None:
    assert explains(with_fit().fit)
    assert not explains(with_fit(force={"residual": 0.402}).fit)
    assert not explains(with_fit(force={"limit": float("inf")}).fit)
    assert not explains(())


def test_excess_is_residual_over_the_quadrature_of_what_is_predicted() -> None:
    fit: FitQuality = synthetic(nodes=False).fit[0]
    assert fit.expected == pytest.approx(0.2, rel=1e-12)
    assert fit.excess == pytest.approx(1.0, rel=1e-12)
    assert fit.slow_excess == pytest.approx(0.75, rel=1e-12)
