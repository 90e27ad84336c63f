"""`kolsky waves` on a flyer test: the shipped shot, from files to files."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky
from shot_folders import shot_in
from synthetic import LENGTH
from synthetic_dic import synthetic_result

from dic.outcome import PointOutcome
from kolsky.pictures.summary import flyer_problem

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def reduced(tmp_path_factory) -> tuple[Path, dict]:
    out = tmp_path_factory.mktemp("flyer")
    return out, json_of("waves", ROOT / "runs" / "open-01", "--out", out)


def test_the_soft_shot_has_no_valid_classical_curve_and_says_so(reduced):
    _, said = reduced
    assert said["valid"] is None
    assert "inverse method" in said["validity"]
    assert any("kolsky identify" in remark for remark in said["remarks"])


def test_clocks_and_full_speed(reduced):
    _, said = reduced
    # facts.json: "camera frame times and scope times are on one clock".
    assert "agrees" in said["synchronisation"]
    events = {event["name"]: event for event in said["events"]}
    assert events["full speed"]["time"] == pytest.approx(87e-6, abs=15e-6)  # the ramp of v(t) ends there
    assert events["arrest"]["time"] is None
    assert "still moves" in events["arrest"]["how"]


def test_forces_agree_where_the_specimen_is_nearly_balanced(reduced):
    """Front and back force, from two transducers of tenfold different sensitivity, late in the test."""
    out, said = reduced
    with h5py.File(out / "waves.h5") as file:
        part = file["entry/reduction"]
        time, front, back = (part[name][()] for name in ("time", "front_force", "back_force"))
        assert file["entry/validity/imbalance"].size > 50
    late = time > time[-1] - 0.3e-3
    # Waves of +-2 N run through the specimen: over three of their periods they average out to 10 % of that,
    # and half the specimen's inertia under -20 m/s^2 is far below.
    assert np.mean(front[late]) == pytest.approx(np.mean(back[late]), abs=0.5)
    mass = next(c for c in said["corrections"] if c["key"] == "mass")
    # 7.1 g at the largest acceleration of some 1e5 m/s^2.
    assert mass["applied"]
    assert mass["size"] == pytest.approx(7.1e-3 * 1.0e5, rel=0.1)


def test_without_the_flyers_transducer_there_is_one_force(shot):
    text = (shot / "shot.toml").read_text()
    begin, end = text.index("[incident_force]"), text.index("[frames]")
    (shot / "shot.toml").write_text(text[:begin] + text[end:])
    said = json_of("waves", shot)
    assert said["synchronisation"] is None
    assert said["valid"] is None
    assert said["balanced"] is None
    assert "not known" in said["validity"]
    assert set(said["results"]) == {"largest strain", "back stress there"}
    assert not any(c["key"] == "mass" for c in said["corrections"])


def test_a_clipped_incident_channel_is_refused(tmp_path):
    folder = shot_in(tmp_path / "shot", ('mass = "7.1 g"', 'full_scale = "0.5 V" \nmass = "7.1 g"'))
    result = run_kolsky("waves", folder, code=2)
    assert "CH1 incident (V)" in result.stderr
    assert "incident_force.full_scale = 0.5 V" in result.stderr
    lines = (folder / "scope.csv").read_text().splitlines()
    first = next(n for n, row in enumerate(lines[1:], start=2) if abs(float(row.split(",")[1])) >= 0.5)
    assert f"scope.csv line {first}:" in result.stderr.replace("\n", " ")
    assert not (folder / "results").exists()


@pytest.fixture(scope="module")
def result():
    return replace(synthetic_result(), axial_displacement=None, motion=None)


def late(result, first: int):
    """Both cameras see the flyer from a frame on."""
    outcome = result.flyer.surface.outcome.copy()
    outcome[:first] = int(PointOutcome.OUT_OF_VIEW)
    surface = replace(result.flyer.surface, outcome=outcome)
    return replace(result, flyer=replace(result.flyer, surface=surface))


def with_lower_end(result, sigma: float):
    """The lower end is known to so much [m]."""
    covariance = np.diag([0.0, 0.0, 0.0, 0.0, sigma**2, 0.0])
    frame = replace(result.placement.frame, covariance=covariance)
    return replace(result, placement=replace(result.placement, frame=frame))


def test_a_flyer_that_no_two_cameras_see(result):
    for none in (replace(result, flyer=None), late(result, len(result.t))):
        problem, cure = flyer_problem(none, LENGTH, 0.0)
        assert "no point that both cameras see" in problem
        assert "crop_offset" in cure


@pytest.mark.parametrize(
    ("rows", "subset", "fitting"),
    [(16, 29, 15), (15, 29, 15), (21, 23, 21), (6, 29, 11), (16, 15, None), (40, 29, None), (6, 11, None)],
)
def test_a_strip_that_is_narrower_than_a_subset_asks_for_a_smaller_one(result, rows, subset, fitting):
    """The largest odd number of pixels that the region is across, 11 at least, if that is smaller."""
    strip = [[93, 0], [191, 0], [191, rows - 1], [93, rows - 1]]
    none = replace(result, flyer=None, facts={**result.facts, "regions": {"flyer": strip}})
    _, cure = flyer_problem(none, LENGTH, 0.0, subset)
    first = "declare a region" if fitting is None else f"set `subset = {fitting}` in [dic]"
    assert cure.startswith(first)
    assert "declare a region that both cameras see" in cure


def test_a_length_that_is_not_known_well_enough(result):
    # 0.25 % of the length is allowed: 16 um; 3 and 4 in quadrature are 5
    seen = with_lower_end(late(result, 22), 0.8 * 0.0025 * LENGTH)
    problem, cure = flyer_problem(seen, LENGTH, 0.6 * 0.0025 * LENGTH * 1.01)
    assert "frame 22" in problem
    assert f"allowed {2.5e3 * LENGTH:.1f} um" in problem
    assert "uncertainty.specimen_length" in cure
    problem, _ = flyer_problem(seen, LENGTH, 0.6 * 0.0025 * LENGTH * 0.99)
    assert "rim of its face" in problem


def test_a_rim_that_is_not_clear(result):
    problem, cure = flyer_problem(with_lower_end(late(result, 15), 1e-6), LENGTH, 1e-6)
    assert problem.startswith("is first seen by both cameras in frame 15")
    assert "2 to 8 pixels" in cure
