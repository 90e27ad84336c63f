"""Where a body is across the axis while one camera alone sees it: by the frames that both saw."""

import numpy as np
import pytest

from dic.bodies.axial_displacement import LATERAL_SIGMA, LEAST_LATERAL, lateral_places

T = 1e-5 * np.arange(120)
PIXEL = 4e-5


def moved(speed: float, noise: float) -> np.ndarray:
    """Both cameras see frames 40 and on; the body drifts along x, its Z is known to `noise`."""
    moves = np.full((120, 3), np.nan)
    moves[40:] = 0.0
    moves[40:, 0] = speed * T[40:]
    moves[40:, 2] = noise * np.where(np.arange(80) % 2, 1.0, -1.0)
    return moves


def test_a_body_that_does_not_drift_is_where_it_is_seen() -> None:
    place, sigma, own = lateral_places(T, moved(0.0, 1e-6), np.full(120, 50), PIXEL)
    np.testing.assert_allclose(place, 0.0, atol=1e-18)
    np.testing.assert_allclose(sigma[30:40], LEAST_LATERAL * PIXEL)
    np.testing.assert_allclose(own, [0.0, 1e-6 * np.sqrt(80 / 78)], rtol=1e-3, atol=1e-18)


def test_a_drift_widens_with_the_time_to_the_mean_of_the_nearest() -> None:
    """0.02 m/s: frame 0 is 495 us before the mean of frames 40 to 59, 9.9 um; nothing scatters."""
    place, sigma, _ = lateral_places(T, moved(0.02, 0.0), np.full(120, 50), PIXEL)
    assert place[0, 0] == pytest.approx(0.02 * 49.5e-5)
    assert sigma[0] == pytest.approx(0.02 * 49.5e-5, rel=1e-6)
    _, fast, _ = lateral_places(T, moved(1.0, 0.0), np.full(120, 50), PIXEL)
    assert fast[0] == pytest.approx(LATERAL_SIGMA * PIXEL)


def test_the_scatter_and_what_it_hides_of_the_drift() -> None:
    """Z alternates by 10 um: its scatter is that times sqrt(80 / 78), and twice the slope's own deviation
    counts, sigma / sqrt(sum of squared times), beside the slope that the alternation gives."""
    noise = 1e-5
    _, sigma, own = lateral_places(T, moved(0.0, noise), np.full(120, 7), PIXEL)
    since = T[40:] - T[40:].mean()
    z = moved(0.0, noise)[40:, 2]
    slope = since @ z / (since @ since)
    scatter = np.sqrt(np.sum((z - z.mean() - slope * since) ** 2) / 78)
    speed = abs(slope) + 2.0 * scatter / np.sqrt(since @ since)
    assert sigma[0] == pytest.approx(speed * 49.5e-5, rel=1e-9)
    assert own[1] == pytest.approx(scatter, rel=1e-9)


def test_frames_with_few_points_count_little() -> None:
    moves, counts = moved(0.0, 0.0), np.full(120, 100)
    moves[40, 2], counts[40] = 2e-5, 1
    place, _, _ = lateral_places(T, moves, counts, PIXEL)
    assert place[0, 1] == pytest.approx(2e-5 / 1901)
    _, few, _ = lateral_places(T[:45], moves[:45], counts[:45], PIXEL)
    np.testing.assert_allclose(few, LATERAL_SIGMA * PIXEL)
