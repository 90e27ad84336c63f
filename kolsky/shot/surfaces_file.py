"""The file dic.h5: a stereo result written whole or not at all, and read back without trust."""

from pathlib import Path

from dic.camera import Camera, StereoRig
from dic.outcome import PointOutcome, Remark
from dic.result import Body, Placement, StereoResult, SurfaceStrain
from dic.rigid_body.axial_displacement import AxialDisplacement
from dic.rigid_body.body_motion import BodyMotion
from dic.surfaces.frame import SpecimenFrame
from dic.surfaces.noise_floor import NoiseFloor
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory
from kolsky.base.hdf5 import Format, reading, stored_attribute, writing
from kolsky.base.hdf5_items import (
    COLLECTION,
    Flags,
    Floats,
    Group,
    IntegerAttribute,
    Integers,
    Json,
    Pairs,
    Text,
    nxdata,
)
from kolsky.base.hdf5_records import Columns, Pair, Part, Record

FORMAT = Format("dic stereo result", version=3, readable=(2, 3), largest=4 * 2**30)

SURFACE = Record(
    SurfaceHistory,
    None,
    {
        "t": Floats("s", "frames"),
        "X": Floats("m", "points 3"),
        "u": Floats("m", "frames points 3"),
        "sigma": Floats("m", "frames points 3"),
        "outcome": Integers("1", "frames points"),
    },
)
BODY = Record(
    Body,
    nxdata("u", "t", "points", "."),
    {
        "surface": Part(SURFACE, at="."),
        "pixels": Pair(Floats("px", "frames points 2")),
        "match_sigma": Pair(Floats("px", "frames points")),
        "zncc": Pair(Floats("1", "frames points")),
        "epipolar": Floats("px", "frames points"),
        "points": Floats("px", "points 2"),
        "cell": Integers("1", "points 2"),
    },
)
STRAIN = Record(
    SurfaceStrain,
    nxdata("value", "../t", "points", "."),
    {
        "value": Floats("1", "frames points 3"),
        "sigma": Floats("1", "frames points 3"),
        "outcome": Integers("1", "frames points"),
        "gauge": Floats("px"),
    },
)
AXIAL_DISPLACEMENT = Record(
    AxialDisplacement,
    nxdata("displacement", "t"),
    {
        "t": Floats("s", "rows"),
        "frame": Integers("1", "rows"),
        "displacement": Floats("m", "rows"),
        "sigma": Floats("m", "rows"),
        "n_points": Integers("1", "rows"),
        "rest_sigma": Floats("m"),
        "from_rim": Flags("1", since=3),
        "rim_disagreement": Floats("m", "2", as_tuple=True, optional=True, since=3),
    },
)
MOTION = Record(
    BodyMotion,
    nxdata("displacement", "../t", "."),
    {
        "at": Floats("m", "3"),
        "displacement": Floats("m", "frames 3"),
        "rotation": Floats("rad", "frames 3"),
        "covariance": Floats("rad^2 m^2", "posed 6 posed 6"),
        "n_points": Integers("1", "frames"),
        "outcome": Integers("1", "frames"),
        "chi2_per_dof": Floats("1"),
        "noise_scale": Floats("1"),
    },
)
OUTLINE = Record(
    CentrePoints,
    nxdata("Z", "t"),
    {
        "t": Floats("s", "rows"),
        "frame": Integers("1", "rows"),
        "y": Floats("m", "rows"),
        "Z": Floats("m", "rows"),
        "sigma": Floats("m", "rows"),
        "left_out": Pairs(
            Integers("1", "outcomes", at="left_out_outcome"),
            Integers("1", "outcomes", at="left_out_count"),
            at=".",
            key=PointOutcome,
        ),
    },
)
FRAME = Record(
    SpecimenFrame,
    None,
    {"rotation": Floats("1", "3 3"), "origin": Floats("m", "3"), "covariance": Floats("SI", "6 6")},
)
PLACEMENT = Record(
    Placement,
    COLLECTION,
    {
        "frame": Part(FRAME, at="."),
        "radius": Floats("m"),
        "radius_sigma": Floats("m"),
        "rms": Floats("m"),
        "chi2_per_dof": Floats("1"),
        "n_points": Integers("1"),
    },
)
NOISE = Record(
    NoiseFloor,
    COLLECTION,
    {
        "n_frames": Integers("1"),
        "n_points": Integers("1"),
        "time": Floats("m", "3"),
        "space": Floats("m", "3"),
        "common": Floats("m", "3"),
        "sigma": Floats("m", "3"),
    },
)
REMARK = Record(
    Remark,
    None,
    {
        "name": Text("remarks", at="remark_names"),
        "text": Text("remarks", at="remark_texts"),
        "cure": Text("remarks", at="remark_cures"),
    },
)
CAMERA = Record(
    Camera,
    Group("NXdetector"),
    {
        "fx": Floats("px"),
        "fy": Floats("px"),
        "cx": Floats("px"),
        "cy": Floats("px"),
        "skew": Floats("px"),
        "distortion": Floats("1", "5", as_tuple=True),
        "rotation": Floats("1", "3 3"),
        "translation": Floats("m", "3"),
        "sensor": IntegerAttribute(2, optional=True),
    },
)
RIG = Record(
    StereoRig,
    COLLECTION,
    {
        "cameras": Pair(Part(CAMERA), ends=("/0", "/1"), at="."),
        "covariance": Floats("px, 1, rad and m, by parameter_names", "numbers numbers", optional=True),
    },
)
RESULT = Record(
    StereoResult,
    Group("NXentry", {"default": "centre_line"}),
    {
        "t": Floats("s", "frames"),
        "frames": Pair(Integers("1", "frames"), at="frame_outcome"),
        "static": Flags("1", "frames"),
        "facts": Json(),
        "remarks": Columns(REMARK),
        "seconds": Pairs(Text("stages", at="stages"), Floats("s", "stages", at="seconds"), at="."),
        "specimen": Part(BODY),
        "flyer": Part(BODY, optional=True),
        "strain": Part(STRAIN),
        "axial_displacement": Part(AXIAL_DISPLACEMENT, at="travel", optional=True),
        "motion": Part(MOTION, optional=True),
        "centre": Part(OUTLINE, at="centre_line"),
        "placement": Part(PLACEMENT, at="test_frame"),
        "noise": Part(NOISE, at="noise_floor"),
        "rig": Part(RIG, at="cameras"),
    },
)


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
    with writing(path, FORMAT, key=key) as place:
        RESULT.write(place, result)
        if result.rig.covariance is not None:
            cameras = place.file[place.at("cameras").path]
            cameras.attrs["parameter_names"] = " ".join(result.rig.parameter_names)


def stored_key(path: Path) -> str | None:
    """The `key` that a result file was written with; None if there is no such file or it is no result."""
    key = stored_attribute(path, FORMAT, "key")
    return key if isinstance(key, str) else None


def read_stereo_result(path: Path) -> StereoResult:
    """Read a stereo result back.

    Raises
    ------
    InputError
        If it is no such file, or something in it is missing, a link, too large, of a wrong type, shape or
        unit, or contradicts itself. The message is one line.
    """
    with reading(path, FORMAT, cure="run `kolsky dic` again") as place:
        return RESULT.read(place)
