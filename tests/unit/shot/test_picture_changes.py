"""When pictures begin to change, against pictures whose difference is known."""

import numpy as np
import pytest

from dic.images.series import PicturesInMemory
from kolsky.pictures.picture_set import MOST_COMPARED, picture_changes


def series(levels: list[int]) -> PicturesInMemory:
    """Even pictures of 10 bits with given grey values."""
    return PicturesInMemory(tuple(np.full((4, 5), level, np.uint16) for level in levels), bits=10)


def test_change_is_relative_to_white_and_to_the_first_picture() -> None:
    time = 1e-6 * np.arange(5.0)
    found = picture_changes((series([100, 100, 90, 200, 1023]), series([7, 7, 7, 7, 8])), time, 2)
    np.testing.assert_allclose(found.change[0], np.array([0.0, 0.0, 10.0, 100.0, 923.0]) / 1023.0, rtol=1e-12)
    np.testing.assert_allclose(found.change[1], np.array([0.0, 0.0, 0.0, 0.0, 1.0]) / 1023.0, rtol=1e-12)
    assert found.rest_end == time[1]
    assert [at for at, _ in found.shown] == [time[0], time[1], time[4]]
    assert [float(picture[0, 0]) for _, picture in found.shown] == pytest.approx(
        [100 / 1023, 100 / 1023, 1.0], rel=1e-12
    )


def test_a_long_series_is_compared_at_equal_distances_to_its_end() -> None:
    n = 3 * MOST_COMPARED
    time = np.arange(float(n))
    pictures = series([0] * (n - 1) + [1023])
    found = picture_changes((pictures, pictures), time, 1)
    assert found.time.size == MOST_COMPARED
    assert found.time[-1] == time[-1]
    assert found.change[0, -1] == 1.0
    assert len(found.shown) == 2  # the first frame is the last static one
