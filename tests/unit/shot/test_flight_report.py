"""The flyer's flight from a shot's pictures: numbers, table, file, end of symmetry and window."""

from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from synthetic import LENGTH, displacement
from synthetic_dic import STATIC, synthetic_result

from dic.output import write_history
from kolsky.bars.flyer import flight
from kolsky.bars.flyer.flight import SHARE, FlightOfSpecimen, flight_of
from kolsky.base.records import Recording
from kolsky.pictures.dic_file import read_stereo_result, write_stereo_result
from kolsky.shot.load import window
from kolsky.uncertainty.warnings import symmetry_warning


@pytest.fixture(scope="module")
def result():
    return synthetic_result()


@pytest.fixture(scope="module")
def straight(result) -> FlightOfSpecimen:
    found = flight_of(result, LENGTH)
    assert isinstance(found, FlightOfSpecimen), found
    return found


def drifting(result, rate: float):
    """The flyer's lateral velocity grows by `rate` [m/s²] from frame 20 on."""
    late = np.maximum(result.t - result.t[20], 0.0)
    u = result.motion.displacement + 0.5 * rate * late[:, None] ** 2 * [1.0, 0.0, 0.0]
    return replace(result, motion=replace(result.motion, displacement=u))


def test_velocity_is_the_slope_of_the_displacement(straight):
    t = straight.time[3:-1]
    h = 1e-6
    speed = (displacement(t + h) - displacement(t - h)) / (2.0 * h)
    velocity, sigma = straight.flight.velocity(t)
    assert np.abs((velocity[:, 0] - speed) / sigma[:, 0]).max() < 5.0  # one smooth history
    said = flight.summary(straight)
    there = straight.flight.toward.velocity([said["separation_s"]])[0]
    assert said["flyer_velocity_m_s"] == there == velocity[:, 0].max(initial=there)


def test_a_straight_flight_keeps_its_symmetry(straight):
    assert straight.symmetry is not None
    assert straight.end is None
    assert flight.summary(straight)["velocity_angle_rad"] < SHARE
    assert "lasts to the last frame" in flight.printed(straight)["symmetry"]


def test_what_is_not_measured_is_empty(result, straight, tmp_path):
    table = flight.columns(straight)
    posed = straight.time >= result.t[12]  # the first frame whose pose is known
    assert not np.isnan(table["velocity toward the specimen (m/s)"]).any()
    assert np.isnan(table["velocity along x (m/s)"][~posed]).all()
    assert np.isfinite(table["velocity along x (m/s)"][posed]).all()
    write_history(tmp_path / "flight.csv", table)
    lines = (tmp_path / "flight.csv").read_text().splitlines()
    assert len(lines) == 1 + straight.time.size
    assert lines[1].split(",")[3] == ""
    assert "nan" not in "".join(lines)


def test_symmetry_ends_where_the_flyer_drifts_away(result):
    speed = np.gradient(displacement(np.maximum(result.t, 0.0)), result.t)
    rate = 0.4 * speed[20] / (result.t[-1] - result.t[20])
    found = flight_of(drifting(result, rate), LENGTH)
    assert found.end is not None
    share = rate * np.maximum(found.time - result.t[20], 0.0) / np.interp(found.time, result.t, speed)
    true = found.time[np.argmax(share > SHARE)]
    # later by what it takes to exceed the share by two sigmas, some frames of 33 us
    assert true <= found.end <= true + 6.0 * np.diff(result.t)[0]
    assert "ends at" in flight.printed(found)["symmetry"]


def test_the_file_has_the_flight_and_is_still_read(result, straight, tmp_path):
    path = tmp_path / "dic.h5"
    write_stereo_result(path, result)
    flight.add_to(path, straight)
    with h5py.File(path) as file:
        group = file["entry/flight"]
        np.testing.assert_array_equal(group["time"][()], straight.time)
        assert group["angular velocity about x"].attrs["units"] == "rad/s"
        assert "symmetry_end_s" not in group.attrs
    assert read_stereo_result(path).motion.at[1] == LENGTH


@pytest.mark.parametrize("missing", ["motion", "axial_displacement"])
def test_no_flight_says_why(result, missing):
    found = flight_of(replace(result, **{missing: None}), LENGTH)
    assert isinstance(found, str)
    assert "not known" in flight.printed(found)["flyer's flight"]


def test_the_window_ends_with_symmetry(result, tmp_path):
    declared = SimpleNamespace(
        frames=SimpleNamespace(static=STATIC), window=SimpleNamespace(start=None, end=None)
    )
    toml = SimpleNamespace(declared=declared)
    t = result.t
    scope = Recording(t, np.zeros(t.size), "CH1", "V", tmp_path / "scope.csv", "0" * 64)
    whole = window(toml, t, t[-1], scope, t)
    ended = window(toml, t, t[-1], scope, t, symmetry_end=float(t[30]))
    assert whole == (t[STATIC - 1], t[-1])
    assert ended == (t[STATIC - 1], t[29])
    assert "where the flyer's direction changes" in next(
        symmetry_warning({"symmetry_end": t[30], "window_end": ended[1]})
    )
    assert "end the window there" in next(symmetry_warning({"symmetry_end": t[30], "window_end": t[-1]}))
    assert not list(symmetry_warning({"symmetry_end": np.inf, "window_end": t[-1]}))


def test_a_short_swing_is_no_end_of_symmetry(result):
    """The flyer moves aside, by a third of its speed, within four frames: less than a tenth of the length."""
    speed = np.gradient(displacement(np.maximum(result.t, 0.0)), result.t)
    frames = 4.0 * np.diff(result.t)[0]
    s = np.clip((result.t - result.t[20]) / frames, 0.0, 1.0)
    aside = 0.3 * speed[20] * frames * (3.0 * s**2 - 2.0 * s**3)
    u = result.motion.displacement + aside[:, None] * [1.0, 0.0, 0.0]
    found = flight_of(replace(result, motion=replace(result.motion, displacement=u)), LENGTH)
    beyond = found.symmetry.share - 2.0 * found.symmetry.sigma > SHARE
    assert beyond.sum() >= 3  # it is seen
    assert found.end is None


def test_another_direction_must_last_as_long_as_the_first_took():
    time = 10e-6 * np.arange(50)
    assert flight.frames_in(100e-6, time) == 11  # eleven frames, ten steps
    assert flight.frames_in(95e-6, time) == 11
    assert flight.frames_in(1e-6, time) == 3
