"""A stereo result as one HDF5 file: written whole or not at all, and read back.

The file follows the NeXus habit: `NXentry` and `NXdata` groups with `signal` and `axes`, `units` on every
array. Text is fixed-length UTF-8 and settings are one JSON text: no pickles, no object types.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from dic.camera import Camera, StereoRig
from dic.files import replacing
from dic.outcome import PointOutcome, Remark
from dic.result import Body, Placement, StereoResult, SurfaceStrain
from dic.rigid_body.axial_displacement import AxialDisplacement
from dic.rigid_body.body_motion import BodyMotion
from dic.surfaces.frame import SpecimenFrame
from dic.surfaces.noise_floor import NoiseFloor
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory
from kolsky.shot import surfaces_layout as layout
from kolsky.shot.surfaces_layout import STORED, Table, shape_problem

LARGEST = 4 * 2**30
"""Most bytes that one dataset may take in memory."""


class ResultFileError(ValueError):
    """A file that is no stereo result, or a damaged one; the text names it and what is wrong."""


def write_stereo_result(path: Path, result: StereoResult, *, key: str = "") -> None:
    """Write a stereo result to one HDF5 file, atomically.

    Parameters
    ----------
    path
        The file, replaced if it exists; its folder must exist.
    result
        The result; its `facts` are stored as JSON.
    key
        What the result was made from, e.g. a hash of inputs and settings: `stored_key` reads it alone.

    Raises
    ------
    ValueError
        If shapes of the result disagree with each other, or `facts` hold what JSON cannot say.
    OSError
        If the file cannot be written; an older file of the name is then unchanged.
    """
    with replacing(path) as partial, h5py.File(partial, "w") as file:
        file.attrs["format"] = layout.FORMAT
        file.attrs["format_version"] = layout.VERSION
        file.attrs["key"] = key
        file.attrs["default"] = "entry"
        _write_entry(_group(file, "entry", "NXentry", default="centre_line"), result)


def _write_entry(entry: h5py.Group, result: StereoResult) -> None:
    sizes = dict(layout.FIXED)
    first, second = result.frames
    remarks = result.remarks
    rows = {
        **vars(result),
        "frame_outcome_0": first,
        "frame_outcome_1": second,
        "facts": json.dumps(dict(result.facts), allow_nan=False),
        "remark_names": tuple(remark.name for remark in remarks),
        "remark_texts": tuple(remark.text for remark in remarks),
        "remark_cures": tuple(remark.cure for remark in remarks),
        "stages": tuple(result.seconds),
        "seconds": list(result.seconds.values()),
    }
    _write(entry, layout.ENTRY, rows, sizes)
    for name, body in (("specimen", result.specimen), ("flyer", result.flyer)):
        if body is not None:
            _write_body(_data(entry, name, "u", "t", "points", "."), body, sizes["frames"])
    part = _data(entry, "strain", "value", "../t", "points", ".")
    _write(part, layout.STRAIN, vars(result.strain), {**layout.FIXED, "frames": sizes["frames"]})
    if result.axial_displacement is not None:
        _write(
            _data(entry, "travel", "displacement", "t"), layout.TRAVEL, vars(result.axial_displacement), {}
        )
    if result.motion is not None:
        part = _data(entry, "motion", "displacement", "../t", ".")
        _write(part, layout.MOTION, vars(result.motion), {**layout.FIXED, "frames": sizes["frames"]})
    left_out = result.centre.left_out
    centre = {
        **vars(result.centre),
        "left_out_outcome": [int(outcome) for outcome in left_out],
        "left_out_count": list(left_out.values()),
    }
    _write(_data(entry, "centre_line", "Z", "t"), layout.CENTRE, centre, {})
    part = _group(entry, "test_frame", "NXcollection")
    _write(part, layout.FRAME, vars(result.placement.frame), dict(layout.FIXED))
    _write(part, layout.PLACEMENT, vars(result.placement), {})
    _write(_group(entry, "noise_floor", "NXcollection"), layout.NOISE, vars(result.noise), {"three": 3})
    cameras = _group(entry, "cameras", "NXcollection")
    for number, camera in enumerate(result.rig.cameras):
        part = _group(cameras, str(number), "NXdetector")
        _write(part, layout.CAMERA, vars(camera), dict(layout.FIXED))
        if camera.sensor is not None:
            part.attrs["sensor"] = camera.sensor
    if result.rig.covariance is not None:
        covariance = cameras.create_dataset("covariance", data=np.asarray(result.rig.covariance, dtype="<f8"))
        covariance.attrs["units"] = "px, 1, rad and m, by parameter_names"
        cameras.attrs["parameter_names"] = " ".join(result.rig.parameter_names)


def _write_body(group: h5py.Group, body: Body, n_frames: int) -> None:
    rows = {**vars(body.surface), "epipolar": body.epipolar, "points": body.points, "cell": body.cell}
    for name in ("pixels", "match_sigma", "zncc"):
        for camera in (0, 1):
            rows[f"{name}_{camera}"] = getattr(body, name)[camera]
    _write(group, layout.BODY, rows, {**layout.FIXED, "frames": n_frames})


def stored_key(path: Path) -> str | None:
    """The `key` that a result file was written with; None if there is no such file or it is no result."""
    try:
        with h5py.File(path, "r") as file:
            if (
                file.attrs.get("format") != layout.FORMAT
                or file.attrs.get("format_version") != layout.VERSION
            ):
                return None
            key = file.attrs.get("key")
            return key if isinstance(key, str) else None
    except (OSError, RuntimeError, KeyError, ValueError):
        return None


def read_stereo_result(path: Path) -> StereoResult:
    """Read a stereo result back.

    Raises
    ------
    ResultFileError
        If it is no such file, or something in it is missing, too large, of a wrong type or shape, or
        contradicts itself.
    """
    try:
        with h5py.File(path, "r") as file:
            found = (file.attrs.get("format"), file.attrs.get("format_version"))
            if found != (layout.FORMAT, layout.VERSION):
                raise ResultFileError(
                    f"{path}: is {found}, must be {(layout.FORMAT, layout.VERSION)}; write it again"
                )
            return _read_entry(file["entry"])
    except ResultFileError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        raise ResultFileError(f"{path}: is no stereo result, or damaged: {error}") from error


def _read_entry(entry: h5py.Group) -> StereoResult:
    sizes = dict(layout.FIXED)
    head = _read(entry, layout.ENTRY, sizes)
    centre = _read(entry["centre_line"], layout.CENTRE, {})
    left_out = {
        PointOutcome(int(outcome)): int(count)
        for outcome, count in zip(centre.pop("left_out_outcome"), centre.pop("left_out_count"), strict=True)
    }
    noise = _read(entry["noise_floor"], layout.NOISE, {"three": 3})
    cameras = entry["cameras"]
    covariance = _array(cameras["covariance"], "f") if "covariance" in cameras else None
    facts = json.loads(head["facts"])
    if not isinstance(facts, dict):
        raise ValueError("facts are no JSON object")
    return StereoResult(
        t=head["t"],
        frames=(head["frame_outcome_0"], head["frame_outcome_1"]),
        static=head["static"],
        specimen=_read_body(entry["specimen"], sizes["frames"]),
        flyer=_read_body(entry["flyer"], sizes["frames"]) if "flyer" in entry else None,
        axial_displacement=AxialDisplacement(**_read(entry["travel"], layout.TRAVEL, {}))
        if "travel" in entry
        else None,
        centre=CentrePoints(**centre, left_out=MappingProxyType(left_out)),
        placement=Placement(
            frame=SpecimenFrame(**_read(entry["test_frame"], layout.FRAME, dict(layout.FIXED))),
            **_read(entry["test_frame"], layout.PLACEMENT, {}),
        ),
        noise=NoiseFloor(**noise),
        strain=SurfaceStrain(
            **_read(entry["strain"], layout.STRAIN, {**layout.FIXED, "frames": sizes["frames"]})
        ),
        remarks=tuple(
            Remark(*texts)
            for texts in zip(head["remark_names"], head["remark_texts"], head["remark_cures"], strict=True)
        ),
        rig=StereoRig(
            cameras=(_read_camera(cameras["0"]), _read_camera(cameras["1"])), covariance=covariance
        ),
        facts=facts,
        seconds=dict(zip(head["stages"], head["seconds"].tolist(), strict=True)),
        motion=BodyMotion(
            **_read(entry["motion"], layout.MOTION, {**layout.FIXED, "frames": sizes["frames"]})
        )
        if "motion" in entry
        else None,
    )


def _read_body(group: h5py.Group, n_frames: int) -> Body:
    rows = _read(group, layout.BODY, {**layout.FIXED, "frames": n_frames})
    surface = SurfaceHistory(**{name: rows.pop(name) for name in ("t", "X", "u", "sigma", "outcome")})
    pairs: dict[str, Any] = {
        name: (rows.pop(f"{name}_0"), rows.pop(f"{name}_1")) for name in ("pixels", "match_sigma", "zncc")
    }
    return Body(surface=surface, **pairs, **rows)


def _read_camera(group: h5py.Group) -> Camera:
    values = _read(group, layout.CAMERA, dict(layout.FIXED))
    values["distortion"] = tuple(values["distortion"].tolist())
    sensor = group.attrs.get("sensor")
    return Camera(**values, sensor=None if sensor is None else (int(sensor[0]), int(sensor[1])))


def _group(parent: h5py.Group, name: str, nx_class: str, **attributes: Any) -> h5py.Group:
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        group.attrs[key] = value
    return group


def _data(parent: h5py.Group, name: str, signal: str, *axes: str) -> h5py.Group:
    return _group(parent, name, "NXdata", signal=signal, axes=list(axes))


def _write(group: h5py.Group, table: Table, source: Mapping[str, Any], sizes: dict[str, int]) -> None:
    """Write the datasets of `table`; named dimensions are checked against `sizes` and added to it."""
    for name, (unit, dimensions, kind) in table.items():
        array = _encoded(source[name]) if kind == "t" else np.asarray(source[name], dtype=STORED[kind])
        wrong = shape_problem(array.shape, dimensions, sizes)
        if wrong:
            raise ValueError(f"{group.name}/{name}: {wrong}")
        large = array.size > 4096
        packing = {"compression": "gzip", "compression_opts": 2, "shuffle": True} if large else {}
        dataset = group.create_dataset(name, data=array, **packing)
        if kind != "t":
            dataset.attrs["units"] = unit


def _encoded(value: str | tuple[str, ...]) -> Any:
    """Text as fixed-length UTF-8."""
    texts = [value] if isinstance(value, str) else list(value)
    encoded = [text.encode() for text in texts]
    if any(b"\0" in text for text in encoded):
        raise ValueError("a text with a NUL character cannot be stored")
    array = np.array(encoded, dtype=h5py.string_dtype("utf-8", max([1, *map(len, encoded)])))
    return array.reshape(()) if isinstance(value, str) else array


def _read(group: h5py.Group, table: Table, sizes: dict[str, int]) -> dict[str, Any]:
    """The datasets of `table`, their units and shapes checked."""
    found: dict[str, Any] = {}
    for name, (unit, dimensions, kind) in table.items():
        dataset = group[name]
        wrong = shape_problem(dataset.shape, dimensions, sizes)
        if wrong:
            raise ValueError(f"{group.name}/{name} {wrong}")
        if kind != "t" and dataset.attrs.get("units") != unit:
            raise ValueError(f"{group.name}/{name} is in {dataset.attrs.get('units')!r}, must be in {unit!r}")
        value = _array(dataset, kind)
        found[name] = value.item() if kind in ("f", "i") and not dimensions else value
    return found


def _array(dataset: h5py.Dataset, kind: str) -> Any:
    if dataset.size * dataset.dtype.itemsize > LARGEST:
        raise ValueError(f"{dataset.name} is larger than {LARGEST} bytes")
    if kind == "t":
        if h5py.check_string_dtype(dataset.dtype) is None:
            raise ValueError(f"{dataset.name} is no text")
        value = dataset.asstr()[()]
        return value if isinstance(value, str) else tuple(value.tolist())
    if dataset.dtype.kind not in "fiub":
        raise ValueError(f"{dataset.name} holds no numbers")
    return np.asarray(dataset[()], dtype=STORED[kind].lstrip("<|"))
