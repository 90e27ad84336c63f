"""A joint identification as files: joint.json, CSV tables of parameters, shots and curve, and one HDF5
file."""

import json
from pathlib import Path
from typing import Any

from kolsky.base.files import jsonable, write_table
from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_records import (
    COLLECTION,
    Flags,
    Floats,
    Integers,
    Json,
    Named,
    Part,
    Parts,
    Record,
    Text,
    numbers,
    nxdata,
)
from kolsky.inverse.joint_result import CurveFound, JointResult, ModelChoice, Scatter, ShotPart, interval
from kolsky.inverse.parameters import reference_words
from kolsky.results.hdf5 import ESTIMATE

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
    """Write a joint identification to one HDF5 file, atomically."""
    with writing(path, FORMAT) as place:
        JOINT.write(place, found)


def read_joint_hdf5(path: Path) -> JointResult:
    """Read a file of `write_joint_hdf5`, trusting nothing in it.

    Raises InputError if the file is missing, truncated or no such result, or a dataset is missing, of another
    type, shape or unit. The message is one line.
    """
    with reading(Path(path), FORMAT, cure="write it again with `kolsky identify`") as place:
        return JOINT.read(place)


STEM = "joint"


def to_json(found: JointResult) -> dict[str, Any]:
    """The result as one object of JSON types; numbers that are not finite become null."""
    names = list(found.estimates)
    said = {
        "estimates": {
            name: {
                "value": e.value,
                "interval_95": interval(e, found.expanded[name]),
                "searched": e.searched,
                "sigma": e.sigma,
                "sigma_noise": e.sigma_noise,
                "sigma_numerical": e.sigma_numerical,
                "on_mesh": e.on_mesh,
                "mesh_correction": e.mesh_correction,
                "noise_parts": e.noise_parts,
                "numerical_parts": e.numerical_parts,
                "unit": e.unit,
                "outcome": e.outcome.value,
            }
            for name, e in found.estimates.items()
        },
        "reference_curve": reference_words((*names, *found.fixed)) or "the quasi-static curve",
        "fixed": found.fixed,
        "correlation": {"names": names, "matrix": found.correlation},
        "shots": [vars(part) for part in found.shots],
        "scatter_between_shots": None if found.scatter is None else vars(found.scatter),
        "slow_tests": found.slow,
        "model_choice": None if found.choice is None else vars(found.choice),
        "curve": None
        if found.curve is None
        else {
            "strain": found.curve.strain,
            "factor": found.curve.factor,
            "sigma_log_factor": found.curve.sigma_log,
            "share_of_smoothness": found.curve.prior_share,
        },
        "mesh": {"search": found.mesh, "refined": found.refined_mesh},
        "runs": found.runs,
        "warnings": found.warnings,
    }
    return {key: jsonable(value, key) for key, value in said.items()}


def write_joint(folder: Path, found: JointResult) -> None:
    """Write joint.h5, joint.json, joint_parameters.csv, joint_shots.csv; of a free curve, joint_curve.csv.

    Raises InputError if a file cannot be written.
    """
    write_joint_hdf5(folder / f"{STEM}.h5", found)
    text = json.dumps(to_json(found), indent=1, allow_nan=False)
    (folder / f"{STEM}.json").write_text(text, encoding="utf-8")
    write_table(folder / f"{STEM}_parameters.csv", parameters(found))
    write_table(folder / f"{STEM}_shots.csv", shots(found))
    if found.curve is not None:
        write_table(folder / f"{STEM}_curve.csv", curve(found))


def parameters(found: JointResult) -> dict[str, list[Any]]:
    """Columns of the shared parameters, SI."""
    rows = found.estimates.values()
    ends = [interval(e, found.expanded[e.name]) for e in rows]
    return {
        "parameter": [e.name for e in rows],
        "unit": [e.unit for e in rows],
        "value (SI)": [e.value for e in rows],
        "standard uncertainty (SI)": [e.sigma for e in rows],
        "half width at 95 % (SI)": [found.expanded[e.name] for e in rows],
        "lower end, 95 % (SI)": [low for low, _ in ends],
        "upper end, 95 % (SI)": [high for _, high in ends],
        "verdict": [e.outcome.value for e in rows],
    }


def shots(found: JointResult) -> dict[str, list[Any]]:
    """Columns of the shots."""
    parts = found.shots
    return {
        "shot": [p.name for p in parts],
        "m (1)": [p.factor for p in parts],
        "sigma of its own part (1)": [p.sigma_factor for p in parts],
        "gain (1)": [p.gain for p in parts],
        "sigma gain (1)": [p.sigma_gain for p in parts],
        "late by (s)": [p.clock for p in parts],
        "sigma late by (s)": [p.sigma_clock for p in parts],
        "chi2 per force bin (1)": [p.chi2_force for p in parts],
        "chi2 per outline point (1)": [p.chi2_outline for p in parts],
        "discrepancy of the force (N)": [p.discrepancy_force for p in parts],
        "discrepancy of the outline (m)": [p.discrepancy_outline for p in parts],
    }


def curve(found: JointResult) -> dict[str, list[float]]:
    """Columns of the curve that the impacts ask for."""
    assert found.curve is not None  # the caller saw to it
    c = found.curve
    return {
        "nominal strain (1)": (c.stretch - 1.0).tolist(),
        "nominal stress (Pa)": c.stress.tolist(),
        "lower end, k = 2 (Pa)": c.band[0].tolist(),
        "upper end, k = 2 (Pa)": c.band[1].tolist(),
    }
