"""Why a flyer's displacement is not known: the reason and its cure, by what the pictures gave."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import LENGTH
from synthetic_dic import synthetic_result

from dic.outcome import PointOutcome
from kolsky.pictures.summary import flyer_problem


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
