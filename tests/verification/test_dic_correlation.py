"""Subset matching on pictures of exact motion; figures and tolerances as on `dic_correlation.py`'s page."""

import dic_correlation as topic
import numpy as np
import pytest

from dic.correlation import Correlation, Shape

pytestmark = pytest.mark.slow  # 15 s


def test_bias_and_standard_deviation_of_the_pair() -> None:
    result = topic.case()
    assert result.floor == pytest.approx(7.7e-3, rel=0.01)
    for pair in result.pairs:
        assert pair.found == 1.0
        assert abs(pair.bias) < topic.BIAS
        if pair.settings.shape is Shape.AFFINE:
            assert pair.spread < topic.OVER_FLOOR * result.floor
    plain = {pair.motion for pair in result.pairs if pair.settings == Correlation()}
    assert plain == {"shift by 0.3 px", "stretch by 2 %"}


def test_no_estimate_beats_its_floor() -> None:
    result = topic.case()
    # 2000 independent subsets: 1.6 % of a standard deviation
    assert np.all(result.subset_spread > 0.97 * result.subset_floor)
    assert np.all(result.subset_spread < 1.3 * result.subset_floor)


def test_sigmas_are_calibrated() -> None:
    result = topic.case()
    for pair in result.pairs:
        assert abs(pair.normalised - 1.0) < topic.CALIBRATED
    assert np.all(np.abs(result.stretch_normalised - 1.0) < topic.COMPRESSED)


def test_s_curve() -> None:
    for bias in topic.case().s_curve.values():
        assert np.ptp(bias) < topic.S_CURVE


def test_a_template_read_between_pixels_is_not_biased_by_its_noise() -> None:
    assert abs(topic.case().update_bias) < topic.BIAS
    assert abs(topic.case().update_bias_untold) > 4 * topic.BIAS  # there is something to take out
