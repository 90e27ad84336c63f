"""Bias of the renderer; figures and tolerances as on the page (`renderer.py`)."""

import numpy as np
import pytest
import renderer as topic

pytestmark = pytest.mark.slow  # 12 s


def test_waves_on_a_board_are_their_integral_over_the_pixels() -> None:
    result = topic.case()
    assert np.abs(result.waves).max() < topic.ALLOWED
    assert result.grey < 0.01  # 4 rays a pixel


def test_a_surface_is_where_an_independent_ray_cast_has_it() -> None:
    result = topic.case()
    assert len(result.surface) > 100
    assert np.abs(result.surface).max() < topic.ALLOWED
    assert np.abs(result.surface.mean(axis=0)).max() < topic.ALLOWED / 10.0


def test_two_correlations_find_the_shift() -> None:
    result = topic.case()
    assert np.abs(result.subsets).max() < topic.ALLOWED
    # linear interpolation: right at whole pixels, symmetric between them, up to 0.02 px off at quarters
    assert np.abs(result.peer[[0, 5, 10]]).max() < topic.ALLOWED
    assert np.abs(result.peer).max() < 0.02
