"""Synthetic shots by the commands: `virtual make` makes them; they are identified with a relaxation test.

Small meshes: `python -m populations.joint_coverage` counts on the meshes of an answer (docs/validation).
"""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky

from populations.joint_coverage import SLOW_SIGMA, Study, relaxation_test

PLANTED = {
    "stiffness_factor": 1.1, "poisson": 0.4985, "damping": 25e-6, "prony_strength_1": 0.35,
    "prony_time_1": 4e-4,
}  # fmt: skip
SPEC = """format = 1
name = "gel"
seed = 20
[material]
stiffness_factor = 1.1
poisson = 0.4985
[motion]
compression = "40 %"
[truth]
mesh = [48, 65]
grading = 5
element = "middle"
[population]
shots = 3
[population.draw]
"motion.speed" = { low = "1.2 m/s", high = "3.5 m/s" }
"""
RELAXING = """[relaxation]
kind = "prony"
strengths = [0.35]
times = ["400 us"]
"""
SLOW_TESTS = """format = 1
[test.held]
kind = "relaxation"
file = "held.csv"
time = { column = "time (s)", unit = "s" }
stress = { column = "stress (Pa)", unit = "Pa" }
strain = "20 %"
rise = "50 us"
branch = "compression"
convention = "tension positive"
relative_sigma = "0 %"
sigma_floor = "50 Pa"
"""
MESHES = ["--mesh", "16x22", "--refined-mesh", "32x44"]


def identified(folder: Path, *, elastic: bool) -> dict[str, Any]:
    """What the commands say of three shots and a relaxation test."""
    folder.mkdir()
    (folder / "SPEC.toml").write_text(SPEC if elastic else SPEC + RELAXING)
    (folder / "slow.toml").write_text(SLOW_TESTS)
    study = Study(elastic=elastic, seed=20)
    held = relaxation_test(study, PLANTED, 0)
    seen = np.isfinite(held.sigma)  # the ramp is none of the data
    rows = zip(held.time[seen], held.stress[seen], strict=True)
    table = "".join(f"{t:.9e},{stress:.6f}\n" for t, stress in rows)
    (folder / "held.csv").write_text(f"time (s),stress (Pa)\n{table}")
    assert SLOW_SIGMA == 50.0  # as the list says
    run_kolsky("virtual", "make", folder / "SPEC.toml", "--out", folder / "shots")
    shots = sorted(str(one.parent) for one in (folder / "shots").glob("*/shot.toml"))
    assert len(shots) == 3
    slow = ["--slow-tests", str(folder / "slow.toml"), "--relaxation", "prony"]
    run_kolsky("identify", *shots, *slow, *MESHES, "--out", folder / "joint", "--json")
    return dict(json.loads((folder / "joint" / "joint.json").read_text("utf-8")))


@pytest.mark.long  # 95 s of one core
def test_strength_and_time_are_found_by_the_command(tmp_path: Path) -> None:
    found = identified(tmp_path / "relaxing", elastic=False)
    assert found["model_choice"]["asked_for"]
    assert "long-term curve" in found["reference_curve"]
    estimates = found["estimates"]
    assert estimates.keys() == PLANTED.keys()
    for name, true in PLANTED.items():
        e = estimates[name]
        assert e["outcome"] == "identified", name
        # One of five exact intervals of k = 2 misses in a fifth of all tests, of k = 3 in one of 75; how
        # often is counted by the study on the default meshes. With patterns made anew at the refined optimum
        # m, nu, beta, strength and time are -0.04, -0.01, 0.03, 0.72, -0.20 off; without, up to 3.1.
        assert abs(e["value"] - true) < 3.0 * e["sigma"], name
        assert e["sigma"] < 0.1 * true, name
    assert np.isfinite(found["slow_tests"]["held"])


@pytest.mark.long  # 95 s of one core
def test_an_elastic_material_stays_one(tmp_path: Path) -> None:
    found = identified(tmp_path / "elastic", elastic=True)
    assert not found["model_choice"]["asked_for"]
    # One right model in a hundred is below; with directions out of step it was 23 of 36.
    assert found["model_choice"]["probability"] > 0.01
    assert "do not need relaxation" in " ".join(found["warnings"])
    for name in ("prony_strength_1", "prony_time_1"):
        assert found["estimates"][name]["outcome"] == "not seen by the data"
    assert found["model_choice"]["elastic"]["stiffness_factor"] == pytest.approx(1.1, rel=0.01)


@pytest.mark.long  # 50 s of one core
def test_one_relaxing_shot_identified_as_an_elastic_one_recommends_to_try_it(tmp_path: Path) -> None:
    """The same shot with and without a branch; the first one's file is made to say nothing of it."""
    said = []
    for name, text in (("relaxing", SPEC + RELAXING), ("elastic", SPEC)):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "SPEC.toml").write_text(text)
        make = ["virtual", "make", str(folder / "SPEC.toml"), "--out", str(folder / "shots")]
        run_kolsky(*make, "--only", "1")
        (file,) = (folder / "shots").glob("*/shot.toml")
        file.write_text(re.sub(r"\[relaxation\]\n([^\[].*\n|\n)*", "", file.read_text("utf-8")))
        words = ["identify", str(file.parent), *MESHES, "--out", str(folder / "out")]
        said.append(" ".join(json_of(*words)["warnings"]))
    assert "identify again with --relaxation prony" in said[0]
    assert "--relaxation prony" not in said[1]
