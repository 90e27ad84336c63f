"""A new camera format, picture format or target passes all tests with one file and one line."""

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
import test_dic_camera_files as camera_battery
import test_dic_images as picture_battery
from test_dic_calibration import SIZE, parameters, sightings, true_poses

from dic import Camera, StereoRig, camera_files, open_pictures
from dic import images as picture_formats
from dic.calibration import targets
from dic.calibration.solve import calibrate
from dic.calibration.targets.base import Geometry, counts, positive
from dic.calibration.views import detect
from dic.camera_files import CameraFileError, read_rig
from dic.camera_files.source import Source, printed
from dic.images import PictureError
from dic.images.series import checked_count, checked_frame, checked_index, checked_shape


class MadeUpCameras:
    """One JSON object after a line that says so: a camera file format in fifty lines."""

    name = "made-up"
    about = "Made-up rig"
    suffix = ".rig"
    absolute_pose = True
    tangential = True
    first = "# made-up rig"

    def sniff(self, text: str) -> bool:
        """True for a text of this format."""
        return text.startswith(self.first)

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig."""
        try:
            entries = json.loads(source.text.removeprefix(self.first))
            cameras = [
                source.camera(
                    index=k,
                    line=2,
                    matrix=[source.number(str(v), "matrix", 2) for v in entry["matrix"]],
                    distortion=tuple(source.number(str(v), "distortion", 2) for v in entry["distortion"]),
                    rotation=np.reshape([float(v) for v in entry["rotation"]], (3, 3)),
                    translation=length_unit * np.array([float(v) for v in entry["translation"]]),
                )
                for k, entry in enumerate(entries)
            ]
            first, second = cameras
        except (ValueError, TypeError, KeyError) as error:
            if isinstance(error, CameraFileError):
                raise
            raise CameraFileError(source.path, f"is cut short or damaged ({error})") from None
        return StereoRig((first, second))

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text."""
        return f"{self.first}\n" + json.dumps([self._entry(camera, length_unit) for camera in rig.cameras])

    def _entry(self, camera: Camera, length_unit: float) -> dict[str, list[str]]:
        return {
            "matrix": [printed(v) for v in (camera.fx, camera.fy, camera.cx, camera.cy, camera.skew)],
            "distortion": [printed(v) for v in camera.distortion],
            "rotation": [f"{v:.17g}" for v in camera.rotation.ravel()],
            "translation": [printed(v) for v in camera.translation / length_unit],
        }


@pytest.fixture
def made_up_cameras(monkeypatch) -> MadeUpCameras:
    """The format, with its line in the registry."""
    member = MadeUpCameras()
    monkeypatch.setattr(camera_files, "FORMATS", (*camera_files.FORMATS, member))
    return member


def test_a_camera_format_gets_the_whole_battery(tmp_path, made_up_cameras):
    camera_battery.test_every_format_returns_what_was_written(tmp_path, made_up_cameras)
    for unit in (1.0, 25.4e-3):
        camera_battery.test_lengths_may_have_another_unit(tmp_path, made_up_cameras, unit)
    camera_battery.test_tangential_distortion_is_kept_or_refused(tmp_path, made_up_cameras)
    for share in (0.2, 0.5, 0.8, 0.95):
        camera_battery.test_a_truncated_file_is_refused_in_one_line(tmp_path, made_up_cameras, share)


def test_a_camera_format_is_named_where_a_file_is_of_none(tmp_path, made_up_cameras):
    path = tmp_path / "other"
    path.write_text("no cameras\n")
    with pytest.raises(CameraFileError, match=r"known are: .*Made-up rig"):
        read_rig(path)
    with pytest.raises(CameraFileError, match=r"use one of vic3d, .*made-up"):
        camera_files.write_rig(path, camera_battery.rig(), "zeiss")


@dataclass(frozen=True)
class MadeUpPictures:
    """Frames of 16 bits behind a header of 18 bytes: a picture format in thirty lines."""

    path: Path
    n_frames: int
    shape: tuple[int, int]
    bits: int = 16
    crop_offset: tuple[float, float] = (0.0, 0.0)
    times: None = None

    def frame(self, index: int) -> np.ndarray:
        """Grey values of one frame, shape [rows, columns]."""
        index = checked_index(self.n_frames, index)
        size = 2 * self.shape[0] * self.shape[1]
        with open(self.path, "rb") as file:
            file.seek(18 + index * size)
            data = file.read(size)
        if len(data) < size:
            raise PictureError(self.path, "is cut off", frame=index)
        return checked_frame(
            self.path, index, np.frombuffer(data, "<u2").reshape(self.shape), self.shape, self.bits
        )


MARK = b"made up"


def read_made_up(path: Path) -> MadeUpPictures:
    """Open a made-up file."""
    header = path.read_bytes()[:18].removeprefix(MARK)
    if len(header) < 11:
        raise PictureError(path, "its header is cut off")
    rows, columns, n_frames = (int(v) for v in np.frombuffer(header[:6], "<u2"))
    return MadeUpPictures(path, checked_count(path, n_frames), checked_shape(path, rows, columns))


def write_made_up(folder: Path) -> None:
    """A made-up file with the battery's pictures."""
    grey = picture_battery.grey()
    header = MARK + np.array([*grey.shape[1:], len(grey)], "<u2").tobytes()
    (folder / "a.made").write_bytes(header.ljust(18, b"-") + grey.astype("<u2").tobytes())


def test_a_picture_format_gets_the_whole_battery(tmp_path, monkeypatch):
    known = picture_formats.Format("Made-up", lambda path, start: start.startswith(MARK), read_made_up)
    monkeypatch.setattr(picture_formats, "FORMATS", (*picture_formats.FORMATS, known))
    write_made_up(tmp_path)
    pictures = open_pictures(tmp_path / "a.made")
    np.testing.assert_array_equal([pictures.frame(k) for k in range(3)], picture_battery.grey())
    with pytest.raises(IndexError, match="frame 3 of 3"):
        pictures.frame(3)
    declared = open_pictures(tmp_path / "a.made", bits=12, crop_offset=(8.0, 4.0), n_frames=5)
    assert (declared.bits, declared.crop_offset, declared.n_frames) == (12, (8.0, 4.0), 5)
    monkeypatch.setitem(picture_battery.WRITERS, "a.made", write_made_up)
    picture_battery.test_damage_anywhere(tmp_path, "a.made")
    (tmp_path / "other").write_bytes(b"nothing known")
    with pytest.raises(PictureError, match=r"is not one of TIFF, .*Made-up, PNG"):
        open_pictures(tmp_path / "other")


@dataclass(frozen=True)
class MadeUpTarget:
    """Dots on a plate, each larger than the one before: a calibration target in forty lines."""

    columns: int
    rows: int
    pitch: float

    def __post_init__(self) -> None:
        counts(2, columns=self.columns, rows=self.rows)
        positive(pitch=self.pitch)

    def geometry(self) -> Geometry:
        """Its dots."""
        j, i = np.divmod(np.arange(self.columns * self.rows), self.columns)
        points = self.pitch * np.stack([i, j, 0.0 * i], axis=1)
        n = len(points)
        flat = np.tile([0.0, 0.0, 1.0], (n, 1))
        return Geometry(points, flat, np.zeros(n), np.zeros((n, 3)), np.arange(n)[None])

    def detect(self, picture: np.ndarray) -> targets.Detection:
        """Its dots, numbered by their size."""
        n = self.columns * self.rows
        dark = (picture < 0.5 * picture.max()).astype(np.uint8)
        count, _, boxes, middles = cv2.connectedComponentsWithStats(dark)
        if count != n + 1:
            raise targets.TargetNotFound(f"{count - 1} dots are seen, {n} were expected")
        order = 1 + np.argsort(boxes[1:, cv2.CC_STAT_AREA])
        return targets.Detection(np.arange(n), middles[order], np.full(n, 0.05))


EXAMPLES: dict[str, targets.Target] = {
    "chessboard": targets.Chessboard(columns=9, rows=7, pitch=2e-3),
    "charuco": targets.Charuco(columns=7, rows=5, pitch=4e-3, marker=3e-3),
    "fiducial_dots": targets.FiducialDots(
        columns=10, rows=8, pitch=1.2e-3, diameter=0.6e-3, hollow=((2, 2), (7, 2), (2, 5))
    ),
    "asymmetric_dots": targets.AsymmetricDots(columns=4, rows=11, step=1e-3, diameter=0.8e-3),
    "dotted_cylinder": targets.DottedCylinder(
        columns=12, rows=7, radius=8e-3, pitch=2e-3, arc=2e-3, size=1e-3, anchors=()
    ),
    "made_up": MadeUpTarget(columns=5, rows=4, pitch=3e-3),
}
"""One of every kind."""


@pytest.fixture
def made_up_target(monkeypatch) -> None:
    """The made-up target's line in the registry."""
    monkeypatch.setitem(targets.TARGETS, "made_up", MadeUpTarget)


def test_every_target_has_an_example(made_up_target):
    assert {kind: type(example) for kind, example in EXAMPLES.items()} == targets.TARGETS


@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_target_has_a_geometry_that_the_solve_can_use(kind):
    target = EXAMPLES[kind]
    assert isinstance(target, targets.Target)
    g = target.geometry()
    n = len(g.points)
    assert (g.normals.shape, g.spread.shape, g.bend.shape) == ((n, 3), (n,), (n, 3))
    np.testing.assert_allclose(np.linalg.norm(g.normals, axis=1), 1.0, rtol=1e-12)
    assert np.all(g.spread >= 0.0)
    np.testing.assert_allclose(np.sum(g.bend * g.normals, axis=1), 0.0, atol=1e-12)  # in the surface
    np.testing.assert_array_equal(g.equivalents[0], np.arange(n))
    for numbering in g.equivalents:  # the same body, turned: all distances stay
        assert sorted(numbering) == list(range(n))
        apart = [np.linalg.norm(X - X[:1], axis=1) for X in (g.points, g.points[numbering])]
        np.testing.assert_allclose(np.sort(apart[1]), np.sort(apart[0]), atol=1e-12)


@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_target_is_refused_where_it_is_not_seen(kind):
    with pytest.raises(targets.TargetNotFound) as caught:
        detect(np.full((200, 300), 127, np.uint8), EXAMPLES[kind])
    assert "\n" not in str(caught.value)


def test_a_made_up_target_is_detected_and_calibrates_two_cameras():
    target = EXAMPLES["made_up"]
    middles = np.array([(20.0 + 36.0 * (k % 5), 25.0 + 36.0 * (k // 5)) for k in range(20)])
    y, x = np.mgrid[0:160, 0:200]
    picture = np.full((160, 200), 220, np.uint8)
    for k, (u, v) in enumerate(middles):
        picture[np.hypot(x - u, y - v) <= 4.0 + 0.6 * k] = 20
    found = detect(picture, target)
    np.testing.assert_array_equal(found.ids, np.arange(20))
    np.testing.assert_allclose(found.pixels, middles, atol=1e-9)  # centroids of symmetric discs
    views = sightings(true_poses(8), noise=0.0, target=target)
    off = parameters(calibrate(*views, target, sensors=SIZE, distortion="k1"))
    assert np.abs(off[-6:]).max() < 1e-8  # as for a chessboard: converged to 1e-10 of the sum of squares
