"""The tried inputs, the order in which they are named, and their texts."""

from math import inf, isfinite, nan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.diagnosis.cause_search import Trial
from kolsky.diagnosis.causes import (
    ALIKE,
    CONTENDERS,
    LEAST_SHARE,
    LEVEL,
    MISTAKE,
    SURE,
    Best,
    CauseAnalysis,
    _contenders,
    by_evidence,
    cause_warnings,
    in_groups,
    percent,
    sentence,
    stiffness_at_bound,
    strangeness,
    with_leading,
    with_likely,
    with_suspects,
    without_twin_between,
)
from kolsky.inverse.result import CauseFinding
from kolsky.shot.inputs import CURVE_SCALE, DENSITY, POISSON, SENSITIVITY, causes

BY_KEY = {c.key: c for c in causes()}


def test_every_candidate_has_a_key_of_its_own_and_a_value_that_leads_back() -> None:
    assert len(BY_KEY) == len(causes())
    for c in causes():
        for u in [*c.scan, c.coordinate(c.exact) if isfinite(c.exact) and not c.parameter else 1.0]:
            if c.lowest <= u <= c.highest:
                assert c.coordinate(c.value(u)) == pytest.approx(u, rel=1e-9, abs=1e-15)


def test_a_gain_is_what_the_evaluated_force_is_multiplied_by() -> None:
    """Where half the sensitivity was declared the force is twice the simulated one: the gain is 1/2."""
    gain = BY_KEY[SENSITIVITY]
    assert gain.changed(gain.coordinate(0.5)).force_factor == pytest.approx(2.0)


def test_poisson_s_coordinate_is_the_logarithm_of_what_is_left_to_one_half() -> None:
    ratio = BY_KEY[POISSON]
    assert ratio.changed(np.log(0.002)).values["poisson"] == pytest.approx(0.499, rel=1e-12)


def trial(key: str, value: float, loss: float) -> Trial:
    c = BY_KEY[key]
    # One time a channel: the loss is the logarithm of the misfit.
    return Trial(c, np.ones(1), c.coordinate(value), np.array([np.exp(loss), 1.0]), np.zeros(2))


def search() -> Any:
    shot = SimpleNamespace(uncertainty={})
    problem, front = SimpleNamespace(shot=shot), SimpleNamespace(path=SimpleNamespace(sigma_onset=1e-7))
    runner = SimpleNamespace(problem=problem, front=front)
    return SimpleNamespace(runner=runner, problem=problem, loss=lambda misfits: float(np.log(misfits[0])))


def test_the_least_misfit_comes_first_and_of_equals_the_more_usual_error() -> None:
    """5 % of a sensitivity is 1.7 of its usual uncertainties of 3 %, 5 % of a density 5 of 1 %."""
    gain, density, late = (
        trial(SENSITIVITY, 0.95, 4.0),
        trial(DENSITY, 1.05, 0.0),
        trial("force.clock_offset", 2e-5, 30.0),
    )
    order = in_groups(search(), [late, density, gain])
    assert order == [SENSITIVITY, DENSITY, "force.clock_offset"]
    apart = in_groups(search(), [trial(SENSITIVITY, 0.95, 11.0), density])
    assert apart == [DENSITY, SENSITIVITY]


def test_what_is_granted_makes_no_error_less_usual() -> None:
    """A clock that is off by 3 us is 1 of its usual uncertainty, though the flyer's onset is known to 0.1."""
    clock, density = trial("force.clock_offset", 3e-6, 0.0), trial(DENSITY, 1.02, 0.0)
    assert in_groups(search(), [density, clock]) == ["force.clock_offset", DENSITY]


def finding(**changes: Any) -> CauseFinding:
    filled: dict[str, Any] = {
        "key": SENSITIVITY, "words": "a force gain", "unit": "1", "exact": 1.0, "value": 0.49762,
        "sigma": 0.0051, "explained": 0.99814, "evidence": 1100.0, "probability": 0.0,
        "parameters": {"stiffness_factor": 1.1164}, "sigmas": {}, "named": True,
    }  # fmt: skip
    return CauseFinding(**{**filled, **changes})


def test_a_cause_is_said_with_value_share_and_what_to_check() -> None:
    said = list(cause_warnings(CauseAnalysis((finding(alike=(DENSITY,)),), np.array([3547.0, 1.06]))))
    assert said == [
        "a force gain of 0.498 ± 0.010 (k = 2) explains 99.8 % of the misfit (equally explained by "
        "specimen.density): check force.sensitivity; with it stiffness_factor = 1.1164"
    ]


def test_values_are_said_in_their_units() -> None:
    assert sentence(finding(words="a lag", unit="s", value=2.0117e-5, sigma=1.3e-7)) == (
        "a lag of 20.12 ± 0.26 us (k = 2)"
    )
    assert percent(0.998) == "99.8 %"
    assert percent(0.62) == "62 %"


def test_a_misfit_that_nothing_explains_is_said_and_a_right_shot_is_quiet() -> None:
    none = finding(named=False)
    (said,) = cause_warnings(CauseAnalysis((none,), np.array([25.0, 1.0])))
    assert said.startswith("no single change of an input explains the misfit (the residual is 5 and 1 times")
    assert not list(cause_warnings(CauseAnalysis((none,), np.array([2.1, 1.1]))))
    assert not list(cause_warnings(CauseAnalysis((none,), np.array([25.0, 1.0])), explained=True))
    # A cause of a small share leaves a misfit; a curve's scale beyond the bound of m has no share of it.
    small = finding(explained=0.9 * LEAST_SHARE)
    named, rest = cause_warnings(CauseAnalysis((small,), np.array([25.0, 1.0])))
    assert "explains 22 % of the misfit" in named
    assert rest == said
    for alone in (finding(explained=LEAST_SHARE), finding(key=CURVE_SCALE, explained=0.0)):
        assert len(list(cause_warnings(CauseAnalysis((alone,), np.array([25.0, 1.0]))))) == 1
    (lost,) = cause_warnings(CauseAnalysis((), np.full(2, nan), lost="the run ended"))
    assert lost == "the search for a wrong input failed: the run ended"


def test_change_is_value_less_what_is_declared() -> None:
    assert finding().change == pytest.approx(-0.50238)
    assert np.isnan(finding(exact=nan, value=0.3).change)
    assert finding(value=inf).change == inf


KEYS = ["specimen.length", "model.damping", "force.sensitivity", "model.mass_damping", "specimen.diameter"]


def order(*evidences: float, losses: tuple[float, ...] = (0.0,) * len(KEYS)) -> list[str]:
    return [KEYS[i] for i in by_evidence(KEYS, evidences, losses)]


def test_the_most_evidence_first() -> None:
    assert order(80.0, 50.0, 65.0, 20.0, 35.0) == [
        "specimen.length", "force.sensitivity", "model.damping", "specimen.diameter", "model.mass_damping",
    ]  # fmt: skip


def test_of_what_cannot_be_told_apart_what_nobody_measured() -> None:
    assert order(51.5, 50.0, 30.0, 12.0, 11.0) == [
        "model.damping", "specimen.length", "force.sensitivity", "model.mass_damping", "specimen.diameter",
    ]  # fmt: skip
    # Told apart from ALIKE on; a group is what is near to its first, not a chain.
    assert order(50.0, 50.0 - ALIKE, 0.0, 0.0, 0.0)[:2] == ["specimen.length", "model.damping"]
    assert order(60.0, 45.0, 52.0, 0.0, 0.0)[:3] == ["specimen.length", "force.sensitivity", "model.damping"]


def test_weak_evidence_is_not_regrouped() -> None:
    assert order(ALIKE, 9.0, 8.0, 7.0, 0.0)[:2] == ["specimen.length", "model.damping"]
    assert order(9.0, 1.0, 8.0, 7.0, 0.0) == [KEYS[0], KEYS[2], KEYS[3], KEYS[1], KEYS[4]]


def test_of_equal_evidence_the_least_loss_comes_first() -> None:
    assert order(77.8, 0.0, 77.8, 0.0, 77.8, losses=(-20.0, 0.0, -39.0, 0.0, -125.0)) == [
        "specimen.diameter", "force.sensitivity", "specimen.length", "model.damping", "model.mass_damping",
    ]  # fmt: skip


def strange(key: str, value: float, sigma: float = 0.0) -> float:
    c = BY_KEY[key]
    start = c.exact if isfinite(c.exact) else nan
    return strangeness(c, value, sigma, start=start, scale=c.typical)


def test_a_usual_mistake_is_as_strange_as_two_standard_uncertainties() -> None:
    """A gain of 0.8 is 6.7 of 3 %; one of 0.5 is a mistake, and so is one that cannot be told from it."""
    assert strange(SENSITIVITY, 0.97) == pytest.approx(1.0)
    assert strange(SENSITIVITY, 0.97) < MISTAKE < strange(SENSITIVITY, 0.9)
    assert strange(SENSITIVITY, 0.8) == pytest.approx(0.2 / 0.03)
    assert strange(SENSITIVITY, 0.5) == MISTAKE
    assert strange(SENSITIVITY, 0.52) == MISTAKE  # 0.02 of 0.5: within 5 % of the mistake's size
    assert strange(SENSITIVITY, 0.53) > MISTAKE
    assert strange(SENSITIVITY, 0.55, sigma=0.03) == MISTAKE
    assert strange("curve.stress", 1.0) == MISTAKE < strange("curve shape", -0.4)
    assert strange("curve.stress", 0.4) > strange("curve shape", 0.25)


def test_what_has_no_declared_number_is_a_mistake_or_is_never_usual() -> None:
    assert strange("centre_line.y", 5e-5) == MISTAKE
    assert strange("centre_line.y", 5e-4) == inf
    assert strange("interface.faces", 0.3) == inf


def test_the_curve_s_scale_is_tried_where_the_stiffness_ends_at_a_bound() -> None:
    box = Box.of({"poisson": (0.49, 0.4999), "stiffness_factor": (0.5, 2.5)})
    assert stiffness_at_bound(box, np.array([0.499, 0.5001]))
    assert stiffness_at_bound(box, np.array([0.499, 2.5]))
    assert not stiffness_at_bound(box, np.array([0.4999, 1.1]))
    assert not stiffness_at_bound(Box.of({"poisson": (0.49, 0.4999)}), np.array([0.4999]))


def test_a_scale_of_the_force_stands_once_before_what_explains_as_much() -> None:
    assert without_twin_between(["a", DENSITY, SENSITIVITY, "b"]) == ["a", DENSITY, "b", SENSITIVITY]
    assert without_twin_between(["a", DENSITY, "b"]) == ["a", DENSITY, "b"]
    # 1.1 of 3 %, 3.4 of 1 % and 3.5 of 0.2 %, all as likely.
    tried = [trial(SENSITIVITY, 0.968, 0.0), trial(DENSITY, 1.034, 0.1), trial("frames.time", 0.993, 6.0)]
    assert in_groups(search(), tried) == [SENSITIVITY, "frames.time", DENSITY]


def test_an_input_is_suspected_where_the_data_are_sure_and_the_answer_leaves_its_interval() -> None:
    """From 1.00 with sigma 0.01 the answer leaves at 1.02; the probability must be below `SURE`."""

    def one(key: str, probability: float, m: float, **more: Any) -> CauseFinding:
        parameters = {"stiffness_factor": m}
        return finding(key=key, named=False, probability=probability, parameters=parameters, **more)

    tried = (
        one("stays", 0.1 * SURE, 1.019),
        one("by chance", 2.0 * SURE, 1.5),
        one("within", 0.1 * SURE, 1.5, declared_sigma=0.4),
        one("lost", 0.1 * SURE, 1.5, status="the run ended"),
        one("moves", 0.2 * SURE, 1.021),
        one("moves more surely", 0.1 * SURE, 0.979),
    )
    found = with_suspects(tried, {"stiffness_factor": 1.0}, 0.01)
    assert [f.key for f in found if f.named] == ["moves more surely", "moves"]
    assert [f.key for f in found][2:] == ["stays", "by chance", "within", "lost"]
    (said, _) = cause_warnings(CauseAnalysis(found, np.ones(2)), explained=True)
    assert said.startswith("the model explains the data, and a force gain of 0.498 ± 0.010 (k = 2) would fit")


@pytest.mark.parametrize(
    ("misfits", "identified", "at_bound", "named"),
    [
        ((1.0, 0.9), False, False, "moves"),  # no misfit: no input has a share of it
        ((1.1, 0.9), False, False, "explains"),
        ((1.0, 0.9), False, True, "explains"),
        ((1.1, 0.9), True, False, "moves"),
    ],
)
def test_what_no_evidence_names_is_named_by_its_share_or_by_what_it_does_to_the_answer(
    misfits: tuple[float, float], identified: bool, at_bound: bool, named: str
) -> None:
    moves = finding(
        key="moves", named=False, probability=0.1 * SURE, explained=0.0,
        parameters={"stiffness_factor": 1.03},
    )  # fmt: skip
    explains = finding(
        key="explains", named=False, probability=0.9 * LEVEL, explained=0.5,
        parameters={"stiffness_factor": 1.0},
    )  # fmt: skip
    unchanged = {"stiffness_factor": 1.0}
    analysis = CauseAnalysis((moves, explains), np.array(misfits), unchanged)
    m: Any = SimpleNamespace(outcome=SimpleNamespace(identified=identified), sigma=0.01)
    found = with_likely(analysis, m, at_bound=at_bound)
    assert [f.key for f in found if f.named] == [named]


def test_inputs_that_the_meshes_could_turn_round_are_compared_by_runs_of_their_own() -> None:
    """Strong ones within `KEPT` of the best, if there are two at least, and no more than `CONTENDERS`."""

    def best(key: str, loss: float) -> Best:
        one = trial(key, 1.1, loss)
        return Best(one, one, SimpleNamespace())  # type: ignore[arg-type]

    judge: Any = search()
    judge.gain = lambda misfits: 200.0 - float(np.log(misfits[0]))
    keys = [SENSITIVITY, DENSITY, "frames.time", "pictures.scale", "specimen.length", "specimen.diameter"]
    near = [best(key, 10.0 * i) for i, key in enumerate(keys)]
    assert [b.own.candidate.key for b in _contenders(judge, near)] == keys[:CONTENDERS]
    far = [best(SENSITIVITY, 0.0), best(DENSITY, 61.0), best("frames.time", 110.0)]
    assert _contenders(judge, far) == []
    weak = [best(SENSITIVITY, 90.0), best(DENSITY, 101.0)]
    assert _contenders(judge, weak) == []


def test_inputs_that_explain_all_are_compared_by_runs_of_their_own() -> None:
    """Evidence ends at the residual of a correct model. Its loss does not: there the meshes decide."""
    tried = [trial(key, 1.1, loss) for key, loss in ((SENSITIVITY, -90.0), (DENSITY, -5.0))]
    judge: Any = search()
    judge.gain = lambda misfits: 200.0 - max(float(np.log(misfits[0])), 0.0)
    both = [Best(t, t, SimpleNamespace()) for t in tried]  # type: ignore[arg-type]
    assert _contenders(judge, both) == both


def test_of_an_answer_that_is_withheld_the_leading_inputs_are_named() -> None:
    """Significant and a share of the misfit are enough there; at a bound what lies beyond comes first."""

    def one(key: str, probability: float, share: float, **more: Any) -> CauseFinding:
        return finding(key=key, named=False, probability=probability, explained=share, evidence=4.0, **more)

    tried = (
        one("leads", 0.9 * LEVEL, LEAST_SHARE), one("by chance", 1.1 * LEVEL, 0.9),
        one("little", 0.0, 0.9 * LEAST_SHARE), one("within", 0.0, 0.9, declared_sigma=0.4),
        one("lost", 0.0, 0.9, status="the run ended"), one(CURVE_SCALE, 1.0, 0.0), one("follows", 0.0, 0.9),
    )  # fmt: skip
    assert [f.key for f in with_leading(tried, at_bound=False) if f.named] == ["leads", "follows"]
    found = with_leading(tried, at_bound=True)
    assert [f.key for f in found if f.named] == [CURVE_SCALE, "leads", "follows"]
    assert len(found) == len(tried)
