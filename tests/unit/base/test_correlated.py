"""Patterns of a correlated error against its covariance."""

import numpy as np
import pytest

from kolsky.pictures import shared_errors
from kolsky.pictures.shared_errors import error_patterns

TIME = np.repeat(1e-5 * np.arange(12), 9)
PLACE = np.tile(np.linspace(0.0, 6e-3, 9), 12)


def test_patterns_add_up_to_the_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_errors, "PATTERN_VARIANCE", 1.0)
    monkeypatch.setattr(shared_errors, "MOST_PATTERNS", 10_000)
    found, left = error_patterns(TIME, PLACE, sigma=2e-6, memory=4e-5, length=3e-3)
    # nodes of 0.75 mm are those of the places: nothing is interpolated
    dt, dy = np.abs(TIME[:, None] - TIME), PLACE[:, None] - PLACE
    expected = 4e-12 * np.exp(-dt / 4e-5) * np.exp(-((dy / 3e-3) ** 2))
    np.testing.assert_allclose(found.T @ found, expected, atol=1e-9 * 4e-12)
    assert left == pytest.approx(0.0, abs=1e-10)


def test_what_is_left_out_is_given_back() -> None:
    found, left = error_patterns(TIME, PLACE, sigma=2e-6, memory=4e-5, length=3e-3)
    assert len(found) < 40  # of 108
    np.testing.assert_allclose((found**2).sum(axis=0).mean() + left**2, 4e-12, rtol=1e-9)
    assert left**2 <= 0.05 * 4e-12 * 1.001


def test_refusals() -> None:
    with pytest.raises(ValueError, match="both must be > 0"):
        error_patterns(TIME, PLACE, sigma=1.0, memory=0.0, length=1.0)
    with pytest.raises(ValueError, match="0 data"):
        error_patterns(TIME[:0], PLACE[:0], sigma=1.0, memory=1.0, length=1.0)
