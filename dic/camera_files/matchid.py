"""MatchID calibration files (.caldat): one ``name;value`` per line.

``Cam0_Fx [pixels];2898.55`` and so on for Fx, Fy, Fs, Kappa 1 to 3, P1, P2, Cx, Cy of Cam0 and Cam1, then
``Tx [mm]``, ``Ty [mm]``, ``Tz [mm]``, ``Theta [deg]``, ``Phi [deg]``, ``Psi [deg]``: X_1 = R X_0 + t with
R = Rz(Psi) Ry(Phi) Rx(Theta).
"""

import re

import numpy as np

from dic.camera import StereoRig
from dic.camera_files.source import Source, angles_of, printed, rotation_of

NUMBERS = ("Fx", "Fy", "Fs", "Kappa 1", "Kappa 2", "Kappa 3", "P1", "P2", "Cx", "Cy")
MUST = ("Fx", "Fy", "Cx", "Cy")
POSE = ("Tx", "Ty", "Tz", "Theta", "Phi", "Psi")
UNITS = {"mm": 1e-3, "m": 1.0, "µm": 1e-6, "um": 1e-6, "inch": 25.4e-3}
ENTRY = re.compile(r"\s*([^\[;:=\t]{1,40}?)\s*(?:\[([^\]]{1,20})\])?\s*[;:=\t]\s*(\S[^;]{0,60}?)\s*;?\s*$")
LONGEST = 400
"""Longest line that is searched for a name and a value [characters]. The time of the search grows with a
power of the length."""
CAMERA = re.compile(r"^[ \t]{0,40}Cam(\d{1,6})_", re.MULTILINE)


class MatchID:
    """The format; see `dic.camera_files.CameraFormat`."""

    name = "matchid"
    about = "MatchID .caldat"
    suffix = ".caldat"
    absolute_pose = False
    tangential = True

    def sniff(self, text: str) -> bool:
        """True for a text of this format."""
        return CAMERA.search(text) is not None

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig; its lengths have the unit stated in the file, if there is one."""
        cameras = sorted({int(number) for number in CAMERA.findall(source.text)})
        if cameras != [0, 1]:
            raise source.error(
                f"has the cameras {cameras}, must have 0 and 1",
                cure="export the calibration of one stereo pair",
            )
        entries = _entries(source)
        for name in [f"Cam{k}_{name}" for k in (0, 1) for name in MUST] + list(POSE):
            if name.replace(" ", "") not in entries:
                raise source.error(f"has no {name}", cure="the file may be cut short: export it again")

        def value(name: str, units: dict[str, float] | None = None) -> float:
            number, line, unit = entries.get(name.replace(" ", ""), (0.0, None, ""))
            if units is None:
                return number
            if unit not in units:
                cure = f"it must be in one of {', '.join(name for name in units if name)}"
                raise source.error(f"{name} is in {unit!r}", line=line, cure=cure)
            return number * units[unit]

        lengths, degrees = UNITS | {"": length_unit}, {"deg": 1.0, "°": 1.0, "": 1.0}
        poses = [
            (np.eye(3), np.zeros(3)),
            (
                rotation_of(*(value(name, degrees) for name in ("Theta", "Phi", "Psi"))),
                np.array([value(name, lengths) for name in ("Tx", "Ty", "Tz")]),
            ),
        ]
        first, second = (
            source.camera(
                index=k,
                line=entries[f"Cam{k}_Fx"][1],
                matrix=tuple(value(f"Cam{k}_{name}") for name in ("Fx", "Fy", "Cx", "Cy", "Fs")),  # type: ignore[arg-type]
                distortion=tuple(  # type: ignore[arg-type]
                    value(f"Cam{k}_{name}") for name in ("Kappa 1", "Kappa 2", "P1", "P2", "Kappa 3")
                ),
                rotation=pose[0],
                translation=pose[1],
            )
            for k, pose in enumerate(poses)
        )
        return StereoRig((first, second))

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text, in mm; the rig's frame becomes that of camera 0."""
        lines = []
        for k, camera in enumerate(rig.cameras):
            k1, k2, p1, p2, k3 = camera.distortion
            values = (camera.fx, camera.fy, camera.skew, k1, k2, k3, p1, p2, camera.cx, camera.cy)
            for name, number in zip(NUMBERS, values, strict=True):
                unit = " [pixels]" if name in ("Fx", "Fy", "Fs", "Cx", "Cy") else ""
                lines.append(f"Cam{k}_{name}{unit};{printed(number)}")
        R, t = rig.relative
        for name, number in zip(POSE, (*(t / 1e-3), *angles_of(R)), strict=True):
            lines.append(f"{name} [{'mm' if name[0] == 'T' and len(name) == 2 else 'deg'}];{printed(number)}")
        return "\n".join([*lines, ""])


def _entries(source: Source) -> dict[str, tuple[float, int, str]]:
    """Value, line and unit by name without blanks."""
    allowed = {f"Cam{k}_{name}" for k in (0, 1) for name in NUMBERS} | set(POSE)
    entries: dict[str, tuple[float, int, str]] = {}
    for line, text in enumerate(source.text.splitlines(), start=1):
        match = ENTRY.match(text) if len(text) <= LONGEST else None
        if match is None:
            continue
        name = match[1].replace(" ", "")
        if name in {k.replace(" ", "") for k in allowed}:
            if name in entries:
                raise source.error(f"gives {match[1]} twice", line=line, cure="keep one")
            entries[name] = (source.number(match[3], match[1], line), line, (match[2] or "").strip())
    return entries
