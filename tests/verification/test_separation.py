"""Separation of overlapping waves; figures and tolerances as on the page (`separation.py`)."""

import pytest
import separation as topic

pytestmark = pytest.mark.slow  # forty separations


def test_overlapping_waves_are_told_apart() -> None:
    result = topic.case()
    for name, errors in result.errors.items():
        assert max(errors) < topic.TARGET, name
        assert result.overlap[name] > 50e-6


def test_sigma_is_the_scatter() -> None:
    for name, ratio in topic.case().ratio.items():
        assert ratio == pytest.approx(1.0, abs=topic.SCATTER_TOLERANCE), name


def test_a_third_gauge_lowers_the_noise_and_shows_a_wrong_gain() -> None:
    result = topic.case()
    assert result.sigma["three gauges"].max() < result.sigma["two gauges"].max()
    assert max(result.misfit) < 1.1  # three gauges, two waves: each misfit is between 0 and 1
    assert max(result.wrong) > 2.0
