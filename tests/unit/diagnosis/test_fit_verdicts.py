"""Withheld verdicts: each by its cause, and none on a good fit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic import synthetic

from kolsky.diagnosis.fit_quality import explained, fit_warnings, near_right, with_verdicts
from kolsky.inverse.result import ClockLag, FitQuality, Identification, RouteDifference, Verdict
from kolsky.uncertainty.warnings import bound_warnings

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
    assert explained(with_fit())
    assert not explained(with_fit(force={"residual": 0.402}))
    assert not explained(with_fit(force={"limit": float("inf")}))
    assert not explained(replace(synthetic(nodes=False), fit=()))


def test_excess_is_residual_over_the_quadrature_of_what_is_predicted() -> None:
    fit: FitQuality = synthetic(nodes=False).fit[0]
    assert fit.expected == pytest.approx(0.2, rel=1e-12)
    assert fit.excess == pytest.approx(1.0, rel=1e-12)
    assert fit.slow_excess == pytest.approx(0.75, rel=1e-12)
