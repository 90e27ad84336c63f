"""The study of coverage with another program's truths: what it is given, what is kept, what is compared."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from populations import other_program
from populations.coverage import Study, truth_file
from populations.coverage_problem import HEIGHTS, drawn, stroke
from populations.truth_meshes import STEPS

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
