"""How far the outline departs from the surface beside its strip, in closed form."""

from types import MappingProxyType

import numpy as np
import pytest

from dic.outcome import PointOutcome
from dic.surfaces.outline import beyond_noise, departures
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory

HALF = 0.5e-3
ACROSS = 0.25e-3 * np.arange(-8, 9)
HEIGHTS = 0.25e-3 * np.arange(1, 9)
R, SLOPE, BUMP, ASIDE, LEAN = 5e-3, 0.1, 7e-6, 20e-6, 0.2
"""Radius at y = 0, its slope; what is added within the strip, to the right and from the left beside it, and
how much higher a column to the right stands in the grid."""


def surface(valid=None) -> SurfaceHistory:
    x, y = (a.ravel() for a in np.meshgrid(ACROSS, HEIGHTS))
    y = y + LEAN * np.abs(x)  # rows of the grid are bent
    side = np.where(np.abs(x) > 1.2 * HALF, np.sign(x), 0.0)
    radius = R + SLOPE * y + ASIDE * side + BUMP * (side == 0.0)
    X = np.stack([x, y, np.sqrt(radius**2 - x**2)], axis=1)
    n = len(X)
    outcome = np.full((1, n), int(PointOutcome.VALID))
    if valid is not None:
        outcome[0, ~valid(x, y)] = int(PointOutcome.LOW_CORRELATION)
    return SurfaceHistory(np.zeros(1), X, np.zeros((1, n, 3)), np.full((1, n, 3), 3e-6), outcome)


def grid() -> np.ndarray:
    i, j = np.meshgrid(np.arange(ACROSS.size), np.arange(HEIGHTS.size))
    return np.stack([4.0 * i.ravel(), -4.0 * j.ravel()], axis=1)


def line(heights) -> CentrePoints:
    y = np.asarray(heights)
    n = y.size
    zero = np.zeros(n, dtype=np.int64)
    return CentrePoints(np.zeros(n), zero, y, R + SLOPE * y + BUMP, np.full(n, 4e-6), MappingProxyType({}))


def test_a_bump_of_the_strip_is_what_departs():
    """The axis off to one side cancels, a radius that changes along the axis is met at the same height, and
    heights that no row beside the strip encloses are not known."""
    # beside the strip lie the columns from 0.75 to 1.75 mm, whose mean height is 0.25 mm above the middle
    heights = np.array([0.45e-3, 0.55e-3, 1.2e-3, 2.2e-3, 2.3e-3])
    found, sigma = departures(surface(), grid(), line(heights), half_width=HALF)
    np.testing.assert_array_equal(np.isfinite(found), [False, True, True, True, False])
    np.testing.assert_allclose(found[1:4], BUMP, atol=1e-9)
    np.testing.assert_allclose(sigma[1:4], np.hypot(4e-6, 3e-6 / 2**0.5))  # two sides of 3 µm each


@pytest.mark.parametrize(
    "valid",
    [
        lambda x, y: x > -0.6e-3,  # one side alone
        lambda x, y: (np.abs(x) < 0.6e-3) | (np.abs(x) > 1.6e-3),  # one point a row on each
        lambda x, y: (np.abs(x) < 0.6e-3) | (y < 0.7e-3),  # two rows at most
    ],
)
def test_too_little_beside_the_strip_tells_nothing(valid):
    found, sigma = departures(surface(valid), grid(), line([0.6e-3]), half_width=HALF)
    assert np.isnan(found).all()
    assert np.isnan(sigma).all()


def test_what_noise_explains_is_taken_off():
    """Twice the noise: the mean square over it is 4, three quarters of which are beyond it."""
    departure, sigma = np.array([6e-6, -6e-6, np.nan]), np.array([3e-6, 3e-6, np.nan])
    share = 0.75**0.5
    np.testing.assert_allclose(beyond_noise(departure, sigma), [6e-6 * share, -6e-6 * share, 0.0])
    assert not beyond_noise(0.5 * departure, sigma).any()
    assert not beyond_noise(np.full(2, np.nan), sigma[:2]).any()
    assert not beyond_noise(np.zeros(2), sigma[:2]).any()
