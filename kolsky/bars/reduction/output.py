"""A reduction to its files: one HDF5 file with units on every array, CSV tables of the curves and the log."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.bars.audit import table_of
from kolsky.bars.records import BarSignal, History
from kolsky.bars.result import FlyerResult, ReducedTest, WavesResult
from kolsky.base.files import write_table
from kolsky.base.hdf5 import Format, OpenGroup, data, group, put, put_text, writing

FORMAT = Format("kolsky-waves")
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
    """Write everything to one HDF5 file, atomically.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    with writing(path, FORMAT) as place:
        entry = group(place.file, place.path, "NXentry", default="reduction")
        _text(entry, "shot", result.name)
        _text(entry, "load", result.load)
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
    write_table(folder / "waves_corrections.csv", table_of(result.corrections))
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
            **{
                f"sensitivity, {name} ({unit} per unit of the input)": [
                    row.sensitivity.get(name, "") for row in budget.contributions
                ]
                for name, (_, _, unit) in budget.results.items()
            },
        },
    )


def _waves(entry: OpenGroup, result: WavesResult) -> None:
    """Gauges, windows and the waves at the faces."""
    gauges = group(entry, "gauges")
    for station in (result.incident, result.transmission):
        _station(gauges, station)
    windows = group(entry, "windows")
    _text(windows, "source", result.windows.source)
    for name in ("incident", "reflected", "transmitted"):
        put(windows, name, getattr(result.windows, name), "s")
    _text(entry, "analysis", result.analysis)
    window = group(entry, "validity")
    _text(window, "sentence", result.validity)
    if result.valid is not None:
        put(window, "window", result.valid, "s")
    waves = result.faces
    faces = data(entry, "faces", "incident", "time")
    put(faces, "time", waves.time, "s")
    for name in ("incident", "reflected", "transmitted"):
        put(faces, name, getattr(waves, name), "1", sigma=waves.sigma[name])


def _station(parent: OpenGroup, station: BarSignal) -> None:
    signal = station.strain
    part = data(parent, station.side, "strain", "time")
    put(part, "time", signal.time, "s")
    put(part, "strain", signal.value, "1", sigma=signal.sigma)
    if station.bending is not None:
        put(part, "bending", station.bending, "1")
    put(part, "position", station.position, "m")


def _flyer(entry: OpenGroup, result: FlyerResult) -> None:
    """Transducers, events, validity."""
    forces = group(entry, "transducers")
    for signal in result.signals:
        part = data(forces, signal.name.replace(" ", "_"), "force", "time")
        put(part, "time", signal.time, "s")
        put(part, "force", signal.value, "N", sigma=signal.sigma)
    events = group(entry, "events")
    for name, at, sigma, how in result.events:
        part = group(events, name.replace(" ", "_"))
        _text(part, "how", how)
        if at is not None and sigma is not None:
            put(part, "time", at, "s")
            put(part, "sigma", sigma, "s")
    window = group(entry, "validity")
    _text(window, "sentence", result.validity)
    if result.valid is not None:
        put(window, "window", result.valid, "s")
    for name, values in result.inertia.items():
        put(window, name, values, "s" if name == "time" else "1")
    if result.synchronisation is not None:
        _text(entry, "synchronisation", result.synchronisation)


def _reduction(entry: OpenGroup, result: ReducedTest) -> None:
    r = result.reduction
    whole = group(entry, "reduction", default="three_waves")
    put(whole, "time", r.time, "s")
    for way, name in WAYS.items():
        if way not in r.strain:
            continue
        part = data(whole, name, "stress", "time")
        part["time"] = whole["time"]
        for quantity, kind in (("strain", r.strain), ("rate", r.rate), ("stress", r.stress)):
            _history(part, quantity, kind[way])
    for name in HISTORIES:
        _history(whole, name, getattr(r, name))
    put(whole, "imbalance", r.imbalance, "1")
    if r.balanced is not None:
        put(whole, "balanced", r.balanced, "s")
    for name, values in result.extra.items():
        words, _, unit = name.rpartition(" (")
        put(whole, words.replace(" ", "_"), values, unit.removesuffix(")"))


def _history(part: OpenGroup, name: str, history: History) -> None:
    put(part, name, history.value, history.unit)
    put(part, f"{name}_sigma", history.sigma, history.unit)


def _tables(entry: OpenGroup, result: ReducedTest) -> None:
    """Corrections, budget, facts, inputs, settings, remarks; a unit of each row is a column of its own."""
    log, rows = group(entry, "corrections"), result.corrections
    for name in ("name", "key", "unit", "reason"):
        _text(log, name, [getattr(c, name) for c in rows])
    for name in ("size", "rms"):
        put(log, name, [getattr(c, name) for c in rows], None)
    put(log, "applied", [c.applied for c in rows], None, kind="u")
    budget, inputs = group(entry, "budget"), result.budget.contributions
    for name in ("name", "unit", "kind"):
        _text(budget, name, [getattr(row.quantity, name) for row in inputs])
    for name in ("value", "sigma", "freedom"):
        put(budget, name, [getattr(row.quantity, name) for row in inputs], None)
    results = group(budget, "results")
    for name, (value, sigma, unit) in result.budget.results.items():
        part = group(results, name.replace(" ", "_"))
        put(part, "value", value, unit)
        put(part, "sigma", sigma, unit)
        put(part, "interval", (value - 2.0 * sigma, value + 2.0 * sigma), unit)
        put(part, "share_of_variance", [row.shares.get(name, 0.0) for row in inputs], None)
        varied = [row for row in inputs if name in row.sensitivity]
        _text(part, "sensitivity_inputs", [row.quantity.name for row in varied])
        put(part, "sensitivity", [row.sensitivity[name] for row in varied], None)
    facts = group(entry, "facts")
    for name, (value, unit) in result.facts.items():
        put(facts, name.replace(" ", "_").replace("/", "_"), value, unit)
    for name, texts in (("inputs", result.inputs), ("settings", result.settings)):
        part = group(entry, name)
        _text(part, "names", texts)
        _text(part, "values", texts.values())
    _text(entry, "remarks", result.remarks)


def _text(parent: OpenGroup, name: str, value: str | Iterable[str]) -> None:
    put_text(parent, name, value, escape=True)


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
        "sensitivity": {
            row.quantity.name: dict(row.sensitivity) for row in result.budget.contributions if row.sensitivity
        },
        "facts": {name: {"value": value, "unit": unit} for name, (value, unit) in result.facts.items()},
        "corrections": [vars(c) for c in result.corrections],
        "remarks": list(result.remarks),
        **_own(result),
    }


def _own(result: ReducedTest) -> dict[str, Any]:
    """Entries that only one kind of test has."""
    if isinstance(result, WavesResult):
        names = ("incident", "reflected", "transmitted")
        spans = {name: list(getattr(result.windows, name)) for name in names}
        return {
            "windows": {**spans, "source": result.windows.source},
            "analysis": result.analysis,
            "valid": None if result.valid is None else list(result.valid),
            "validity": result.validity,
        }
    assert isinstance(result, FlyerResult)  # there is no third kind
    keys = ("name", "time", "sigma", "how")
    return {
        "events": [dict(zip(keys, event, strict=True)) for event in result.events],
        "valid": None if result.valid is None else list(result.valid),
        "validity": result.validity,
        "synchronisation": result.synchronisation,
    }
