"""Faults of a set-up and the calibration's share of sigma, on pictures of a shot whose answer is known."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from dic import Camera, StereoRig
from dic.calibration.solve import calibrate
from dic.calibration.targets import FiducialDots
from dic.calibration.views import detect
from dic.correlation import Correlation, Shape
from dic.correlation.subsets import apply
from dic.stereo.diagnose import Fault, diagnose
from dic.stereo.geometry import triangulate
from dic.stereo.match import match_stereo
from dic.stereo.reconstruction import Reconstruction, calibration_sigma, calibration_slopes, reconstruct
from dic.tracking import Tracking, track

N_FRAMES = 60
"""Frames that are followed: 12 at rest, then the motion."""


@pytest.fixture(scope="module")
def shot(shared: Path) -> Path:
    """open-01, or a skipped test."""
    folder = shared / "data" / "shots" / "open-01"
    if not folder.is_dir():
        pytest.skip(f"no folder {folder}")
    return folder


@pytest.fixture(scope="module")
def full(shot: Path) -> StereoRig:
    """The true cameras, of the whole sensor."""
    first, second = (
        Camera(
            *(entry["K"][0][0], entry["K"][1][1], entry["K"][0][2], entry["K"][1][2], 0.0),
            distortion=tuple(entry["dist"]),
            rotation=np.array(entry["R"]),
            translation=np.array(entry["t"]),
        )
        for entry in json.loads((shot / "truth.json").read_text())["cameras"]
    )
    return StereoRig((first, second))


@pytest.fixture(scope="module")
def crop(shot: Path) -> tuple[float, float]:
    """Where the pictures lie on the sensor [px]."""
    x, y = json.loads((shot / "facts.json").read_text())["camera"]["crop_offset_px"]
    return x, y


@pytest.fixture(scope="module")
def surface(shot: Path, full: StereoRig, crop: tuple[float, float]) -> Reconstruction:
    """A few points followed from the pictures."""
    pictures = [tifffile.imread(shot / f"cam{k}.tif")[:N_FRAMES] for k in (0, 1)]
    rig = full.cropped(crop, crop)
    grid = np.stack(np.meshgrid(np.arange(40.0, 92.0, 10.0), np.arange(34.0, 95.0, 10.0)), -1).reshape(-1, 2)
    settings = Correlation(shape=Shape.QUADRATIC)
    match = match_stereo(pictures[0][0], pictures[1][0], grid, rig, settings, noise=20.0)
    found = match.valid
    points, tracking = grid[found], Tracking(correlation=settings)
    first = track(pictures[0], points, tracking, noise=20.0)
    start = {"start": match.warp[found], "start_covariance": match.covariance[found]}
    second = track(pictures[1], points, tracking, noise=20.0, **start)
    assert first.outcome.size > 0.9 * N_FRAMES * len(grid)
    np.testing.assert_allclose(apply(points, first.warp[0]), points, atol=1e-12)
    return reconstruct(rig, first, second)


@pytest.mark.slow
def test_a_sound_set_up(surface: Reconstruction, full: StereoRig, crop: tuple[float, float]) -> None:
    assert diagnose(full.cropped(crop, crop), *surface.pixels) == ()
    assert np.nanmedian(np.abs(surface.epipolar)) < 0.02  # matches of some mpx, no calibration error


@pytest.mark.slow
def test_exchanged_cameras(surface: Reconstruction, full: StereoRig, crop: tuple[float, float]) -> None:
    first, second = full.cropped(crop, crop).cameras
    (finding,) = diagnose(StereoRig((second, first)), *surface.pixels)
    assert finding.fault is Fault.SWAPPED_CAMERAS


@pytest.mark.slow
def test_forgotten_crop(surface: Reconstruction, full: StereoRig, crop: tuple[float, float]) -> None:
    (finding,) = diagnose(full, *surface.pixels)
    assert finding.fault is Fault.CROP_OFFSET
    np.testing.assert_allclose(finding.value, [*crop, *crop], atol=6.0)  # 3 of the sigmas it gives, 1 to 2 px


@pytest.mark.slow
@pytest.mark.parametrize("late", [1, -1, 2])
def test_one_camera_late(
    late: int, surface: Reconstruction, full: StereoRig, crop: tuple[float, float]
) -> None:
    first, second = surface.pixels
    pair = (first[:-late], second[late:]) if late > 0 else (first[-late:], second[:late])
    (finding,) = diagnose(full.cropped(crop, crop), *pair)
    assert finding.fault is Fault.OUT_OF_STEP
    assert finding.value[0] == pytest.approx(late, abs=0.05)  # quarter frames are told apart


@pytest.mark.slow
def test_the_calibration_s_share_of_sigma(shot: Path, full: StereoRig) -> None:
    """Positions of a specimen by a calibration from pictures, against those by the true cameras."""
    facts = json.loads((shot / "facts.json").read_text())["calibration_target"]
    target = FiducialDots(
        columns=facts["columns"],
        rows=facts["rows"],
        pitch=1e-3 * facts["pitch_mm"],
        diameter=1e-3 * facts["dot_mm"],
        hollow=tuple((c, r) for c, r in facts["hollow_dots_column_row"]),
    )
    views = [
        [detect(read_grey(path), target) for path in sorted(shot.glob(f"calibration/cam{k}_*.png"))[::2]]
        for k in (0, 1)
    ]
    rig = calibrate(*views, target, sensors=((512, 512), (512, 512)), distortion="k1").rig
    angle, height = (a.ravel() for a in np.meshgrid(np.linspace(-0.8, 0.8, 5), np.linspace(0.5e-3, 6e-3, 5)))
    X = np.stack([4.75e-3 * np.sin(angle), height, 4.75e-3 * np.cos(angle)], axis=-1)
    unit = np.eye(2)
    met = triangulate(rig, full.cameras[0].project(X), full.cameras[1].project(X), unit, unit)
    # Both in the frame of camera 0, whose pose a calibration does not share with the specimen.
    error = rig.cameras[0].in_camera(met.position) - full.cameras[0].in_camera(X)
    assert np.all(np.abs(error) < 3.5 * calibration_sigma(rig, met.position))
    S = calibration_slopes(rig, met.position).reshape(-1, 26)
    values, modes = np.linalg.eigh(S @ rig.covariance @ S.T)
    strong = values > 1e-8 * values.max()
    square = np.sum((modes[:, strong].T @ error.ravel()) ** 2 / values[strong])
    # Chi-squared over the modes in which the calibration can move the specimen: 1e-3 of its tail.
    assert 4 <= strong.sum() <= 16
    assert square < strong.sum() + 3.1 * np.sqrt(2.0 * strong.sum()) + 3.0


def read_grey(path: Path) -> np.ndarray:
    """Grey values of one picture."""
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return picture
