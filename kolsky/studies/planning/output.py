"""A plan as one JSON object, as CSV tables and as an HDF5 file."""

import json
from collections.abc import Mapping
from math import floor, isfinite, log10
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.files import jsonable
from kolsky.base.hdf5 import creating, put
from kolsky.inverse.parameters import PARAMETERS
from kolsky.studies.planning.plan import CRITERIA, Choice, Plan, best_rate, correlations

VERSION = 1
"""Of the HDF5 file's layout."""


def to_json(plan: Plan) -> dict[str, Any]:
    """The plan as one object of JSON types, SI; numbers that are not finite become null."""
    names = plan.names
    slopes = plan.information.sensitivity
    parameters = {
        name: {
            "value": slopes.point[j],
            "unit": PARAMETERS[name].unit,
            "sigma": plan.expected["all"].deviations[j],
            "interval": plan.interval(name),
            "sigma_others_known": plan.expected["all"].alone[j],
            "shift_by_force_scale": plan.force_scale[j],
            **{f"sigma_{part}": e.deviations[j] for part, e in plan.expected.items() if part != "all"},
        }
        for j, name in enumerate(names)
    }
    whole = {
        "shot": plan.shot,
        "parameters": parameters,
        "correlations": correlations(plan.expected["all"], names),
        "unseen": {part: e.unseen for part, e in plan.expected.items() if e.unseen},
        "instruments": vars(plan.instruments),
        "discrepancy": {"force_N": plan.discrepancy[0], "outline_m": plan.discrepancy[1]},
        "camera_windows": [
            {"share_of_window": share, **_choice(choice, names)}
            for share, choices in plan.windows.items()
            for choice in choices
        ],
        "camera_heights": [_choice(c, names) for choices in plan.heights.values() for c in choices],
        "rates": [
            {
                "speed_factor": rate.factor,
                "mean_strain_rate": rate.mean_rate,
                "peak_force": rate.peak_force,
                "discrepancy": {"force_N": rate.discrepancy[0], "outline_m": rate.discrepancy[1]},
                "sigma": dict(zip(names, rate.expected.deviations, strict=True)),
                "sigma_others_known": dict(zip(names, rate.expected.alone, strict=True)),
                "correlations": correlations(rate.expected, names),
            }
            for rate in plan.rates
        ],
        "best_rate": {c: best_rate(plan.rates, c).factor for c in CRITERIA},
        "provenance": plan.provenance,
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def _choice(choice: Choice, names: tuple[str, ...]) -> dict[str, Any]:
    return {
        "criterion": choice.criterion,
        "places": choice.places,
        "sigma": dict(zip(names, choice.deviations, strict=True)),
    }


def tables(plan: Plan) -> dict[str, dict[str, Any]]:
    """Force, outline and rates as named columns, SI, units in the names."""
    found, slopes = plan.information, plan.information.sensitivity
    grid, names = slopes.grid, plan.names
    units = [PARAMETERS[name].unit for name in names]
    force, outline = found.densities()
    time, height = np.meshgrid(grid.frames, grid.heights, indexing="ij")
    of_force: dict[str, Any] = {"time (s)": grid.times, "force (N)": slopes.force}
    of_outline: dict[str, Any] = {
        "time (s)": time.ravel(),
        "y (m)": height.ravel(),
        "Z (m)": slopes.radius.ravel(),
    }
    for j, name in enumerate(names):
        per = "" if units[j] == "1" else f"/({units[j]})"
        of_force[f"dF/d {name} (N{per})"] = slopes.force_slope[j]
        of_force[f"share of information on {name} (1/s)"] = force[j]
        of_outline[f"dZ/d {name} (m{per})"] = slopes.radius_slope[j].ravel()
        of_outline[f"share of information on {name} (1/(m s))"] = outline[j].ravel()
    of_rates: dict[str, Any] = {
        "speed over the shot's (1)": [rate.factor for rate in plan.rates],
        "mean strain rate (1/s)": [rate.mean_rate for rate in plan.rates],
        "peak force (N)": [rate.peak_force for rate in plan.rates],
    }
    for j, name in enumerate(names):
        of_rates[f"sigma {name} ({units[j]})"] = [float(rate.expected.deviations[j]) for rate in plan.rates]
        alone = [float(rate.expected.alone[j]) for rate in plan.rates]
        of_rates[f"sigma {name}, others known ({units[j]})"] = alone
    return {"plan_force": of_force, "plan_outline": of_outline, "plan_rates": of_rates}


def write_hdf5(path: Path, plan: Plan) -> Path:
    """Write everything of a plan to one HDF5 file, atomically; arrays carry their `units`."""
    found, slopes = plan.information, plan.information.sensitivity
    grid = slopes.grid
    force, outline = found.densities()
    force_alone, outline_alone = found.densities(alone=True)
    units = [PARAMETERS[name].unit for name in plan.names]
    said = json.dumps(to_json(plan), allow_nan=False)
    with creating(path, format="kolsky plan", version=VERSION, shot=plan.shot, summary=said) as file:
        put(file, "force_edges", grid.edges, "s")
        put(file, "frames", grid.frames, "s")
        put(file, "heights", grid.heights, "m")
        put(file, "force", slopes.force, "N")
        put(file, "radius", slopes.radius, "m")
        put(file, "end_times", plan.end_times, "s")
        for j, name in enumerate(plan.names):
            part, per = file.create_group(name), "" if units[j] == "1" else f"/({units[j]})"
            part.attrs["value"] = slopes.point[j]
            part.attrs["scale"] = slopes.scale[j]
            part.attrs["units"] = units[j]
            put(part, "force_slope", slopes.force_slope[j], f"N{per}")
            put(part, "radius_slope", slopes.radius_slope[j], f"m{per}")
            put(part, "force_left", slopes.force_left[j], "N")
            put(part, "radius_left", slopes.radius_left[j], "m")
            put(part, "force_information", force[j], "1/s")
            put(part, "outline_information", outline[j], "1/(m s)")
            put(part, "force_information_others_known", force_alone[j], "1/s")
            put(part, "outline_information_others_known", outline_alone[j], "1/(m s)")
            put(part, "sigma_by_end", [e.deviations[j] for e in plan.by_end], units[j])
    return path


def rows(plan: Plan) -> Mapping[str, Any]:
    """Lines for a terminal: a name and a value each, parameters in the units in which reports show them."""
    names, slopes, whole = plan.names, plan.information.sensitivity, plan.expected["all"]
    shown: dict[str, Any] = {"shot": plan.shot}
    for j, name in enumerate(names):
        p = PARAMETERS[name]
        unit, double = _unit(name), 2.0 * p.shown_factor
        value = _measured(p.shown_factor * slopes.point[j], double * whole.deviations[j])
        shown[p.symbol] = (
            f"{value}{unit} (k = 2, expected); {double * whole.alone[j]:.2g} if the others were known"
        )
        parts = [
            f"{part} {double * e.deviations[j]:.2g}" for part, e in plan.expected.items() if part != "all"
        ]
        shown[f"{p.symbol}, from one kind of data"] = ", ".join(parts)
        if plan.force_scale[j] > 0.0:
            shown[f"{p.symbol}, apart"] = f"± {double * plan.force_scale[j]:.2g}{unit} by the force's scale"
    for pair, r in correlations(whole, names).items():
        symbols = "-".join(PARAMETERS[name].symbol for name in pair.split(", "))
        shown[f"correlation {symbols}"] = "not known" if r is None else f"{r:.2f}"
    for share, choices in plan.windows.items():
        for choice in choices:
            begin, end = 1e3 * choice.places
            shown[f"{100 * share:g} % of frames, {choice.criterion}-optimal"] = (
                f"{begin:.2f} to {end:.2f} ms: {_sigmas(choice.deviations, names)}"
            )
    for count, choices in plan.heights.items():
        for choice in choices:
            places = ", ".join(f"{1e3 * y:.2f}" for y in choice.places)
            shown[f"{count} height{'s' if count > 1 else ''}, {choice.criterion}-optimal"] = (
                f"{places} mm: {_sigmas(choice.deviations, names)}"
            )
    for rate in plan.rates:
        first_pair = next(iter(correlations(rate.expected, names).values()), None)
        shown[f"speed x {rate.factor:g}"] = (
            f"{rate.mean_rate:.0f}/s: "
            + _sigmas(rate.expected.deviations, names)
            + ("" if first_pair is None else f"; first correlation {first_pair:.2f}")
        )
    best = [f"{c}-optimal x {best_rate(plan.rates, c).factor:g}" for c in CRITERIA]
    for j, name in enumerate(names):
        sigmas = [float(rate.expected.deviations[j]) for rate in plan.rates]
        rate = plan.rates[sigmas.index(min(sigmas))]
        best.append(f"for {PARAMETERS[name].symbol} x {rate.factor:g}")
    shown["best speed"] = ", ".join(best)
    return shown


def _unit(name: str) -> str:
    """Unit in which a parameter is shown, after a space and in ASCII; nothing for a plain number."""
    unit = PARAMETERS[name].shown_unit
    return "" if unit == "1" else f" {unit.replace('µ', 'u')}"


def _measured(value: float, U: float) -> str:
    """A value and its expanded uncertainty, both to the second significant digit of the uncertainty."""
    if not (isfinite(U) and U > 0.0):
        return f"{value:.6g} ± {U:.2g}"
    digits = max(0, 1 - floor(log10(U)))
    return f"{value:.{digits}f} ± {U:.{digits}f}"


def _sigmas(deviations: FloatArray, names: tuple[str, ...]) -> str:
    """Expanded uncertainties of all parameters, e.g. "m ± 0.0041, beta ± 0.69 us"."""
    return ", ".join(
        f"{PARAMETERS[name].symbol} ± {2.0 * PARAMETERS[name].shown_factor * sigma:.2g}{_unit(name)}"
        for name, sigma in zip(names, deviations, strict=True)
    )
