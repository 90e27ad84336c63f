"""The file dic.h5 of a stereo result, and of a measurement by image correlation without a shot.

The file is written completely or not at all. Every value is checked when it is read.
"""

from pathlib import Path

from dic.bodies.axial_displacement import AxialDisplacement
from dic.bodies.body_motion import BodyMotion
from dic.camera import Camera, StereoRig
from dic.outcome import PointOutcome, Remark
from dic.result import Body, Extension, FittedCylinder, FullField, Placement, StereoResult, SurfaceStrain
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.surface_history import CentrePoints, NoiseFloor, SurfaceHistory
from kolsky.base.hdf5 import Format, reading, stored_attribute, writing
from kolsky.base.hdf5_records import (
    COLLECTION,
    RECORD_UNIT,
    Columns,
    Flags,
    Floats,
    Group,
    IntegerAttribute,
    Integers,
    Json,
    Pair,
    Pairs,
    Part,
    Parts,
    Record,
    Text,
    nxdata,
)

STEREO_FORMAT = Format("dic stereo result", version=3, readable=(2, 3), largest=4 * 2**30)


def _surface(unit: str, group: Group | None = None) -> Record[SurfaceHistory]:
    """A surface with a unit of its lengths."""
    return Record(
        SurfaceHistory,
        group,
        {
            "t": Floats("s", "frames"),
            "X": Floats(unit, "points 3"),
            **dict.fromkeys(("u", "sigma"), Floats(unit, "frames points 3")),
            "outcome": Integers("1", "frames points"),
        },
    )


def _strain(time: str) -> Record[SurfaceStrain]:
    """Strains of a surface, with the location of their times."""
    return Record(
        SurfaceStrain,
        nxdata("value", time, "points", "."),
        {
            **dict.fromkeys(("value", "sigma"), Floats("1", "frames points 3")),
            "outcome": Integers("1", "frames points"),
            "gauge": Floats("px"),
        },
    )


STEREO_SURFACE = _surface("m")
BODY = Record(
    Body,
    nxdata("u", "t", "points", "."),
    {
        "surface": Part(STEREO_SURFACE, at="."),
        "pixels": Pair(Floats("px", "frames points 2")),
        "match_sigma": Pair(Floats("px", "frames points")),
        "zncc": Pair(Floats("1", "frames points")),
        "epipolar": Floats("px", "frames points"),
        "points": Floats("px", "points 2"),
        "cell": Integers("1", "points 2"),
    },
)
STEREO_STRAIN = _strain("../t")
AXIAL_DISPLACEMENT = Record(
    AxialDisplacement,
    nxdata("displacement", "t"),
    {
        "t": Floats("s", "rows"),
        "frame": Integers("1", "rows"),
        **dict.fromkeys(("displacement", "sigma"), Floats("m", "rows")),
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
        **dict.fromkeys(("n_points", "outcome"), Integers("1", "frames")),
        **dict.fromkeys(("chi2_per_dof", "noise_scale"), Floats("1")),
    },
)
OUTLINE = Record(
    CentrePoints,
    nxdata("Z", "t"),
    {
        "t": Floats("s", "rows"),
        "frame": Integers("1", "rows"),
        **dict.fromkeys(("y", "Z", "sigma"), Floats("m", "rows")),
        "left_out": Pairs(
            Integers("1", "outcomes", at="left_out_outcome"),
            Integers("1", "outcomes", at="left_out_count"),
            at=".",
            as_key=PointOutcome,
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
        **dict.fromkeys(("radius", "radius_sigma", "rms"), Floats("m")),
        "chi2_per_dof": Floats("1"),
        "n_points": Integers("1"),
    },
)
NOISE = Record(
    NoiseFloor,
    COLLECTION,
    {
        **dict.fromkeys(("n_frames", "n_points"), Integers("1")),
        **dict.fromkeys(("time", "space", "common", "sigma"), Floats("m", "3")),
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
        **dict.fromkeys(("fx", "fy", "cx", "cy", "skew"), Floats("px")),
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
STEREO_RESULT = Record(
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
        "strain": Part(STEREO_STRAIN),
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

    ``path``: the file, which is replaced if it exists. Its folder must exist. ``result``: the result. Its
    `facts` are stored as JSON. ``key``: identifies the input of the result, e.g. a hash of inputs and
    settings. `stored_key` reads it without the result. Raises ValueError if shapes of the result disagree, or
    if `facts` contain a value that JSON cannot represent. Raises OSError if the file cannot be written. An
    existing file is then unchanged.
    """
    with writing(path, STEREO_FORMAT, key=key) as place:
        STEREO_RESULT.write(place, result)
        if result.rig.covariance is not None:
            cameras = place.file[place.at("cameras").path]
            cameras.attrs["parameter_names"] = " ".join(result.rig.parameter_names)


def stored_key(path: Path) -> str | None:
    """The `key` stored in a result file; None if the file does not exist or is not a result."""
    key = stored_attribute(path, STEREO_FORMAT, "key")
    return key if isinstance(key, str) else None


def read_stereo_result(path: Path) -> StereoResult:
    """Read a stereo result from a file.

    Raises InputError if the file is not a stereo result. The same error is raised for an entry that is
    missing, a link, too large, inconsistent, or of wrong type, shape or unit. The message is one line.
    """
    with reading(path, STEREO_FORMAT, cure="run `kolsky dic` again") as place:
        return STEREO_RESULT.read(place)


FULL_FIELD_FORMAT = Format("dic full field", largest=4 * 2**30)

FULL_FIELD_SURFACE = _surface(RECORD_UNIT, nxdata("u", "t", "points", "."))
FULL_FIELD_STRAIN = _strain(".")
EXTENSION = Record(
    Extension,
    nxdata("elongation", "."),
    {
        "name": Text(),
        "ends": Floats("px", "2 2"),
        **dict.fromkeys(("length", "elongation", "sigma"), Floats(RECORD_UNIT, "frames")),
        "strain": Floats("1", "frames"),
        "outcome": Integers("1", "frames"),
    },
)
CYLINDER = Record(
    FittedCylinder,
    nxdata("radius", "."),
    {
        **dict.fromkeys(("radius", "sigma", "rms"), Floats("m", "frames")),
        "n_points": Integers("1", "frames"),
        "correction": Floats("px"),
        "uncorrected": Floats("m"),
    },
)
FULL_FIELD_RESULT = Record(
    FullField,
    Group("NXentry", {"default": "surface"}),
    {
        "kind": Text(among=("plane", "surface", "cylinder")),
        "unit": Text(among=("m", "px")),
        "timed": Flags("1"),
        "frame_outcome": Integers("1", "frames"),
        "facts": Json(),
        "remarks": Columns(REMARK),
        "points": Floats("px", "points 2"),
        "cell": Integers("1", "points 2"),
        "pixels": Floats("px", "cameras frames points 2"),
        "zncc": Floats("1", "cameras frames points"),
        "epipolar": Floats("px", "frames points"),
        "noise": Floats("1", "cameras"),
        "surface": Part(FULL_FIELD_SURFACE),
        "strain": Part(FULL_FIELD_STRAIN),
        "extensions": Parts(EXTENSION),
        "cylinder": Part(CYLINDER, optional=True),
    },
)


def write_full_field(path: Path, result: FullField) -> None:
    """Write a full-field result to one HDF5 file, atomically.

    ``path``: the file, which is replaced if it exists. Its folder must exist. ``result``: the result. Raises
    OSError if the file cannot be written. An existing file is then unchanged.
    """
    with writing(path, FULL_FIELD_FORMAT) as place:
        FULL_FIELD_RESULT.write(place, result)


def read_full_field(path: Path) -> FullField:
    """Read a full-field result from a file."""
    with reading(path, FULL_FIELD_FORMAT, cure="run `kolsky dic` again") as place:
        return FULL_FIELD_RESULT.read(place)
