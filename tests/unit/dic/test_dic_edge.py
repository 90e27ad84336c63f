"""The end of a speckled side found in rendered pictures whose edge is known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from dic.bodies.ends import find_edge

FINE = 10


def picture(edge: float, *, band: float = 0.5, seed: int = 1) -> np.ndarray:
    """Rows of speckle above `edge`, a dark band, an even platen below: integrated over pixels, with noise."""
    rng = np.random.default_rng(seed)
    size = 64 * FINE
    speckle = gaussian_filter(rng.normal(0.0, 1.0, (size, size)), 1.8 * FINE)
    speckle = 1500.0 + 900.0 * np.tanh(1.5 * speckle / speckle.std())
    y = (np.arange(size) + 0.5) / FINE - 0.5
    fine = np.where((y < edge)[:, None], speckle, np.where((y < edge + band)[:, None], 500.0, 1000.0))
    fine = gaussian_filter(fine, 0.45 * FINE)
    coarse = fine.reshape(64, FINE, 64, FINE).mean(axis=(1, 3))
    return coarse + rng.normal(0.0, 8.0, coarse.shape)


@pytest.mark.parametrize("edge", [39.7, 40.0, 40.45])
@pytest.mark.parametrize("seed", [1, 2])
def test_an_edge_is_found_within_its_sigma(edge, seed):
    found = find_edge(picture(edge, seed=seed), (31.0, 40.6), (0, -1))
    assert found is not None
    # Edge and band are told apart by how columns differ alone; three sigma as stated.
    assert 40.6 - found.offset == pytest.approx(edge, abs=0.3)
    assert 0.1 <= found.sigma < 0.2


@pytest.mark.parametrize(
    ("turn", "place", "inward"),
    [
        (lambda p: p[::-1], (31.0, 63.0 - 40.2), (0, 1)),
        (lambda p: p.T, (40.2, 31.0), (-1, 0)),
        (lambda p: p.T[:, ::-1], (63.0 - 40.2, 31.0), (1, 0)),
    ],
)
def test_every_side_is_alike(turn, place, inward):
    upright = picture(40.0)
    one = find_edge(upright, (31.0, 40.2), (0, -1))
    other = find_edge(turn(upright), place, inward)
    assert one is not None
    assert other is not None
    assert other.offset == pytest.approx(one.offset, abs=1e-6)


def test_no_edge_is_none():
    even = picture(200.0)  # speckle all over
    assert find_edge(even, (31.0, 30.0), (0, -1)) is None
    assert find_edge(picture(40.0), (31.0, 61.0), (0, -1)) is None  # the picture ends there
    assert find_edge(picture(40.0), (31.0, 46.0), (0, -1)) is None  # the edge is six pixels away
