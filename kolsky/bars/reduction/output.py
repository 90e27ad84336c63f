"""A reduction as files: HDF5 with units, CSV tables, and one CSV with metadata for a materials database."""

import csv
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dic.files import replacing, text_cell
from kolsky.bars.audit import table_of
from kolsky.bars.records import BarSignal, FlyerResult, History, ReducedTest, Reduction, WavesResult
from kolsky.base.arrays import FloatArray
from kolsky.base.hdf5 import Format, OpenGroup, data, group, put, put_text, writing

FORMAT = Format("kolsky-waves")
WAYS = {"one wave": "one_wave", "two waves": "two_waves", "three waves": "three_waves"}
"""Group names of the ways of analysis."""


def write_hdf5(path: Path, result: ReducedTest) -> None:
    """Write everything to one HDF5 file, atomically.

    Raises OSError if the file cannot be written. An older file is then unchanged.
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


def tables(result: ReducedTest) -> dict[str, Mapping[str, Any]]:
    """Histories, audit log of the corrections, and budget as named columns, SI."""
    r = result.reduction
    columns: dict[str, Any] = {"time (s)": r.time}
    for way, name, history in _histories(r):
        words = f"{name}, {way}" if way else name.replace("_", " ")
        columns[f"{words} ({history.unit})"] = history.value
        columns[f"sigma of {words} ({history.unit})"] = history.sigma
    columns["imbalance R (1)"] = r.imbalance
    columns.update(result.extra)
    budget = result.budget
    return {
        "waves": {key: np.asarray(value).tolist() for key, value in columns.items()},
        "waves_corrections": table_of(result.corrections),
        "waves_budget": {
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
    }


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
    _validity(entry, result)
    waves = result.faces
    faces = data(entry, "faces", "incident", "time")
    put(faces, "time", waves.time, "s")
    for name in ("incident", "reflected", "transmitted"):
        put(faces, name, getattr(waves, name), "1", sigma=waves.sigma[name])


def _validity(entry: OpenGroup, result: WavesResult | FlyerResult) -> OpenGroup:
    window = group(entry, "validity")
    _text(window, "sentence", result.validity)
    if result.valid is not None:
        put(window, "window", result.valid, "s")
    return window


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
    window = _validity(entry, result)
    for name, values in result.inertia.items():
        put(window, name, values, "s" if name == "time" else "1")
    if result.synchronisation is not None:
        _text(entry, "synchronisation", result.synchronisation)


def _reduction(entry: OpenGroup, result: ReducedTest) -> None:
    r = result.reduction
    whole = group(entry, "reduction", default="three_waves")
    put(whole, "time", r.time, "s")
    for way, name, history in _histories(r):
        if way and WAYS[way] not in whole:
            data(whole, WAYS[way], "stress", "time")["time"] = whole["time"]
        part = whole[WAYS[way]] if way else whole
        put(part, name, history.value, history.unit)
        put(part, f"{name}_sigma", history.sigma, history.unit)
    put(whole, "imbalance", r.imbalance, "1")
    if r.balanced is not None:
        put(whole, "balanced", r.balanced, "s")
    for name, values in result.extra.items():
        words, _, unit = name.rpartition(" (")
        put(whole, words.replace(" ", "_"), values, unit.removesuffix(")"))


def _histories(r: Reduction) -> Iterator[tuple[str, str, History]]:
    """Method of analysis ("" for histories common to all), name and values of every history."""
    for way in WAYS:
        if way in r.strain:
            yield from ((way, name, getattr(r, name)[way]) for name in ("strain", "rate", "stress"))
    shared = ("front_force", "back_force", "front_velocity", "back_velocity")
    yield from (("", name, getattr(r, name)) for name in shared)


def _tables(entry: OpenGroup, result: ReducedTest) -> None:
    """Corrections, budget, facts, inputs, settings, remarks. The unit of each row is in a separate column."""
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
        **_test_summary(result),
    }


def _test_summary(result: ReducedTest) -> dict[str, Any]:
    """Entries that only one kind of test has."""
    valid = {"valid": None if result.valid is None else list(result.valid), "validity": result.validity}
    if isinstance(result, WavesResult):
        names = ("incident", "reflected", "transmitted")
        spans = {name: list(getattr(result.windows, name)) for name in names}
        return {"windows": {**spans, "source": result.windows.source}, "analysis": result.analysis, **valid}
    assert isinstance(result, FlyerResult)  # there are only these two kinds
    keys = ("name", "time", "sigma", "how")
    events = [dict(zip(keys, event, strict=True)) for event in result.events]
    return {"events": events, **valid, "synchronisation": result.synchronisation}


_MEGA = 1e-6
"""Factor from Pa to MPa."""
DATABASE_FORMAT = "kolsky bar test, version 1"
"""First line of the metadata."""


def write_database(path: Path, result: WavesResult) -> Path:
    """Write metadata as lines "# key: value", then the table of the reported analysis; returns the path."""
    with replacing(Path(path)) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        for key, value in metadata(result).items():
            file.write(f"# {_one_line(key)}: {_one_line(value)}\n")
        rows = csv.writer(file, lineterminator="\n")
        table = columns(result)
        rows.writerow(table)
        rows.writerows([f"{value:.9g}" for value in row] for row in zip(*table.values(), strict=True))
    return path


def columns(result: WavesResult) -> dict[str, FloatArray]:
    """Columns of the table by name, shape [n] each.

    `load_case` determines whether compression or tension is positive.
    """
    r, way, extra = result.reduction, result.analysis, result.extra
    strain, rate, stress = r.strain[way], r.rate[way], r.stress[way]
    table = {
        "time_s": r.time,
        "engineering_strain": strain.value,
        "u_engineering_strain": strain.sigma,
        "engineering_strain_rate_per_s": rate.value,
        "u_engineering_strain_rate_per_s": rate.sigma,
        "engineering_stress_MPa": _MEGA * stress.value,
        "u_engineering_stress_MPa": _MEGA * stress.sigma,
    }
    if "true strain (1)" in extra:
        table |= {
            "true_strain": extra["true strain (1)"],
            "u_true_strain": extra["sigma of true strain (1)"],
            "true_stress_MPa": _MEGA * extra["true stress (Pa)"],
            "u_true_stress_MPa": _MEGA * extra["sigma of true stress (Pa)"],
        }
    return table | {"force_equilibrium": _inside(r.time, r.balanced), "valid": _inside(r.time, result.valid)}


def metadata(result: WavesResult) -> dict[str, str]:
    """Key -> value of the lines above the table."""
    first, second = result.incident.bar, result.transmission.bar
    span = result.reduction.balanced
    said: dict[str, str] = {
        "format": DATABASE_FORMAT,
        "test_name": result.name,
        "test_type": "split Hopkinson (Kolsky) bar",
        "load_case": f"{result.load}, counted positive",
        "specimen_shape": "circular cylinder",
        "specimen_diameter_mm": f"{1e3 * result.specimen.diameter:.6g}",
        "specimen_length_mm": f"{1e3 * result.specimen.length:.6g}",
        "specimen_density_kg_per_m3": f"{result.specimen.density:.6g}",
    }
    for name, bar in (("incident_bar", first), ("transmission_bar", second)):
        said |= {
            f"{name}_diameter_mm": f"{1e3 * bar.diameter:.6g}",
            f"{name}_youngs_modulus_GPa": f"{1e-9 * bar.youngs_modulus:.6g}",
            f"{name}_density_kg_per_m3": f"{bar.density:.6g}",
            f"{name}_wave_speed_m_per_s": f"{bar.wave_speed:.6g}",
        }
    said |= {
        "analysis": result.analysis,
        "true_quantities": "by constancy of volume; barrelling and necking are not seen",
        "uncertainty": "u_: combined standard uncertainty, k = 1",
        "corrections_applied": _names(result, True),
        "corrections_left_out": _names(result, False),
        "force_equilibrium_s": "none" if span is None else f"{span[0]:.6g} to {span[1]:.6g}",
        "validity": result.validity,
    }
    for name, (value, sigma, unit) in result.budget.results.items():
        said[f"{name.replace(' ', '_')}_{_UNITS.get(unit, unit)}".rstrip("_")] = _measured(value, sigma, unit)
    said |= {f"input_sha256 {name}": digest for name, digest in result.inputs.items()}
    for package in ("kolsky", "numpy", "scipy"):
        if package in result.settings:
            said[f"software {package}"] = result.settings[package]
    for number, remark in enumerate(result.remarks, start=1):
        said[f"remark_{number}"] = remark
    return said


_UNITS: Mapping[str, str] = {"Pa": "MPa", "1/s": "per_s", "1": ""}


def _measured(value: float, sigma: float, unit: str) -> str:
    factor = _MEGA if unit == "Pa" else 1.0
    return f"{factor * value:.6g} (u = {factor * sigma:.2g})"


def _names(result: WavesResult, applied: bool) -> str:
    return ", ".join(dict.fromkeys(c.key for c in result.corrections if c.applied is applied)) or "none"


def _inside(time: FloatArray, span: tuple[float, float] | None) -> FloatArray:
    """1 inside a span, 0 outside."""
    if span is None:
        return np.zeros(time.size)
    return ((time >= span[0]) & (time <= span[1])).astype(float)


def _one_line(text: str) -> str:
    """A text as one line that a spreadsheet does not read as a formula."""
    return text_cell(" ".join(text.split()))
