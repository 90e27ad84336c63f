"""Pictures of synthetic shots: requested cameras, equal for a seed, tables and files as in a shot."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import tifffile
from scipy.stats import chi2

from dic.calibration.solve import calibrate
from dic.images import open_pictures
from kolsky.schema.pictures import CalibrationSection, DicSection, PicturesSection
from kolsky.virtual.pictures import (
    instants_of,
    lens_model,
    poses_of,
    rig_of,
    scene_of,
    target_of,
    write_pictures,
)
from kolsky.virtual.schema import Specification
from kolsky.virtual.truth import SurfaceHistory

LENGTH, RADIUS = 6.5e-3, 4.75e-3
SMALL = {
    "write": True, "sensor": [160, 160], "picture": [64, 64], "field": "7.2 mm", "misalignment": "0 rad",
}  # fmt: skip
FEW = {"poses": 4, "columns": 7, "rows": 5, "share": 0.5}


def spec(cameras=None, **tables):
    """A specification with small pictures."""
    cameras = {**SMALL, **(cameras or {})}
    return Specification.model_validate({"cameras": cameras, "calibration": FEW, **tables})


def surface(n=5, speed=2.6, dt=1 / 120e3):
    """A cylinder at rest for two frames, then pressed flat and wider, evenly."""
    time = dt * (np.arange(n) - 1.0)
    d = speed * np.maximum(time, 0.0)
    share = np.linspace(0.0, 1.0, 9)
    y = share * (LENGTH - d[:, None])
    r = RADIUS * np.sqrt(LENGTH / (LENGTH - d[:, None])) + 0.0 * y
    return SurfaceHistory(time=time, r=r, y=y, displacement=d, tilt=np.zeros(n))


@pytest.mark.parametrize(
    ("side", "axis", "sign"), [("up", 1, -1), ("down", 1, 1), ("left", 0, -1), ("right", 0, 1)]
)
@pytest.mark.parametrize("baseline", ["across", "along"])
def test_the_flyer_is_on_its_side(side, axis, sign, baseline):
    q = spec({"flyer_side": side, "flyer_share": "20 %", "baseline": baseline})
    rig = rig_of(q, shot=0)
    for k in (0, 1):
        face = rig.camera(k).project(np.array([0.0, LENGTH, 0.0]))
        platen = rig.camera(k).project(np.array([0.0, 0.0, 0.0]))
        assert np.sign(face - platen)[axis] == sign
        assert abs((face - platen)[axis]) > 5 * abs((face - platen)[1 - axis])
        # 0.2 of 64 px beyond the face; the crop is whole pixels, the view oblique by up to 6 degrees
        beyond = face[axis] + 0.5 if sign < 0 else 63.5 - face[axis]
        assert beyond == pytest.approx(0.2 * 64, abs=1.5)


def test_distances_angle_and_field_are_as_asked():
    q = spec({"distance_0": "250 mm", "distance_1": "400 mm", "angle": "20 deg", "elevation": "5 deg"})
    rig = rig_of(q, shot=0)
    first, second = rig.stereo.cameras
    away = [camera.centre - rig.middle for camera in (first, second)]
    assert [np.linalg.norm(a) for a in away] == pytest.approx([0.25, 0.4])
    views = [a / np.linalg.norm(a) for a in away]
    for view in views:
        assert np.arcsin(view[1]) == pytest.approx(np.radians(5.0))
    angle = np.arctan2(views[1][0], views[1][2]) - np.arctan2(views[0][0], views[0][2])
    assert angle == pytest.approx(np.radians(20.0))
    for camera, distance in ((first, 0.25), (second, 0.4)):
        assert camera.fx == pytest.approx(64 * distance / 7.2e-3)
        assert camera.rotation[2] @ (rig.middle - camera.centre) == pytest.approx(distance)


def test_cameras_of_other_shots_differ_and_of_the_same_do_not():
    q = spec({"misalignment": "3 mrad"})
    first, again, other = (rig_of(q, shot=shot).stereo.cameras[0] for shot in (1, 1, 2))
    assert np.array_equal(first.rotation, again.rotation)
    assert not np.array_equal(first.rotation, other.rotation)


def test_a_picture_that_leaves_its_sensor_is_refused():
    q = spec({"misalignment": "1 rad"})
    with pytest.raises(ValueError, match="does not lie on"):
        rig_of(q, shot=1)


def test_instants_follow_the_blur():
    """2.6 m/s and 2 us on 112.5 um pixels blur by 0.046 px: one instant; 40 us blur by 0.92 px: two."""
    assert np.all(np.diff(instants_of(spec(), surface()).begin) == 1)
    slow = spec(optics={"exposure": "40 us"})
    assert np.diff(instants_of(slow, surface()).begin)[-1] == 2
    slower = spec(optics={"exposure": "100 us"})
    assert np.diff(instants_of(slower, surface()).begin)[-1] == 4  # 2.3 px


def test_specimen_flyer_and_platen_meet():
    q = spec(imperfections={"off_centre": "0.2 mm"})
    history = replace(surface(), tilt=np.full(5, 0.01))
    specimen, flyer, platen = scene_of(q, history, shot=0).bodies
    assert specimen.y[-1, 1] == pytest.approx(0.0)
    assert specimen.y[-1, -1] == pytest.approx(LENGTH - history.displacement[-1], abs=1e-9)
    assert flyer.place[-1] == pytest.approx([0.0, LENGTH - history.displacement[-1], -0.2e-3], abs=1e-9)
    assert platen.place[-1, 1] + platen.y.max() == pytest.approx(0.0)
    # camera side ahead: a place of the flyer's face toward +z lies lower
    rim = flyer.turn[-1].T @ np.array([0.0, 0.0, 1.0])
    assert rim[1] == pytest.approx(-np.sin(0.01))


def test_the_side_of_the_flyer_is_painted_and_its_face_is_bare():
    q = spec()
    paint = scene_of(q, surface(), shot=0).bodies[1].texture
    around = np.linspace(-1e-3, 1e-3, 101)
    assert paint.at(around, np.full(101, -q.cameras.pixel)) == pytest.approx(q.speckle.bare)
    assert paint.at(around, np.full(101, 0.0)).std() > 0.1


def test_pictures_are_the_same_for_a_seed(tmp_path):
    one, two, other = (tmp_path / name for name in ("one", "two", "other"))
    for folder, seed, threads in ((one, 1, 1), (two, 1, 2), (other, 2, 1)):
        folder.mkdir()
        q = spec({"baseline": "across"}, seed=seed, optics={"haze": 0.2, "highlight": 0.2})
        write_pictures(q, surface(), folder, shot=3, threads=threads)
    a, b, c = (tifffile.imread(folder / "cam1.tif") for folder in (one, two, other))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
    assert (a.shape, a.dtype) == ((5, 64, 64), np.uint16)
    calibration = [cv2.imread(str(folder / "calibration" / "cam0_03.png"), -1) for folder in (one, two)]
    assert np.array_equal(*calibration)


@pytest.mark.parametrize("form", ["tiff", "png", "cine", "mraw"])
def test_tables_are_those_of_a_shot_file(form, tmp_path):
    q = spec({"format": form, "flyer_side": "left"})
    tables, cameras = write_pictures(q, surface(), tmp_path, threads=1)
    pictures = PicturesSection.model_validate(tables["pictures"])
    target = tables["calibration.target"]
    calibration = CalibrationSection.model_validate({**tables["calibration"], "target": target})
    dic = DicSection.model_validate(tables["dic"])
    assert dic.flyer_side == "left"
    assert calibration.distortion == "k1"
    for k, series in enumerate(pictures.cameras):
        key, source = series.source
        found = open_pictures(tmp_path / source if key == "file" else (tmp_path / source).parent)
        assert found.n_frames == 5
        assert found.shape == (64, 64)
        K, dist = np.array(cameras[k]["K"]), cameras[k]["dist"]
        assert K[0, 0] == pytest.approx(64 * 0.305 / 7.2e-3)
        assert dist[0] == (-0.17, -0.16)[k]
    assert len(list((tmp_path / "calibration").iterdir())) == 8


def test_the_lens_model_holds_both_lenses():
    assert lens_model(spec()) == "k1"
    assert lens_model(spec({"distortion_0": [0, 0, 0, 0, 0], "distortion_1": [0, 0, 0, 0, 0]})) == "none"
    assert lens_model(spec({"distortion_1": [-0.1, 0, 1e-3, 0, 0]})) == "k1 p1 p2"
    assert lens_model(spec({"distortion_1": [-0.1, 0.1, 0, 0, 1]})) == "k1 k2 k3"


@pytest.mark.parametrize("kind", ["fiducial_dots", "chessboard", "charuco"])
def test_every_pose_is_in_both_views(kind):
    q = spec({"misalignment": "3 mrad"}, calibration={**FEW, "target": kind, "poses": 12})
    rig = rig_of(q, shot=0)
    g = target_of(q).geometry()
    corners = np.array([[0.0, 0.0], *g.points[[-1], :2]])
    box = np.array([corners.min(0), [corners[1, 0], 0.0], corners.max(0), [0.0, corners[1, 1]]])
    poses = poses_of(q, rig, box, shot=0)
    assert len(poses) == 12
    for R, t in poses:
        for camera in rig.stereo.cameras:
            at = camera.project(g.points @ R.T + t)
            assert 0 < at.min() <= at.max() < 159
        assert -R[2, 2] > np.cos(0.45)  # its face toward the cameras, no more than the tilt and their angle


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("cameras", "picture", [2048, 64]), ("cameras", "picture", [256, 256]),
        ("cameras", "distortion_0", [0.1]), ("cameras", "flyer_share", "90 %"), ("optics", "white", 0.01),
        ("speckle", "coverage", 1.2), ("calibration", "tilt", "80 deg"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(table, key, value):
    base = {"cameras": dict(SMALL), table: {**(SMALL if table == "cameras" else {}), key: value}}
    with pytest.raises(ValueError, match=rf"{key}|{table}"):
        Specification.model_validate(base)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["fiducial_dots", "charuco"])
def test_the_rig_is_recovered_within_its_sigma(kind, tmp_path):
    """12 poses of 512 x 512 px: chi-square of the cameras' shared parameters, 25 s each."""
    q = Specification.model_validate(
        {"cameras": {"write": True}, "calibration": {"target": kind, "poses": 14}, "seed": 5}
    )
    _, cameras = write_pictures(q, surface(3), tmp_path)
    target = target_of(q)
    seen = [
        [
            target.detect(cv2.imread(str(path), -1))
            for path in sorted((tmp_path / "calibration").glob(f"cam{k}_*"))
        ]
        for k in (0, 1)
    ]
    found = calibrate(*seen, target, sensors=((512, 512), (512, 512)), distortion="k1", square_pixels=True)
    names, off = list(found.rig.parameter_names), {}
    for k, (camera, true) in enumerate(zip(found.rig.cameras, cameras, strict=True)):
        K = np.array(true["K"])
        off |= {f"fx{k}": camera.fx - K[0, 0], f"cx{k}": camera.cx - K[0, 2], f"cy{k}": camera.cy - K[1, 2]}
        off[f"k1{k}"] = camera.distortion[0] - true["dist"][0]
    rows = [names.index(name) for name in off]
    d = np.array(list(off.values()))
    assert d @ np.linalg.solve(found.rig.covariance[np.ix_(rows, rows)], d) < chi2.ppf(0.999, len(d))
