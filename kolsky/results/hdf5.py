"""A result to its HDF5 file: one file a shot, written whole or not at all.

The file follows the NeXus habit: `NXentry` and `NXdata` groups with `signal` and `axes`, and `units` on
every array. Text is stored as fixed-length UTF-8 and provenance as one JSON text: no pickles, no object
types.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from explicit import EnergyLedger, Outcome, Response
from kolsky.base.errors import InputError
from kolsky.base.files import replacing
from kolsky.base.json_types import jsonable
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.misfit import Terms
from kolsky.inverse.result import Comparison, Estimate, Identification, Route, SurrogateCurve, Verdict
from kolsky.inverse.run_table import DesignTable
from kolsky.results.datasets import Refused as _Refused
from kolsky.results.datasets import data as _data
from kolsky.results.datasets import group as _group
from kolsky.results.datasets import numbered as _numbered
from kolsky.results.datasets import opened as _opened
from kolsky.results.datasets import read as _read
from kolsky.results.datasets import read_numbers as _read_numbers
from kolsky.results.datasets import safe as _safe
from kolsky.results.datasets import write as _write
from kolsky.results.datasets import write_numbers as _write_numbers
from kolsky.results.knowledge import read_knowledge, read_variations, write_knowledge
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
    READABLE,
    RECORDED,
    RESPONSE,
    ROUTE,
    TERMS,
    VERSION,
)
from kolsky.results.methods import read_methods, write_methods


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


def read_identification(path: Path) -> Identification:
    """Read a file of `write_identification`, trusting nothing in it.

    Parameters
    ----------
    path : Path
        The HDF5 file.

    Returns
    -------
    Identification
        The same numbers, bit for bit.

    Raises
    ------
    InputError
        If the file is missing, truncated or no such result, or if a dataset is missing, a link to another
        file, of another type or shape, or larger than 1 GiB. The message is one line.
    """
    path = Path(path)
    cure = "write it again with `kolsky identify`"
    try:
        with h5py.File(path, "r") as file:
            version = _attribute(file, "format_version")
            if not (_attribute(file, "format") == FORMAT and version in READABLE):
                known = " or ".join(map(str, READABLE))
                raise _Refused(f"not a result of version {known} of the format {FORMAT!r}")
            found = _read_entry(file, int(str(version)))
            return found if version == 1 else replace(found, **_read_later(file))
    except FileNotFoundError:
        raise InputError(path, "no such file", cure=cure) from None
    except _Refused as error:
        raise InputError(path, str(error), cure=cure) from None
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        # What h5py raises on damaged files; its messages can span lines.
        cause = " ".join(str(error).split())
        raise InputError(path, f"not a readable HDF5 file ({cause})", cure=cure) from error


def _read_later(file: h5py.File) -> dict[str, Any]:
    """What the first version does not hold."""
    return {
        "variations": read_variations(file),
        "image_correlation": _read_numbers(file, "entry/image_correlation"),
    }


def _attribute(file: h5py.File, name: str) -> object:
    value = file.attrs.get(name)
    return value.item() if isinstance(value, np.generic) else value


def _read_entry(file: h5py.File, version: int) -> Identification:
    entry = _read(file, "entry", ENTRY, {"two": 2})
    try:
        provenance = json.loads(entry["provenance"])
    except (ValueError, RecursionError) as error:
        raise _Refused(f"/entry/provenance: not JSON ({error})") from None
    if not isinstance(provenance, dict):
        raise _Refused(f"/entry/provenance: a JSON {type(provenance).__name__}, expected an object")

    names = _read(file, "entry/estimates", {"names": ("", "entries", "t")}, {})["names"]
    estimates = {name: _read_estimate(file, name, version) for name in names}
    routes = []
    for place in _numbered(file, "entry/routes"):
        parameters, sigma = (_read_numbers(file, f"{place}/{part}") for part in ("parameters", "sigma"))
        routes.append(Route(**_read(file, place, ROUTE, {}), parameters=parameters, sigma=sigma))
    points: dict[str, int] = {}
    comparison = Comparison(
        **_read(file, "entry/force", FORCE, {}),
        centre_line=CentreLine(**_read(file, "entry/profile", PROFILE, points)),
        **_read(file, "entry/profile", PROFILE_MODEL, points),
        recorded=ForceHistory(**_read(file, "entry/recorded", RECORDED, {})),
    )
    return Identification(
        shot=entry["shot"],
        estimates=estimates,
        fixed=_read_numbers(file, "entry/fixed"),
        routes=tuple(routes),
        terms=Terms(**_read(file, "entry/terms", TERMS, {})),
        comparison=comparison,
        response=_read_response(file),
        mesh=(int(entry["mesh"][0]), int(entry["mesh"][1])),
        refined_mesh=(int(entry["refined_mesh"][0]), int(entry["refined_mesh"][1])),
        design=DesignTable(**_read_design(file)),
        curves=tuple(SurrogateCurve(**_read(file, p, CURVE, {})) for p in _numbered(file, "entry/curves")),
        surrogate=_read_numbers(file, "entry/surrogate"),
        seconds=_read_numbers(file, "entry/seconds"),
        warnings=entry["warnings"],
        provenance=provenance,
        methods=read_methods(file),
        **read_knowledge(file),
    )


def _read_estimate(file: h5py.File, name: str, version: int) -> Estimate:
    if not name.isidentifier():
        raise _Refused(f"/entry/estimates/names: {name!r} is no parameter name")
    place = f"entry/estimates/{name}"
    values = _read(file, place, ESTIMATE, {})
    try:
        values["outcome"] = Verdict(values["outcome"])
    except ValueError:
        known = ", ".join(repr(v.value) for v in Verdict)
        raise _Refused(f"/{place}/outcome: {values['outcome']!r}, expected one of {known}") from None
    if version > 1:
        values["numerical_parts"] = _read_numbers(file, f"{place}/numerical_parts")
    return Estimate(name=name, **values, noise_parts=_read_numbers(file, f"{place}/noise_parts"))


def _read_design(file: h5py.File) -> dict[str, Any]:
    values = _read(file, "entry/design", DESIGN, {"two": 2})
    _known_outcomes("entry/design", values["outcomes"])
    return values


def _known_outcomes(place: str, names: tuple[str, ...]) -> None:
    unknown = sorted(set(names) - set(Outcome.__members__))
    if unknown:
        known = ", ".join(Outcome.__members__)
        raise _Refused(f"/{place}/outcomes: {unknown[0]!r}, expected one of {known}")


def _read_response(file: h5py.File) -> Response:
    dims = {"two": 2}
    values = _read(file, "entry/response", RESPONSE, dims)
    _known_outcomes("entry/response", values["outcomes"])
    values["outcomes"] = tuple(Outcome[name] for name in values["outcomes"])
    if "nodes" in _opened(file, "entry/response", h5py.Group):
        values |= _read(file, "entry/response", NODES, dims)
    return Response(**values, energy=EnergyLedger(**_read(file, "entry/energy", ENERGY, dims)))
