"""Other valleys of a free Poisson's ratio: closed form for a force that oscillates as a sine."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kolsky.diagnosis.cause_search import PHASE, CauseSearch, Trial, in_valleys, without_change
from kolsky.diagnosis.causes import ALIKE, best_trials, ranked
from kolsky.inverse.valleys import oscillation_table
from tests.unit.diagnosis.test_declared_causes import K, candidate, expected, runner

FloatArray = NDArray[np.float64]
TRUE = 20.0
"""Oscillations of the measured force over the window."""
LAG = 0.02
"""By how much of the window it is early: 0.4 oscillations."""
SIZE = 8.0
"""Amplitude of the ringing, in standard deviations of the noise."""
FACTOR = 1.3
BOUNDS = (0.49, 0.4999)


def ringing_runner() -> Any:
    """A specimen of 6 mm and 1000 kg/m^3, 60 kPa, over 1.5 ms; stiffness and Poisson's ratio are free."""
    whole = runner()
    one = whole.problem
    stretch = np.linspace(0.9, 1.1, 21)
    one.shot.curve = SimpleNamespace(stretch=stretch, stress=6e4 * (stretch - 1.0))
    one.shot.specimen = SimpleNamespace(density=1000.0, length=6e-3)
    one.prepared.observations = SimpleNamespace(bins=SimpleNamespace(edges=np.array([0.0, 1.5e-3])))
    one.box = SimpleNamespace(names=("stiffness_factor", "poisson"))
    return whole


# The number of oscillations for the table's stiffness: the model below rings by it whatever its stiffness.
POISSON, NUMBER = oscillation_table(ringing_runner().problem.prepared, 1.0, BOUNDS)


def ratio(number: float) -> float:
    """Poisson's ratio with so many oscillations."""
    return float(np.interp(number, NUMBER, POISSON))


def number(poisson: float) -> float:
    """Oscillations with a Poisson's ratio."""
    return float(np.interp(poisson, POISSON, NUMBER))


class Ringing:
    """SIZE sin(2 pi N (t + u)) + 20 (m - 1) t: m by its slope, N by Poisson's ratio, u the input "late"."""

    def __init__(self, at: float, lag: float) -> None:
        self.t = np.linspace(0.0, 1.0, K)
        noise = np.random.default_rng(5).standard_normal(K)
        self.data = self.force(FACTOR, TRUE, lag) + noise
        self.x = np.array([1.0, ratio(at)])
        self.lower, self.upper = np.array([0.5, BOUNDS[0]]), np.array([2.5, BOUNDS[1]])
        self.observations = SimpleNamespace(bins=SimpleNamespace(mean=self.data), n_force=K)
        self.runs = 0

    def force(self, m: float, n: float, lag: float) -> FloatArray:
        return np.asarray(SIZE * np.sin(2.0 * np.pi * n * (self.t + lag)) + 20.0 * (m - 1.0) * self.t)

    def steps(self, x: FloatArray) -> FloatArray:
        return np.array([0.01, 0.01 * (0.5 - x[1])])

    def slopes(self, x: FloatArray, changed: Any) -> list[Any]:
        return [SimpleNamespace(x=x + step, changed=changed) for step in np.diag(self.steps(x))]

    @property
    def screen(self) -> Any:
        return self

    def vectors(self, points: Any) -> FloatArray:
        self.runs += len(points)
        lags = [LAG * p.changed.values.get("late", 0.0) for p in points]
        return np.array([self.force(p.x[0], number(p.x[1]), u) for p, u in zip(points, lags, strict=True)])


def search(at: float, lag: float = 0.0) -> tuple[CauseSearch, Any]:
    model: Any = Ringing(at, lag)
    tried = [candidate("late"), candidate("idle")]
    return CauseSearch(ringing_runner(), model, expected(), np.ones(K, dtype=bool), tried), model


def trial(one: CauseSearch, key: str, at: float, u: float = 0.0, *, m: float = 1.0) -> Trial:
    x = np.array([m, ratio(at)])
    return one.measured([Trial(candidate(key), x, u, one.before, one.left)])[0]


@pytest.mark.parametrize("off", [-0.93, -0.63, 0.63, 0.93])
def test_a_start_is_taken_to_the_valley_in_step(off: float) -> None:
    one, _ = search(TRUE + off, LAG)
    start = trial(one, "late", TRUE + off, 1.0)
    # Out of step: a mean square of SIZE^2 / 2 each for data and model.
    assert start.misfits[0] > 0.5 * SIZE**2
    (found,) = in_valleys(one, [start])
    assert abs(number(found.x[1]) - TRUE) <= 0.6 * PHASE
    assert found.x[0] == pytest.approx(FACTOR, abs=0.05)
    assert found.u == start.u
    # Half a step of the scan is 2 pi PHASE / 2 out of phase at the end: its mean square is a third of that.
    assert found.misfits[0] < 1.5 + 0.5 * SIZE**2 * (np.pi * 1.2 * PHASE) ** 2 / 3.0


def test_gauss_newton_alone_stays_in_the_valley_where_it_starts() -> None:
    one, _ = search(TRUE - 1.4, LAG)
    start = trial(one, "late", TRUE - 1.4, 1.0)
    (alone,) = one.followed([start])
    assert alone.misfits[0] > 0.25 * SIZE**2
    assert abs(number(alone.x[1]) - TRUE) > 0.2


def test_the_best_start_of_each_input_is_scanned_about() -> None:
    one, _ = search(TRUE - 0.6, LAG)
    near, far = trial(one, "late", TRUE - 0.3, 1.0), trial(one, "late", TRUE - 0.6, 1.0)
    assert near.misfits[0] < far.misfits[0]
    idle = trial(one, "idle", TRUE - 0.6)
    found = in_valleys(one, [far, near, idle])
    assert found[0] is far
    assert abs(number(found[1].x[1]) - TRUE) <= 0.6 * PHASE
    assert [t.candidate.key for t in found] == ["late", "late", "idle"]
    assert one.loss(found[2].misfits) <= one.loss(idle.misfits)


def test_a_start_that_is_in_step_stays() -> None:
    one, _ = search(TRUE, LAG)
    start = trial(one, "late", TRUE, 1.0, m=FACTOR)
    (found,) = in_valleys(one, [start])
    assert number(found.x[1]) == pytest.approx(TRUE, abs=1e-3)
    assert found.x[0] == pytest.approx(FACTOR, abs=0.01)


def test_what_another_valley_explains_is_no_evidence_for_an_input() -> None:
    """All inputs right, the answer out of step: the free parameters explain the data, no input does."""
    one, _ = search(TRUE - 0.63)
    before = one.before[0]
    assert before > 0.25 * SIZE**2
    tried = [candidate("late"), candidate("idle")]
    findings = ranked(one, best_trials(one, tried))
    assert one.before[0] == pytest.approx(1.0, abs=0.3)
    assert number(one.at[1]) == pytest.approx(TRUE, abs=0.02)
    assert not any(f.named for f in findings)
    assert all(f.evidence < ALIKE for f in findings)


def test_evidence_counts_against_the_better_of_both() -> None:
    one, _ = search(TRUE - 0.63)
    without_change(one)
    left, before, bare = one.left, one.before, one.bare
    worse = Trial(candidate("idle"), one.x, 0.0, 2.0 * before, left)
    one.against(worse)
    assert one.before is before
    assert one.bare is bare
    np.testing.assert_allclose(bare, before)  # nothing is declared uncertain here


def test_an_answer_that_is_explained_is_not_scanned_about() -> None:
    one, model = search(TRUE)
    assert one.before[0] < 1.5
    runs = model.runs
    best_trials(one, [candidate("late"), candidate("idle")])
    assert model.runs == runs


def test_a_ratio_that_is_held_is_not_scanned() -> None:
    one, model = search(TRUE - 0.63, LAG)
    one.problem = replace_names(one.problem, ("stiffness_factor", "damping"))
    runs, before = model.runs, one.before
    best_trials(one, [candidate("idle")])
    assert one.before is before
    # Tangents need no run; the followed start has at most TURNS rounds of 4 + 3 runs, and one to begin with.
    assert model.runs - runs <= 1 + 6 * 7


def replace_names(problem: Any, names: tuple[str, ...]) -> Any:
    return SimpleNamespace(**{**vars(problem), "box": SimpleNamespace(names=names)})
