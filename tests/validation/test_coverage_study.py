"""The reduced study of coverage: checks of the experiments, and identification of a dozen of them."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2

from populations import other_program
from populations.coverage import NOMINAL, Study, _free, run, summary, table, truth_file
from populations.coverage_problem import (
    FORCE_SIGMA,
    GROUP,
    HEIGHTS,
    NOISE,
    drawn,
    experiment,
    middle,
    stroke,
    template,
    velocity,
)
from populations.truth_meshes import STEPS

M = "stiffness_factor"


def _found(error: float, sigma: float, number: int = 0) -> dict[str, Any]:
    one = {M: sigma}
    routes = {"force only": {M: [1.1 + 1.9 * error, sigma]}}
    return {
        "number": number,
        "truth": {M: 1.1},
        "value": {M: 1.1 + error},
        "sigma": one,
        "correction": {M: -0.004},
        "parts": {M: {"mesh": sigma}},
        "routes": routes,
        "profile": {M: [1.1 + error - sigma, 1.1 + error + sigma]},
        "outcome": "identified",
        "warnings": [],
        "figures": {},
        "seconds": 0.0,
    }


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
    with pytest.raises(ValueError, match="48 of the identification"):
        Study(free=(M,), truth_mesh=(64, 86))


def test_a_truth_is_the_middle_of_both_elements() -> None:
    force, Z = np.array([3.0, 5.0]), np.array([6e-3, 7e-3])
    found = middle((force + 0.1, Z - 1e-4), (force - 0.1, Z + 1e-4))
    np.testing.assert_allclose(found[0], force, rtol=1e-12)
    np.testing.assert_allclose(found[1], Z, rtol=1e-12)


COARSE = Study(free=(M,), mesh=(16, 22), refined_mesh=(24, 32), truth_mesh=(36, 48), seed=7)


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


@pytest.mark.long
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


SETUP, TRUTH = drawn(11, 3)
STUDY = Study(free=tuple(STEPS), seed=3)
PROGRAM = """
import json, sys
import numpy as np
given = json.load(open(sys.argv[1]))
np.savez(sys.argv[2], force=np.array(given["samples"]), Z=np.array([given["damping"], float(sys.argv[4])]))
with open(sys.argv[1] + ".runs", "a") as file:
    file.write("run ")
"""


def test_two_of_every_group_and_all_groups_first() -> None:
    assert other_program.numbers_of(3) == [0, 10, 20, 1, 11, 21]


def test_what_the_other_program_is_given() -> None:
    """Everything that the exact course depends on, no noise, in SI; frames of the motion alone."""
    said = json.loads(json.dumps(other_program.described(SETUP, TRUTH)))
    assert (said["diameter"], said["length"], said["density"]) == (
        SETUP.diameter,
        SETUP.length,
        SETUP.density,
    )
    for name in ("stiffness_factor", "poisson", "damping", "shear_modulus", "second", "third", "drag"):
        assert said[name] == getattr(TRUTH, name)
    assert not {"friction", "force_sigma", "outline_sigma"} & set(said)
    assert (len(said["frames"]), said["frames"][-1], min(said["frames"]) > 0.0) == (160, SETUP.end, True)
    again = replace(TRUTH, **{k: said[k] for k in ("speed", "rise", "start_power", "end_power", "drag")})
    at = np.array(said["frames"])
    np.testing.assert_array_equal(stroke(at, SETUP, again), stroke(at, SETUP, TRUTH))


def test_a_truth_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM, encoding="utf-8")
    monkeypatch.setattr(other_program, "SCRIPT", script)
    for _ in range(2):
        other_program.make_truth(STUDY, tmp_path / "answers", 11, sys.executable)
    place = truth_file(STUDY, tmp_path / "answers", 11)
    with np.load(place) as stored:
        np.testing.assert_array_equal(stored["force"], SETUP.samples)
        np.testing.assert_array_equal(stored["Z"], [TRUTH.damping, 24.0])
    assert place.with_suffix(".json.runs").read_text() == "run "
    assert not list(place.parent.glob("*.part*"))


def test_means_of_sixteen_samples() -> None:
    """0 to 15 have the mean 7.5, 16 to 31 that of 23.5; the last three are no bin."""
    np.testing.assert_allclose(other_program.binned(np.arange(35.0)), [7.5, 23.5])
    assert other_program.binned(np.ones((32, 3))).shape == (2, 3)


def test_thinned() -> None:
    """Force t at samples 1 to 40 of two rows: means of 1 to 20 and of 21 to 40; frames 8 and 16."""
    n = len(HEIGHTS)
    rows = other_program.thinned(np.arange(41.0), np.arange(16.0 * n))
    np.testing.assert_array_equal(rows[:, 0], [10.5, 30.5])
    np.testing.assert_array_equal(rows[:, 1], [7.0 * n, 15.0 * n])
    assert rows.shape == (2, 1 + n)


def test_a_shift_of_the_parameters_is_found() -> None:
    """Force and outline linear in the three; the force is off by one more sigma in every second bin."""
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(320, 3)) * [1.0, 1e3, 1e5], 1e-3 * rng.normal(size=(50, 3)) * [1.0, 1e3, 1e5]
    shift = np.array([0.01, -2e-6, 3e-7])
    here = slope[0] @ shift, slope[1] @ shift
    found = other_program.apart(here, (0.0 * here[0], 0.0 * here[1]), slope, TRUTH)
    assert [found[name] for name in STEPS] == pytest.approx(shift.tolist(), rel=1e-9)  # rounding
    assert found["outline rms (um)"] == pytest.approx(1e6 * np.sqrt(np.mean(here[1] ** 2)))
    jagged = TRUTH.force_sigma * np.repeat([1.0, -1.0] * 10, 16)
    assert other_program.apart((jagged, here[1]), (0.0 * jagged, here[1]), slope, TRUTH)[
        "force rms over sigma"
    ] == pytest.approx(1.0)


def test_force_and_outline_weigh_as_their_noise() -> None:
    """A parameter seen by a bin of the force as 1, by a point as 3: the mean with weights 1 / sigma^2."""
    truth = replace(TRUTH, force_sigma=4.0, outline_sigma=2.0)  # of a bin's mean 4 / sqrt(16) = 1
    force_slope, outline_slope = np.zeros((48, 3)), np.zeros((3, 3))
    force_slope[:16, 0], force_slope[16:32, 1], force_slope[32:, 2] = 1.0, 1.0, 1.0
    outline_slope[0, 0] = 1.0
    one = np.repeat([1.0, 0.0, 0.0], 16), np.array([3.0, 0.0, 0.0])
    zero = np.zeros(48), np.zeros(3)
    found = other_program.apart(one, zero, (force_slope, outline_slope), truth)
    assert found["stiffness_factor"] == pytest.approx((1.0 / 1.0 + 3.0 / 4.0) / (1.0 + 1.0 / 4.0))
