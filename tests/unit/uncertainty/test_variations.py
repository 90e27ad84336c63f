"""Other windows and bins of the same data: the remaining data, and the result of a whole identification."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.identification import identify
from kolsky.inverse.coarse_search import search
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction, observe
from kolsky.inverse.settings import Numerics, Settings
from kolsky.shot.load import load_shot
from kolsky.uncertainty.analyse import FORCE_BINS, SEARCHED, WINDOW_END, _halves, shorter_window, wider_bins

ROOT = Path(__file__).parents[3]
BOX = Box(names=("stiffness_factor",), lower=(0.5,), upper=(1.5,))
WINDOW = (0.0, 1e-3)
SAMPLES = np.linspace(*WINDOW, 1001)
FRAMES = np.linspace(0.05e-3, 0.95e-3, 19)


def force(m: float, time: FloatArray) -> FloatArray:
    """A force that a factor of 1 fits until 0.85 ms, and one of 1.1 afterwards."""
    return m * 1e5 * time * np.where(time <= 0.85e-3, 1.0, 1.0 / 1.1)


def made() -> tuple[Objective, FloatArray]:
    """An objective over 21 bins and 19 points, every fourth not counted; the slope of its linear model."""
    line = CentreLine(
        time=FRAMES, frame=np.arange(19), y=np.full(19, 1e-3), Z=1.0 + 100.0 * FRAMES, sigma=np.full(19, 0.1)
    )
    history = ForceHistory(time=SAMPLES, force=1e5 * SAMPLES, sigma=np.full(SAMPLES.size, 0.5))
    seen = observe(history, line, window=WINDOW, bin_width=1e-3 / 21)
    objective = Objective(seen, np.arange(19) % 4 != 0)
    return objective, np.concatenate([force(1.0, seen.bins.centres), np.zeros(int(objective.counted.sum()))])


def model(points: FloatArray) -> FloatArray:
    """The force answers m linearly, the outline not at all."""
    objective, slope = made()
    level = np.concatenate([np.zeros(objective.n_force), objective.data[objective.n_force :]])
    return level + np.atleast_2d(points) * slope


def test_a_shorter_window_is_that_window() -> None:
    objective, _ = made()
    cut, predict = shorter_window(objective, model, 0.8e-3)
    assert cut.times.max() <= 0.8e-3
    whole = objective.times <= 0.8e-3  # a bin that the end cuts is left out: its centre may be inside
    assert whole.sum() - len(cut.data) in (0, 1)
    assert cut.data.size == cut.noise.size == predict(np.array([1.2])).shape[1]
    np.testing.assert_array_equal(np.unique(cut.observations.centre_line.time), FRAMES[FRAMES <= 0.8e-3])
    # What of the model lies before the kink fits exactly; the last 15 % pull the optimum of the whole up.
    assert search(BOX, cut, predict).x[0] == pytest.approx(1.0, abs=1e-5)  # tolerance of the search
    assert search(BOX, objective, model).x[0] > 1.02


@pytest.mark.parametrize(("end", "words"), [(0.1e-3, "2 bins of the force"), (-1.0, "0 bins")])
def test_a_window_that_is_too_short(end: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        shorter_window(made()[0], model, end)


def test_wider_bins_are_the_means_that_the_samples_have() -> None:
    objective, _ = made()
    wide, predict = wider_bins(objective, model)
    bins = wide.observations.bins
    assert bins.mean.size == 11  # ten pairs and the odd one
    for k, mean in enumerate(bins.mean):
        low, high = bins.edges[k : k + 2]
        inside = (low <= SAMPLES) & (high >= SAMPLES)
        t, F = SAMPLES[inside], objective.observations.force.force[inside]
        assert mean == pytest.approx(np.trapezoid(F, t) / np.ptp(t), rel=1e-12)  # round-off
        assert bins.n[k] == inside.sum()
        # n equal samples: sigma / sqrt(n), where the ends of the trapezoid count half: to 1 in n.
        assert bins.sigma[k] == pytest.approx(0.5 / np.sqrt(inside.sum() - 1), rel=1.5 / inside.sum())
    data = wide.data
    exact = model(np.array([1.0]))
    exact[0, : objective.n_force] = objective.observations.bins.mean
    merged = wider_bins(objective, lambda x: exact)[1](np.array([1.0]))[0]
    np.testing.assert_allclose(merged, data, rtol=1e-12)  # data and model are merged alike
    assert predict(np.array([1.0])).shape == (1, data.size)


def test_halves_have_the_mean_of_their_bin() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5, 1.5, 61))
    edge = np.array([0, 12, 20, 40, 60])
    halves = np.array([0, 6, 12, 16, 20, 30, 40, 50, 60])
    F = np.stack([3.0 + 0.2 * time, np.sin(time)])
    exact = np.stack([3.0 + 0.1 * (time[edge[1:]] + time[edge[:-1]]), rng.normal(size=4)])
    empty = np.empty((2, 0))
    made = Prediction(force=F, force_bins=exact, Z=empty, inside=empty.astype(bool))
    found = _halves(made, time, edge, halves)
    h = np.diff(time[halves])
    again = (h * found).reshape(2, 4, 2).sum(axis=2) / h.reshape(4, 2).sum(axis=1)
    np.testing.assert_allclose(again, exact, rtol=1e-12)
    line = 3.0 + 0.1 * (time[halves[1:]] + time[halves[:-1]])  # a straight line's means are its middles'
    np.testing.assert_allclose(found[0], line, rtol=1e-12)


@pytest.mark.slow
def test_the_shift_is_that_of_an_identification_with_the_other_window() -> None:
    """The same shot with its window declared shorter, identified from scratch."""
    shot = load_shot(ROOT / "runs" / "open-01")
    settings = Settings(
        free={"stiffness_factor": None}, numerics=Numerics(mesh=(16, 22)), refined_mesh=(24, 32), replicates=0
    )
    # (On 12 x 16 elements, half as fine as the answer's, the ringing in the shorter window is not the refined
    # mesh's, and the surrogate's shift is too small by three times what the residuals leave open.)
    found = identify(shot, settings)
    told = {(v.key, round(1e6 * v.value)): v for v in found.variations}
    assert [key for key, _ in told] == [WINDOW_END, WINDOW_END, FORCE_BINS, FORCE_BINS]
    assert {v.status for v in told.values()} == {SEARCHED}
    first, last = shot.window
    end = first + 0.8 * (last - first)
    other = identify(replace(shot, window=(first, end)), settings)
    m, n = (answer.estimates["stiffness_factor"] for answer in (found, other))
    shift = told[WINDOW_END, round(1e6 * end)].shifts["stiffness_factor"]
    # Another design about another optimum, and steps on a mesh half as fine as the answer's on the way to
    # it: the two agree within what the residuals alone leave open.
    # Both on the mesh they were searched on. Each answer is then corrected for that mesh's error: how fine
    # the mesh is is no choice of a window.
    assert shift == pytest.approx(n.on_mesh - m.on_mesh, abs=m.noise_parts["force and shape"])
    assert shift > 0.6 * m.noise_parts["force and shape"]  # and there is something to foretell
