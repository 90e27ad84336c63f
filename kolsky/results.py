"""Results on disk: one HDF5 file a shot, tables in CSV, one JSON object.

The HDF5 file follows the NeXus habit: `NXentry` and `NXdata` groups with `signal` and `axes`, and `units`
on every array. Text is stored as fixed-length UTF-8 and provenance as one JSON text: no pickles, no object
types. Reading trusts nothing: link, type, shape and size of every dataset are checked before its values.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from explicit import EnergyLedger, Outcome, Response
from kolsky.atomic import replacing
from kolsky.errors import InputError
from kolsky.identification import (
    Comparison,
    DesignTable,
    Estimate,
    Identification,
    Route,
    SurrogateCurve,
    Terms,
    Verdict,
)
from kolsky.records import CentreLine, ForceHistory
from kolsky.results_layout import (
    CURVE,
    DESIGN,
    ENERGY,
    ENTRY,
    ESTIMATE,
    FORCE,
    NODES,
    NUMBERS,
    PROFILE,
    PROFILE_MODEL,
    RECORDED,
    RESPONSE,
    ROUTE,
    TERMS,
    Table,
    shape_problem,
)
from kolsky.results_text import jsonable, to_json, write_csv

__all__ = ["read_identification", "to_json", "write_csv", "write_identification"]

FORMAT = "kolsky identification"
VERSION = 1
LARGEST_DATASET = 2**30
"""Largest dataset that is read [bytes]; a dense mesh at every frame takes 1e7."""


class _Refused(Exception):
    """One dataset that cannot be used, said without the file's name."""


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
    _write(_data(entry, "design", "chi2_force", "."), DESIGN, vars(result.design), {})
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


def _group(parent: h5py.Group, name: str, nx_class: str, **attributes: Any) -> h5py.Group:
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        group.attrs[key] = value
    return group


def _data(parent: h5py.Group, name: str, signal: str, *axes: str) -> h5py.Group:
    return _group(parent, name, "NXdata", signal=signal, axes=list(axes))


def _safe(name: str) -> str:
    if not name.isidentifier():
        raise ValueError(
            f"parameter name {name!r} cannot name a group of the file; use letters, digits and _"
        )
    return name


def _write(
    group: h5py.Group,
    table: Table,
    source: Mapping[str, Any],
    dims: dict[str, int],
    *,
    unit: str | None = None,
) -> None:
    """Write the datasets of `table`; sizes of named dimensions are checked against and added to `dims`."""
    for name, (own_unit, dimensions, kind) in table.items():
        value = source[name]
        if kind == "t":
            texts = np.array([value] if isinstance(value, str) else list(value), dtype=object)
            if any("\0" in text for text in texts):
                raise ValueError(f"{group.name}/{name}: a text with a NUL character cannot be stored")
            encoded = [text.encode() for text in texts]
            longest = max([1, *map(len, encoded)])
            array = np.array(encoded, dtype=h5py.string_dtype("utf-8", longest))
            array = array.reshape(()) if isinstance(value, str) else array
        else:
            array = np.asarray(value, dtype={"f": np.float64, "i": np.int64, "b": np.bool_}[kind])
        wrong = shape_problem(array.shape, dimensions, dims)
        if wrong:
            raise ValueError(f"{group.name}/{name}: {wrong}")
        large = array.size > 4096
        packing = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if large else {}
        dataset = group.create_dataset(name, data=array, **packing)
        if kind != "t":
            dataset.attrs["units"] = own_unit if unit is None else unit


def _write_numbers(parent: h5py.Group, name: str, values: Mapping[str, float], unit: str = "SI") -> None:
    source = {"names": tuple(values), "values": list(values.values())}
    _write(_group(parent, name, "NXcollection"), NUMBERS, source, {}, unit=unit)


# Reading ------------------------------------------------------------------------------------------


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
            if not (_attribute(file, "format") == FORMAT and _attribute(file, "format_version") == VERSION):
                raise _Refused(f"not a result of version {VERSION} of the format {FORMAT!r}")
            return _read_entry(file)
    except FileNotFoundError:
        raise InputError(path, "no such file", cure=cure) from None
    except _Refused as error:
        raise InputError(path, str(error), cure=cure) from None
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        # What h5py raises on damaged files; its messages can span lines.
        cause = " ".join(str(error).split())
        raise InputError(path, f"not a readable HDF5 file ({cause})", cure=cure) from error


def _attribute(file: h5py.File, name: str) -> object:
    value = file.attrs.get(name)
    return value.item() if isinstance(value, np.generic) else value


def _read_entry(file: h5py.File) -> Identification:
    entry = _read(file, "entry", ENTRY, {"two": 2})
    try:
        provenance = json.loads(entry["provenance"])
    except (ValueError, RecursionError) as error:
        raise _Refused(f"/entry/provenance: not JSON ({error})") from None
    if not isinstance(provenance, dict):
        raise _Refused(f"/entry/provenance: a JSON {type(provenance).__name__}, expected an object")

    names = _read(file, "entry/estimates", {"names": ("", "entries", "t")}, {})["names"]
    estimates = {name: _read_estimate(file, name) for name in names}
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
        design=DesignTable(**_read(file, "entry/design", DESIGN, {})),
        curves=tuple(SurrogateCurve(**_read(file, p, CURVE, {})) for p in _numbered(file, "entry/curves")),
        surrogate=_read_numbers(file, "entry/surrogate"),
        seconds=_read_numbers(file, "entry/seconds"),
        warnings=entry["warnings"],
        provenance=provenance,
    )


def _read_estimate(file: h5py.File, name: str) -> Estimate:
    if not name.isidentifier():
        raise _Refused(f"/entry/estimates/names: {name!r} is no parameter name")
    place = f"entry/estimates/{name}"
    values = _read(file, place, ESTIMATE, {})
    try:
        values["outcome"] = Verdict(values["outcome"])
    except ValueError:
        known = ", ".join(repr(v.value) for v in Verdict)
        raise _Refused(f"/{place}/outcome: {values['outcome']!r}, expected one of {known}") from None
    return Estimate(name=name, **values, noise_parts=_read_numbers(file, f"{place}/noise_parts"))


def _read_response(file: h5py.File) -> Response:
    dims = {"two": 2}
    values = _read(file, "entry/response", RESPONSE, dims)
    unknown = sorted(set(values["outcomes"]) - set(Outcome.__members__))
    if unknown:
        known = ", ".join(Outcome.__members__)
        raise _Refused(f"/entry/response/outcomes: {unknown[0]!r}, expected one of {known}")
    values["outcomes"] = tuple(Outcome[name] for name in values["outcomes"])
    if "nodes" in _open(file, "entry/response", h5py.Group):
        values |= _read(file, "entry/response", NODES, dims)
    return Response(**values, energy=EnergyLedger(**_read(file, "entry/energy", ENERGY, dims)))


def _read_numbers(file: h5py.File, place: str) -> dict[str, float]:
    values = _read(file, place, NUMBERS, {})
    return dict(zip(values["names"], values["values"].tolist(), strict=True))


def _numbered(file: h5py.File, place: str) -> list[str]:
    """Paths of the sub-groups "0", "1", ... of a group, which must be all it holds."""
    found = set(_open(file, place, h5py.Group).keys())
    expected = [str(number) for number in range(len(found))]
    if found != set(expected):
        raise _Refused(f"/{place}: groups {sorted(found)[:5]}, expected them numbered from 0")
    return [f"{place}/{number}" for number in expected]


def _read(file: h5py.File, place: str, table: Table, dims: dict[str, int]) -> dict[str, Any]:
    """Read the datasets of `table`; sizes of named dimensions are checked against and added to `dims`."""
    _open(file, place, h5py.Group)
    values: dict[str, Any] = {}
    for name, (_, dimensions, kind) in table.items():
        where = f"/{place}/{name}"
        dataset = _open(file, f"{place}/{name}", h5py.Dataset)
        if dataset.external or dataset.is_virtual:
            raise _Refused(f"{where}: its values lie in another file, expected them in this one")
        expected = {"f": "<f8", "i": "<i8", "b": "|b1", "t": "S"}[kind]
        if not (dataset.dtype.kind == "S" if kind == "t" else dataset.dtype == np.dtype(expected)):
            raise _Refused(f"{where}: type {dataset.dtype}, expected {expected}")
        if dataset.shape is None:
            raise _Refused(f"{where}: holds nothing, expected ({dimensions or 'scalar'})")
        wrong = shape_problem(dataset.shape, dimensions, dims)
        if wrong:
            raise _Refused(f"{where}: {wrong}")
        if dataset.size * dataset.dtype.itemsize > LARGEST_DATASET:
            raise _Refused(f"{where}: more than {LARGEST_DATASET} bytes")
        values[name] = _text(dataset[()], where) if kind == "t" else dataset[()]
        if kind != "t" and not dimensions:
            values[name] = values[name].item()
    return values


def _open(file: h5py.File, place: str, kind: type) -> Any:
    """The object at `place`, reached over hard links only (a soft or external link could lead anywhere)."""
    here: Any = file
    done = ""
    for part in place.split("/"):
        done += "/" + part
        link = here.get(part, getlink=True) if isinstance(here, h5py.Group) else None
        if link is None:
            raise _Refused(f"{done}: missing")
        if not isinstance(link, h5py.HardLink):
            raise _Refused(f"{done}: a {type(link).__name__}, expected the object itself")
        here = here[part]
    if not isinstance(here, kind):
        raise _Refused(f"{done}: a {type(here).__name__}, expected a {kind.__name__}")
    return here


def _text(value: Any, where: str) -> str | tuple[str, ...]:
    try:
        if isinstance(value, np.ndarray):
            return tuple(text.decode() for text in value.tolist())
        return bytes(value).decode()
    except UnicodeDecodeError as error:
        raise _Refused(f"{where}: not UTF-8 ({error.reason})") from None
