"""Shared parts of the camera file formats: safe reading of text and XML, numbers, and the error class.

VIC-3D, DICe and MatchID write the angles of R = Rz(γ) Ry(β) Rx(α), in degrees. XML is parsed by Expat. A
document that declares an entity is rejected; no entity is expanded or loaded.
"""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from dic.basics import FloatArray
from dic.camera import Camera
from dic.files import one_line, regular

LARGEST = 16 * 2**20
"""Largest size of a camera file [bytes]; a project of ten thousand pictures is one file."""
LONGEST = 100_000
"""Largest side of a picture [px]."""


class CameraFileError(ValueError):
    """A camera file that cannot be read, or a rig that a format cannot hold.

    Its text names the file, the line (if known), the fault and the remedy.
    """

    def __init__(self, path: Path | str, fault: str, *, line: int | None = None, cure: str = "") -> None:
        where = f"{path}" if line is None else f"{path}, line {line}"
        super().__init__(one_line(f"{where}: {fault}" + (f"; {cure}" if cure else "")))
        self.path, self.line, self.what, self.cure = Path(path), line, fault, cure


_COMMA = re.compile(r"\s*[+-]?\d{1,15},\d{1,20}(?:[eE][+-]?\d{1,3})?\s*")


@dataclass(frozen=True)
class Source:
    """The text of a camera file."""

    path: Path
    text: str
    """The whole text."""

    @classmethod
    def open(cls, path: Path | str) -> "Source":
        """Read a file.

        Raises CameraFileError if the file is missing, larger than `LARGEST`, or not text.
        """
        path = Path(path)
        try:
            with regular(path).open("rb") as file:
                data = file.read(LARGEST + 1)
        except OSError as error:
            raise CameraFileError(path, f"cannot be read ({error.strerror})", cure="check the path") from None
        if len(data) > LARGEST:
            raise CameraFileError(
                path, f"is larger than {LARGEST // 2**20} MiB", cure="name the calibration, not a picture"
            )
        if data.startswith(b"PK\3\4"):
            cure = "unpack it (a .z3d is a ZIP archive) and name the project file in it"
            raise CameraFileError(path, "is a packed archive", cure=cure)
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return cls(path, data.decode("utf-16", "replace"))
        if b"\0" in data:
            raise CameraFileError(path, "is not a text file", cure="name the calibration, not a picture")
        try:
            return cls(path, data.decode("utf-8-sig"))
        except UnicodeDecodeError:
            return cls(path, data.decode("latin-1"))

    def error(self, fault: str, *, line: int | None = None, cure: str = "") -> CameraFileError:
        """A fault of this file."""
        return CameraFileError(self.path, fault, line=line, cure=cure)

    def line_of(self, position: int) -> int:
        """Line number of a character, counted from 1."""
        return self.text.count("\n", 0, position) + 1

    def number(self, word: str, quantity: str, line: int | None) -> float:
        """A finite number.

        Raises CameraFileError if `word` is not a finite number.
        """
        try:
            value = float(word.replace("_", "x"))  # Python would read 1_000 as a number
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.error(
                f"{quantity} is {word.strip()[:40]!r}",
                line=line,
                cure="write the decimal sign as a point"
                if _COMMA.fullmatch(word)
                else "it must be a finite number",
            )
        return value

    def camera(
        self,
        *,
        index: int,
        line: int | None,
        matrix: tuple[float, float, float, float, float],
        distortion: tuple[float, float, float, float, float],
        rotation: FloatArray,
        translation: FloatArray,
        sensor: tuple[float, float] | None = None,
    ) -> Camera:
        """A camera from numbers of the file.

        ``index``, ``line``: number of the camera in the file, and the line where it begins. ``matrix``: fx,
        fy, cx, cy, skew [px]. ``distortion``: k1, k2, p1, p2, k3 [-]. ``rotation``, ``translation``: its
        pose, translation in m. A matrix that is a rotation within the digits of a file (1e-4) is replaced by
        the nearest exact rotation. ``sensor``: columns and rows [px]. Raises CameraFileError if the numbers
        define no camera.
        """
        rotation = np.asarray(rotation, dtype=np.float64)
        if np.all(np.isfinite(rotation)) and np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-4:
            u, _, vt = np.linalg.svd(rotation)
            rotation = u @ vt
        size = None
        if sensor is not None:
            size = (int(sensor[0]), int(sensor[1]))
            if size != sensor or not all(1 <= side <= LONGEST for side in size):
                raise self.error(
                    f"camera {index}: pictures of {sensor[0]:g} x {sensor[1]:g} px",
                    line=line,
                    cure=f"columns and rows must be whole numbers from 1 to {LONGEST}",
                )
        fx, fy, cx, cy, skew = matrix
        try:
            return Camera(fx, fy, cx, cy, skew, distortion, rotation, translation, size)
        except ValueError as error:
            cure = "check the order of the numbers, or export the calibration again"
            raise self.error(f"camera {index}: {error}", line=line, cure=cure) from None


def printed(value: float) -> str:
    """A number with 15 digits, which a double reproduces exactly when read and printed again."""
    return f"{value:.15g}"


def rotation_of(alpha: float, beta: float, gamma: float) -> FloatArray:
    """R = Rz(gamma) Ry(beta) Rx(alpha) of angles in degrees, shape [3, 3]."""
    (cx, cy, cz), (sx, sy, sz) = (f(np.deg2rad([alpha, beta, gamma])) for f in (np.cos, np.sin))
    return np.array(
        [
            [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz],
            [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz],
            [-sy, sx * cy, cx * cy],
        ]
    )


def angles_of(R: FloatArray) -> tuple[float, float, float]:
    """Alpha, beta, gamma [degrees] of a rotation; gamma is set to 0 for beta = ±90°, where it is not
    unique."""
    level = np.hypot(R[0, 0], R[1, 0])
    beta = np.arctan2(-R[2, 0], level)
    if level > 1e-12:
        alpha, gamma = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    else:
        alpha, gamma = np.arctan2(-R[1, 2], R[1, 1]), 0.0
    a, b, c = np.rad2deg([alpha, beta, gamma])
    return float(a), float(b), float(c)


DEEPEST = 20
"""Largest depth of nested elements."""


@dataclass
class Element:
    """One element."""

    name: str
    """Its tag."""
    attributes: dict[str, str]
    """Attributes by name."""
    line: int
    """Line in which it begins in the file, counted from 1."""
    text: str = ""
    """Characters before its first child."""
    children: list["Element"] = field(default_factory=list)
    """Children in the order of the file."""

    def with_tag(self, name: str) -> list["Element"]:
        """Children with this tag."""
        return [child for child in self.children if child.name == name]


def parse(source: Source, *, start: int = 0, end: int | None = None) -> Element:
    """The root element of a file, or of a part of it.

    ``source``: the file. ``start``, ``end``: the part [characters]. Raises CameraFileError if it is not
    well-formed, cut short, nested too deep, or declares an entity.
    """
    before = source.line_of(start) - 1
    document = Element("", {}, 0)
    open_ = [document]

    def begin(name: str, attributes: dict[str, str]) -> None:
        element = Element(name, attributes, parser.CurrentLineNumber + before)
        if len(open_) > DEEPEST:
            raise source.error(
                f"nests more than {DEEPEST} elements",
                line=element.line,
                cure="name the calibration of one pair",
            )
        open_[-1].children.append(element)
        open_.append(element)

    def characters(text: str) -> None:
        if not open_[-1].children:
            open_[-1].text += text

    def entity(*_: object) -> None:
        raise source.error(
            "declares an XML entity, which is not allowed in a calibration",
            line=parser.CurrentLineNumber + before,
            cure="export the calibration again from its program",
        )

    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: open_.pop()
    parser.CharacterDataHandler = characters
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(source.text[start:end].encode(), True)
    except expat.ExpatError as error:
        raise source.error(
            f"is not well-formed XML ({expat.ErrorString(error.code)})",
            line=error.lineno + before,
            cure="it may be cut short: export it again",
        ) from None
    return document.children[0]
