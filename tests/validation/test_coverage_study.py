"""The study of coverage, reduced: made experiments are what they say, and a dozen of them identified."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2

from populations.coverage import Found, Study, _free, run
from populations.coverage_counts import NOMINAL, summary, table
from populations.coverage_problem import (
    FORCE_SIGMA,
    GROUP,
    NOISE,
    drawn,
    experiment,
    middle,
    stroke,
    template,
    velocity,
)

M = "stiffness_factor"


def _found(error: float, sigma: float, number: int = 0) -> dict[str, Any]:
    one = {M: sigma}
    routes = {"force only": {M: [1.1 + 1.9 * error, sigma]}}
    return asdict(
        Found(
            number=number,
            truth={M: 1.1},
            value={M: 1.1 + error},
            sigma=one,
            correction={M: -0.004},
            parts={M: {"mesh": sigma}},
            routes=routes,
            profile={M: [1.1 + error - sigma, 1.1 + error + sigma]},
            outcome="identified",
            warnings=[],
            figures={},
            seconds=0.0,
        )
    )


def _five() -> list[dict[str, Any]]:
    """Errors of 1, -1.9, 2.1 and 0 sigma, and no answer."""
    lost = _found(0.0, 1.0) | {"value": {M: float("nan")}, "sigma": {M: float("nan")}}
    return [*(_found(e * 0.01, 0.01) for e in (1.0, -1.9, 2.1, 0.0)), lost]


def test_covered_is_counted_by_hand() -> None:
    """Three of five within two sigma."""
    said = summary(_five())[M]
    assert said["covered"] == pytest.approx(0.6)
    assert said["answers"] == 4
    assert said["misses, value too high and too low"] == {"above": 1, "below": 0}
    assert said["mean error"] == pytest.approx(0.003)
    assert said["mean error without the mesh correction"] == pytest.approx(0.007)
    assert said["scatter"] == pytest.approx(np.std([0.01, -0.019, 0.021, 0.0], ddof=1))
    assert said["covered by the profile likelihood alone"] == pytest.approx(0.5)  # 1.0 and 0.0
    # Errors of 1.9, -3.6, 4 and 0 sigma by the force alone.
    assert said["covered by force alone and outline alone"] == {"force only": pytest.approx(0.5)}


def test_what_is_refused_is_counted_apart() -> None:
    """Of five two miss, one of them refused: of the four that are called identified three hold the truth."""
    each = [_found(e * 0.01, 0.01) for e in (1.0, 2.1, 0.0, 0.5, 9.0)]
    each[0]["outcome"] = "identified by the outline alone; identified"
    each[4]["outcome"] = "identified; not explained by the model"
    said = summary(each)
    assert said["called identified"] == 4
    assert said[M]["covered"] == pytest.approx(0.6)
    assert said[M]["covered of those called identified"] == pytest.approx(0.75)
    low, high = said[M]["exact interval of those, 95 % of studies"]
    assert (low, high) == tuple(binom.interval(0.95, 4, NOMINAL) / np.array(4.0))
    whole = {"study": {"free": [M]}, **said}
    assert "| of the 4 that are called identified | 75.0 % (75.0 to 100.0 %) |" in table(whole)


def test_parameters_are_named_or_written_as_symbols() -> None:
    assert _free("m,nu,beta") == _free("m,poisson,damping") == (M, "poisson", "damping")
    for wrong in ("m,gamma", "m,nu,poisson"):
        with pytest.raises(SystemExit, match="at most once"):
            _free(wrong)


def test_what_is_wanted_is_judged() -> None:
    def wanted(errors: list[float]) -> dict[str, bool]:
        found: dict[str, bool] = summary([_found(e, 1.0) for e in errors])[M]["as wanted"]
        return found

    rest = [0.1, -0.1] * 50
    good = wanted([2.1, -2.1, 2.1, -2.1, *rest[:96]])
    assert all(good.values())
    # Six misses to one side are chance once in 32.
    assert not wanted([2.1] * 6 + rest[:94])["misses on both sides"]
    assert not wanted([2.1] * 6 + [-2.1] * 6 + rest[:88])["covered 92 to 98 %"]
    assert not wanted(rest[:100])["covered 92 to 98 %"]  # all of them: too long
    assert not wanted([e + 0.3 for e in rest])["mean error below a quarter of sigma"]


def test_experiments_are_what_they_say() -> None:
    pairs = [drawn(number, 3) for number in range(2 * GROUP)]
    assert len({setup for setup, _ in pairs}) == 2
    assert len({truth.shear_modulus for _, truth in pairs}) == 2 * GROUP
    assert drawn(GROUP + 1, 3) == pairs[GROUP + 1]
    assert drawn(1, 4) != pairs[1]
    for name, (low, high) in {"stiffness_factor": (0.9, 1.3), "poisson": (0.49925, 0.49965)}.items():
        values = [getattr(truth, name) for _, truth in pairs]
        assert low <= min(values) < low + 0.2 * (high - low)
        assert high - 0.2 * (high - low) < max(values) <= high
    assert all(NOISE[0] <= truth.force_sigma / FORCE_SIGMA <= NOISE[1] for _, truth in pairs)

    setup, truth = pairs[0]
    seen = template(setup, truth)
    exact = (3.0 + 0.0 * seen.force.time, seen.centre_line.Z)
    one, other = (experiment(0, setup, truth, exact, "bonded", np.random.default_rng([1, i])) for i in (1, 2))
    noise = one.force.history().force - 3.0
    assert noise.std() == pytest.approx(truth.force_sigma, rel=0.06)  # 2700 samples: 1.4 %, four times that
    assert not np.array_equal(noise, other.force.history().force - 3.0)
    assert one.model.poisson == truth.poisson


def test_the_flyer_moves_as_its_velocity_says() -> None:
    for number in range(5):
        setup, truth = drawn(number, 2)
        t = np.linspace(0.0, setup.end, 40_001)
        v = velocity(t, setup, truth)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
        # Trapezoids of a smooth velocity: h^2 / 12 of its second derivative, 1e-9 of the way here.
        np.testing.assert_allclose(stroke(t, setup, truth), way, atol=1e-7 * way[-1])
        assert v[0] == 0.0
        # When it has gone the specimen's length the flyer has lost the share `drag` of its speed.
        reached = stroke(t, setup, truth)[-1] / setup.length
        assert v[-1] == pytest.approx(truth.speed * (1.0 - truth.drag * reached), rel=1e-9)
        assert 0.3 < reached <= 0.5


def test_a_truth_as_coarse_as_the_answer_is_refused() -> None:
    with pytest.raises(ValueError, match="64 of the identification"):
        Study((M,), truth_mesh=(64, 86))


def test_a_truth_is_the_middle_of_both_elements() -> None:
    force, Z = np.array([3.0, 5.0]), np.array([6e-3, 7e-3])
    found = middle((force + 0.1, Z - 1e-4), (force - 0.1, Z + 1e-4))
    np.testing.assert_allclose(found[0], force, rtol=1e-12)
    np.testing.assert_allclose(found[1], Z, rtol=1e-12)


COARSE = Study((M,), mesh=(16, 22), refined_mesh=(24, 32), truth_mesh=(36, 48), seed=7)


@pytest.mark.slow
def test_a_study_goes_on_where_it_stopped(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    (first,) = run(COARSE, folder, [0], workers=1)
    kept = folder / "answer-0000.json"
    stamp = kept.stat().st_mtime_ns
    again = run(COARSE, folder, [0], workers=1)
    assert again == [first]
    assert kept.stat().st_mtime_ns == stamp
    assert json.loads(kept.read_text())["number"] == 0
    with pytest.raises(ValueError, match="of another study"):
        run(replace(COARSE, seed=8), folder, [0], workers=1)


@pytest.mark.slow
def test_the_interval_covers_the_truth(tmp_path: Path) -> None:
    n = 8
    found = run(COARSE, tmp_path / "study", list(range(n)), workers=1)
    said = summary(found)[M]
    assert said["answers"] == n
    # A binomial band: an interval that holds 95.45 % holds fewer than this once in a thousand studies.
    assert round(said["covered"] * n) >= binom.ppf(1e-3, n, NOMINAL)
    # Nor may it hold them by being long: were the errors half of what is said, chi-square over n would be a
    # quarter, and is below this once in a thousand studies of right intervals.
    z = [(one["value"][M] - one["truth"][M]) / one["sigma"][M] for one in found]
    assert chi2.ppf(1e-3, n) < np.square(z).sum() < chi2.ppf(1.0 - 1e-3, n)
