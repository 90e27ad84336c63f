"""The file dic.h5 of a measurement by image correlation alone."""

from pathlib import Path

from dic.full_field.result import Extension, FittedCylinder, FullField
from dic.outcome import Remark
from dic.result import SurfaceStrain
from dic.surfaces.surface_history import SurfaceHistory
from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_items import OWN, Flags, Floats, Group, Integers, Json, Text, nxdata
from kolsky.base.hdf5_records import Columns, Part, Parts, Record

FORMAT = Format("dic full field", largest=4 * 2**30)

SURFACE = Record(
    SurfaceHistory,
    nxdata("u", "t", "points", "."),
    {
        "t": Floats("s", "frames"),
        "X": Floats(OWN, "points 3"),
        "u": Floats(OWN, "frames points 3"),
        "sigma": Floats(OWN, "frames points 3"),
        "outcome": Integers("1", "frames points"),
    },
)
STRAIN = Record(
    SurfaceStrain,
    nxdata("value", ".", "points", "."),
    {
        "value": Floats("1", "frames points 3"),
        "sigma": Floats("1", "frames points 3"),
        "outcome": Integers("1", "frames points"),
        "gauge": Floats("px"),
    },
)
EXTENSION = Record(
    Extension,
    nxdata("elongation", "."),
    {
        "name": Text(),
        "ends": Floats("px", "2 2"),
        "length": Floats(OWN, "frames"),
        "elongation": Floats(OWN, "frames"),
        "sigma": Floats(OWN, "frames"),
        "strain": Floats("1", "frames"),
        "outcome": Integers("1", "frames"),
    },
)
CYLINDER = Record(
    FittedCylinder,
    nxdata("radius", "."),
    {
        "radius": Floats("m", "frames"),
        "sigma": Floats("m", "frames"),
        "rms": Floats("m", "frames"),
        "n_points": Integers("1", "frames"),
        "correction": Floats("px"),
        "uncorrected": Floats("m"),
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
RESULT = Record(
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
        "surface": Part(SURFACE),
        "strain": Part(STRAIN),
        "extensions": Parts(EXTENSION),
        "cylinder": Part(CYLINDER, optional=True),
    },
)


def write_full_field(path: Path, result: FullField) -> None:
    """Write a result to one HDF5 file, atomically.

    Parameters
    ----------
    path
        The file, replaced if it exists; its folder must exist.
    result
        The result.

    Raises
    ------
    OSError
        If the file cannot be written; an older file of the name is then unchanged.
    """
    with writing(path, FORMAT) as place:
        RESULT.write(place, result)


def read_full_field(path: Path) -> FullField:
    """Read a result back.

    Raises
    ------
    InputError
        If it is no such file, or something in it is missing, too large, of a wrong type, shape or unit. The
        message is one line.
    """
    with reading(path, FORMAT, cure="run `kolsky dic` again") as place:
        return RESULT.read(place)
