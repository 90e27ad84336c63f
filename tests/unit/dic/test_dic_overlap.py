"""Correlation of points whose subsets overlap: of pairs that do, and in memory that grows with the points."""

import tracemalloc

import numpy as np

from dic.correlation.subsets import overlap_correlation, overlap_factor, overlap_matrix


def _grid(columns: int, rows: int, step: float = 6.0) -> np.ndarray:
    return step * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)


def test_pairs_hold_the_common_area_and_both_points_of_a_pair_have_it():
    # 20 px squares: beside (6, 0) 14/20, below (0, 12) 8/20, diagonal (6, 12) their product, (24, 0) nothing
    points = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 12.0], [24.0, 0.0]])
    expected = np.array(
        [[1.0, 0.7, 0.4, 0.0], [0.7, 1.0, 0.28, 0.1], [0.4, 0.28, 1.0, 0.0], [0.0, 0.1, 0.0, 1.0]]
    )
    found = overlap_matrix(points, 20.0)
    np.testing.assert_allclose(found.toarray(), expected, atol=1e-15)
    assert found.nnz == 4 + 2 * 4  # none of the pairs that share nothing


def test_pairs_agree_with_all_distances_of_scattered_points():
    points = np.random.default_rng(3).uniform(0.0, 120.0, (300, 2))
    whole = overlap_correlation(points, points, 25.0)
    np.testing.assert_allclose(overlap_matrix(points, 25.0).toarray(), whole, atol=1e-15)
    np.testing.assert_allclose(overlap_factor(points, 25.0), whole.sum(axis=1), rtol=1e-13)


def test_memory_grows_with_the_points_and_not_with_their_square():
    peaks = []
    for rows in (100, 200):
        points = _grid(100, rows)
        tracemalloc.start()
        overlap_factor(points, 25.0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2.5 * peaks[0]  # twice the points; the square would be four times
    assert peaks[1] < 20_000 * 5000  # bytes: a point has 80 neighbours, of all points 160 kB
