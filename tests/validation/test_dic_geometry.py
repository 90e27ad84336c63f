"""Triangulation and camera files against the results and files of VIC-3D, DICe and OpenCorr."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from shared_data import columns, data, grey, named
from synthetic_dic import true_rig

from dic import StereoRig
from dic.calibration.solve import calibrate
from dic.calibration.targets import FiducialDots
from dic.calibration.views import detect
from dic.camera_files import CameraFileError, read_rig, write_rig
from dic.stereo.geometry import epipolar_distance, triangulate
from dic.stereo.reconstruction import calibration_sigma, calibration_slopes


@pytest.fixture
def targets() -> Path:
    """DICe's calibration files, two of them from VIC-3D."""
    return data("dic", "dice_calibration_targets")


@pytest.fixture
def challenge() -> Path:
    """Stereo-DIC Challenge 1.0, sample 3."""
    return data("dic", "stereo_challenge1_S3_dspecimen")


def test_opencorr_s_points_are_triangulated(challenge: Path) -> None:
    table = named(challenge / "OpenCorr_GT4-0273_result.csv.gz")
    rig = read_rig(challenge / "OpenCorr_camera_parameters.txt")
    unit = np.eye(2)
    for first, second, position in (
        (("x", "y"), ("r2_x", "r2_y"), "ref"),
        (("t1_x", "t1_y"), ("t2_x", "t2_y"), "tar"),
    ):
        met = triangulate(rig, columns(table, *first), columns(table, *second), unit, unit)
        theirs = 1e-3 * columns(table, *(f"{position}_{axis}" for axis in "xyz"))
        off = np.linalg.norm(met.position - theirs, axis=-1)
        assert len(off) == 9997
        # The target, 1e-4 mm. OpenCorr works in single precision: one digit of 393 mm is 3e-5 mm, and one of
        # an undistorted pixel, over the angle of 19°, 3e-5 mm too.
        assert np.median(off) < 1e-7
        # Where rays miss each other by more, OpenCorr's linear solution and the nearest point differ; in the
        # second state 6 points do, false matches.
        apart = np.abs(met.epipolar) > 0.4
        assert np.sum(apart) == (0 if position == "ref" else 6)
        assert np.all(table["r1t2_ZNCC"][apart] < 0.7)
        assert off[~apart].max() < 4e-7


def test_vic3d_project_is_read_to_its_printed_digits(challenge: Path, tmp_path: Path) -> None:
    text = (challenge / "vic3d_project_cal.xml").read_text(encoding="latin-1")
    rig = read_rig(challenge / "vic3d_project_cal.xml")
    write_rig(tmp_path / "again.xml", rig, "vic3d")
    pattern = re.compile(r'<camera id="\d">([^<]*)<orientation>([^<]*)<')
    theirs, ours = (pattern.findall(t) for t in (text, (tmp_path / "again.xml").read_text()))
    assert len(theirs) == 2
    for a, b in zip(theirs, ours, strict=True):
        numbers = " ".join(a).split()
        assert len(numbers) == 14
        for printed, again in zip(numbers, " ".join(b).split(), strict=True):
            assert f"{float(again):.9e}" == f"{float(printed):.9e}"
    # The frame lies between the cameras: their views are mirror images in x, to the digits of the angles.
    first, second = (camera.rotation[2] for camera in rig.cameras)
    np.testing.assert_allclose(first[[0, 2]], second[[0, 2]] * [-1.0, 1.0], atol=2e-6)
    # Baseline and angle as others computed them from the file, to the digits they gave.
    R, t = rig.relative
    assert np.linalg.norm(t) == pytest.approx(123.205e-3, abs=1e-6)
    assert np.rad2deg(np.arccos((np.trace(R) - 1.0) / 2.0)) == pytest.approx(18.83, abs=0.01)


def test_one_rig_in_four_files(targets: Path) -> None:
    rig = read_rig(targets / "cal_a.xml")
    R, t = rig.relative
    np.testing.assert_allclose(1e3 * t, [130.7549, -0.6105, 17.1329], atol=5e-5)  # the digits of its README
    # The text files print tx with 5 digits (0.005 mm) and angles with 4 to 5 (5e-6 rad), the XML 6 digits.
    for name, digits in (("cal_a.txt", 5e-3), ("cal_a_with_R.txt", 5e-3), ("DICe_cal_a.xml", 5e-5)):
        other = read_rig(targets / name)
        np.testing.assert_allclose(1e3 * other.relative[1], 1e3 * t, atol=digits)
        np.testing.assert_allclose(other.relative[0], R, atol=5e-6)
        for ours, theirs in zip(rig.cameras, other.cameras, strict=True):
            np.testing.assert_allclose(theirs.matrix, ours.matrix, atol=5e-3)
            np.testing.assert_allclose(theirs.distortion, ours.distortion, atol=5e-7)
    assert rig.cameras[0].sensor == (1280, 800)


@pytest.mark.parametrize(
    ("name", "t", "lens"),
    [("sim_dot_cal_gold.xml", (122.2488, 1.84888, 17.62463), (0.021682, -0.01028, 0.0, 0.0, 2.0585)),
     ("sim_checkerboard_cal_gold.xml", (122.2488, 1.84888, 17.62463),
     (0.0319436, -0.702904, 0, 0, 0.0873144))],
)  # fmt: skip
def test_dice_solutions(targets: Path, name: str, t: tuple[float, ...], lens: tuple[float, ...]) -> None:
    rig = read_rig(targets / name)
    np.testing.assert_allclose(1e3 * rig.relative[1], t, rtol=1e-14)
    assert rig.cameras[0].distortion == lens
    assert rig.cameras[0].sensor == (1920, 1200)


def test_files_that_are_no_calibration_of_two_cameras(targets: Path) -> None:
    with pytest.raises(CameraFileError, match=r"has 1 cameras \(CAMERA 0\)"):
        read_rig(targets / "sim_white_dot_cal_gold.xml")
    with pytest.raises(CameraFileError, match="is no camera file known here"):
        read_rig(targets / "checkerboard_input.xml")


def test_vic3d_s_radial_terms_are_even_powers(challenge: Path) -> None:
    """VIC-3D's calibration undone with several meanings of k1 and k2, on points that OpenCorr matched."""
    table = named(challenge / "OpenCorr_GT4-0273_result.csv.gz")
    rig = read_rig(challenge / "vic3d_project_cal.xml")
    seen = (columns(table, "x", "y"), columns(table, "r2_x", "r2_y"))
    plain = [
        type(c)(c.fx, c.fy, c.cx, c.cy, c.skew, (0.0,) * 5, c.rotation, c.translation) for c in rig.cameras
    ]

    def scatter(powers: tuple[int, int]) -> float:
        """Standard deviation of the epipolar distances with 1 + k1 r^a + k2 r^b [px]."""
        straight = []
        for camera, bent, pixels in zip(plain, rig.cameras, seen, strict=True):
            target = camera.undistort(pixels)
            ideal = target.copy()
            for _ in range(60):
                r = np.linalg.norm(ideal, axis=-1, keepdims=True)
                ideal = target / (
                    1.0 + bent.distortion[0] * r ** powers[0] + bent.distortion[1] * r ** powers[1]
                )
            straight.append(camera.to_pixels(ideal))
        return float(epipolar_distance(StereoRig((plain[0], plain[1])), *straight).std())

    even, odd, dice = scatter((2, 4)), scatter((1, 3)), scatter((0, 1))
    assert epipolar_distance(rig, *seen).std() < 0.03  # with k3 too; the matches scatter by some hundredths
    assert even < 0.04
    assert odd > 2.0 * even
    assert dice > 50.0 * even  # K1 R + K2 R² on the radius, as DICe supposes


@pytest.mark.slow
def test_the_calibration_s_share_of_sigma() -> None:
    """Positions of a specimen by a calibration from pictures, against those by the true cameras."""
    shot = data("shots", "open-01")
    full = true_rig(shot)
    facts = json.loads((shot / "facts.json").read_text())["calibration_target"]
    target = FiducialDots(
        columns=facts["columns"],
        rows=facts["rows"],
        pitch=1e-3 * facts["pitch_mm"],
        diameter=1e-3 * facts["dot_mm"],
        hollow=tuple((c, r) for c, r in facts["hollow_dots_column_row"]),
    )
    views = [
        [detect(grey(path), target) for path in sorted(shot.glob(f"calibration/cam{k}_*.png"))[::2]]
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
