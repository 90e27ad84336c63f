"""Camera files of other programs: meaning of their numbers, and round trips."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from camera_texts import DICE, MATCHID, OPENCORR, TEXT, VIC3D

from dic import Camera, StereoRig
from dic.camera_files import FORMATS, read_rig, write_rig
from dic.camera_files.opencv import DEEPEST, _depth
from dic.camera_files.source import CameraFileError, angles_of, rotation_of


def rig(**changes: object) -> StereoRig:
    """A rig with a pose of its own for both cameras, in numbers that a file prints with few digits."""
    cameras = tuple(
        replace(
            Camera(
                5406.5 + k, 5380.25, 254.5, 258.125, 0.75, (-0.175, 0.5, 0.0, 0.0, -0.25),
                rotation_of(178.5, 7.25 - 14.5 * k, 0.5), np.array([0.0315 - 0.066 * k, 1.5e-3, 0.30475]),
                (512, 384),
            ),
            **changes,
        )
        for k in (0, 1)
    )  # fmt: skip
    return StereoRig((cameras[0], cameras[1]))


def written(tmp_path: Path, text: str, name: str = "camera.file") -> Path:
    """A file with this text."""
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_vic3d_convention(tmp_path: Path) -> None:
    found = read_rig(written(tmp_path, VIC3D))
    first, second = found.cameras
    assert (first.cx, first.cy, first.fx, first.fy, first.skew) == (955.05, 645.23, 6636.03, 6636.44, -0.25)
    assert second.distortion == (-0.005, 1.0775, 0.0, 0.0, -30.0)
    assert first.sensor == (1920, 1200)
    np.testing.assert_allclose(first.translation, [-58.207e-3, 0.164e-3, 20.168e-3], rtol=1e-15)
    turns = [
        cv2.Rodrigues(np.deg2rad(a) * axis)[0]
        for a, axis in zip((179.93, 9.416, -0.05775), np.eye(3), strict=True)
    ]
    np.testing.assert_allclose(first.rotation, turns[2] @ turns[1] @ turns[0], atol=1e-14)  # Rz Ry Rx


def test_matchid_convention(tmp_path: Path) -> None:
    found = read_rig(written(tmp_path, MATCHID))
    R, t = found.relative
    np.testing.assert_allclose(t, [-0.1805, 1.5e-3, 48.25e-3], rtol=1e-15)
    turns = [
        cv2.Rodrigues(np.deg2rad(a) * axis)[0] for a, axis in zip((0.5, 15.0, -1.0), np.eye(3), strict=True)
    ]
    np.testing.assert_allclose(R, turns[2] @ turns[1] @ turns[0], atol=1e-14)
    assert found.cameras[1].fx == 2899.5
    assert found.cameras[0].distortion == (-0.1, 0.2, 1e-3, -2e-3, 0.0)
    metres = MATCHID.replace("Tx [mm]; -180.5", "Tx [m]; -0.1805")
    np.testing.assert_allclose(
        read_rig(written(tmp_path, metres), length_unit=1.0).relative[1], t, rtol=1e-12
    )


@pytest.mark.parametrize("relative", ["true", "false"])
def test_dice_convention(tmp_path: Path, relative: str) -> None:
    text = DICE.format(kind="OPENCV", relative=relative, model="OPENCV_LENS_DISTORTION")
    first, second = read_rig(written(tmp_path, text)).cameras
    assert first.sensor == (1200, 800)
    assert first.distortion == (0.064, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(first.translation, [-63.25e-3, 0.0, 18.5e-3], rtol=1e-15)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    if relative == "true":  # X_1 = quarter (R0 X + t0) + t
        np.testing.assert_allclose(second.rotation, quarter @ first.rotation, atol=1e-15)
        np.testing.assert_allclose(second.translation, [64.75e-3, -63.25e-3 - 0.875e-3, 18.5e-3], rtol=1e-14)
    else:
        np.testing.assert_allclose(second.rotation, quarter, atol=1e-15)
        np.testing.assert_allclose(second.translation, [64.75e-3, -0.875e-3, 0.0], rtol=1e-15)


def test_opencorr_convention(tmp_path: Path) -> None:
    found = read_rig(written(tmp_path, OPENCORR))
    first, second = found.cameras
    assert (first.fx, first.cy, first.distortion) == (6673.25, 580.0, (0.03, -1.0, 1e-3, 0.0, 29.75))
    np.testing.assert_allclose(second.translation, [0.122, 1.5e-3, 17.5e-3], rtol=1e-15)
    np.testing.assert_allclose(cv2.Rodrigues(second.rotation)[0].ravel(), [0.003, -0.33, 0.005], atol=1e-14)


def test_dice_text_convention(tmp_path: Path) -> None:
    found = read_rig(written(tmp_path, TEXT))
    assert found.cameras[0].sensor == (970, 550)
    assert (found.cameras[1].fy, found.cameras[1].skew) == (2376.9, 0.09)
    np.testing.assert_allclose(found.relative[1], [130.75e-3, -0.61e-3, 17.125e-3], rtol=1e-15)
    np.testing.assert_allclose(angles_of(found.relative[0]), [0.09, -18.03, -0.0875], atol=1e-12)


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_opencv_storage_written_by_opencv(tmp_path: Path, suffix: str) -> None:
    R = cv2.Rodrigues(np.array([0.01, -0.2, 0.02]))[0]
    storage = cv2.FileStorage(str(tmp_path / f"stereo.{suffix}"), cv2.FILE_STORAGE_WRITE)
    for k in (1, 2):
        storage.write(
            f"cameraMatrix{k}", np.array([[5000.0 + k, 0.0, 250.0], [0.0, 5001.0, 260.0], [0.0, 0.0, 1.0]])
        )
        storage.write(f"distCoeffs{k}", np.array([[-0.1, 0.2, 1e-3, 2e-3, 0.3 * k]]))
    storage.write("R", R)
    storage.write("T", np.array([[-65.5], [0.25], [7.5]]))
    storage.write("image_width", 512)
    storage.write("image_height", 384)
    storage.release()
    found = read_rig(tmp_path / f"stereo.{suffix}")
    assert found.cameras[1].fx == 5002.0
    assert found.cameras[1].distortion == (-0.1, 0.2, 1e-3, 2e-3, 0.6)
    assert found.cameras[0].sensor == (512, 384)
    np.testing.assert_allclose(found.relative[0], R, atol=1e-15)
    np.testing.assert_allclose(found.relative[1], [-65.5e-3, 0.25e-3, 7.5e-3], rtol=1e-15)


def test_opencv_storage_of_plain_lists(tmp_path: Path) -> None:
    text = """{"K1": [[5000, 0, 250], [0, 5001, 260], [0, 0, 1]], "D1": [[-0.1, 0.2, 0, 0]],
    "t": [[-65.5], [0], [0]],
    "K2": [[5000, 0, 250], [0, 5001, 260], [0, 0, 1]], "D2": [0, 0, 0, 0, 0, 0, 0, 0],
    "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}"""
    found = read_rig(written(tmp_path, text))
    assert found.cameras[0].distortion == (-0.1, 0.2, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(found.cameras[1].centre, [65.5e-3, 0.0, 0.0], rtol=1e-15)


@pytest.mark.parametrize("format_", FORMATS, ids=lambda f: f.name)
def test_every_format_returns_what_was_written(tmp_path: Path, format_) -> None:
    start = rig()
    path = tmp_path / f"rig{format_.suffix}"
    write_rig(path, start, format_.name)
    found = read_rig(path)
    for ours, theirs in zip(start.cameras, found.cameras, strict=True):
        # Printed with 15 digits, so numbers of few digits come back as they were.
        np.testing.assert_array_equal(theirs.matrix, ours.matrix)
        assert theirs.distortion == ours.distortion
        assert theirs.sensor in (ours.sensor, None)
    for ours, theirs in zip(start.relative, found.relative, strict=True):
        np.testing.assert_allclose(theirs, ours, atol=1e-14)  # angles in degrees with 15 digits
    if format_.absolute_pose:
        for ours, theirs in zip(start.cameras, found.cameras, strict=True):
            np.testing.assert_allclose(theirs.rotation, ours.rotation, atol=1e-14)
            np.testing.assert_allclose(theirs.translation, ours.translation, atol=1e-15)
    again = tmp_path / f"again{format_.suffix}"
    write_rig(again, found, format_.name)
    third = read_rig(again)
    for ours, theirs in zip(found.relative, third.relative, strict=True):
        np.testing.assert_allclose(theirs, ours, atol=1e-14)


@pytest.mark.parametrize("unit", [1.0, 25.4e-3])
@pytest.mark.parametrize("format_", FORMATS, ids=lambda f: f.name)
def test_lengths_may_have_another_unit(tmp_path: Path, format_, unit: float) -> None:
    path = tmp_path / "rig"
    write_rig(path, rig(), format_.name, length_unit=unit)
    np.testing.assert_allclose(
        read_rig(path, length_unit=unit).relative[1], rig().relative[1], atol=1e-15
    )  # round-off of 0.3 m


def test_own_opencv_file_keeps_covariance_and_unit(tmp_path: Path) -> None:
    root = np.random.default_rng(0).normal(size=(26, 26))
    start = StereoRig(rig().cameras, root @ root.T)
    write_rig(tmp_path / "rig.yml", start, "opencv", length_unit=1e-2)
    found = read_rig(tmp_path / "rig.yml")
    assert found.covariance is not None
    np.testing.assert_allclose(found.covariance, start.covariance, rtol=1e-15)
    np.testing.assert_allclose(found.relative[1], start.relative[1], atol=1e-15)  # round-off of 0.3 m


@pytest.mark.parametrize("format_", FORMATS, ids=lambda f: f.name)
def test_tangential_distortion_is_kept_or_refused(tmp_path: Path, format_) -> None:
    lens = (-0.175, 0.5, 1e-3, -2e-3, -0.25)
    path = tmp_path / "rig"
    if not format_.tangential:
        with pytest.raises(CameraFileError, match=r"tangential distortion p1 = 0.001"):
            write_rig(path, rig(distortion=lens), format_.name)
        assert not path.exists()
    else:
        write_rig(path, rig(distortion=lens), format_.name)
        assert read_rig(path).cameras[1].distortion == lens


@pytest.mark.parametrize("format_", FORMATS, ids=lambda f: f.name)
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 0.95])
def test_a_truncated_file_is_refused_in_one_line(tmp_path: Path, format_, share: float) -> None:
    path = tmp_path / "rig"
    write_rig(path, rig(), format_.name)
    text = path.read_text()
    whole = read_rig(path)
    path.write_text(text[: int(share * len(text.rstrip()))])
    refused = ""
    try:
        found = read_rig(path)
    except CameraFileError as error:
        refused = str(error)
    if refused:
        assert str(path) in refused
        assert "\n" not in refused
    else:  # what was cut off said nothing of the cameras, as the end of a VIC-3D project does
        assert share > 0.5
        for ours, theirs in zip(whole.cameras, found.cameras, strict=True):
            np.testing.assert_array_equal(theirs.matrix, ours.matrix)
            assert theirs.distortion == ours.distortion
            np.testing.assert_array_equal(theirs.translation, ours.translation)


def test_coefficients_of_a_vic3d_system_are_vic3d_s(tmp_path: Path) -> None:
    text = DICE.format(kind="VIC3D", relative="false", model="K1R1_K2R2_K3R3")
    assert read_rig(written(tmp_path, text)).cameras[0].distortion == (0.064, 0.0, 0.0, 0.0, 0.0)


def test_wrong_options_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CameraFileError, match="format 'zeiss' is unknown; use one of vic3d, dice"):
        write_rig(tmp_path / "rig", rig(), "zeiss")
    for call in (
        lambda: read_rig(tmp_path / "rig", length_unit=0.0),
        lambda: write_rig(tmp_path / "rig", rig(), "vic3d", length_unit=1e3),
    ):
        with pytest.raises(ValueError, match="length_unit must be above 0 and at most 1 m"):
            call()


def test_angles_at_the_end_of_their_range() -> None:
    for angles in ((30.0, 90.0, 0.0), (-170.0, -90.0, 0.0), (179.9, -12.0, -0.1)):
        np.testing.assert_allclose(
            rotation_of(*angles_of(rotation_of(*angles))), rotation_of(*angles), atol=1e-14
        )


def broken_file(tmp_path: Path, text: str) -> Path:
    """A file with this text."""
    path = tmp_path / "camera.file"
    path.write_text(text, encoding="utf-8")
    return path


MARKER = '<Parameter name="xml_file_format" type="string" value="DICe_xml_camera_system_file"/>'


def cases() -> list[tuple[str, str, str]]:
    """Broken files: name, text, words of the message."""
    dice = DICE.format(kind="OPENCV", relative="false", model="OPENCV_LENS_DISTORTION")
    camera2 = VIC3D.replace(
        "</calibration>", '<camera id="2">1</camera><camera id="3">1</camera></calibration>'
    )
    entity = '<!DOCTYPE vpml [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>'
    return [
        ("vic3d four cameras", camera2, r"line 4: has 4 cameras \(0, 1, 2, 3\), must have 0 and 1"),
        ("vic3d one camera", VIC3D.replace('id="1"', 'id="9"'), r"has 2 cameras \(0, 9\)"),
        (
            "vic3d few numbers",
            VIC3D.replace("971.33 ", ""),
            "line 7: camera 1 has 7 numbers, must have 8: cx cy fx",
        ),
        (
            "vic3d word",
            VIC3D.replace("971.33", "97l.33"),
            "line 7: camera 1: cx is '97l.33'; it must be a finite",
        ),
        ("vic3d infinite", VIC3D.replace("971.33", "1e999"), "line 7: camera 1: cx is '1e999'"),
        ("vic3d short pose", VIC3D.replace(" 20.168<", "<"), "line 6: camera 0's orientation has 5 numbers"),
        (
            "vic3d focal length",
            VIC3D.replace("6636.03", "-6636.03"),
            "line 5: camera 0: focal lengths must be pos",
        ),
        ("vic3d entity", VIC3D.replace("<!DOCTYPE vpml>", entity), "line 2: declares an XML entity"),
        ("vic3d reference", VIC3D.replace("971.33", "&b;"), "line 7: is not well-formed XML"),
        (
            "vic3d cut",
            VIC3D[: VIC3D.index("</calibration>")],
            "line 4: the calibration element is not closed",
        ),
        (
            "dice four cameras",
            dice.replace("</ParameterList>\n</P", '</ParameterList>\n<ParameterList name="CAMERA 2"/></P'),
            r"has 3 cameras \(CAMERA 0, CAMERA 1, CAMERA 2\)",
        ),
        ("dice no focal length", dice.replace('"FX"', '"FU"', 1), "line 5: camera 0 has no FX"),
        (
            "dice model",
            DICE.format(kind="GENERIC_SYSTEM", relative="true", model="K1R2_K2R4_K3R6"),
            "line 9: camera 0: the lens model K1R2_K2R4_K3R6 is not one of",
        ),
        (
            "dice K4",
            dice.replace('name="K1"', 'name="K4"', 1),
            "line 8: camera 0: K4 = 0.064, but only k1, k2",
        ),
        (
            "dice row",
            dice.replace("{ 0.0, -1.0, 0.0 }", "{ 0.0, -1.0 }"),
            "ROW 0 is '{ 0.0, -1.0 }', must hold 3",
        ),
        (
            "dice no rotation",
            dice.replace("{ 0.0, -1.0, 0.0 }", "{ 0.0, -1.5, 0.0 }"),
            "camera 1: rotation must be",
        ),
        ("dice entity", f"<!DOCTYPE p [<!ENTITY a 'b'>]>{dice}", "line 1: declares an XML entity"),
        (
            "dice deep",
            f"<ParameterList>{MARKER}{'<a>' * 30}{'</a>' * 30}</ParameterList>",
            "nests more than 20",
        ),
        (
            "matchid four cameras",
            MATCHID + "\nCam2_Fx [pixels];1\nCam3_Fx [pixels];1",
            r"cameras \[0, 1, 2, 3\]",
        ),
        ("matchid missing", MATCHID.replace("Phi", "Phu"), "has no Phi; the file may be cut short"),
        ("matchid twice", MATCHID + "\nTx [mm];1", "line 27: gives Tx twice"),
        (
            "matchid unit",
            MATCHID.replace("Ty [mm]", "Ty [furlong]"),
            "line 22: Ty is in 'furlong'; it must be in one of mm",
        ),
        ("matchid angle", MATCHID.replace("Phi [deg]", "Phi [rad]"), "line 25: Phi is in 'rad'"),
        ("matchid word", MATCHID.replace("48.25", "x"), "line 23: Tz is 'x'"),
        ("opencorr views", OPENCORR.replace("view2", "view7"), r"has the views \[1, 7\]"),
        (
            "opencorr missing",
            OPENCORR.replace("view2_cam_extrinsics.ry", "view2_cam_extrinsics.qq"),
            "view 2 has no ry",
        ),
        ("opencorr k4", OPENCORR.replace("k4 = 0", "k4 = 1"), "line 9: view 1: k4 = 1.0, but only"),
        ("opencorr word", OPENCORR.replace("17.5", "1O"), "line 13: view 1: tz is '1O'"),
        ("text count", TEXT.replace("\n970", ""), r"has 23 numbers, must have 24 \(with angles\) or 30"),
        ("text words", TEXT.replace("17.125", "17 125"), "line 23: holds 2 words"),
        (
            "text size",
            TEXT.replace("550", "550.5"),
            "line 1: camera 0: pictures of 970 x 550.5 px; columns and",
        ),
        (
            "dice size",
            dice.replace("{ 800, 1200 }", "{ 0, 1e9 }"),
            "line 5: camera 0: pictures of 1e.09 x 0 px",
        ),
        ("text nan", TEXT.replace("17.125", "nan"), "line 23: number 22 is 'nan'"),
        ("opencv empty", "%YAML:1.0\n---\nA: 1\n", r"has no R .* among A"),
        ("opencv broken", "%YAML:1.0\n---\n\tM1: [a,\n", "OpenCV cannot parse it"),
        (
            "opencv huge",
            "%YAML:1.0\n---\nR: !!opencv-matrix\n   rows: 30000000\n"
            "   cols: 30000000\n   dt: d\n   data: [ 1 ]\n",
            "R holds 1 numbers, must hold 3 × 3",
        ),
        ("opencv words", '{"R": ["a", "b"]}', "R contains a value that is not a number"),
        ("nothing", "hello\n", "is no camera file known here; known are: VIC-3D project XML, DICe"),
        ("empty", "", "is no camera file known here"),
    ]


@pytest.mark.parametrize(("text", "words"), [case[1:] for case in cases()], ids=[case[0] for case in cases()])
def test_broken_and_hostile_files_are_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = broken_file(tmp_path, text)
    with pytest.raises(CameraFileError, match=words) as caught:
        read_rig(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("lens", ["[1,2,3]", "[0,0,0,0,0,0.5,0,0]"])
def test_opencv_models_beyond_brown_s_are_refused(tmp_path: Path, lens: str) -> None:
    text = f"""{{"K1": [[5000, 0, 250], [0, 5001, 260], [0, 0, 1]], "D1": {lens}, "t": [-65.5, 0, 0],
    "K2": [[5000, 0, 250], [0, 5001, 260], [0, 0, 1]], "D2": [0, 0, 0, 0],
    "R": [1, 0, 0, 0, 1, 0, 0, 0, 1]}}"""
    with pytest.raises(CameraFileError, match=r"D1 has (3 numbers|.*beyond k1 k2 p1 p2 k3)"):
        read_rig(broken_file(tmp_path, text))
    with pytest.raises(CameraFileError, match="transpose it"):
        read_rig(
            broken_file(
                tmp_path, text.replace("[5000, 0, 250]", "[5000, 0, 0]").replace("[0, 0, 1]]", "[9, 9, 1]]")
            )
        )


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "picture.tif").write_bytes(b"II*\0\x08\0\0\0")
    with pytest.raises(CameraFileError, match="is not a text file"):
        read_rig(tmp_path / "picture.tif")
    (tmp_path / "project.z3d").write_bytes(b"PK\3\4\0\0")
    with pytest.raises(CameraFileError, match="packed archive; unpack it"):
        read_rig(tmp_path / "project.z3d")
    with pytest.raises(CameraFileError, match="cannot be read"):
        read_rig(tmp_path / "missing.xml")
    with (tmp_path / "large.xml").open("wb") as file:
        file.truncate(17 * 2**20)
    with pytest.raises(CameraFileError, match="larger than 16 MiB"):
        read_rig(tmp_path / "large.xml")


def test_text_of_two_bytes_a_character_is_read_and_a_decimal_comma_named(tmp_path: Path) -> None:
    path = tmp_path / "rig.caldat"
    write_rig(path, rig(), "matchid")
    text = path.read_text()
    path.write_text(text, encoding="utf-16")
    assert np.array_equal(read_rig(path).cameras[1].matrix, rig().cameras[1].matrix)
    path.write_text(text.replace(".", ","))
    with pytest.raises(CameraFileError, match="write the decimal sign as a point"):
        read_rig(path)


DEEP = 100_000


@pytest.mark.parametrize(
    "text",
    [
        '{"M1":' * DEEP + "1" + "}" * DEEP,
        '{"M1":' + "[" * DEEP + "]" * DEEP + "}",
        "%YAML:1.0\n---\nM1: " + "[" * DEEP,
        "%YAML:1.0\n---\nM1:\n" + "- " * DEEP + "1\n",
        "<opencv_storage>" + "<a>" * DEEP + "</a>" * DEEP + "</opencv_storage>",
    ],
)
def test_deep_nesting_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.yml"
    path.write_text(text)
    with pytest.raises(CameraFileError, match=f"more than {DEEPEST} levels deep"):
        read_rig(path)


def test_the_depth_is_counted() -> None:
    assert _depth('{"a": [1, 2], "b": {"c": [3]}}') == 3
    assert _depth("<opencv_storage><a><b>1</b></a><c>2</c></opencv_storage>") == 3
    assert _depth("a: !!opencv-matrix\n   rows: 3\n   data: [ 1., -2., -3. ]\n") == 1
    assert _depth("x:\n  - - - 1\n  - 2\n") == 3
