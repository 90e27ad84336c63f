"""A result to its HDF5 file: one file a shot, written whole or not at all.

The file follows the NeXus habit: `NXentry` and `NXdata` groups with `signal` and `axes`, and `units` on
every array. Text is stored as fixed-length UTF-8 and provenance as one JSON text: no pickles, no object
types.
"""

import json
from pathlib import Path

import h5py

from kolsky.base.files import replacing
from kolsky.inverse.result import Identification
from kolsky.results.datasets import data as _data
from kolsky.results.datasets import group as _group
from kolsky.results.datasets import safe as _safe
from kolsky.results.datasets import write as _write
from kolsky.results.datasets import write_numbers as _write_numbers
from kolsky.results.knowledge import write_knowledge
from kolsky.results.layout import (
    CURVE,
    DESIGN,
    ENERGY,
    ENTRY,
    ESTIMATE,
    FORCE,
    FORMAT,
    NODES,
    PROFILE,
    PROFILE_MODEL,
    RECORDED,
    RESPONSE,
    ROUTE,
    TERMS,
    VERSION,
)
from kolsky.results.methods import write_methods
from kolsky.results.text import jsonable


def write_identification(path: Path, identification: Identification) -> None:
    """Write everything `kolsky identify` returns to one HDF5 file, atomically.

    Parameters
    ----------
    path : Path
        The file, replaced if it exists; its folder must exist.
    identification : Identification
        The result. Provenance is stored as JSON: tuples become lists, values that are not finite null.

    Raises
    ------
    ValueError
        If shapes of the result disagree with each other, or a text cannot be stored.
    TypeError
        If provenance holds something JSON cannot say.
    OSError
        If the file cannot be written; an older file of the name is then unchanged.
    """
    with replacing(Path(path)) as partial, h5py.File(partial, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = VERSION
        file.attrs["default"] = "entry"
        _write_entry(_group(file, "entry", "NXentry", default="force"), identification)


def _write_entry(entry: h5py.Group, result: Identification) -> None:
    text = json.dumps(jsonable(result.provenance, "provenance"), allow_nan=False)
    _write(entry, ENTRY, {**vars(result), "provenance": text}, {"two": 2})

    estimates = _group(entry, "estimates", "NXcollection")
    _write(estimates, {"names": ("", "entries", "t")}, {"names": tuple(result.estimates)}, {})
    for name, estimate in result.estimates.items():
        part = _group(estimates, _safe(name), "NXcollection")
        _write(part, ESTIMATE, vars(estimate), {}, unit=estimate.unit)
        _write_numbers(part, "noise_parts", estimate.noise_parts, estimate.unit)
        _write_numbers(part, "numerical_parts", estimate.numerical_parts, estimate.unit)
        for derived, value in (("sigma", estimate.sigma), ("interval", estimate.interval)):
            part.create_dataset(derived, data=value).attrs["units"] = estimate.unit
        part["interval"].attrs["coverage_factor"] = 2
    routes = _group(entry, "routes", "NXcollection")
    for number, route in enumerate(result.routes):
        part = _group(routes, str(number), "NXcollection")
        _write(part, ROUTE, vars(route), {})
        _write_numbers(part, "parameters", route.parameters)
        _write_numbers(part, "sigma", route.sigma)
    _write_numbers(entry, "fixed", result.fixed)
    _write_numbers(entry, "surrogate", result.surrogate)
    _write_numbers(entry, "seconds", result.seconds, "s")
    _write(_group(entry, "terms", "NXcollection"), TERMS, vars(result.terms), {})

    comparison = result.comparison
    points: dict[str, int] = {}
    _write(_data(entry, "force", "force_measured", "force_time"), FORCE, vars(comparison), {})
    profile = _data(entry, "profile", "Z", "time")
    _write(profile, PROFILE, vars(comparison.centre_line), points)
    _write(profile, PROFILE_MODEL, vars(comparison), points)
    _write(_data(entry, "recorded", "force", "time"), RECORDED, vars(comparison.recorded), {})
    _write(_data(entry, "design", "chi2_force", "."), DESIGN, vars(result.design), {"two": 2})
    curves = _group(entry, "curves", "NXcollection")
    for number, curve in enumerate(result.curves):
        _write(_data(curves, str(number), "chi2", "x"), CURVE, vars(curve), {})

    response, dims = result.response, {"two": 2}
    part = _data(entry, "response", "force_transmission", ".", "force_times")
    names = tuple(outcome.name for outcome in response.outcomes)
    _write(part, RESPONSE, {**vars(response), "outcomes": names}, dims)
    if response.nodes is not None:
        _write(part, NODES, vars(response), dims)
    energy = _data(entry, "energy", "external", ".", "surface_times")
    energy["surface_times"] = part["surface_times"]  # one dataset, two names
    _write(energy, ENERGY, vars(response.energy), dims)
    write_knowledge(entry, result)
    _write_numbers(entry, "image_correlation", result.image_correlation)
    write_methods(entry, result.methods)
