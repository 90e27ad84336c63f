"""Faults of a set-up from epipolar distances: each is made on purpose, on a compressed barrel."""

import numpy as np
import pytest

from dic import Camera, StereoRig
from dic.camera_files.source import rotation_of
from dic.stereo.diagnose import Fault, diagnose, synchronisation
from dic.stereo.reconstruction import perturbed

N_FRAMES, NOISE = 60, 0.02


def camera(side: float, cx: float, cy: float) -> Camera:
    """One of a pair 13° apart with a small field, aligned to a few pixels as on a bench."""
    return Camera(
        5400.0, 5400.0, cx, cy, 0.0, (-0.17, 0.0, 0.0, 0.0, 0.0),
        rotation_of(180.0 + 0.05 * side, 6.3 * side, 0.3 * side),
        np.array([4e-4 * side, 3.1e-3, 0.3047]), (512, 512),
    )  # fmt: skip


FULL = StereoRig((camera(-1.0, 254.3, 258.3), camera(1.0, 257.1, 252.6)))
RIG = FULL.cropped((192.0, 192.0), (192.0, 192.0))


def barrel(t: np.ndarray) -> np.ndarray:
    """Points of a cylinder of 9.5 mm x 6.5 mm at times in frames [m], shape [n_frames, n_points, 3].

    Twelve frames at rest, then the face moves by 0.02 mm a frame.
    """
    angle, height = (
        a.ravel() for a in np.meshgrid(np.linspace(-0.8, 0.8, 9), np.linspace(0.3e-3, 6.2e-3, 9))
    )
    stretch = 1.0 - 2e-5 * np.maximum(0.0, t - 12.0)[:, None] / 6.5e-3
    r = 4.75e-3 / np.sqrt(stretch)
    y = stretch * height
    return np.stack([r * np.sin(angle), y, np.broadcast_to(r, y.shape) * np.cos(angle)], axis=-1)


def seen(late: float = 0.0, outliers: float = 0.0) -> list[np.ndarray]:
    """What the two cameras see, camera 1 `late` frames later, a share of its points false [px]."""
    rng = np.random.default_rng(0)
    t = np.arange(N_FRAMES, dtype=float)
    pixels = [
        cam.project(X) + rng.normal(0.0, NOISE, (*X.shape[:2], 2))
        for cam, X in zip(RIG.cameras, (barrel(t), barrel(t + late)), strict=True)
    ]
    false = rng.random(pixels[1].shape[:2]) < outliers
    pixels[1][false] += rng.uniform(-20.0, 20.0, (int(false.sum()), 2))
    return pixels


SWAPPED = StereoRig((RIG.cameras[1], RIG.cameras[0]))


def test_nothing_wrong_nothing_said() -> None:
    assert diagnose(RIG, *seen()) == ()
    assert diagnose(RIG, *seen(outliers=0.3)) == ()


@pytest.mark.parametrize("outliers", [0.0, 0.3])
def test_swapped_cameras_and_a_crop_left_out(outliers: float) -> None:
    (finding,) = diagnose(SWAPPED, *seen(outliers=outliers))
    assert finding.fault is Fault.SWAPPED_CAMERAS
    assert finding.before > 3.0  # what the misalignment of this bench leaves
    assert finding.after < 0.05  # noise of 0.02 √2 px, medians of magnitudes 0.67 of that
    assert "exchanged" in finding.what
    (finding,) = diagnose(FULL, *seen(outliers=outliers))
    assert finding.fault is Fault.CROP_OFFSET
    # Each component to three of the pixels that the text gives as its sigma.
    np.testing.assert_allclose(finding.value, [192.0] * 4, atol=6.0)
    assert finding.value[:2] == finding.value[2:]
    assert finding.after < 0.1
    assert "both cameras" in finding.what


@pytest.mark.parametrize(("camera_1", "y"), [(True, 8.0), (True, -3.0), (False, 16.0)])
def test_crop_of_one_camera_wrong(camera_1: bool, y: float) -> None:
    pixels = seen()
    pixels[1 if camera_1 else 0] = pixels[1 if camera_1 else 0] - [0.0, y]
    (finding,) = diagnose(RIG, *pixels)
    assert finding.fault is Fault.CROP_OFFSET
    # Epipolar distances know the difference of the cameras only.
    assert finding.value[3] == (y if camera_1 else -y)
    assert finding.value[:2] == (0.0, 0.0)
    assert "camera 0 would explain it as well" in finding.cure


@pytest.mark.parametrize("camera", [0, 1])
@pytest.mark.parametrize("off", [-8.0, 8.0])
def test_a_crop_offset_along_the_lines_is_found_from_many_points(camera: int, off: float) -> None:
    """It leaves some hundredths of a pixel, that no tolerance would refuse."""
    rng = np.random.default_rng(1)
    t = np.zeros(15)
    pixels = [cam.project(barrel(t)) + rng.normal(0.0, 0.004, (15, 81, 2)) for cam in RIG.cameras]
    cameras = list(RIG.cameras)
    cameras[camera] = cameras[camera].cropped((off, 0.0))
    wrong = StereoRig((cameras[0], cameras[1]))
    (finding,) = diagnose(wrong, *pixels)
    assert finding.fault is Fault.CROP_OFFSET
    assert finding.before < 0.2
    assert finding.value[2] == pytest.approx(-off, abs=4.0)  # two of its sigmas; along the lines both alike
    assert finding.value[3] == 0.0
    assert diagnose(wrong, *(one[:2] for one in pixels)) == ()  # two frames: nothing is said
    assert diagnose(wrong, *(one[:, ::2] for one in pixels)) == ()  # nor of 41 points


def test_right_cameras_are_not_doubted_for_their_noise() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = np.zeros(15)
        pixels = [cam.project(barrel(t)) + rng.normal(0.0, NOISE, (15, 81, 2)) for cam in RIG.cameras]
        assert diagnose(RIG, *pixels) == ()


def test_two_faults_at_once() -> None:
    first, second = diagnose(StereoRig((FULL.cameras[1], FULL.cameras[0])), *seen())
    assert (first.fault, second.fault) == (Fault.SWAPPED_CAMERAS, Fault.CROP_OFFSET)
    np.testing.assert_allclose(second.value, [192.0] * 4, atol=6.0)
    first, second = diagnose(SWAPPED, *seen(1.0))
    assert (first.fault, second.fault) == (Fault.SWAPPED_CAMERAS, Fault.OUT_OF_STEP)
    assert second.value[0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("outliers", [0.0, 0.3])
@pytest.mark.parametrize("late", [1.0, -1.0, 2.0, 0.5])
def test_cameras_out_of_step(late: float, outliers: float) -> None:
    (finding,) = diagnose(RIG, *seen(late, outliers))
    assert finding.fault is Fault.OUT_OF_STEP
    assert finding.value[0] == pytest.approx(late, abs=0.05)  # its sigma is below 0.02, false points bias it
    assert f"camera {1 if late > 0 else 0} is late by" in finding.what
    if abs(late) >= 1.0:
        assert f"the first {abs(late):.0f} frame" in finding.cure
        assert f"of camera {0 if late > 0 else 1}" in finding.cure
        assert finding.after < 0.6 * finding.before


def test_a_camera_that_turned_is_the_calibration() -> None:
    change = np.zeros(26)
    change[RIG.parameter_names.index("rz")] = 0.05  # 3° about the view: no offset undoes that
    (finding,) = diagnose(perturbed(RIG, change), *seen())
    assert finding.fault is Fault.CALIBRATION
    assert "calibrate again" in finding.cure
    assert finding.before == finding.after > 0.2


def test_lost_points_and_frames_do_not_count() -> None:
    pixels = seen(1.0)
    pixels[0][::3, ::2], pixels[1][20:25] = np.nan, np.nan
    pixels[1][:, 7] = np.nan
    (finding,) = diagnose(RIG, *pixels)
    assert finding.value[0] == pytest.approx(1.0, abs=0.05)


def test_no_motion_or_motion_along_the_lines_cannot_tell() -> None:
    t = np.arange(N_FRAMES, dtype=float)
    rng = np.random.default_rng(1)
    X = barrel(0.0 * t)
    for moved in (X, X + 2e-5 * np.maximum(0.0, t - 12.0)[:, None, None] * [1.0, 0.0, 0.0]):
        late = np.concatenate([moved[1:], moved[-1:]])
        pixels = [
            cam.project(Y) + rng.normal(0.0, NOISE, (*Y.shape[:2], 2))
            for cam, Y in zip(RIG.cameras, (moved, late), strict=True)
        ]
        assert not synchronisation(RIG, *pixels).decided
        assert diagnose(RIG, *pixels) == ()


def test_few_frames_are_not_examined_for_their_step() -> None:
    pixels = [p[:4] for p in seen()]
    assert diagnose(RIG, *pixels) == ()
    with pytest.raises(ValueError, match="farthest must be from 1 to 1 "):
        synchronisation(RIG, *pixels)


def test_wrong_input_is_refused() -> None:
    pixels = seen()
    with pytest.raises(ValueError, match="must have one shape"):
        diagnose(RIG, pixels[0], pixels[1][1:])
    with pytest.raises(ValueError, match="tolerance must be positive, got 0"):
        diagnose(RIG, *pixels, tolerance=0.0)
    with pytest.raises(ValueError, match="at least 20 point pairs, got 10"):
        diagnose(RIG, pixels[0][:1, :10], pixels[1][:1, :10])
