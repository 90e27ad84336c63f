"""OpenCV's storage files (.yml, .xml, .json): results of `cv2.stereoCalibrate` under their usual names.

Camera matrices M1 and M2, distortion D1 and D2 (k1 k2 p1 p2 [k3 ...]), R and T with ``X_1 = R X_0 + T``;
`NAMES` lists the other names in use. Lengths have the unit of the calibration target. Files written here
state it (`length_unit`, in m). They also contain two entries that other programs ignore: the pose of camera
0, and the covariance of `dic.StereoRig` in m, rad and px.
"""

import re

import numpy as np

from dic.basics import FloatArray, cv2
from dic.camera import Camera, StereoRig
from dic.camera_files.source import Source

NAMES = {
    "M1": ("M1", "K1", "cameraMatrix1", "camera_matrix_1", "camera_matrix1", "camera_matrix_left"),
    "M2": ("M2", "K2", "cameraMatrix2", "camera_matrix_2", "camera_matrix2", "camera_matrix_right"),
    "D1": ("D1", "distCoeffs1", "dist_coeffs_1", "distortion_coefficients_1", "distortion_coefficients_left"),
    "D2": (
        "D2",
        "distCoeffs2",
        "dist_coeffs_2",
        "distortion_coefficients_2",
        "distortion_coefficients_right",
    ),
    "R": ("R", "rotation_matrix", "R_stereo"),
    "T": ("T", "t", "translation_vector", "T_stereo"),
}
SIZE = ("imageSize", "image_size")
MOST = 1024
"""Largest number of values in one entry."""
DEEPEST = 64
"""Largest depth of nested entries; OpenCV's parser has no limit and would exhaust the stack."""


_LEVELS = re.compile(r"[\[\]{}]|</?[A-Za-z_]|^[ \t]*(?:-[ \t]+){2,}", re.MULTILINE)


class OpenCV:
    """The format; see `dic.camera_files.CameraFormat`."""

    name = "opencv"
    about = "OpenCV storage (YAML, XML or JSON)"
    suffix = ".yml"
    absolute_pose = True
    tangential = True

    def sniff(self, text: str) -> bool:
        """True for a text of this format."""
        start = text[:1000].lstrip()
        return start.startswith(("%YAML", "{")) or "<opencv_storage>" in start

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig."""
        if "<!ENTITY" in source.text:
            raise source.error("declares an XML entity", cure="export the calibration again")
        if _depth(source.text) > DEEPEST:
            raise source.error(
                f"nests its entries more than {DEEPEST} levels deep, too deep for a calibration",
                cure="write the calibration again",
            )
        try:
            storage = cv2.FileStorage(source.text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        except (cv2.error, SystemError) as error:
            reason = str(error.__cause__ or error).strip().splitlines()[-1][:120]
            raise source.error(
                f"OpenCV cannot parse it ({reason})", cure="it may be cut short: write it again"
            ) from None
        root = storage.root()
        keys = list(root.keys()) if root.isMap() else []
        unit = _entry(source, root, ["length_unit"], (1, 1))
        if unit is not None:
            length_unit = float(unit[0, 0])
        pose0 = (_entry(source, root, ["R0"], (3, 3)), _entry(source, root, ["T0"], (3, 1)))
        R0 = np.eye(3) if pose0[0] is None else pose0[0]
        t0 = np.zeros(3) if pose0[1] is None else length_unit * pose0[1][:, 0]
        R = _must(source, root, keys, "R", (3, 3))
        t = length_unit * _must(source, root, keys, "T", (3, 1))[:, 0]
        first = _camera(source, root, keys, 0, R0, t0)
        second = _camera(source, root, keys, 1, R @ R0, R @ t0 + t)
        n = len(StereoRig((first, second)).parameter_names)
        return StereoRig((first, second), _entry(source, root, ["covariance"], (n, n)))

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The file's text, YAML."""
        storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
        storage.write("length_unit", float(length_unit))
        for k, camera in enumerate(rig.cameras, start=1):
            storage.write(f"M{k}", camera.matrix)
            storage.write(f"D{k}", np.array([camera.distortion]))
            if camera.sensor is not None:
                storage.write(f"imageSize{k}", np.array([camera.sensor], dtype=np.float64))
        R, t = rig.relative
        storage.write("R", R)
        storage.write("T", t[:, None] / length_unit)
        storage.write("R0", rig.cameras[0].rotation)
        storage.write("T0", rig.cameras[0].translation[:, None] / length_unit)
        if rig.covariance is not None:
            storage.writeComment("of " + " ".join(rig.parameter_names) + " in px, rad and m", False)
            storage.write("covariance", rig.covariance)
        return str(storage.releaseAndGetString())


def _camera(
    source: Source, root: cv2.FileNode, keys: list[str], k: int, R: FloatArray, t: FloatArray
) -> Camera:
    matrix = _must(source, root, keys, f"M{k + 1}", (3, 3))
    if np.any(matrix[[1, 2, 2], [0, 0, 1]]) or matrix[2, 2] != 1.0:
        raise source.error(
            f"M{k + 1} is {matrix.tolist()}",
            cure="it must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]: transpose it if it came from MATLAB",
        )
    lens = _must(source, root, keys, f"D{k + 1}", None).ravel()
    if len(lens) not in (4, 5, 8, 12, 14):
        raise source.error(f"D{k + 1} has {len(lens)} numbers", cure="OpenCV's models have 4, 5, 8, 12 or 14")
    if np.any(lens[5:]):
        raise source.error(
            f"D{k + 1} has {lens[5:].tolist()} beyond k1 k2 p1 p2 k3",
            cure="calibrate without the rational, thin prism and tilted models",
        )
    size = _entry(source, root, [f"imageSize{k + 1}", *SIZE], (1, 2))
    if size is None:
        sides = [_entry(source, root, [f"image_{name}"], (1, 1)) for name in ("width", "height")]
        size = None if sides[0] is None or sides[1] is None else np.hstack([sides[0], sides[1]])
    return source.camera(
        index=k,
        line=None,
        matrix=(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], matrix[0, 1]),
        distortion=(lens[0], lens[1], lens[2], lens[3], lens[4] if len(lens) > 4 else 0.0),
        rotation=R,
        translation=t,
        sensor=None if size is None else (size[0, 0], size[0, 1]),
    )


def _must(
    source: Source, root: cv2.FileNode, keys: list[str], name: str, shape: tuple[int, int] | None
) -> FloatArray:
    """An entry under any of its names."""
    values = _entry(source, root, list(NAMES[name]), shape)
    if values is None:
        raise source.error(
            f"has no {name} (nor {', '.join(NAMES[name][1:])}) among {', '.join(keys[:20]) or 'no entries'}",
            cure="write the results of cv2.stereoCalibrate into one file: M1 D1 M2 D2 R T",
        )
    return values


def _entry(
    source: Source, root: cv2.FileNode, names: list[str], shape: tuple[int, int] | None
) -> FloatArray | None:
    """The finite numbers of the first entry found, with `shape` or in one row; None if there is no such
    entry."""
    for name in names:
        node = root.getNode(name) if root.isMap() else None
        if node is None or node.isNone():
            continue
        numbers: list[float] = []
        _collect(source, name, node.getNode("data") if node.isMap() else node, numbers)
        values = np.array(numbers)
        if not np.all(np.isfinite(values)):
            raise source.error(f"{name} is {values.tolist()}", cure="it must be finite")
        if shape is None:
            return values[None]
        if values.size != shape[0] * shape[1]:
            raise source.error(
                f"{name} holds {values.size} numbers, must hold {shape[0]} × {shape[1]}",
                cure="write the calibration again",
            )
        return values.reshape(shape)
    return None


def _collect(source: Source, name: str, node: cv2.FileNode, into: list[float]) -> None:
    """The numbers in a node and in its lists."""
    if node.isReal() or node.isInt():
        into.append(node.real())
    elif node.isSeq():
        for i in range(node.size()):
            _collect(source, name, node.at(i), into)
            if len(into) > MOST:
                raise source.error(
                    f"{name} holds more than {MOST} numbers", cure="name the calibration of one pair"
                )
    else:
        raise source.error(
            f"{name} contains a value that is not a number", cure="write the calibration again"
        )


def _depth(text: str) -> int:
    """Depth of nested brackets, tags and list dashes. Unclosed ones count too."""
    deepest = depth = 0
    for match in _LEVELS.finditer(text):
        token = match[0]
        if "-" in token:
            deepest = max(deepest, token.count("-"))
        else:
            depth += -1 if token in "]}" or token.startswith("</") else 1
            deepest = max(deepest, depth)
    return deepest
