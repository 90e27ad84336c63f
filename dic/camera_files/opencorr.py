"""OpenCorr camera parameters, as written by its programs and examples.

``view1_cam_intrinsics.fx = 6673.3f;`` and so on for fx fy fs cx cy k1 to k6 p1 p2 of views 1 and 2, and
``view1_cam_extrinsics.tx`` to ``rz``: ``X_view = R X + t``, where Rodrigues' formula gives R from the
rotation vector (rx, ry, rz) [rad]. Lengths have the unit of the calibration target, which the file does not
state.
"""

import re

import numpy as np

from dic.basics import cv2
from dic.camera import StereoRig
from dic.camera_files.source import Source, printed

INTRINSIC = ("fx", "fy", "fs", "cx", "cy", "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
POSE = ("tx", "ty", "tz", "rx", "ry", "rz")
ENTRY = re.compile(
    r"^[ \t]*view(\d{1,3})_cam_(in|ex)trinsics\.(\w{2})[ \t]*=[ \t]*([^;\n]{1,60});", re.MULTILINE
)


class OpenCorr:
    """The format; see `dic.camera_files.CameraFormat`."""

    name = "opencorr"
    about = "OpenCorr camera parameters"
    suffix = ".txt"
    absolute_pose = True
    tangential = True

    def sniff(self, text: str) -> bool:
        """True for a text of this format."""
        return "_cam_intrinsics." in text

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig."""
        entries: dict[tuple[int, str], tuple[float, int]] = {}
        line, place = 1, 0
        for match in ENTRY.finditer(source.text):
            line += source.text.count("\n", place, match.start(3))
            view, name, place = int(match[1]), match[3], match.start(3)
            word = re.sub(r"(?<=[\d.])f$", "", match[4].strip())
            entries[view, name] = (source.number(word, f"view {view}: {name}", line), line)
        views = sorted({view for view, _ in entries})
        if views != [1, 2]:
            raise source.error(
                f"has the views {views}, must have 1 and 2", cure="write the parameters of one pair"
            )
        cameras = []
        for view in (1, 2):
            for name in (*INTRINSIC[:5], *POSE):
                if (view, name) not in entries:
                    raise source.error(f"view {view} has no {name}", cure="the file may be cut short")
            values = {name: entries.get((view, name), (0.0, None))[0] for name in (*INTRINSIC, *POSE)}
            for name in ("k4", "k5", "k6"):
                if values[name] != 0.0:
                    raise source.error(
                        f"view {view}: {name} = {values[name]}, but only k1 k2 k3 p1 p2 are known here",
                        line=entries[view, name][1],
                        cure="calibrate with Brown's five coefficients",
                    )
            turn = np.array([values["rx"], values["ry"], values["rz"]])
            cameras.append(
                source.camera(
                    index=view - 1,
                    line=entries[view, "fx"][1],
                    matrix=(values["fx"], values["fy"], values["cx"], values["cy"], values["fs"]),
                    distortion=(values["k1"], values["k2"], values["p1"], values["p2"], values["k3"]),
                    rotation=np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64),
                    translation=length_unit * np.array([values["tx"], values["ty"], values["tz"]]),
                )
            )
        return StereoRig((cameras[0], cameras[1]))

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text."""
        lines = []
        for view, camera in enumerate(rig.cameras, start=1):
            k1, k2, p1, p2, k3 = camera.distortion
            values = (
                camera.fx, camera.fy, camera.skew, camera.cx, camera.cy, k1, k2, k3, 0.0, 0.0, 0.0, p1, p2
            )  # fmt: skip
            turn = cv2.Rodrigues(camera.rotation)[0].ravel()
            pose = [printed(v) for v in camera.translation / length_unit] + [f"{v:.17g}" for v in turn]
            lines += [
                f"view{view}_cam_intrinsics.{name} = {printed(value)};"
                for name, value in zip(INTRINSIC, values, strict=True)
            ]
            lines += [f"view{view}_cam_extrinsics.{n} = {v};" for n, v in zip(POSE, pose, strict=True)]
        return "\n".join([*lines, ""])
