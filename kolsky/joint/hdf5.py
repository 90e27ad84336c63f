"""A joint identification as one HDF5 file: unit, dimensions and place of every field, read without trust."""

from pathlib import Path

from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_items import COLLECTION, Flags, Floats, Integers, Json, Text, numbers, nxdata
from kolsky.base.hdf5_records import Named, Part, Parts, Record
from kolsky.joint.records import CurveFound, JointResult, ModelChoice, Scatter, ShotPart
from kolsky.results.layout import ESTIMATE

FORMAT = Format("kolsky joint identification", version=4, readable=(3, 4))
"""Its first version is 3, that of an identification, whose records of a parameter it shares."""

SHOT = Record(
    ShotPart,
    COLLECTION,
    {
        "name": Text(),
        "inputs": Json(),
        "factor": Floats("1"),
        "sigma_factor": Floats("1"),
        "gain": Floats("1"),
        "sigma_gain": Floats("1"),
        "clock": Floats("s"),
        "sigma_clock": Floats("s"),
        "chi2_force": Floats("1"),
        "chi2_outline": Floats("1"),
        "discrepancy_force": Floats("N"),
        "discrepancy_outline": Floats("m"),
    },
)
SCATTER = Record(Scatter, COLLECTION, {"value": Floats("1"), "interval": Floats("1", "2", as_tuple=True)})
CHOICE = Record(
    ModelChoice,
    COLLECTION,
    {
        "aic": Floats("1"),
        "bic": Floats("1"),
        "elastic": numbers("SI"),
        "gain": Floats("1"),
        "time": Floats("s"),
        "probability": Floats("1"),
        "asked_for": Flags("1"),
        "sentence": Text(),
    },
)
CURVE = Record(
    CurveFound,
    nxdata("stress", "stretch"),
    {
        "strain": Floats("1", "nodes"),
        "factor": Floats("1", "nodes"),
        "sigma_log": Floats("1", "nodes"),
        "prior_share": Floats("1", "nodes"),
        "stretch": Floats("1", "points"),
        "stress": Floats("Pa", "points"),
        "band": Floats("Pa", "2 points"),
    },
)
JOINT = Record(
    JointResult,
    COLLECTION,
    {
        "estimates": Named(ESTIMATE),
        "fixed": numbers("SI"),
        "correlation": Floats("1", "estimates estimates"),
        "expanded": numbers("SI"),
        "shots": Parts(SHOT),
        "scatter": Part(SCATTER, optional=True),
        "slow": numbers("1"),
        "choice": Part(CHOICE, optional=True),
        "curve": Part(CURVE, optional=True),
        "mesh": Integers("1", "2", as_tuple=True),
        "refined_mesh": Integers("1", "2", as_tuple=True),
        "runs": Integers("1"),
        "warnings": Text("warnings"),
    },
)


def write_joint_hdf5(path: Path, found: JointResult) -> None:
    """Write a joint identification to one HDF5 file, atomically.

    Raises
    ------
    ValueError
        If shapes of the result disagree with each other, or a text cannot be stored.
    OSError
        If the file cannot be written; an older file of the name is then unchanged.
    """
    with writing(path, FORMAT) as place:
        JOINT.write(place, found)


def read_joint_hdf5(path: Path) -> JointResult:
    """Read a file of `write_joint_hdf5`, trusting nothing in it.

    Raises
    ------
    InputError
        If the file is missing, truncated or no such result, or a dataset is missing, of another type, shape
        or unit. The message is one line.
    """
    with reading(Path(path), FORMAT, cure="write it again with `kolsky identify`") as place:
        return JOINT.read(place)
