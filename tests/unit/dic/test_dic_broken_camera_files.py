"""Camera files that are broken, hostile or of another kind: each refused in one line that says where."""

from pathlib import Path

import pytest
from camera_texts import DICE, MATCHID, OPENCORR, TEXT, VIC3D

from dic.camera_files import CameraFileError, read_rig


def written(tmp_path: Path, text: str) -> Path:
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
        ("opencv words", '{"R": ["a", "b"]}', "R holds something that is no number"),
        ("nothing", "hello\n", "is no camera file known here; known are: VIC-3D project XML, DICe"),
        ("empty", "", "is no camera file known here"),
    ]


@pytest.mark.parametrize(("text", "words"), [case[1:] for case in cases()], ids=[case[0] for case in cases()])
def test_broken_and_hostile_files_are_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = written(tmp_path, text)
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
        read_rig(written(tmp_path, text))
    with pytest.raises(CameraFileError, match="transpose it"):
        read_rig(
            written(
                tmp_path, text.replace("[5000, 0, 250]", "[5000, 0, 0]").replace("[0, 0, 1]]", "[9, 9, 1]]")
            )
        )


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "picture.tif").write_bytes(b"II*\0\x08\0\0\0")
    with pytest.raises(CameraFileError, match="is no text"):
        read_rig(tmp_path / "picture.tif")
    with pytest.raises(CameraFileError, match="cannot be read"):
        read_rig(tmp_path / "missing.xml")
    with (tmp_path / "large.xml").open("wb") as file:
        file.truncate(17 * 2**20)
    with pytest.raises(CameraFileError, match="larger than 16 MiB"):
        read_rig(tmp_path / "large.xml")
