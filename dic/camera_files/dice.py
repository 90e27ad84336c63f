"""DICe's calibrations: camera system files (.xml, Teuchos parameter lists) and the older text files (.txt).

Poses are world to camera, ``X_cam = R X + t`` with R given, or R = Rz(γ) Ry(β) Rx(α) in degrees. With
``extrinsics_relative_camera_to_camera``, and in text files, the pose of camera 1 is relative to camera 0.
Lengths have the unit of the target, which the file does not state. A text file holds cx cy fx fy fs k1 k2 k3
of each camera, alpha beta gamma [degrees] or R11 to R33, tx ty tz, height and width; a # begins a comment. FS
is a skew in px. Brown's lens models are read. Coefficients of VIC-3D are read with VIC-3D's definition, also
in text files. In these DICe assumes K1 R + K2 R² + K3 R³ on the radius. Other models are rejected.
"""

import numpy as np

from dic.basics import FloatArray
from dic.camera import Camera, StereoRig
from dic.camera_files.source import Element, Source, parse, printed, rotation_of

MARK = "DICe_xml_camera_system_file"
BROWN = {"OPENCV_LENS_DISTORTION", "OPENCV_DIS", "K1R3_K2R5_K3R7"}
NONE = {"NO_LENS_DISTORTION", "NONE"}
OTHER = {"VIC3D_LENS_DISTORTION", "VIC3D_DIS", "K1R1_K2R2_K3R3", "K1R2_K2R4_K3R6"}
BEYOND = ("K4", "K5", "K6", "S1", "S2", "S3", "S4", "T1", "T2")
"""Coefficients that `Camera` does not have."""


class DiceXml:
    """The format; see `dic.camera_files.CameraFormat`."""

    name = "dice"
    about = "DICe camera system XML"
    suffix = ".xml"
    absolute_pose = True
    tangential = True

    def sniff(self, text: str) -> bool:
        """True for a text of this format."""
        return "<ParameterList" in text and MARK in text

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig."""
        system = parse(source)
        lists = {child.attributes.get("name", ""): child for child in system.with_tag("ParameterList")}
        cameras = sorted(name for name in lists if name.startswith("CAMERA"))
        if cameras != ["CAMERA 0", "CAMERA 1"]:
            raise source.error(
                f"has {len(cameras)} cameras ({', '.join(cameras) or 'none'}), must have CAMERA 0 "
                "and CAMERA 1",
                line=system.line,
                cure="write the calibration of one stereo pair",
            )
        top = _parameters(system)
        kind = top["system_type_3D"][0] if "system_type_3D" in top else ""
        relative = top.get("extrinsics_relative_camera_to_camera", ("false", 0))[0].lower() == "true"
        for name in ("user_4x4_param_transform", "user_6_param_transform"):
            if name in lists or name in top:
                raise source.error(f"has a {name}, which is not used here", cure="take it out of the file")
        first, second = (
            _camera(source, lists[f"CAMERA {k}"], k, length_unit, from_vic3d=kind == "VIC3D") for k in (0, 1)
        )
        if relative:
            R, t = second.rotation, second.translation
            rotation, translation = R @ first.rotation, R @ first.translation + t
            second = Camera(
                second.fx, second.fy, second.cx, second.cy, second.skew, second.distortion,
                rotation, translation, second.sensor,
            )  # fmt: skip
        return StereoRig((first, second))

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text."""
        lines = [
            "<ParameterList>",
            f'<Parameter name="xml_file_format" type="string" value="{MARK}" />',
            '<Parameter name="system_type_3D" type="string" value="OPENCV" />',
            '<Parameter name="extrinsics_relative_camera_to_camera" type="bool" value="false" />',
        ]
        for k, camera in enumerate(rig.cameras):
            if camera.sensor is None:
                raise ValueError(
                    f"camera {k} has no sensor size, which DICe needs; set Camera.sensor to (columns, rows)"
                )
            k1, k2, p1, p2, k3 = camera.distortion
            values = {"CX": camera.cx, "CY": camera.cy, "FX": camera.fx, "FY": camera.fy, "FS": camera.skew}
            values |= {"K1": k1, "K2": k2, "K3": k3, "P1": p1, "P2": p2}
            values |= dict(zip(("TX", "TY", "TZ"), camera.translation / length_unit, strict=True))
            lines.append(f'<ParameterList name="CAMERA {k}">')
            lines.append(f'<Parameter name="CAMERA_ID" type="string" value="CAMERA {k}" />')
            lines += [
                f'<Parameter name="{name}" type="double" value="{printed(value)}" />'
                for name, value in values.items()
            ]
            model = "OPENCV_LENS_DISTORTION"
            lines.append(f'<Parameter name="LENS_DISTORTION_MODEL" type="string" value="{model}" />')
            lines.append('<ParameterList name="rotation_3x3_matrix">')
            for i, row in enumerate(camera.rotation):
                text = ", ".join(f"{value:.17g}" for value in row)
                lines.append(f'<Parameter name="ROW {i}" type="string" value="{{ {text} }}" />')
            lines.append("</ParameterList>")
            size = f"{{ {camera.sensor[1]}, {camera.sensor[0]} }}"
            lines.append(f'<Parameter name="IMAGE_HEIGHT_WIDTH" type="string" value="{size}" />')
            lines.append("</ParameterList>")
        return "\n".join([*lines, "</ParameterList>", ""])


def _parameters(element: Element) -> dict[str, tuple[str, int]]:
    """Values and lines of a list's parameters, by name, without those of nested lists."""
    return {
        child.attributes.get("name", ""): (child.attributes.get("value", "").strip(), child.line)
        for child in element.with_tag("Parameter")
    }


def _camera(source: Source, element: Element, index: int, length_unit: float, *, from_vic3d: bool) -> Camera:
    parameters = _parameters(element)

    def value(name: str, *, must: bool = False) -> float:
        if name not in parameters and must:
            raise source.error(
                f"camera {index} has no {name}", line=element.line, cure="write the calibration again"
            )
        word, line = parameters.get(name, ("0", element.line))
        return source.number(word, f"camera {index}: {name}", line)

    for name in BEYOND:
        if value(name) != 0.0:
            raise source.error(
                f"camera {index}: {name} = {value(name)}, but only k1, k2, k3, p1 and p2 are known here",
                line=parameters[name][1],
                cure="calibrate with Brown's five coefficients",
            )
    k1, k2, p1, p2, k3 = (value(name) for name in ("K1", "K2", "P1", "P2", "K3"))
    model, line = parameters.get("LENS_DISTORTION_MODEL", ("NO_LENS_DISTORTION", element.line))
    if model in NONE:
        k1 = k2 = p1 = p2 = k3 = 0.0
    elif model not in BROWN and not (model in OTHER and (from_vic3d or not any((k1, k2, k3)))):
        raise source.error(
            f"camera {index}: the lens model {model} is not one of {', '.join(sorted(BROWN | NONE))}",
            line=line,
            cure="calibrate with the model of OpenCV; coefficients that came from VIC-3D or OpenCV are "
            "OPENCV_LENS_DISTORTION whatever the file states",
        )
    sensor = None
    if "IMAGE_HEIGHT_WIDTH" in parameters:
        rows, columns = _braces(source, *parameters["IMAGE_HEIGHT_WIDTH"], "IMAGE_HEIGHT_WIDTH", 2)
        sensor = (columns, rows)
    return source.camera(
        index=index,
        line=element.line,
        matrix=(
            value("FX", must=True), value("FY", must=True), value("CX", must=True), value("CY", must=True),
            value("FS"),
        ),
        distortion=(k1, k2, p1, p2, k3),
        rotation=_rotation(source, element, [value(name) for name in ("ALPHA", "BETA", "GAMMA")]),
        translation=length_unit * np.array([value(name) for name in ("TX", "TY", "TZ")]),
        sensor=sensor,
    )  # fmt: skip


def _rotation(source: Source, element: Element, angles: list[float]) -> FloatArray:
    """The rotation matrix of a camera's list, or the one from its angles."""
    matrices = [
        c for c in element.with_tag("ParameterList") if c.attributes.get("name") == "rotation_3x3_matrix"
    ]
    if not matrices:
        return rotation_of(*angles)
    if any(angles):
        raise source.error(
            "gives angles and a rotation matrix", line=matrices[0].line, cure="keep one of them"
        )
    rows = _parameters(matrices[0])
    matrix = []
    for i in range(3):
        if f"ROW {i}" not in rows:
            raise source.error(
                f"the rotation has no ROW {i}", line=matrices[0].line, cure="write the calibration again"
            )
        matrix.append(_braces(source, *rows[f"ROW {i}"], f"ROW {i}", 3))
    return np.array(matrix)


def _braces(source: Source, text: str, line: int, name: str, count: int) -> list[float]:
    """Numbers of a list ``{ a, b }``."""
    words = text.strip().strip("{}").split(",")
    if len(words) != count:
        raise source.error(
            f"{name} is {text[:60]!r}, must hold {count} numbers",
            line=line,
            cure="write the calibration again",
        )
    return [source.number(word, name, line) for word in words]


INTRINSIC = ("cx", "cy", "fx", "fy", "fs", "k1", "k2", "k3")
ANGLES, MATRIX = 24, 30
"""Count of numbers in a file, with angles and with a rotation matrix."""


class DiceText:
    """The format; see `dic.camera_files.CameraFormat`."""

    name = "dice-text"
    about = "DICe text"
    suffix = ".txt"
    absolute_pose = False
    tangential = False

    def sniff(self, text: str) -> bool:
        """True for this format: the first lines hold a number and nothing else."""
        words = [line.partition("#")[0].split() for line in text.splitlines()[:40]]
        words = [line for line in words if line]
        try:
            return len(words) >= 8 and all(
                len(line) == 1 and np.isfinite(float(line[0])) for line in words[:8]
            )
        except ValueError:
            return False

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig."""
        numbers: list[float] = []
        lines: list[int] = []
        for line, text in enumerate(source.text.splitlines(), start=1):
            words = text.partition("#")[0].split()
            if not words:
                continue
            if len(words) > 1:
                cure = "a line holds one number; comments follow a #"
                raise source.error(f"holds {len(words)} words", line=line, cure=cure)
            numbers.append(source.number(words[0], f"number {len(numbers) + 1}", line))
            lines.append(line)
        if len(numbers) not in (ANGLES, MATRIX):
            raise source.error(
                f"has {len(numbers)} numbers, must have {ANGLES} (with angles) or {MATRIX} (with R)",
                cure="2 × 8 of the cameras, the rotation, tx ty tz, then height and width of the pictures",
            )
        pose = np.array(numbers[16:-2])
        rotation = rotation_of(*pose[:3]) if len(numbers) == ANGLES else pose[:9].reshape(3, 3)
        poses: list[tuple[FloatArray, FloatArray]] = [
            (np.eye(3), np.zeros(3)),
            (rotation, length_unit * pose[-3:]),
        ]
        cameras = []
        for k, (R, t) in enumerate(poses):
            cx, cy, fx, fy, fs, k1, k2, k3 = numbers[8 * k : 8 * k + 8]
            cameras.append(
                source.camera(
                    index=k,
                    line=lines[8 * k],
                    matrix=(fx, fy, cx, cy, fs),
                    distortion=(k1, k2, 0.0, 0.0, k3),
                    rotation=R,
                    translation=t,
                    sensor=(numbers[-1], numbers[-2]),
                )
            )
        return StereoRig((cameras[0], cameras[1]))

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text; the rig's frame becomes that of camera 0."""
        lines = []
        for k, camera in enumerate(rig.cameras):
            k1, k2, p1, p2, k3 = camera.distortion
            if p1 or p2:
                raise ValueError(
                    f"camera {k} has tangential distortion p1 = {p1}, p2 = {p2}, which DICe's text files "
                    "cannot hold; write its XML (dice) instead"
                )
            values = (camera.cx, camera.cy, camera.fx, camera.fy, camera.skew, k1, k2, k3)
            lines += [f"{printed(v)} # {name}" for name, v in zip(INTRINSIC, values, strict=True)]
        sizes = {camera.sensor for camera in rig.cameras}
        size = sizes.pop()
        if sizes or size is None:
            raise ValueError("DICe's text files need one sensor size for both cameras; set Camera.sensor")
        R, t = rig.relative
        lines += [f"{value:.17g} # R{i // 3 + 1}{i % 3 + 1}" for i, value in enumerate(R.ravel())]
        lines += [
            f"{printed(v)} # {name}" for name, v in zip(("tx", "ty", "tz"), t / length_unit, strict=True)
        ]
        return "\n".join([*lines, f"{size[1]} # height", f"{size[0]} # width", ""])
