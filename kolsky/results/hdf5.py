"""The file format of an identification: path, unit, key and heading of every field, one table per record.

HDF5, JSON, tables and display units are derived from it. Every value is checked when it is read.
"""

from dataclasses import fields, replace
from pathlib import Path

from explicit import EnergyLedger, Outcome, Response
from kolsky.base.files import jsonable
from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_records import (
    COLLECTION,
    RECORD_UNIT,
    Choice,
    Flags,
    Floats,
    Group,
    GroupName,
    Integers,
    Item,
    Json,
    JsonOnly,
    Named,
    Part,
    Parts,
    Record,
    Text,
    by_parameter,
    numbers,
    nxdata,
)
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.result import (
    CauseFinding,
    ClockLag,
    Comparison,
    Contribution,
    Declaration,
    Estimate,
    FitQuality,
    Identification,
    Method,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Route,
    RouteDifference,
    SurrogateCurve,
    Variation,
    Verdict,
)
from kolsky.inverse.run_table import DesignTable, Terms

FIT = Record(
    FitQuality,
    COLLECTION,
    {
        "channel": Text(heading="channel"),
        "unit": Text(),
        "values": Integers("1", heading="values"),
        "residual": Floats(RECORD_UNIT),
        "predicted": numbers(RECORD_UNIT),
        "peak": Floats(RECORD_UNIT),
        "slow_residual": Floats(RECORD_UNIT),
        "slow_expected": Floats(RECORD_UNIT),
        "chi2": Floats("1", heading="chi2 over noise"),
        "discrepancy_share": Floats("1"),
        "correlation": Floats("1"),
        "whiteness": Floats("1"),
        "weight": numbers("1"),
        "limit": Floats("1", heading="at most"),
        "slow_limit": Floats("1", heading="at most, slow"),
        "expected": Floats(RECORD_UNIT, derived=True),
        "over_noise": JsonOnly(),
        "over_peak": JsonOnly(),
        "excess": Floats("1", derived=True, heading="residual over expected"),
        "slow_excess": Floats("1", derived=True, heading="slow residual over expected"),
        "explained": Flags("1", derived=True, heading="explained"),
    },
)
CLOCK = Record(
    ClockLag,
    COLLECTION,
    {
        "recording": Text(),
        "lag": Floats("s"),
        "sigma": Floats("s"),
        "evidence": Floats("1"),
        "explains": Flags("1"),
        "file": Text(),
        "key": Text(),
        "significance": JsonOnly(),
    },
)
CAUSE = Record(
    CauseFinding,
    COLLECTION,
    {
        "key": Text(),
        "words": Text(),
        "unit": Text(),
        "exact": Floats(RECORD_UNIT),
        "value": Floats(RECORD_UNIT),
        "sigma": Floats(RECORD_UNIT),
        "explained": Floats("1"),
        "evidence": Floats("1"),
        "probability": Floats("1"),
        "parameters": numbers("SI"),
        "sigmas": numbers("SI"),
        "named": Flags("1"),
        "alike": Text("alike"),
        "beside": Text(),
        "status": Text(),
        "declared_sigma": Floats(RECORD_UNIT, optional=True),
        "solved": numbers("SI"),
        "solved_sigmas": numbers("SI"),
        "change": JsonOnly(),
        "within": JsonOnly(),
    },
)


FORMAT = Format("kolsky identification", version=4, readable=(1, 2, 3, 4))
"""Fields that an older version lacks have ``since``."""

ESTIMATE = Record(
    Estimate,
    COLLECTION,
    {
        "name": GroupName(key=None, heading="parameter"),
        "unit": Text(heading="unit"),
        "value": Floats(RECORD_UNIT, heading="value", parameter="name"),
        "sigma": Floats(RECORD_UNIT, heading="sigma", derived=True),
        "interval": Floats(
            RECORD_UNIT,
            "2",
            attributes={"coverage_factor": 2},
            heading=("lower (k = 2)", "upper (k = 2)"),
            derived=True,
        ),
        "sigma_noise": Floats(RECORD_UNIT, heading="sigma noise", parameter="name"),
        "sigma_numerical": Floats(RECORD_UNIT, heading="sigma mesh and step", parameter="name"),
        "sigma_systematic": Floats(RECORD_UNIT, parameter="name"),
        "mesh_shift": Floats(RECORD_UNIT, parameter="name"),
        "noise_parts": numbers(RECORD_UNIT, parameter="name"),
        "numerical_parts": numbers(RECORD_UNIT, since=2, parameter="name"),
        "on_mesh": Floats(RECORD_UNIT, derived=True),
        "mesh_correction": Floats(RECORD_UNIT, since=3, parameter="name"),
        "searched": Floats(RECORD_UNIT, "2", as_tuple=True, since=4, parameter="name"),
        "outcome": Choice(Verdict, heading="verdict"),
    },
)
CONTRIBUTION = Record(Contribution, COLLECTION, {"source": Text(), "sigma": by_parameter()})
BUDGET = Parts(CONTRIBUTION, by="source", only="sigma")
ROUTE = Record(
    Route,
    COLLECTION,
    {
        "name": Text(),
        "parameters": by_parameter(),
        "cost": Floats("1"),
        "sigma": by_parameter(),
        "correction": by_parameter(since=3),
        "budget": replace(BUDGET, since=3),
    },
)
DIFFERENCE = Record(
    RouteDifference, COLLECTION, {"values": by_parameter(), "sigma": by_parameter(), "budget": BUDGET}
)
METHOD = Record(
    Method,
    COLLECTION,
    {
        "name": Text(),
        "values": by_parameter(),
        "distances": numbers("1"),
        "runs": Integers("1"),
        "shared_runs": Integers("1"),
        "converged": Flags("1"),
        "ended": Text(),
    },
)


def _term(name: str) -> Item:
    if name.startswith("n_"):
        return Integers("1")
    return Floats("N" if name in ("phi_force", "sigma_phi_force") else "1")


TERMS = Record(Terms, COLLECTION, {**{f.name: _term(f.name) for f in fields(Terms)}, "chi2": JsonOnly()})
OUTLINE = Record(
    CentreLine,
    None,
    {
        "frame": Integers("1", "points"),
        "time": Floats("s", "points", heading="time"),
        "y": Floats("m", "points", heading="y"),
        "Z": Floats("m", "points", heading="Z measured"),
        "sigma": Floats("m", "points", heading="sigma Z"),
        "modes": Floats("m", "modes points", optional=True),
    },
)
RECORDED = Record(
    ForceHistory,
    nxdata("force", "time"),
    {"time": Floats("s", "recorded"), "force": Floats("N", "recorded"), "sigma": Floats("N", "recorded")},
)
COMPARISON = Record(
    Comparison,
    None,
    {
        "force_time": Floats("s", "bins", at="force/force_time", heading="time"),
        "force_measured": Floats("N", "bins", at="force/force_measured", heading="measured force"),
        "force_sigma": Floats("N", "bins", at="force/force_sigma", heading="sigma"),
        "force_model": Floats("N", "bins", at="force/force_model", heading="simulated force"),
        "centre_line": Part(OUTLINE, at="profile"),
        "Z_model": Floats("m", "points", at="profile/Z_model", heading="Z simulated"),
        "inside": Flags("1", "points", at="profile/inside", heading="inside"),
        "recorded": Part(RECORDED, at="recorded"),
    },
    groups={"force": nxdata("force_measured", "force_time"), "profile": nxdata("Z", "time")},
)
DESIGN = Record(
    DesignTable,
    nxdata("chi2_force", "."),
    {
        "names": Text("parameters"),
        "points": Floats("SI", "runs parameters", parameter="names"),
        "lower": Floats("SI", "parameters", parameter="names"),
        "upper": Floats("SI", "parameters", parameter="names"),
        "outcomes": Text("runs", among=tuple(Outcome.__members__), heading="outcome"),
        "phi_force": Floats("N", "runs", heading="Phi_F"),
        "phi_shape": Floats("1", "runs", heading="Phi_S"),
        "chi2_force": Floats("1", "runs", heading="chi2 force"),
        "chi2_shape": Floats("1", "runs", heading="chi2 shape"),
        "end_times": Floats("s", "runs", heading="end"),
        "failed_elements": Integers("1", "runs"),
        "failed_places": Floats("m", "runs 2"),
        "stage": Text("runs"),
    },
)
CURVE = Record(
    SurrogateCurve,
    nxdata("chi2", "x"),
    {
        "parameter": Text(),
        "x": Floats("SI", "x", parameter="parameter"),
        "chi2": Floats("1", "x"),
        "phi_shape": Floats("1", "x"),
        "phi_force": Floats("N", "x"),
    },
)
ENERGY = Record(
    EnergyLedger,
    nxdata("external", ".", "surface_times"),
    {f.name: Floats("J", "samples surface_times") for f in fields(EnergyLedger)},
)
RESPONSE = Record(
    Response,
    nxdata("force_transmission", ".", "force_times"),
    {
        "force_times": Floats("s", "force_times"),
        "force_flyer": Floats("N", "samples force_times"),
        "force_transmission": Floats("N", "samples force_times"),
        "impulse_flyer": Floats("N s", "samples force_times"),
        "impulse_transmission": Floats("N s", "samples force_times"),
        "surface_times": Floats("s", "surface_times"),
        "surface_r": Floats("m", "samples surface_times surface_nodes"),
        "surface_y": Floats("m", "samples surface_times surface_nodes"),
        "outcomes": Choice(Outcome, "samples"),
        "failed_elements": Integers("1", "samples"),
        "failed_places": Floats("m", "samples 2"),
        "end_times": Floats("s", "samples"),
        "steps": Integers("1", "samples"),
        "smallest_step": Floats("s", "samples"),
        "extrapolated_share": Floats("1", "samples"),
        "largest_strain_measure": Floats("1", "samples"),
        "nodes": Floats("m", "samples surface_times nodes 2", optional=True),
        "energy": Part(ENERGY, at="../energy"),
    },
    links={"../energy/surface_times": "surface_times"},
)
PROFILE = Record(
    ParameterProfile,
    nxdata("rise", "values"),
    {
        "name": Text(key=None),
        "values": Floats("SI", "values", key=None, parameter="name"),
        "rise": Floats("1", "values", key=None),
        "points": Floats("SI", "values parameters", key=None),
        "level": Floats("1"),
        "correlation": Floats("1", key=None),
        "interval": Floats("SI", "2", as_tuple=True, parameter="name"),
        "alone": Floats("SI", "2", as_tuple=True, key="interval_others_known", parameter="name"),
        "verdict": Text(),
        "text": Text(),
        "error": Floats("1"),
    },
)
RIDGE = Record(
    PairMap,
    nxdata("rise", "y", "x"),
    {
        "names": Text("2"),
        "x": Floats("SI", "x", parameter="names.0"),
        "y": Floats("SI", "y", parameter="names.1"),
        "rise": Floats("1", "y x"),
    },
)
DECLARED = Record(
    Declaration,
    COLLECTION,
    {
        "key": Text(key=None),
        "sigma": Floats("SI"),
        "unit": Text(),
        "shifts": by_parameter(),
        "status": Text(),
        "amount": Floats("SI", since=3, key=None),
        "moves": by_parameter(since=3, key=None),
        "visible": Floats("1", since=3, key=None),
        "alike": Text("alike", since=3, key=None),
    },
)
VARIATION = Record(
    Variation, COLLECTION, {"key": Text(), "value": Floats("s"), "shifts": by_parameter(), "status": Text()}
)
POSTERIOR = Record(
    PosteriorSummary,
    COLLECTION,
    {
        "names": Text("coordinates"),
        "samples": Floats("SI", "samples coordinates", key=None, parameter="names"),
        "median": Floats("SI", "coordinates", parameter="names"),
        "lower": Floats("SI", "coordinates", parameter="names"),
        "upper": Floats("SI", "coordinates", parameter="names"),
        "converged": Flags("1"),
        "autocorrelation": Floats("1"),
        "steps": Integers("1"),
        "acceptance": Floats("1"),
        "power": Floats("1"),
        "prior": Text(),
    },
)
IDENTIFICATION = Record(
    Identification,
    Group("NXentry", {"default": "force"}),
    {
        "shot": Text(),
        "mesh": Integers("1", "2", as_tuple=True, key=None),
        "refined_mesh": Integers("1", "2", as_tuple=True, key=None),
        "warnings": Text("warnings"),
        "provenance": Json(),
        "estimates": Named(ESTIMATE, key=None),
        "fixed": by_parameter(),
        "routes": Parts(ROUTE),
        "terms": Part(TERMS),
        "comparison": Part(COMPARISON, at=".", key=None),
        "response": Part(RESPONSE, key=None),
        "design": Part(DESIGN, key=None),
        "curves": Parts(CURVE, key=None),
        "surrogate": numbers("SI"),
        "seconds": numbers("s"),
        "methods": Parts(METHOD),
        "profiles": Parts(PROFILE, by="name", at="knowledge/profiles"),
        "systematic": Parts(DECLARED, by="key", at="knowledge/systematic"),
        "variations": Parts(VARIATION, at="knowledge/variations", since=2),
        "ridge": Part(RIDGE, at="knowledge/ridge", optional=True, key=None),
        "posterior": Part(POSTERIOR, at="knowledge/posterior", optional=True),
        "route_difference": Part(DIFFERENCE, optional=True, since=3),
        "fit": Parts(FIT, by="channel", since=3),
        "clocks": Parts(CLOCK, by="recording", since=3),
        "causes": Parts(CAUSE, since=3),
        "image_correlation": numbers("SI", since=2, key=None),
    },
    groups={"knowledge": COLLECTION},
)


def write_identification(path: Path, identification: Identification) -> None:
    """Write everything `kolsky identify` returns to one HDF5 file, atomically.

    Parameters
    ----------
    path
        The file; its folder must exist. OSError, with an existing file unchanged, if it cannot be written.
    identification
        The result; ValueError if its shapes are inconsistent or a text cannot be stored. Provenance is stored
        as JSON: tuples become lists, and values that are not finite become null; TypeError if JSON cannot
        represent a value.
    """
    plain = replace(identification, provenance=jsonable(identification.provenance, "provenance"))
    with writing(path, FORMAT) as place:
        IDENTIFICATION.write(place, plain)


def read_identification(path: Path) -> Identification:
    """Read a file of `write_identification`, of any version: the same numbers, bit for bit.

    Raises InputError, in one line, if the file is missing, truncated or not such a result, or if a dataset is
    missing, a link to another file, of a wrong type, shape or unit, or larger than 1 GiB.
    """
    with reading(Path(path), FORMAT, cure="write it again with `kolsky identify`") as place:
        return IDENTIFICATION.read(place)
