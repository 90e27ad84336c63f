"""A joint identification as joint.json, CSV tables of parameters, shots and curve, and one HDF5 file."""

from pathlib import Path
from typing import Any

from kolsky.base.files import jsonable
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
from kolsky.inverse.joint_result import (
    CurveFound,
    JointResult,
    ModelChoice,
    OwnStiffness,
    Scatter,
    ShotAgreement,
    ShotCause,
    ShotPart,
    interval,
)
from kolsky.inverse.parameters import reference_words
from kolsky.inverse.result import FitQuality
from kolsky.results.hdf5 import ESTIMATE, FIT

FORMAT = Format("kolsky joint identification", version=7, readable=(3, 4, 5, 6, 7))
"""Its first version is 3. This is the version of the identification format with the same parameter
records."""

OWN = Record(
    OwnStiffness,
    COLLECTION,
    {
        "value": Floats("1", heading="own stiffness over the shared, less 1"),
        "sigma": Floats("1", heading="sigma of it"),
        "force": Floats("1", heading="by its force"),
        "sigma_force": Floats("1", heading="sigma by its force"),
        "outline": Floats("1", heading="by its outline"),
        "sigma_outline": Floats("1", heading="sigma by its outline"),
        "scale": Floats("1", since=7, heading="force over the predicted, its stiffness free, less 1"),
        "sigma_scale": Floats("1", since=7, heading="sigma of this scale"),
    },
)
NOT_KNOWN = OwnStiffness(**dict.fromkeys(OWN.fields, float("nan")))
"""Stiffness of a shot without a separate estimate."""
AGREEMENT = Record(
    ShotAgreement,
    COLLECTION,
    {
        "chi2": Floats("1"),
        "freedom": Integers("1"),
        "probability": Floats("1"),
        "ratio": Floats("1"),
        "shots": Text("shots"),
        "channel": Text(),
        "noticeable": Floats("1", "compared", as_tuple=True, since=7),
        "sentence": Text(derived=True),
    },
)
CAUSE = Record(
    ShotCause,
    COLLECTION,
    {
        "shot": Text(),
        "key": Text(),
        "amount": Floats("1"),
        "sigma": Floats("1"),
        "gain": Floats("1"),
        "share": Floats("1"),
        "words": Text(derived=True),
    },
)
SHOT = Record(
    ShotPart,
    COLLECTION,
    {
        "name": Text(heading="shot"),
        "inputs": Json(),
        "factor": Floats("1", heading="m"),
        "sigma_factor": Floats("1", heading="sigma of its own part"),
        "gain": Floats("1", heading="gain"),
        "sigma_gain": Floats("1", heading="sigma gain"),
        "clock": Floats("s", heading="late by"),
        "sigma_clock": Floats("s", heading="sigma late by"),
        "chi2_force": Floats("1", heading="chi2 per force bin"),
        "chi2_outline": Floats("1", heading="chi2 per outline point"),
        "discrepancy_force": Floats("N", heading="discrepancy of the force"),
        "discrepancy_outline": Floats("m", heading="discrepancy of the outline"),
        "fit": Parts(FIT, by="channel", since=5),
        "own": Part(OWN, optional=True, since=5),
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
        "sigma_log": Floats("1", "nodes", key="sigma_log_factor"),
        "prior_share": Floats("1", "nodes", key="share_of_smoothness"),
        "stretch": Floats("1", "points", key=None),
        "stress": Floats("Pa", "points", key=None),
        "band": Floats("Pa", "2 points", key=None),
    },
)
JOINT = Record(
    JointResult,
    COLLECTION,
    {
        "estimates": Named(ESTIMATE, key=None),
        "fixed": numbers("SI"),
        "correlation": Floats("1", "estimates estimates", key=None),
        "expanded": numbers("SI", key=None),
        "shots": Parts(SHOT),
        "scatter": Part(SCATTER, optional=True, key="scatter_between_shots"),
        "slow": numbers("1", key="slow_tests"),
        "choice": Part(CHOICE, optional=True, key="model_choice"),
        "curve": Part(CURVE, optional=True),
        "mesh": Integers("1", "2", as_tuple=True, key=None),
        "refined_mesh": Integers("1", "2", as_tuple=True, key=None),
        "runs": Integers("1"),
        "warnings": Text("warnings"),
        "slow_fit": Parts(FIT, by="channel", since=5),
        "agreement": Part(AGREEMENT, optional=True, since=5),
        "causes": Parts(CAUSE, since=6),
        "verdict": Text(derived=True),
    },
)


def write_joint_hdf5(path: Path, found: JointResult) -> None:
    """Write a joint identification to one HDF5 file, atomically."""
    with writing(path, FORMAT) as place:
        JOINT.write(place, found)


def read_joint_hdf5(path: Path) -> JointResult:
    """Read a file of `write_joint_hdf5` and check everything in it. The message is one line."""
    with reading(Path(path), FORMAT, cure="write it again with `kolsky identify`") as place:
        return JOINT.read(place)


_OF_ONE_SHOT = ("interval", "mesh_shift", "sigma_systematic")
"""Fields of an estimate that exist only for a single shot."""


def to_json(found: JointResult) -> dict[str, Any]:
    """The result as one object of JSON types. Numbers that are not finite become null."""
    names = list(found.estimates)
    estimates: dict[str, dict[str, Any]] = {}
    for name, e in found.estimates.items():
        said = {key: value for key, value in ESTIMATE.json(e).items() if key not in _OF_ONE_SHOT}
        estimates[name] = {**said, "interval_95": interval(e, found.expanded[name])}
    whole = {
        "estimates": estimates,
        "reference_curve": reference_words((*names, *found.fixed)) or "the quasi-static curve",
        "correlation": {"names": names, "matrix": found.correlation},
        "mesh": {"search": found.mesh, "refined": found.refined_mesh},
        **JOINT.json(found),
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def tables(found: JointResult) -> dict[str, dict[str, Any]]:
    """Named columns (SI) of shared parameters, shots and, for a free curve, the curve from the impacts."""
    own = OWN.columns(NOT_KNOWN if shot.own is None else shot.own for shot in found.shots)
    fits = fits_of(found)
    made = {
        "joint_parameters": _parameters(found),
        "joint_shots": {**SHOT.columns(found.shots), **own},
        "joint_fit": {"of": [of for of, _ in fits], **FIT.columns(fit for _, fit in fits)},
    }
    return made if found.curve is None else {**made, "joint_curve": _curve(found.curve)}


def _parameters(found: JointResult) -> dict[str, list[Any]]:
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


def fits_of(found: JointResult) -> list[tuple[str, FitQuality]]:
    """The residuals of every channel of a shot and of every slow test, each with its source."""
    fits = [(shot.name, fit) for shot in found.shots for fit in shot.fit]
    return fits + [("slow test", fit) for fit in found.slow_fit]


def _curve(c: CurveFound) -> dict[str, list[float]]:
    return {
        "nominal strain (1)": (c.stretch - 1.0).tolist(),
        "nominal stress (Pa)": c.stress.tolist(),
        "lower end, k = 2 (Pa)": c.band[0].tolist(),
        "upper end, k = 2 (Pa)": c.band[1].tolist(),
    }
