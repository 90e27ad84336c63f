"""Errors that neighbours and frames share, found in made epipolar distances whose size is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from dic.stereo.reconstruction import NONE, demeaned, shared_error

FloatArray = NDArray[np.float64]
SUBSET = 15
GRID = np.stack(np.meshgrid(np.arange(0.0, 180.0, 9.0), np.arange(0.0, 180.0, 9.0)), axis=-1).reshape(-1, 2)


def made(
    sigma: float, length: float, memory: float, *, own: float, n: int = 400, seed: int = 0
) -> FloatArray:
    """Distances of a shared error, an own one, and an offset of each place that all frames have."""
    rng = np.random.default_rng(seed)
    apart = np.linalg.norm(GRID[:, None] - GRID, axis=-1)
    root = np.linalg.cholesky(np.exp(-((apart / length) ** 2)) + 1e-6 * np.eye(len(GRID)))
    keep, state = np.exp(-1.0 / memory), root @ rng.standard_normal(len(GRID))
    found = np.empty((n, len(GRID)))
    for k in range(n):
        found[k] = state
        state = keep * state + np.sqrt(1.0 - keep**2) * (root @ rng.standard_normal(len(GRID)))
    return sigma * found + own * rng.standard_normal(found.shape) + 0.05 * rng.standard_normal(len(GRID))


@pytest.mark.parametrize("own", [0.0, 0.03])
def test_size_length_and_memory_are_found(own: float) -> None:
    distances = made(0.02, 45.0, 10.0, own=own)
    found = shared_error(distances, np.ones(distances.shape, dtype=bool), GRID, subset=SUBSET)
    # 400 frames of memory 10 are 20 independent ones of some 9 patches: 180 values know a standard deviation
    # to 5 %, a memory and a length to some 15 %; twice that
    assert found.sigma == pytest.approx(0.02, rel=0.12)
    assert found.length == pytest.approx(45.0, rel=0.3)
    assert found.memory == pytest.approx(10.0, rel=0.35)


def test_noise_of_the_points_alone_is_not_shared() -> None:
    rng = np.random.default_rng(1)
    distances = 0.02 * rng.standard_normal((200, len(GRID)))
    found = shared_error(distances, np.ones(distances.shape, dtype=bool), GRID, subset=SUBSET)
    assert found.sigma < 0.1 * 0.02


def test_points_that_are_lost_say_nothing() -> None:
    distances = made(0.02, 45.0, 10.0, own=0.01)
    valid = np.random.default_rng(2).random(distances.shape) > 0.3
    spoilt = np.where(valid, distances, np.nan)
    found = shared_error(spoilt, valid, GRID, subset=SUBSET)
    assert found.sigma == pytest.approx(0.02, rel=0.12)
    assert shared_error(spoilt[:, :5], valid[:, :5], GRID[:5], subset=SUBSET) is NONE
    assert shared_error(spoilt[:11], valid[:11], GRID, subset=SUBSET) is NONE


def test_what_the_mean_over_time_takes() -> None:
    """Two values of correlation r about their mean are -+ half their difference, of variance (1 - r) / 2."""
    r = np.exp(-1.0 / 3.0)
    np.testing.assert_allclose(demeaned(2, 3.0), [0.5 * (1.0 - r), -0.5 * (1.0 - r)])
    np.testing.assert_allclose(demeaned(5, 1e-3), [0.8, -0.2, -0.2, -0.2, -0.2])
    # Three values of correlations r and r²: with the means of the rows a, b, a and of all, the product of
    # neighbours is r - a - b + all
    a, b, whole = (1.0 + r + r**2) / 3.0, (1.0 + 2.0 * r) / 3.0, (3.0 + 4.0 * r + 2.0 * r**2) / 9.0
    np.testing.assert_allclose(demeaned(3, 3.0)[:2], [1.0 - whole, r - a - b + whole])


def test_a_short_record_has_all_of_the_error() -> None:
    """Eight records of eight memories each: their mean over time takes some 0.2 of the variance with it. 300
    independent values know the root mean square to 4 %."""
    records = [made(0.02, 45.0, 10.0, own=0.01, n=80, seed=seed) for seed in range(8)]
    sigmas = [shared_error(one, np.ones(one.shape, dtype=bool), GRID, subset=SUBSET).sigma for one in records]
    assert np.sqrt(np.mean(np.square(sigmas))) == pytest.approx(0.02, rel=0.07)


def test_what_ends_within_a_subset_is_not_continued_to_no_distance() -> None:
    """Errors over 7 px: at a subset's 15 px 1 % of their variance is left, and no more is said of them."""
    distances = made(0.02, 7.0, 10.0, own=0.0)
    found = shared_error(distances, np.ones(distances.shape, dtype=bool), GRID, subset=SUBSET)
    assert found.sigma < 0.4 * 0.02
