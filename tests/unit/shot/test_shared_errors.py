"""[uncertainty] of shot.toml, and errors that means share."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from shot_folders import shot_in

from dic.stereo.reconstruction import SharedError
from kolsky.base.errors import InputError
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
from kolsky.schema.apparatus import IDENTIFY_KEYS, UncertaintySection
from kolsky.shot.load import load_shot

# The effect of a mean on a shared error in closed form, in the outline and the flyer.

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


# [uncertainty] of shot.toml: entries that `kolsky identify` uses, and entries for `kolsky waves` only.


def shot_with(tmp_path: Path, table: str) -> Path:
    """A copy of open-01 with another table at its end."""
    folder = shot_in(tmp_path / "shot")
    with (folder / "shot.toml").open("a") as file:
        file.write(table)
    return folder


def test_declared_uncertainties_reach_the_shot_in_si(tmp_path: Path) -> None:
    table = """
[uncertainty]
poisson = 0.0005
damping = "2 us"
curve_scale = "1 %"
specimen_diameter = "0.2 %"
clock_offset = "0.5 us"
Z_offset = "5 um"
mass = "0.5 %"
friction = 0.0
"""
    assert load_shot(shot_with(tmp_path, table)).uncertainty == {
        "poisson": 5e-4,
        "damping": pytest.approx(2e-6, rel=1e-12),
        "friction": 0.0,
        "curve_scale": pytest.approx(0.01, rel=1e-12),
        "specimen_diameter": pytest.approx(0.002, rel=1e-12),
        "clock_offset": pytest.approx(5e-7, rel=1e-12),
        "Z_offset": pytest.approx(5e-6, rel=1e-12),
    }


def test_what_is_absent_was_not_declared(tmp_path: Path) -> None:
    assert load_shot(shot_with(tmp_path, "")).uncertainty == {}


def test_waves_do_not_see_what_only_the_model_has() -> None:
    section = UncertaintySection(poisson=0.01, sensitivity="1 %", curve_scale="1 %")
    said = section.for_waves()
    assert said["sensitivity"] == pytest.approx(0.01)
    assert not {"poisson", "curve_scale", "damping", "friction", "Z_offset"} & set(said)
    assert set(section.for_identify()) <= set(IDENTIFY_KEYS)


@pytest.mark.parametrize(
    ("line", "key", "words"),
    [
        ('poisson = "0.01"', "uncertainty.poisson", "number"),
        ('damping = "-1 us"', "uncertainty.damping", ">= 0"),
        ('clock_offset = "1 mm"', "uncertainty.clock_offset", "time"),
        ("friction = -0.1", "uncertainty.friction", ">= 0"),
        ('specimen_densty = "1 %"', "uncertainty.specimen_densty", "specimen_density"),
    ],
)
def test_nonsense_is_refused_with_its_line(tmp_path: Path, line: str, key: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        load_shot(shot_with(tmp_path, f"\n[uncertainty]\n{line}\n"))
    message = str(caught.value)
    assert key in message
    assert words in message
    assert "shot.toml" in message
