"""`plan`: expected uncertainties of a test like this shot, without its data.

Choices of the laboratory are compared.

Window, frames, heights and rate are compared by the determinant of the expected covariance.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from dic.views import ResultViews
from doe.information import (
    Placement,
    SingularInformationError,
    UndecidedError,
    best_groups,
    best_window,
    costs,
)
from kolsky.base.arrays import FloatArray
from kolsky.base.files import jsonable
from kolsky.inverse.parameters import PARAMETERS, any_slides
from kolsky.inverse.problem import PreparedShot, prepare_shot, provenance
from kolsky.inverse.settings import Numerics
from kolsky.results.numbers import measured, plain_sentence
from kolsky.shot.records import Shot
from kolsky.studies.local_sensitivity import REACH
from kolsky.studies.planning.information import (
    Expected,
    Information,
    Instruments,
    discrepancies,
    information,
    instruments_of,
)

SHARES = (0.25, 0.5, 0.75)
"""Recording lengths of the cameras to be compared, divided by the window."""


@dataclass(frozen=True)
class Choice:
    """The D-optimal choice (smallest volume of the joint interval), and its expected uncertainties."""

    places: FloatArray
    """Heights [m], or first and last time [s]."""
    deviations: FloatArray
    """Standard deviations with all parameters estimated together, shape [d]."""


@dataclass(frozen=True)
class Rate:
    """The same test at another speed of the flyer."""

    factor: float
    """Speed divided by that of the shot [-]."""
    peak_force: float
    """Largest mean force of a bin [N]."""
    mean_rate: float
    """Mean nominal strain rate over the window [1/s]."""
    discrepancy: tuple[float, float]
    """Assumed discrepancy of the model [N], [m]."""
    expected: Expected
    cost: float
    """-ln det H, with parameters in units of their scale [-]."""


def window_ends(found: Information, shares: FloatArray) -> tuple[FloatArray, list[Expected]]:
    """Expected deviations from the data up to a time, for shares of the window in (0, 1]."""
    edges = found.sensitivity.grid.edges
    times = edges[0] + shares * (edges[-1] - edges[0])
    return times, [Expected.of(found.data.select(found.time <= t)) for t in times]


def camera_windows(found: Information, share: float) -> Choice | None:
    """Best recording time of the cameras if their memory covers only a share of the window. The force is
    recorded throughout. None without cameras, or if no choice constrains all parameters."""
    frames = found.sensitivity.grid.frames
    choice = _chosen(found, found.by_frame(), max(1, round(share * len(frames))), best_window, frames)
    return None if choice is None else replace(choice, places=choice.places[[0, -1]])


def camera_heights(found: Information, count: int) -> Choice | None:
    """The heights at which an outline, together with the force, gives the most information.

    None without cameras, or if no choice constrains all parameters.
    """
    heights = found.sensitivity.grid.heights
    if not 1 <= count <= len(heights):
        raise ValueError(f"of the {len(heights)} heights of the map 1 or more can be chosen, got {count}")
    return _chosen(found, found.by_height(), count, best_groups, heights)


def best_rate(rates: Sequence[Rate]) -> Rate:
    """The D-optimal rate."""
    return min(rates, key=lambda rate: rate.cost)


def _chosen(
    found: Information, groups: FloatArray, count: int, choose: Callable[..., Placement], places: FloatArray
) -> Choice | None:
    try:
        chosen = choose(groups, count, base=found.of_force) if groups.any() else None
    except UndecidedError:
        return None  # unconstrained parameters are reported with the expected deviations
    if chosen is None:
        return None
    deviations = found.data.scale * np.sqrt(np.diag(np.linalg.inv(chosen.information)))
    return Choice(places[list(chosen.chosen)], deviations)


NAMES = ("stiffness_factor", "poisson", "damping")
"""Default parameters."""
RATES = (0.5, 1.0, 2.0)
"""Speeds of the flyer to be compared, divided by that of the shot."""
ENDS = np.linspace(0.1, 1.0, 19)
"""Ends of the window to be compared, as shares of it."""


@dataclass(frozen=True)
class Plan(ResultViews):
    """Expected uncertainties of a planned test, and the times and heights with the largest contributions."""

    shot: str
    instruments: Instruments
    discrepancy: tuple[float, float]
    """Assumed discrepancy of the model in a force bin [N] and an outline point [m]."""
    information: Information
    """Slopes and information at the rate of the shot."""
    expected: dict[str, Expected]
    """Expected uncertainties by "all", "force" and "outline". Without cameras, "outline" is missing."""
    force_scale: FloatArray
    """Shift of each estimate by one standard uncertainty of the force's scale, in its unit, shape [d]. The
    deviations above do not include it. It is 0 if the shot declares no such uncertainty, and infinite if some
    direction is unconstrained."""
    end_times: FloatArray
    """Ends of the window [s], shape [n]."""
    by_end: tuple[Expected, ...]
    """Expected uncertainties from the data up to each end, length n."""
    windows: dict[float, Choice]
    """Best recording times of the cameras, by the share of the window in their memory."""
    heights: dict[int, Choice]
    """Best heights of the outline, by the number of heights."""
    rates: tuple[Rate, ...]
    """The test at other speeds of the flyer."""
    provenance: dict[str, Any]

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters."""
        return self.information.sensitivity.names

    def interval(self, name: str) -> tuple[float, float]:
        """The expected k = 2 interval of a parameter if its assumed value is true."""
        j = self.names.index(name)
        value = float(self.information.sensitivity.point[j])
        half = 2.0 * float(self.expected["all"].deviations[j])
        return value - half, value + half


def plan(
    shot: Shot,
    *,
    names: Sequence[str] = NAMES,
    held: Mapping[str, float] | None = None,
    instruments: Callable[[PreparedShot], Instruments] = instruments_of,
    rates: Sequence[float] = RATES,
    heights: Sequence[int] = (1, 2, 3),
    reach: float = REACH,
    discrepancy: tuple[float, float] | None = None,
    numerics: Numerics | None = None,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> Plan:
    """Predict the accuracy with which a test would determine parameters.

    Parameters
    ----------
    shot
        A loaded shot. Specimen, interface, flyer's motion and curve are those of the planned test.
    names
        Parameters to be estimated together.
    held
        Values of parameters (also those in `names`) that differ from the shot's.
    instruments
        The instruments; default: those of the shot.
    rates
        Speeds of the flyer divided by that of the shot; 1 is always included.
    heights
        Numbers of heights to choose.
    reach
        Range for the slopes (`kolsky.studies.local_sensitivity`).
    discrepancy
        Standard deviations of the model error in a force bin [N] and an outline point [m]. Default: its
        change to a finer mesh, at each rate.
    numerics
        Mesh, precision, device.
    progress
        Called with stage, rates done, number of rates.

    Raises
    ------
    ValueError
        If a value is outside its range, or if a run does not complete.
    """
    numerics, held = numerics or Numerics(), dict(held or {})
    prepared = prepare_shot(shot)
    tools = instruments(prepared)
    factors = sorted({1.0, *rates})
    for factor in factors:
        if not 0.0 < factor < np.inf:
            raise ValueError(f"a rate must be finite and > 0, got {factor}")
    path, (start, end) = prepared.path, tools.window
    judged, own = [], None
    for done, factor in enumerate(factors):
        progress("rates", done, len(factors))
        left_out = discrepancy or discrepancies(prepared.forward, tools, held, rate=factor, numerics=numerics)
        found = information(
            prepared.forward, tools, names, held=held, rate=factor, reach=reach, numerics=numerics,
            discrepancy=left_out,
        )  # fmt: skip
        travel, edges = float(path.position(end) - path.position(start)), found.sensitivity.grid.edges
        judged.append(
            Rate(
                factor=factor,
                peak_force=float(found.sensitivity.force.max()),
                mean_rate=travel / shot.specimen.length / float(edges[-1] - edges[0]),
                discrepancy=left_out,
                expected=Expected.of(found.data),
                cost=float(costs(found.data.information)),
            )
        )
        if factor == 1.0:
            own = found, left_out
    progress("rates", len(factors), len(factors))
    assert own is not None  # 1 is among the factors
    found, left_out = own
    parts = {"all": found.data, "force": found.data.select(found.is_force)}
    if found.seen.any():
        parts["outline"] = found.data.select(~found.is_force)
    times, by_end = window_ends(found, ENDS)
    settings = {
        "free": list(names),
        "held": held,
        "reach": reach,
        "rates": factors,
        "discrepancy": list(left_out),
        "numerics": numerics,
    }
    sliding = any_slides([*names, *held])
    return Plan(
        shot=shot.name,
        instruments=tools,
        discrepancy=left_out,
        information=found,
        expected={name: Expected.of(data) for name, data in parts.items()},
        force_scale=_scale_shift(found, prepared.observations.force_sigma_gain),
        end_times=times,
        by_end=tuple(by_end),
        windows={share: best for share in SHARES if (best := camera_windows(found, share))},
        heights={count: best for count in heights if (best := camera_heights(found, count))},
        rates=tuple(judged),
        provenance=provenance(shot, settings, prepared, sliding=sliding),
    )


def _scale_shift(found: Information, sigma_gain: float) -> FloatArray:
    """Shift of the estimates by a wrong force scale. No number of samples averages it out."""
    if sigma_gain == 0.0:
        return np.zeros(len(found.data.names))
    try:
        gain = found.data.gain[:, : found.n_force]
    except SingularInformationError:
        return np.full(len(found.data.names), np.inf)
    return np.abs(gain @ (sigma_gain * found.sensitivity.force))


def correlations(expected: Expected, names: Sequence[str]) -> dict[str, float | None]:
    """Correlations of the estimates by pair, e.g. "stiffness_factor, damping"."""
    R = expected.correlation
    return {
        f"{names[i]}, {names[j]}": None if R is None else float(R[i, j])
        for i, j in combinations(range(len(names)), 2)
    }


def to_json(plan: Plan) -> dict[str, Any]:
    """The plan as one object of JSON types, SI. Numbers that are not finite become null."""
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
            {"share_of_window": share, **_choice(choice, names)} for share, choice in plan.windows.items()
        ],
        "camera_heights": [_choice(choice, names) for choice in plan.heights.values()],
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
        "best_rate": best_rate(plan.rates).factor,
        "provenance": plan.provenance,
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def _choice(choice: Choice, names: tuple[str, ...]) -> dict[str, Any]:
    return {"places": choice.places, "sigma": dict(zip(names, choice.deviations, strict=True))}


def tables(plan: Plan) -> dict[str, dict[str, Any]]:
    """Force, outline, rates and ends of the window as named columns, SI, units in the names."""
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
    of_ends: dict[str, Any] = {"end of the window (s)": plan.end_times}
    for j, name in enumerate(names):
        of_ends[f"sigma {name} ({units[j]})"] = [float(e.deviations[j]) for e in plan.by_end]
    return {"plan_force": of_force, "plan_outline": of_outline, "plan_rates": of_rates, "plan_ends": of_ends}


def rows(plan: Plan) -> Mapping[str, Any]:
    """Lines for a terminal with a name and a value each. Parameters are in the units of the reports."""
    names, slopes, whole = plan.names, plan.information.sensitivity, plan.expected["all"]
    shown: dict[str, Any] = {"shot": plan.shot}
    for j, name in enumerate(names):
        p = PARAMETERS[name]
        unit, double = _unit(name), 2.0 * p.shown_factor
        value, U = map(
            plain_sentence, measured(p.shown_factor * slopes.point[j], double * whole.deviations[j])
        )
        shown[p.symbol] = (
            f"{value} ± {U}{unit} (k = 2, expected); {double * whole.alone[j]:.2g} if the others were known"
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
    for share, choice in plan.windows.items():
        begin, end = 1e3 * choice.places
        shown[f"{100 * share:g} % of frames, D-optimal"] = (
            f"{begin:.2f} to {end:.2f} ms: {_sigmas(choice.deviations, names)}"
        )
    for count, choice in plan.heights.items():
        places = ", ".join(f"{1e3 * y:.2f}" for y in choice.places)
        shown[f"{count} height{'s' if count > 1 else ''}, D-optimal"] = (
            f"{places} mm: {_sigmas(choice.deviations, names)}"
        )
    for rate in plan.rates:
        first_pair = next(iter(correlations(rate.expected, names).values()), None)
        shown[f"speed x {rate.factor:g}"] = (
            f"{rate.mean_rate:.0f}/s: "
            + _sigmas(rate.expected.deviations, names)
            + ("" if first_pair is None else f"; first correlation {first_pair:.2f}")
        )
    best = [f"D-optimal x {best_rate(plan.rates).factor:g}"]
    for j, name in enumerate(names):
        sigmas = [float(rate.expected.deviations[j]) for rate in plan.rates]
        rate = plan.rates[sigmas.index(min(sigmas))]
        best.append(f"for {PARAMETERS[name].symbol} x {rate.factor:g}")
    shown["best speed"] = ", ".join(best)
    return shown


def _unit(name: str) -> str:
    """Display unit of a parameter, after a space and in ASCII. It is empty for a plain number."""
    unit = PARAMETERS[name].shown_unit
    return "" if unit == "1" else f" {unit.replace('µ', 'u')}"


def _sigmas(deviations: FloatArray, names: tuple[str, ...]) -> str:
    """Expanded uncertainties of all parameters, e.g. "m ± 0.0041, beta ± 0.69 us"."""
    return ", ".join(
        f"{PARAMETERS[name].symbol} ± {2.0 * PARAMETERS[name].shown_factor * sigma:.2g}{_unit(name)}"
        for name, sigma in zip(names, deviations, strict=True)
    )
