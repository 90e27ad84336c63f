"""A reduction to its files: one HDF5 file with units on every array, CSV tables of the curves and the log."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from kolsky.bars.records import BarSignal, History
from kolsky.bars.result import FlyerResult, ReducedTest, WavesResult
from kolsky.base.files import replacing, write_table

FORMAT, VERSION = "kolsky-waves", 1
HISTORIES = {
    "front_force": "N",
    "back_force": "N",
    "front_velocity": "m/s",
    "back_velocity": "m/s",
}
"""Single histories of a reduction and their units."""
WAYS = {"one wave": "one_wave", "two waves": "two_waves", "three waves": "three_waves"}
"""Group names of the ways of analysis."""


def write_hdf5(path: Path, result: ReducedTest) -> None:
    """Write everything to one HDF5 file, atomically; text is fixed-length UTF-8, nothing is pickled.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    with replacing(Path(path)) as partial, h5py.File(partial, "w") as file:
        file.attrs["format"], file.attrs["format_version"], file.attrs["default"] = FORMAT, VERSION, "entry"
        entry = _group(file, "entry", "NXentry", default="reduction")
        entry["shot"], entry["load"] = _text([result.name])[0], _text([result.load])[0]
        if isinstance(result, WavesResult):
            _waves(entry, result)
        elif isinstance(result, FlyerResult):
            _flyer(entry, result)
        _reduction(entry, result)
        _tables(entry, result)


def write_csv(folder: Path, result: ReducedTest) -> None:
    """Write waves.csv (histories), waves_corrections.csv (audit log) and waves_budget.csv."""
    r = result.reduction
    columns: dict[str, Any] = {"time (s)": r.time}
    for way in WAYS:
        if way not in r.strain:
            continue
        for name, kind, unit in (
            ("strain", r.strain, "1"),
            ("rate", r.rate, "1/s"),
            ("stress", r.stress, "Pa"),
        ):
            columns[f"{name}, {way} ({unit})"] = kind[way].value
            columns[f"sigma of {name}, {way} ({unit})"] = kind[way].sigma
    for name, unit in HISTORIES.items():
        columns[f"{name.replace('_', ' ')} ({unit})"] = getattr(r, name).value
        columns[f"sigma of {name.replace('_', ' ')} ({unit})"] = getattr(r, name).sigma
    columns["imbalance R (1)"] = r.imbalance
    columns.update(result.extra)
    write_table(folder / "waves.csv", {key: np.asarray(value).tolist() for key, value in columns.items()})
    log = result.corrections
    write_table(
        folder / "waves_corrections.csv",
        {
            "correction": [c.name for c in log],
            "switch": [c.key for c in log],
            "applied": ["yes" if c.applied else "no" for c in log],
            "largest change": [c.size for c in log],
            "rms change": [c.rms for c in log],
            "unit": [c.unit for c in log],
            "reason": [c.reason for c in log],
        },
    )
    budget = result.budget
    write_table(
        folder / "waves_budget.csv",
        {
            "input": [row.quantity.name for row in budget.contributions],
            "value": [row.quantity.value for row in budget.contributions],
            "standard uncertainty": [row.quantity.sigma for row in budget.contributions],
            "unit": [row.quantity.unit for row in budget.contributions],
            "kind": [row.quantity.kind for row in budget.contributions],
            **{
                f"share of variance, {name}": [row.shares.get(name, 0.0) for row in budget.contributions]
                for name in budget.results
            },
        },
    )


def _waves(entry: h5py.Group, result: WavesResult) -> None:
    """Gauges, windows and the waves at the faces."""
    gauges = _group(entry, "gauges", "NXcollection")
    for station in (result.incident, result.transmission):
        _station(gauges, station)
    windows = _group(entry, "windows", "NXcollection")
    windows["source"] = _text([result.windows.source])[0]
    for name in ("incident", "reflected", "transmitted"):
        _array(windows, name, getattr(result.windows, name), "s")
    faces = _group(entry, "faces", "NXdata", signal="incident", axes=["time"])
    for name in ("time", "incident", "reflected", "transmitted"):
        _array(faces, name, getattr(result.faces, name), "s" if name == "time" else "1")
    for name, sigma in result.faces.sigma.items():
        faces[name].attrs["sigma"] = sigma


def _flyer(entry: h5py.Group, result: FlyerResult) -> None:
    """Transducers, events, validity."""
    forces = _group(entry, "transducers", "NXcollection")
    for signal in result.signals:
        part = _group(forces, signal.name.replace(" ", "_"), "NXdata", signal="force", axes=["time"])
        _array(part, "time", signal.time, "s")
        _array(part, "force", signal.value, "N")
        part["force"].attrs["sigma"] = signal.sigma
    events = _group(entry, "events", "NXcollection")
    for name, at, sigma, how in result.events:
        part = _group(events, name.replace(" ", "_"), "NXcollection")
        part["how"] = _text([how])[0]
        if at is not None and sigma is not None:
            _array(part, "time", at, "s")
            _array(part, "sigma", sigma, "s")
    window = _group(entry, "validity", "NXcollection")
    window["sentence"] = _text([result.validity])[0]
    if result.valid is not None:
        _array(window, "window", result.valid, "s")
    for name, values in result.inertia.items():
        _array(window, name, values, "s" if name == "time" else "1")
    if result.synchronisation is not None:
        entry["synchronisation"] = _text([result.synchronisation])[0]


def _station(parent: h5py.Group, station: BarSignal) -> None:
    signal = station.strain
    group = _group(parent, station.side, "NXdata", signal="strain", axes=["time"])
    _array(group, "time", signal.time, "s")
    _array(group, "strain", signal.value, "1")
    group["strain"].attrs["sigma"] = signal.sigma
    if station.bending is not None:
        _array(group, "bending", station.bending, "1")
    _array(group, "position", station.position, "m")


def _reduction(entry: h5py.Group, result: ReducedTest) -> None:
    r = result.reduction
    group = _group(entry, "reduction", "NXcollection", default="three_waves")
    _array(group, "time", r.time, "s")
    for way, name in WAYS.items():
        if way not in r.strain:
            continue
        part = _group(group, name, "NXdata", signal="stress", axes=["time"])
        part["time"] = group["time"]
        for quantity, kind in (("strain", r.strain), ("rate", r.rate), ("stress", r.stress)):
            _history(part, quantity, kind[way])
    for name in HISTORIES:
        _history(group, name, getattr(r, name))
    _array(group, "imbalance", r.imbalance, "1")
    if r.balanced is not None:
        _array(group, "balanced", r.balanced, "s")
    for name, values in result.extra.items():
        words, _, unit = name.rpartition(" (")
        _array(group, words.replace(" ", "_"), values, unit.removesuffix(")"))


def _tables(entry: h5py.Group, result: ReducedTest) -> None:
    log = _group(entry, "corrections", "NXcollection")
    for name in ("name", "key", "unit", "reason"):
        log[name] = _text([getattr(c, name) for c in result.corrections])
    for name in ("size", "rms"):
        log[name] = np.array([getattr(c, name) for c in result.corrections], dtype=np.float64)
    log["applied"] = np.array([c.applied for c in result.corrections], dtype=np.uint8)
    budget = _group(entry, "budget", "NXcollection")
    rows = result.budget.contributions
    for name in ("name", "unit", "kind"):
        budget[name] = _text([getattr(row.quantity, name) for row in rows])
    for name in ("value", "sigma", "freedom"):
        budget[name] = np.array([getattr(row.quantity, name) for row in rows], dtype=np.float64)
    results = _group(budget, "results", "NXcollection")
    for name, (value, sigma, unit) in result.budget.results.items():
        part = _group(results, name.replace(" ", "_"), "NXcollection")
        _array(part, "value", value, unit)
        _array(part, "sigma", sigma, unit)
        _array(part, "interval", (value - 2.0 * sigma, value + 2.0 * sigma), unit)
        part["share_of_variance"] = np.array([row.shares.get(name, 0.0) for row in rows])
    facts = _group(entry, "facts", "NXcollection")
    for name, (value, unit) in result.facts.items():
        _array(facts, name.replace(" ", "_").replace("/", "_"), value, unit)
    for name, texts in (("inputs", result.inputs), ("settings", result.settings)):
        part = _group(entry, name, "NXcollection")
        part["names"], part["values"] = _text(list(texts)), _text(list(texts.values()))
    entry["remarks"] = _text(list(result.remarks))


def _history(group: h5py.Group, name: str, history: History) -> None:
    _array(group, name, history.value, history.unit)
    _array(group, f"{name}_sigma", history.sigma, history.unit)


def _group(parent: h5py.Group, name: str, nx_class: str, **attributes: Any) -> h5py.Group:
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        group.attrs[key] = value
    return group


def _array(group: h5py.Group, name: str, values: Any, unit: str) -> None:
    group.create_dataset(name, data=np.asarray(values, dtype=np.float64)).attrs["units"] = unit


def _text(texts: list[str]) -> np.ndarray:
    encoded = [text.replace("\0", "\\0").encode() for text in texts]
    longest = max([1, *map(len, encoded)])
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", longest))


def summary(result: ReducedTest) -> Mapping[str, Any]:
    """The result as JSON types: quoted numbers with their intervals, facts, corrections, remarks."""
    return {
        "shot": result.name,
        "load": result.load,
        "balanced": None if result.reduction.balanced is None else list(result.reduction.balanced),
        "results": {
            name: {
                "value": value,
                "sigma": sigma,
                "interval": [value - 2 * sigma, value + 2 * sigma],
                "unit": unit,
            }
            for name, (value, sigma, unit) in result.budget.results.items()
        },
        "facts": {name: {"value": value, "unit": unit} for name, (value, unit) in result.facts.items()},
        "corrections": [vars(c) for c in result.corrections],
        "remarks": list(result.remarks),
        **_own(result),
    }


def _own(result: ReducedTest) -> dict[str, Any]:
    """What only one kind of test has."""
    if isinstance(result, WavesResult):
        names = ("incident", "reflected", "transmitted")
        spans = {name: list(getattr(result.windows, name)) for name in names}
        return {"windows": {**spans, "source": result.windows.source}}
    assert isinstance(result, FlyerResult)  # there is no third kind
    keys = ("name", "time", "sigma", "how")
    return {
        "events": [dict(zip(keys, event, strict=True)) for event in result.events],
        "valid": None if result.valid is None else list(result.valid),
        "validity": result.validity,
        "synchronisation": result.synchronisation,
    }
