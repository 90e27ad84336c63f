"""Measured fields in a page: maps over pictures, one point over time, a calibration."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from boards import board_series
from matplotlib import colormaps
from nicegui import ui
from nicegui.testing import User
from simulated import walk
from speckle_pictures import PLANE_SIDE, plane
from synthetic_dic import BLACK, SIDE, synthetic_result

from dic.calibration.views import Pair, PairOutcome, PairView
from dic.outcome import PointOutcome
from dic.result import FullField, SurfaceStrain
from dic.surfaces.surface_history import SurfaceHistory
from kolsky.app.calibration import ARROW, arrow_scale, pair_words, view_svg
from kolsky.app.fields import path_svg, point_words, scale_html
from kolsky.app.pictures import measured_in, open_all
from kolsky.pictures.dic_file import write_full_field
from kolsky.report.surface_maps import faces_of, limits_of, map_png
from kolsky.shot.measured_points import MeasuredPoints, points_of, read_measured_points

STRETCH = 0.02
"""Of the plane along x in frame 2; its points move by that times their distance from the middle."""


@pytest.fixture(scope="module")
def specimen() -> MeasuredPoints:
    return points_of(synthetic_result())[0]


def stretched_plane(folder: Path) -> Path:
    """The plane of three pictures with a made-up result: stretched along x in the last frame."""
    plane(folder)
    x, y = np.meshgrid(np.arange(9), np.arange(9))
    cell = np.column_stack([x.ravel(), y.ravel()])
    points = 24.0 + 10.0 * cell
    u = np.zeros((3, len(points), 3))
    u[2, :, 0] = STRETCH * (points[:, 0] - 64.0) * 1e-5
    outcome = np.zeros((3, len(points)), dtype=np.int64)
    outcome[2, 0] = int(PointOutcome.LOW_CORRELATION)
    strain = np.zeros_like(u)
    strain[2, :, 0] = STRETCH
    lost = outcome != 0
    pixels = points + u[..., :2] / 1e-5
    pixels[lost] = np.nan
    strain[lost] = np.nan
    t = np.arange(3.0)
    field = FullField(
        kind="plane",
        unit="m",
        timed=False,
        frame_outcome=np.zeros(3, dtype=np.int64),
        surface=SurfaceHistory(
            t, np.column_stack([points * 1e-5, np.zeros(len(points))]), u, np.full(u.shape, 1e-7), outcome
        ),
        strain=SurfaceStrain(strain, np.where(np.isnan(strain), np.nan, 1e-4), lost.astype(np.int64), 31.0),
        points=points,
        cell=cell,
        pixels=pixels[None],
        zncc=np.ones((1, *outcome.shape)),
        epipolar=np.full(outcome.shape, np.nan),
        noise=np.array([2.0]),
        facts={"reference": 0},
    )
    (folder / "results").mkdir()
    write_full_field(folder / "results" / "dic.h5", field)
    return folder


def test_fields_have_units_and_sigmas(specimen: MeasuredPoints) -> None:
    assert list(specimen.fields) == [
        *("U", "V", "W", "Eθθ", "Eyy", "Eθy"),
        *(f"sigma {name}" for name in ("U", "V", "W", "Eθθ", "Eyy", "Eθy")),
        "outcome",
    ]
    V, valid = specimen.fields["V"], specimen.surface.valid
    np.testing.assert_allclose(V.values[valid], 1e3 * specimen.surface.u[valid][:, 1], rtol=1e-12)
    assert np.isnan(V.values[~valid]).all()
    assert V.sigma is not None
    np.testing.assert_allclose(specimen.fields["sigma V"].values[valid], 1e3 * V.sigma[valid], rtol=1e-12)
    assert specimen.fields["sigma Eyy"].values[0, 5] == pytest.approx(0.02)  # 2e-4 in per cent
    counts = specimen.outcomes(35)
    assert counts[PointOutcome.LOW_CORRELATION] == 2
    assert sum(counts.values()) == specimen.surface.n_points


def test_a_lost_point_stays_at_its_last_place(specimen: MeasuredPoints) -> None:
    for camera in (0, 1):
        places = specimen.places(camera, 30)
        np.testing.assert_array_equal(places[0], specimen.pixels[camera][24, 0])
        np.testing.assert_array_equal(places[50], specimen.pixels[camera][30, 50])
        x, y = places[50]
        assert specimen.nearest(camera, 30, (x + 0.3, y - 0.3)) == 50
    assert len(faces_of(specimen, 30)) < len(faces_of(specimen, 0)) == 2 * 18 * 16
    assert len(faces_of(specimen, BLACK)) == 0


def test_the_limits_hold_for_all_frames(specimen: MeasuredPoints) -> None:
    V = specimen.fields["V"]
    known = V.values[np.isfinite(V.values)]
    low, high = limits_of(V)
    assert ((known >= low) & (known <= high)).mean() == pytest.approx(0.98, abs=0.002)
    flat = SimpleNamespace(values=np.full((2, 3), 4.0))
    assert limits_of(flat) == (3.5, 4.5)  # type: ignore[arg-type]


def test_a_map_has_the_colour_of_the_value_at_its_point(specimen: MeasuredPoints) -> None:
    k, V = 15, specimen.fields["V"]
    limits = (float(V.values[k].min()), float(V.values[k].max()))
    for camera in (0, 1):
        png = map_png(specimen, "V", k, camera=camera, shape=(SIDE, SIDE), limits=limits)
        picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        factor = picture.shape[0] / SIDE
        assert factor == 4.0
        for point in (2 * 19 + 5, 8 * 19 + 9, 13 * 19 + 14):  # inside the grid
            x, y = specimen.pixels[camera][k, point]
            b, g, r, a = (int(v) for v in picture[int(factor * (y + 0.5)), int(factor * (x + 0.5))])
            share = (V.values[k, point] - limits[0]) / (limits[1] - limits[0])
            assert a == 255
            np.testing.assert_allclose((r, g, b), colormaps["viridis"](share, bytes=True)[:3], atol=6)
        assert picture[2, 2, 3] == 0  # no points there: the picture is seen
    png = map_png(specimen, "outcome", 35, shape=(SIDE, SIDE), limits=(0.0, 1.0))
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    x, y = specimen.places(0, 35)[1]
    np.testing.assert_array_equal(
        picture[int(4 * (y + 0.5)), int(4 * (x + 0.5))], (0x00, 0x5E, 0xD5, 255)
    )  # blue, green, red of a low correlation


def test_what_is_known_of_a_point_is_told(specimen: MeasuredPoints) -> None:
    words = point_words(specimen, 50, 30, "V")
    V = specimen.fields["V"]
    assert f"V = {V.values[30, 50]:.4g} ± " in words
    assert "camera 1 at (" in words
    lost = point_words(specimen, 0, 30, "V")
    assert f"lost in frame 30, {PointOutcome.LOW_CORRELATION.cause}; " in lost
    assert 'fill="none"' in path_svg(specimen, 0, 0, 30, 1.0).split("<circle")[1]
    assert 'fill="#d55e00"' in path_svg(specimen, 50, 1, 30, 1.0).split("<circle")[1]
    assert "-16.6 %" in scale_html(-16.56, 0.03, "%")


def test_a_plane_is_coloured_and_its_point_followed(tmp_path: Path) -> None:
    folder = stretched_plane(tmp_path / "root" / "one")
    (points,) = read_measured_points(folder)
    assert points.plane
    assert "W" not in points.fields
    assert points.fields["Exx"].values[2, 5] == pytest.approx(2.0)
    opened = open_all(folder)
    assert opened.remark == ""
    assert "No fields yet" in measured_in(tmp_path / "root", opened.series)[1]

    async def steps(user: User) -> None:
        await user.open("/pictures?shot=one")
        await user.should_see("Camera 0", retries=100)
        image = next(iter(user.find(ui.interactive_image).elements))
        (field,) = user.find(marker="field").elements
        field.set_value("Exx")
        assert str(image.content).startswith('<image href="data:image/png;base64,')
        await user.should_see(marker="point")
        (mode,) = user.find(marker="mode").elements
        mode.set_value("follow")
        (slider,) = user.find(marker="frame").elements
        slider.set_value(2)
        press = {"mouse_event_type": "mousedown", "image_x": 65.0, "image_y": 63.0}
        user.find(ui.interactive_image).trigger("mouse", press)
        await user.should_see("Exx = 2 ± 0.02 % (k = 2) in frame 2")
        assert "<polyline" in str(image.content)
        user.find(ui.interactive_image).trigger("mouse", {**press, "image_x": 20.0, "image_y": 20.0})
        await user.should_see(f"lost in frame 2, {PointOutcome.LOW_CORRELATION.cause}")
        field.set_value("outcome")
        await user.should_see("low correlation 1")

    walk(tmp_path / "root", tmp_path / "main.py", steps)
    assert opened.session.pictures.shape[0] == PLANE_SIDE


def test_residuals_are_arrows_from_what_was_measured() -> None:
    view = PairView(
        np.arange(2),
        np.array([[10.0, 20.0], [30.0, 40.0]]),
        np.full(2, 0.01),
        np.array([[0.1, -0.2], [0.0, 0.5]]),
        np.array([True, False]),
    )
    svg = view_svg(view, 100.0, 1.0)
    assert 'x1="10.00" y1="20.00" x2="20.00" y2="0.00"' in svg
    assert svg.count('stroke="#ff3b30"') == 1  # the one that was left out
    assert arrow_scale(SimpleNamespace(rms=0.02), 500) == pytest.approx(ARROW * 500 / 0.02)  # type: ignore[arg-type]
    pair = Pair("7", PairOutcome.ONE_CAMERA, "glare", (view, None), None, None)
    words = pair_words(pair)
    assert words.startswith(
        f"Pair 7: camera 0: 2 points, {np.hypot(0.1, 0.2):.3f} px rms; camera 1: not recog"
    )
    assert "(glare)" in words
    assert PairOutcome.ONE_CAMERA.cure in words


@pytest.mark.slow  # looks for a board in 14 pictures
def test_a_calibration_is_looked_at_pair_by_pair(tmp_path: Path) -> None:
    (tmp_path / "root" / "board").mkdir(parents=True)
    board_series(tmp_path / "root" / "board")

    async def steps(user: User) -> None:
        await user.open("/pictures?shot=board")
        user.find("Calibrate").click()
        await user.should_see("Rms residual of every pair", retries=600)
        first, second = sorted(user.find(ui.interactive_image).elements, key=lambda one: one.id)
        assert str(first.content).count("<circle") == 80
        assert str(second.source).startswith("data:image/png;base64,")
        await user.should_see("Pair 0: camera 0: 80 points")
        (slider,) = user.find(marker="pair").elements
        slider.set_value(3)
        await user.should_see(PairOutcome.INCONSISTENT.cause)
        (table,) = user.find(ui.table).elements
        assert {"name": "pairs used", "value": "5 of 7"} in table.rows

    walk(tmp_path / "root", tmp_path / "main.py", steps)
