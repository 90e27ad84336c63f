"""VIC-3D project files (.xml, .z3d unpacked): a line of intrinsic numbers and an orientation per camera.

``<camera id="0">cx cy fx fy skew k1 k2 k3 <orientation>α β γ tx ty tz</orientation></camera>``, with ``X_cam
= R X + t``, R = Rz(γ) Ry(β) Rx(α) in degrees and the radial distortion 1 + k1 r² + k2 r⁴ + k3 r⁶. Lengths
have the unit of the calibration target, which the file does not state. Projects are not always well-formed
XML, so only their calibration element is parsed.
"""

import re

import numpy as np

from dic.camera import Camera, StereoRig
from dic.camera_files.source import Element, Source, angles_of, parse, printed, rotation_of

OPENS = re.compile(r"<calibration(?=[\s>])")
NUMBERS = ("cx", "cy", "fx", "fy", "skew", "k1", "k2", "k3")
ORIENTATION = ("alpha", "beta", "gamma", "tx", "ty", "tz")
SIZE = re.compile(r"<polygonmask\b[^<>]{0,200}?\bwidth=\"(\d{1,6})\"[^<>]{0,200}?\bheight=\"(\d{1,6})\"")


class Vic3D:
    """The format; see `dic.camera_files.CameraFormat`."""

    name = "vic3d"
    about = "VIC-3D project XML"
    suffix = ".xml"
    absolute_pose = True
    tangential = False

    def sniff(self, text: str) -> bool:
        """True for a text of this format."""
        return OPENS.search(text) is not None and "<camera" in text

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig."""
        opens = OPENS.search(source.text)
        start = opens.start() if opens else 0
        end = source.text.find("</calibration>", start)
        if end < 0:
            raise source.error(
                "the calibration element is not closed",
                line=source.line_of(start),
                cure="the file is cut short: save the project again",
            )
        if "<!ENTITY" in source.text:
            raise source.error(
                "declares an XML entity, which is not allowed in a project",
                line=source.line_of(source.text.index("<!ENTITY")),
                cure="save the project again",
            )
        calibration = parse(source, start=start, end=end + len("</calibration>"))
        cameras = calibration.with_tag("camera")
        names = [camera.attributes.get("id", "?") for camera in cameras]
        if sorted(names) != ["0", "1"]:
            cure = "export a two-camera project"
            if names in (["0"], ["1"]):
                cure = "the project is of one camera, or cut short: save the stereo project again"
            raise source.error(
                f"has {len(cameras)} cameras ({', '.join(names) or 'none'}), must have 0 and 1",
                line=calibration.line,
                cure=cure,
            )
        size = SIZE.search(source.text)
        sensor = (int(size[1]), int(size[2])) if size else None
        first, second = sorted(cameras, key=lambda camera: camera.attributes["id"])
        return StereoRig(
            (_camera(source, first, 0, length_unit, sensor), _camera(source, second, 1, length_unit, sensor))
        )

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text."""
        lines = [
            '<?xml version="1.0" encoding="ISO-8859-1"?>',
            "<project>",
            ' <calibration lri="calibration">',
        ]
        for k, camera in enumerate(rig.cameras):
            k1, k2, p1, p2, k3 = camera.distortion
            if p1 or p2:
                raise ValueError(
                    f"camera {k} has tangential distortion p1 = {p1}, p2 = {p2}, which a VIC-3D project "
                    "cannot hold; calibrate without it, or write another format"
                )
            numbers = (camera.cx, camera.cy, camera.fx, camera.fy, camera.skew, k1, k2, k3)
            pose = (*angles_of(camera.rotation), *(camera.translation / length_unit))
            lines.append(
                f'  <camera id="{k}">{" ".join(map(printed, numbers))}'
                f"<orientation>{' '.join(map(printed, pose))}</orientation></camera>"
            )
        lines.append(" </calibration>")
        sizes = {camera.sensor for camera in rig.cameras}
        if len(sizes) == 1 and (size := sizes.pop()) is not None:
            lines.append(f' <polygonmask width="{size[0]}" height="{size[1]}" lri="polygonmask"/>')
        return "\n".join([*lines, "</project>", ""])


def _camera(
    source: Source, element: Element, index: int, length_unit: float, sensor: tuple[int, int] | None
) -> Camera:
    values = _values(source, element, f"camera {index}", NUMBERS)
    orientations = element.with_tag("orientation")
    if len(orientations) != 1:
        raise source.error(
            f"camera {index} has {len(orientations)} orientations, must have one",
            line=element.line,
            cure="save the project after its stereo calibration",
        )
    pose = _values(source, orientations[0], f"camera {index}'s orientation", ORIENTATION)
    return source.camera(
        index=index,
        line=element.line,
        matrix=(values["fx"], values["fy"], values["cx"], values["cy"], values["skew"]),
        distortion=(values["k1"], values["k2"], 0.0, 0.0, values["k3"]),
        rotation=rotation_of(pose["alpha"], pose["beta"], pose["gamma"]),
        translation=length_unit * np.array([pose["tx"], pose["ty"], pose["tz"]]),
        sensor=sensor,
    )


def _values(source: Source, element: Element, quantity: str, names: tuple[str, ...]) -> dict[str, float]:
    """The numbers in an element's text, by name."""
    words = element.text.split()
    if len(words) != len(names):
        raise source.error(
            f"{quantity} has {len(words)} numbers, must have {len(names)}: {' '.join(names)}",
            line=element.line,
            cure="save the project again",
        )
    return {
        name: source.number(word, f"{quantity}: {name}", element.line)
        for name, word in zip(names, words, strict=True)
    }
