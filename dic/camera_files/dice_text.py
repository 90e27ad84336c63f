"""DICe's old text calibrations (.txt): one number a line, in a fixed order.

cx cy fx fy fs k1 k2 k3 of camera 0, the same of camera 1, then alpha beta gamma [degrees] or R11 to R33, then
tx ty tz, then height and width: ``X_1 = R X_0 + t``, R = Rz(γ) Ry(β) Rx(α). What follows a # is a comment.
Such files were made from calibrations of VIC-3D or OpenCV, and their coefficients are read as those programs
mean them, 1 + k1 r² + k2 r⁴ + k3 r⁶ (DICe's reader assumes K1 R + K2 R² + K3 R³ on the radius instead).
"""

import numpy as np

from dic.arrays import FloatArray
from dic.camera import StereoRig
from dic.camera_files.source import CameraFileError, Source, printed, rotation_of

INTRINSIC = ("cx", "cy", "fx", "fy", "fs", "k1", "k2", "k3")
ANGLES, MATRIX = 24, 30
"""Count of numbers in a file, with angles and with a rotation matrix."""


class DiceText:
    """The format; see `dic.camera_files.formats.CameraFormat`."""

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
                raise CameraFileError(source.path, f"holds {len(words)} words", line=line, cure=cure)
            numbers.append(source.number(words[0], f"number {len(numbers) + 1}", line))
            lines.append(line)
        if len(numbers) not in (ANGLES, MATRIX):
            raise CameraFileError(
                source.path,
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
