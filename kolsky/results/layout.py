"""The HDF5 file of an identification: unit, dimensions and place of every field, a table a record."""

from dataclasses import fields

from explicit import EnergyLedger, Outcome, Response
from kolsky.base.hdf5 import Format
from kolsky.base.hdf5_items import (
    COLLECTION,
    OWN,
    Choice,
    Flags,
    Floats,
    Group,
    Integers,
    Item,
    Json,
    Text,
    numbers,
    nxdata,
)
from kolsky.base.hdf5_records import GroupName, Named, Part, Parts, Record
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.method_comparison import Method
from kolsky.inverse.misfit import Terms
from kolsky.inverse.result import (
    Comparison,
    Contribution,
    Estimate,
    Identification,
    Route,
    RouteDifference,
    SurrogateCurve,
    Verdict,
)
from kolsky.inverse.run_table import DesignTable
from kolsky.inverse.uncertainty_results import (
    Declaration,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)
from kolsky.results.layout_fit import CAUSE, CLOCK, FIT, HELD

FORMAT = Format("kolsky identification", version=4, readable=(1, 2, 3, 4))
"""Version 1 knows no other choices, numbers of image correlation and parts of the numerical uncertainty;
version 2 no goodness of fit, no lags of clocks and no causes of a misfit; version 3 not the ranges in which
parameters were searched."""

ESTIMATE = Record(
    Estimate,
    COLLECTION,
    {
        "name": GroupName(),
        "unit": Text(),
        "value": Floats(OWN),
        "sigma_noise": Floats(OWN),
        "sigma_numerical": Floats(OWN),
        "sigma_systematic": Floats(OWN),
        "mesh_shift": Floats(OWN),
        "noise_parts": numbers(OWN),
        "numerical_parts": numbers(OWN, since=2),
        "mesh_correction": Floats(OWN, since=3),
        "searched": Floats(OWN, "2", as_tuple=True, since=4),
        "outcome": Choice(Verdict),
    },
    derived={
        "sigma": Floats(OWN),
        "interval": Floats(OWN, "2", attributes={"coverage_factor": 2}),
        "on_mesh": Floats(OWN),
    },
)
CONTRIBUTION = Record(Contribution, COLLECTION, {"source": Text(), "sigma": numbers("SI")})
ROUTE = Record(
    Route,
    COLLECTION,
    {
        "name": Text(),
        "parameters": numbers("SI"),
        "cost": Floats("1"),
        "sigma": numbers("SI"),
        "correction": numbers("SI", since=3),
        "budget": Parts(CONTRIBUTION, since=3),
    },
)
DIFFERENCE = Record(
    RouteDifference,
    COLLECTION,
    {"values": numbers("SI"), "sigma": numbers("SI"), "budget": Parts(CONTRIBUTION)},
)
METHOD = Record(
    Method,
    COLLECTION,
    {
        "name": Text(),
        "values": numbers("SI"),
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


TERMS = Record(Terms, COLLECTION, {f.name: _term(f.name) for f in fields(Terms)})
OUTLINE = Record(
    CentreLine,
    None,
    {
        "time": Floats("s", "points"),
        "frame": Integers("1", "points"),
        "y": Floats("m", "points"),
        "Z": Floats("m", "points"),
        "sigma": Floats("m", "points"),
        "modes": Floats("m", "modes points", optional=True),
    },
)
RECORDED = Record(
    ForceHistory,
    nxdata("force", "time"),
    {
        "time": Floats("s", "recorded"),
        "force": Floats("N", "recorded"),
        "sigma": Floats("N", "recorded"),
    },
)
COMPARISON = Record(
    Comparison,
    None,
    {
        "force_time": Floats("s", "bins", at="force/force_time"),
        "force_measured": Floats("N", "bins", at="force/force_measured"),
        "force_sigma": Floats("N", "bins", at="force/force_sigma"),
        "force_model": Floats("N", "bins", at="force/force_model"),
        "centre_line": Part(OUTLINE, at="profile"),
        "Z_model": Floats("m", "points", at="profile/Z_model"),
        "inside": Flags("1", "points", at="profile/inside"),
        "recorded": Part(RECORDED, at="recorded"),
    },
    groups={"force": nxdata("force_measured", "force_time"), "profile": nxdata("Z", "time")},
)
DESIGN = Record(
    DesignTable,
    nxdata("chi2_force", "."),
    {
        "names": Text("parameters"),
        "points": Floats("SI", "runs parameters"),
        "lower": Floats("SI", "parameters"),
        "upper": Floats("SI", "parameters"),
        "outcomes": Text("runs", among=tuple(Outcome.__members__)),
        "end_times": Floats("s", "runs"),
        "failed_elements": Integers("1", "runs"),
        "failed_places": Floats("m", "runs 2"),
        "stage": Text("runs"),
        "phi_shape": Floats("1", "runs"),
        "phi_force": Floats("N", "runs"),
        "chi2_shape": Floats("1", "runs"),
        "chi2_force": Floats("1", "runs"),
    },
)
CURVE = Record(
    SurrogateCurve,
    nxdata("chi2", "x"),
    {
        "parameter": Text(),
        "x": Floats("SI", "x"),
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
        "name": Text(),
        "values": Floats("SI", "values"),
        "rise": Floats("1", "values"),
        "points": Floats("SI", "values parameters"),
        "level": Floats("1"),
        "correlation": Floats("1"),
        "interval": Floats("SI", "2", as_tuple=True),
        "alone": Floats("SI", "2", as_tuple=True),
        "verdict": Text(),
        "text": Text(),
        "error": Floats("1"),
    },
)
RIDGE = Record(
    PairMap,
    nxdata("rise", "y", "x"),
    {"names": Text("2"), "x": Floats("SI", "x"), "y": Floats("SI", "y"), "rise": Floats("1", "y x")},
)
DECLARED = Record(
    Declaration,
    COLLECTION,
    {
        "key": Text(),
        "sigma": Floats("SI"),
        "unit": Text(),
        "shifts": numbers("SI"),
        "status": Text(),
        "amount": Floats("SI", since=3),
        "moves": numbers("SI", since=3),
        "visible": Floats("1", since=3),
        "alike": Text("alike", since=3),
    },
)
VARIATION = Record(
    Variation,
    COLLECTION,
    {"key": Text(), "value": Floats("s"), "shifts": numbers("SI"), "status": Text()},
)
POSTERIOR = Record(
    PosteriorSummary,
    COLLECTION,
    {
        "names": Text("coordinates"),
        "samples": Floats("SI", "samples coordinates"),
        "median": Floats("SI", "coordinates"),
        "lower": Floats("SI", "coordinates"),
        "upper": Floats("SI", "coordinates"),
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
        "mesh": Integers("1", "2", as_tuple=True),
        "refined_mesh": Integers("1", "2", as_tuple=True),
        "warnings": Text("warnings"),
        "provenance": Json(),
        "estimates": Named(ESTIMATE),
        "fixed": numbers("SI"),
        "routes": Parts(ROUTE),
        "terms": Part(TERMS),
        "comparison": Part(COMPARISON, at="."),
        "response": Part(RESPONSE),
        "design": Part(DESIGN),
        "curves": Parts(CURVE),
        "surrogate": numbers("SI"),
        "seconds": numbers("s"),
        "methods": Parts(METHOD),
        "profiles": Parts(PROFILE, at="knowledge/profiles"),
        "systematic": Parts(DECLARED, at="knowledge/systematic"),
        "variations": Parts(VARIATION, at="knowledge/variations", since=2),
        "ridge": Part(RIDGE, at="knowledge/ridge", optional=True),
        "posterior": Part(POSTERIOR, at="knowledge/posterior", optional=True),
        "route_difference": Part(DIFFERENCE, optional=True, since=3),
        "fit": Parts(FIT, since=3),
        "clocks": Parts(CLOCK, since=3),
        "held_answer": Part(HELD, at="knowledge/held_answer", optional=True),
        "causes": Parts(CAUSE, since=3),
        "image_correlation": numbers("SI", since=2),
    },
    groups={"knowledge": COLLECTION},
)
