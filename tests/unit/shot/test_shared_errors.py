"""The effect of a mean on a shared error in closed form, in the outline and the flyer."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dic.stereo.reconstruction import SharedError
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.pictures import shared_errors
from kolsky.pictures.shared_errors import (
    PictureErrors,
    mean_over_time,
    outline_offsets,
    variance_of_mean,
    with_departures,
    with_flyer_errors,
    with_outline_errors,
)

ERRORS = PictureErrors(SharedError(0.02, 50.0, 8.0), 0.015, 3e-6, 5e-5, 1e-5)
T = 1e-5 * np.arange(4)


def result() -> Any:
    """Two points 30 px apart, one of the flyer's lost in frame 2 and both in frame 3 of camera 0; two frames
    at rest."""
    points = np.array([[0.0, 0.0], [30.0, 0.0]])
    seen = np.ones((4, 2), dtype=bool)
    pixels = [np.zeros((4, 2, 2)), np.zeros((4, 2, 2))]
    pixels[0][3] = pixels[0][2, 1] = np.nan
    covariance = np.diag([0.0, 0.0, 0.0, 0.0, 4e-12, 1e-12])
    return SimpleNamespace(
        t=T,
        static=np.array([True, True, False, False]),
        specimen=SimpleNamespace(points=points, surface=SimpleNamespace(valid=seen)),
        flyer=SimpleNamespace(points=points, pixels=pixels),
        placement=SimpleNamespace(frame=SimpleNamespace(covariance=covariance)),
    )


def test_means_of_two() -> None:
    """The mean of two values of correlation r has the variance (1 + r) / 2."""
    r = np.exp(-0.36)
    assert variance_of_mean(np.array([[0.0, 0.0], [30.0, 0.0]]), 50.0) == pytest.approx(0.5 * (1.0 + r))
    assert mean_over_time(2, 8.0) == pytest.approx(0.5 * (1.0 + np.exp(-0.125)))
    assert mean_over_time(1, 8.0) == 1.0


def test_the_flyer_has_the_mean_of_two_cameras() -> None:
    motion = with_flyer_errors(FlyerMotion(T, np.zeros(4), np.full(4, 1e-8)), result(), ERRORS)
    two = 0.5 * (1.0 + np.exp(-0.36))  # variance of the mean of two points
    share = np.array([0.25 * (two + two), 0.25 * (two + two), 0.25 * (two + 1.0), two])
    assert motion.shared_sigma is not None
    np.testing.assert_allclose(motion.shared_sigma, 5e-5 * 0.015 * np.sqrt(share))
    assert motion.shared_memory == pytest.approx(8e-5)


def test_the_outline_has_all_of_its_variance() -> None:
    line = CentreLine(T, np.arange(4), np.full(4, 1e-3), np.full(4, 5e-3), np.full(4, 1e-6))
    found = with_outline_errors(line, result(), ERRORS)
    assert found.modes is not None
    whole = (found.modes**2).sum(axis=0) + found.sigma**2
    np.testing.assert_allclose(whole.mean(), 9e-12 + 1e-12, rtol=1e-9)


def test_offsets_of_the_frame() -> None:
    """The lower end's sigma along y; along Z the fit's own, and the mean over two points and two frames."""
    share = 0.25 * (1.0 + np.exp(-0.36)) * (1.0 + np.exp(-0.125))
    found = outline_offsets(result(), ERRORS)
    assert found["y_offset"] == pytest.approx(2e-6)
    assert found["Z_offset"] == pytest.approx(np.sqrt(1e-12 + 9e-12 * share))
    assert outline_offsets(result(), None)["Z_offset"] == pytest.approx(1e-6)


def test_the_outline_has_what_departs_from_the_surface_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Departures of three and one standard deviations, mean square 5: four fifths are beyond noise."""
    line = CentreLine(T[:2], np.arange(2), np.full(2, 1e-3), np.full(2, 5e-3), np.full(2, 1e-6))
    gave = [(np.array([6e-6, -2e-6]), np.full(2, 2e-6))]
    monkeypatch.setattr(shared_errors, "departures", lambda *given, half_width: gave[0])
    shot = SimpleNamespace(specimen=SimpleNamespace(surface=None, points=None), centre=None)
    found = with_departures(line, shot, 6e-4)  # type: ignore[arg-type]
    assert found.modes is not None
    np.testing.assert_allclose(found.modes, [[6e-6 * 0.8**0.5, -2e-6 * 0.8**0.5]])
    both = with_departures(found, shot, 6e-4)  # type: ignore[arg-type]
    assert both.modes is not None
    np.testing.assert_allclose(both.modes, np.repeat(found.modes, 2, axis=0))
    gave[0] = np.full(2, 1e-6), np.full(2, 2e-6)
    assert with_departures(line, shot, 6e-4) is line  # type: ignore[arg-type]
