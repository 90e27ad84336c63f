"""Search of causes from another point than the answer: closed form for predictions with two valleys."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.diagnosis import causes
from kolsky.diagnosis.cause_search import CauseSearch, Trial
from kolsky.diagnosis.causes import EVIDENCE, Best, best_of_each, best_trials, list_pairs, ranked, solved
from kolsky.diagnosis.fit_quality import UNEXPLAINED
from kolsky.inverse.result import CauseFinding
from tests.unit.diagnosis.test_declared_causes import K, candidate, expected, runner

WRONG, RIGHT = 1.0, 5.0
LATE, OFF = 12.0, 9.0


class TwoValleys:
    """In the wrong valley the late input changes nothing; in the right one it explains what is left.

    With three orthonormal directions and the input u, prediction minus data is noise - LATE l + 300 m (x - 1)
    below x = 3, and noise - LATE l + 300 m (x - 5) + u LATE l + (u - 1) OFF o above.
    """

    def __init__(self, x: float) -> None:
        rng = np.random.default_rng(11)
        self.m, self.late, self.off = np.linalg.qr(rng.standard_normal((K, 3)))[0].T
        self.data = LATE * self.late + rng.standard_normal(K)
        self.x, self.lower, self.upper = np.array([x]), np.zeros(1), np.full(1, 10.0)
        self.observations = SimpleNamespace(bins=SimpleNamespace(mean=self.data), n_force=K)

    def steps(self, x: np.ndarray) -> np.ndarray:
        return np.full(1, 0.01)

    def slopes(self, x: np.ndarray, changed: Any) -> list[Any]:
        return [SimpleNamespace(x=x + 0.01, changed=changed)]

    @property
    def screen(self) -> Any:
        return self

    def vectors(self, points: Any) -> np.ndarray:
        found = []
        for p in points:
            x, u = p.x[0], p.changed.values.get("late", 0.0)
            if x < 3.0:
                found.append(300.0 * self.m * (x - WRONG))
            else:
                seen = u * LATE * self.late + (u - 1.0) * OFF * self.off
                found.append(300.0 * self.m * (x - RIGHT) + seen)
        return np.array(found)


def searches() -> tuple[CauseSearch, CauseSearch]:
    """From the answer, which lies in the wrong valley, and from the right one."""
    found = []
    for x in (WRONG, RIGHT):
        model: Any = TwoValleys(x)
        tried = [candidate("late"), candidate("idle")]
        found.append(CauseSearch(runner(), model, expected(), np.ones(K, dtype=bool), tried))
    return found[0], found[1]


def test_evidence_counts_against_the_answer_and_not_against_the_other_start() -> None:
    answer, second = searches()
    # Noise of mean square one, and what is left of the data beside it, over K entries.
    assert answer.before[0] == pytest.approx(1.0 + LATE**2 / K, abs=0.3)
    assert second.before[0] == pytest.approx(1.0 + (LATE**2 + OFF**2) / K, abs=0.3)
    second.judge(answer)
    assert second.before[0] == answer.before[0]
    # An answer that is worse than the other start is no yardstick.
    worse, better = searches()[1], searches()[0]
    before = better.before[0]
    better.judge(worse)
    assert better.before[0] == before


def test_an_input_out_of_reach_of_the_answer_is_named_from_the_other_start() -> None:
    answer, second = searches()
    tried = [candidate("late"), candidate("idle")]
    trials = best_trials(answer, tried)
    assert not any(f.named for f in ranked(answer, trials))
    second.judge(answer)
    both = [Best(second.seen(answer, t), t, answer) for t in trials]
    both += [Best(t, t, second) for t in best_trials(second, tried)]
    best = best_of_each(both, second)
    assert {one.own.candidate.key: one.search for one in best}["late"] is second
    late = ranked(second, [one.seen for one in best])[0]
    assert (late.key, late.named) == ("late", True)
    assert late.value == pytest.approx(1.0, abs=0.2)
    left = second.expected.misfits(next(one.seen.residual for one in best if one.search is second))[0]
    assert left == pytest.approx(1.0, abs=0.2)
    assert late.evidence == pytest.approx(K * np.log(answer.before[0] / max(left, 1.0)), rel=1e-6)
    assert late.evidence > EVIDENCE


def test_trials_of_the_answer_keep_the_entries_that_count_in_both() -> None:
    answer, second = searches()
    second.use = np.arange(K) >= 10
    trials = best_trials(answer, [candidate("idle")])
    second.expected = SimpleNamespace(  # type: ignore[assignment]
        misfits=lambda r: np.array([float(r @ r) / len(r), 1.0]), times=np.array([K, 0])
    )
    second.before = np.zeros(2)
    seen = second.seen(answer, trials[0])
    np.testing.assert_array_equal(seen.residual, trials[0].residual[10:])
    assert seen.misfits[0] == pytest.approx(float((trials[0].residual[10:] ** 2).mean()))


@pytest.mark.parametrize(("explained", "far"), [(False, True), (True, False)])
def test_values_far_away_are_tried_only_where_the_fit_does_not_explain_the_data(
    explained: bool, far: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, search = searches()
    search.before = np.array([UNEXPLAINED + 0.1, 1.0])
    tried = [candidate("late"), candidate("idle")]
    scanned: list[Any] = []
    monkeypatch.setattr(causes, "scan_inputs", lambda _, candidates: scanned.extend(candidates) or [])
    trials = best_trials(search, tried, explained=explained)
    assert bool(scanned) is far
    assert [t.candidate.key for t in trials] == ["late", "idle"]


def finding(key: str, *, named: bool, beside: str = "", status: str = "") -> CauseFinding:
    numbers = dict.fromkeys(("exact", "value", "sigma", "explained", "evidence", "probability"), 0.0)
    return CauseFinding(
        key=key, words="", unit="1", parameters={}, sigmas={}, named=named, beside=beside, status=status,
        **numbers,
    )  # fmt: skip


def test_what_is_listed_after_the_first_cause() -> None:
    """Beside it b is likely; in its place c was; d is judged beside it anew, e could not be."""
    more = [
        finding("b", named=True, beside="a"),
        finding("d", named=False, beside="a"),
        finding("c", named=False, beside="a"),
        finding("e", named=False, beside="a", status="lost"),
    ]
    alone = [
        finding("c", named=True), finding("b", named=True), finding("e", named=False),
        finding("d", named=False), finding("f", named=False),
    ]  # fmt: skip
    listed = [(f.key, f.beside) for f in list_pairs(more, alone)]
    assert listed == [("b", "a"), ("c", ""), ("d", "a"), ("e", ""), ("f", "")]


def test_a_cause_that_leaves_what_a_right_model_does_ends_the_search() -> None:
    t = Trial(candidate("late"), np.ones(1), 1.0, np.array([1.4, 1.0]), np.zeros(2))
    assert solved(t)
    assert not solved(replace(t, misfits=np.array([1.6, 1.0])))
    assert not solved(replace(t, misfits=np.array([1.0, 1.6])))
    assert not solved(replace(t, lost="ended"))
