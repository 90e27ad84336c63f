"""Figures of planned experiments: information, candidate designs, signals of a planned test."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from kolsky.prediction.design import EVERY, Aim, Scan
from kolsky.prediction.predict import Prediction
from kolsky.report.figures.base import (
    BAND,
    FORCE,
    GREY,
    MARKERS,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SERIES,
    SHAPE,
    UM,
    FigureKind,
    Panels,
    colour_bar,
    figure,
    label_point,
    largest,
    plain_log_ticks,
)
from kolsky.results.nomenclature import name_of
from kolsky.studies.local_sensitivity import ObservationGrid
from kolsky.studies.planning.plan import Plan


def draw_map(
    ax: Axes, grid: ObservationGrid, values: NDArray[np.float64], label: str, *, bottom: float | None = None
) -> None:
    """Draw values of shape [n_frames, n_heights]; missing values are NaN.

    ``values``: values in the unit of the label. ``bottom``: smallest value of a one-sided scale. Without it,
    the scale is symmetric about zero.
    """
    top = largest(values)
    colours, least = ("RdBu_r", -top) if bottom is None else ("cividis", bottom)
    style: dict[str, Any] = {"cmap": colours, "vmin": least, "vmax": top, "rasterized": True}
    cells = np.ma.masked_invalid(values.T)
    drawn = ax.pcolormesh(MS * grid.frames, MM * grid.heights, cells, shading="nearest", **style)
    ax.set(xlabel="Time (ms)", ylabel="Height $y$ (mm)", ylim=(0.0, MM * grid.heights[-1]))
    # Few ticks: more of them would get longer labels than the layout allowed for, if the axes shrink.
    colour_bar(drawn, ax, label, aspect=25, pad=0.02, ticks=MaxNLocator(4))


PER_MM_MS, PER_MS = 1e-6, 1e-3
"""From shares per m and s, and per s, to shares per mm and ms, and per ms."""


def _by_parameter(*parts: str) -> Callable[[Callable[[Plan, Panels], str]], FigureKind[Plan]]:
    """A column for each parameter with two parts, the map of the outline higher than the force."""
    return figure(
        PAGE,
        92.0,
        lambda plan: [[f"{name} {part}" for name in plan.names] for part in parts],
        height_ratios=[1.35 if part == "outline" else 1.0 for part in parts],
        letters=True,
    )


@_by_parameter("outline", "force")
def plan_information(plan: Plan, panels: Panels) -> str:
    information = plan.information
    grid = information.sensitivity.grid
    force, outline = information.densities()
    single, _ = information.densities(alone=True)
    for j, name in enumerate(plan.names):
        symbol = name_of(name).tex
        top, low = panels[f"{name} outline"], panels[f"{name} force"]
        label = f"Share on ${symbol}$ (1/(mm ms))"
        draw_map(top, grid, PER_MM_MS * outline[j], label, bottom=0.0)
        left, right = top.get_xlim()
        for count, choice in plan.heights.items():
            x = np.full(choice.places.size, left + (right - left) * (0.035 * count))
            top.plot(x, MM * choice.places, ">", color="white", ms=2.4, mew=0.0)
        top.set_xlim(left, right)
        time = MS * grid.times
        low.plot(time, PER_MS * force[j], color=FORCE)
        if len(plan.names) > 1:
            low.plot(time, PER_MS * single[j], color=GREY, ls="--", lw=0.8)
        low.set(xlabel="Time (ms)", xlim=top.get_xlim())
        low.set_ylim(bottom=0.0)
        low.set_ylabel(f"Share on ${symbol}$ (1/ms)")
        if j > 0:
            top.set_ylabel("")
    several = len(plan.names) > 1
    together = " when all parameters are estimated together" if several else ""
    counts = ", ".join(str(n) for n in sorted(plan.heights))
    best = f"; triangles: the best heights (D-optimal), {counts} of them" if plan.heights else ""
    known = ", and what it would be if the other parameters were known (dashed)" if several else ""
    return (
        f"Information of a measurement about each parameter over place and time{together}. Top: share of a "
        "parameter’s information in the outline at height y above the transmission platen and at a time, per "
        f"mm and ms; white: no measurement possible there{best}. Bottom: share in the force per ms{known}."
    )


SLOPE_CHANGE = 0.01
"""Drawn change of a parameter, divided by its scale [-]."""


def _design_words(plan: Plan, j: int) -> str:
    slopes, name = plan.information.sensitivity, name_of(plan.names[j])
    unit = "" if name.unit == "1" else f" {name.unit}"
    return f"Δ{name.symbol} = {SLOPE_CHANGE * slopes.scale[j] * name.factor:.3g}{unit}"


@_by_parameter("force", "outline")
def plan_slopes(plan: Plan, panels: Panels) -> str:
    slopes = plan.information.sensitivity
    time = MS * slopes.grid.times
    for j, name in enumerate(plan.names):
        step = SLOPE_CHANGE * slopes.scale[j]
        top, low = panels[f"{name} force"], panels[f"{name} outline"]
        change = step * slopes.force_slope[j]
        slack = SLOPE_CHANGE / slopes.reach * slopes.force_left[j]
        top.fill_between(time, change - slack, change + slack, color=BAND, alpha=0.35, lw=0.0)
        top.axhline(0.0, color=GREY, lw=0.5)
        top.plot(time, change, color=FORCE)
        top.set(xlabel="Time (ms)", ylabel=rf"$\Delta F$ with $\Delta {name_of(name).tex}$ (N)")
        change_of_radius = UM * step * slopes.radius_slope[j]
        shown = np.where(np.isfinite(slopes.radius), change_of_radius, np.nan)
        draw_map(low, slopes.grid, shown, rf"$\Delta Z$ with $\Delta {name_of(name).tex}$ (µm)")
        top.set_xlim(low.get_xlim())
        if j > 0:
            low.set_ylabel("")
    changes = ", ".join(_design_words(plan, j) for j in range(len(plan.names)))
    reach = 100.0 * plan.information.sensitivity.reach
    return (
        "Change of the transmitted force (top) and of the outline (bottom) with each parameter, for "
        f"{changes}: straight lines through runs within {reach:g} % of the parameter’s scale. Band: ± the "
        "part of the force that the lines do not describe, over that change; most of it is ringing. "
        "White: no free surface at that height."
    )


@figure(PAGE, 58.0, [["end", "rate", "correlation"]], letters=True)
def plan_choices(plan: Plan, panels: Panels) -> str:
    scale = plan.information.sensitivity.scale
    by_end = np.array([e.deviations for e in plan.by_end]) / scale
    speeds = np.array([rate.factor for rate in plan.rates])
    together = np.array([rate.expected.deviations for rate in plan.rates]) / scale
    single = np.array([rate.expected.alone for rate in plan.rates]) / scale
    for unbounded in (by_end, together, single):
        unbounded[~np.isfinite(unbounded)] = np.nan
    for j, name in enumerate(plan.names):
        colour, marker, symbol = SERIES[j % len(SERIES)], MARKERS[j % len(MARKERS)], f"${name_of(name).tex}$"
        panels["end"].plot(MS * plan.end_times, 100.0 * by_end[:, j], color=colour, label=symbol)
        line: dict[str, Any] = {"color": colour, "marker": marker, "ms": 3.2}
        panels["rate"].plot(speeds, 100.0 * together[:, j], label=symbol, **line)
        panels["rate"].plot(speeds, 100.0 * single[:, j], ls=":", mfc="white", lw=0.7, **line)
    for number, (i, k) in enumerate(combinations(range(len(plan.names)), 2)):
        first, second = name_of(plan.names[i]).tex, name_of(plan.names[k]).tex
        r = [np.nan if R is None else R[i, k] for R in (rate.expected.correlation for rate in plan.rates)]
        colour, marker = SERIES[number % len(SERIES)], MARKERS[number % len(MARKERS)]
        style: dict[str, Any] = {"color": colour, "marker": marker, "ms": 3.2}
        panels["correlation"].plot(speeds, r, label=f"${first}$, ${second}$", **style)
    panels["end"].set(xlabel="End of the data (ms)", ylabel="Standard deviation over scale (%)")
    panels["rate"].set_ylabel("Standard deviation over scale (%)")
    panels["correlation"].set_ylabel("Correlation (–)")
    panels["correlation"].set_ylim(-1.05, 1.05)
    panels["correlation"].axhline(0.0, color=GREY, lw=0.5)
    for name in ("end", "rate"):
        panels[name].set_yscale("log")
        plain_log_ticks(panels[name].yaxis)
    for name in ("rate", "correlation"):
        panels[name].set(xlabel="Speed of the flyer over the shot’s (–)", xscale="log")
        panels[name].set_xticks(speeds, [f"{speed:g}" for speed in speeds])
        panels[name].minorticks_off()
    for ax in panels.values():
        if ax.get_legend_handles_labels()[0] and ax is not panels["rate"]:  # its colours are those of (a)
            ax.legend(loc="best")
    return (
        "Expected standard deviations of the parameters over their scale, all estimated together from force "
        "and outline: (a) if the data end at some time, (b) at other speeds of the flyer on the same path "
        "(colours as in (a); open symbols: if the other parameters were known). (c) Expected correlations of "
        "the estimates. The scale is the value itself, of Poisson’s ratio its distance from 1/2."
    )


MARKS = {
    "incident_rise": "arrival",
    "separation": "separation",
    "arrest": "arrest",
    "push_back": "push-back",
    "second_impact": "second impact",
}
"""Events drawn, in a word or two."""
RINGING = 20e-6
"""Span of the running mean of forces in short parts [s]. Short parts oscillate along their axis."""
PREDICTION_PANELS = ("bar", "velocity", "flyer", "transmitted", "path")
PREDICTION_SHOWN = ("flyer_speed", "mean_rate", "largest_strain")
"""Quantities of a scan that are drawn, with their labels."""
SCAN_LABELS = {
    "flyer_speed": "Flyer (m/s)",
    "mean_rate": "Mean strain rate (1/s)",
    "largest_strain": "Largest compression",
}


@figure(PAGE, 170.0, [[name] for name in PREDICTION_PANELS], letters=True)
def signals(result: Prediction, panels: Panels) -> str:
    bars, test = result.bars, result.test.declared
    step = float(bars.times[1])
    every = slice(None, None, max(1, round(EVERY / step)))
    time = MS * bars.times[every]
    end = bars.incident.velocity(test.incident.length)
    first = next(iter(test.flyer.values()))
    inside = _mean_force(bars.flyer.force(0.5 * first.length), step)
    passed = _mean_force(bars.transmission.force(result.test.sensor_depth()), step)
    for name, force, colour, width, label in (
        ("bar", 1e-3 * bars.incident.force(0.5 * test.incident.length), MEASURED, 0.7, "Incident\nbar (kN)"),
        ("flyer", inside, FORCE, 0.8, "Flyer\n(N)"),
        ("transmitted", passed, SHAPE, 0.8, "Transmitted\n(N)"),
    ):
        panels[name].plot(time, force[every], color=colour, lw=width)
        panels[name].set_ylabel(label)
    _limits(panels["flyer"], result, inside)
    _limits(panels["transmitted"], result, passed)
    velocity = panels["velocity"]
    velocity.plot(time, end[every], color=GREY, lw=0.6, label="bar's end")
    velocity.plot(time, _mean_force(bars.flyer_velocity, step)[every], color=MODEL, lw=0.9, label="flyer")
    velocity.set_ylabel("Velocity\n(m/s)")
    velocity.legend(loc="lower left", ncols=2)
    path = panels["path"]
    path.plot(time, (MM * np.cumsum(end) * step)[every], color=GREY, lw=0.6, label="bar's end")
    path.plot(time, MM * bars.flyer_path[every], color=MODEL, lw=0.9, label="flyer")
    path.set(xlabel="Time since the striker's touch (ms)", ylabel="Path\n(mm)")
    path.legend(loc="upper left", ncols=2)
    share = 100.0 / (MM * test.specimen.length)
    right = path.secondary_yaxis("right", functions=(_times(share), _times(1.0 / share)))
    right.set_ylabel("(%)")
    for name in PREDICTION_PANELS:
        panels[name].set_xlim(0.0, time[-1])
        _mark(panels[name], result, named=name == "bar")
        panels[name].tick_params(labelbottom=name == PREDICTION_PANELS[-1])
    stand_in = "" if result.response is not None else "; the specimen's static curve replaces it"
    return (
        "The planned test from the striker's touch on; compression is positive, dotted lines are the events "
        "found in the signals. (a) Force at the middle of the incident bar. (b) Velocity of the flyer and of "
        "the incident bar's end. (c) Force inside the flyer, mean over 20 µs. (d) Force transmitted by the "
        f"specimen at its sensor, mean over 20 µs{stand_in}. (e) Paths of the flyer and of the bar's end; "
        "the right axis is the flyer's over the specimen's length."
    )


def _times(factor: float) -> Callable[[Any], Any]:
    """A scale of an axis."""
    return lambda value: factor * np.asarray(value)


def _mark(ax: Axes, result: Prediction, *, named: bool) -> None:
    for name, words in MARKS.items():
        at = getattr(result.events, name)
        if not np.isfinite(at):
            continue
        ax.axvline(MS * at, color=GREY, lw=0.6, ls=":")
        if named:
            top: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "ha": "center"}
            label_point(ax, words, (MS * at, 1.0), (0, 3), fontsize="small", **top)


def _limits(ax: Axes, result: Prediction, signal: np.ndarray) -> None:
    """Set limits from the flight, with a margin. The impact of bar on flyer may lie outside the axes."""
    events, times = result.events, result.bars.times
    if not np.isfinite(events.separation):
        return
    last = events.second_impact if np.isfinite(events.second_impact) else times[-1]
    flight = signal[(times > events.separation + 2.0 * RINGING) & (times < last - 2.0 * RINGING)]
    if flight.size:
        low, high = float(flight.min()), float(flight.max())
        least = 0.01 * float(np.ptp(signal))  # of a flyer that carries no wave in flight
        room = 0.3 * max(high - low, least)
        ax.set_ylim(low - room, high + room)


def _mean_force(signal: np.ndarray, step: float) -> np.ndarray:
    n = max(1, round(RINGING / step))
    return np.convolve(signal, np.full(n, 1.0 / n), mode="same")


@figure(PAGE, 62.0, [list(PREDICTION_SHOWN)], letters=True)
def scan(result: tuple[Scan, Aim | None], panels: Panels) -> str:
    scan, aim = result
    first, *second = scan.varied
    others = np.unique(scan.points[:, 1]) if second else [None]
    for name in PREDICTION_SHOWN:
        ax, values = panels[name], scan.column(name)
        for k, other in enumerate(others):
            rows = slice(None) if other is None else scan.points[:, 1] == other
            x, y = scan.points[rows, 0], values[rows]
            colour = str(0.7 * k / max(len(others) - 1, 1))
            label = None if other is None else f"{other:.4g} {second[0].unit}"
            order = np.argsort(x, kind="stable")
            ax.plot(x[order], y[order], marker="o", ms=2.5, lw=0.8 if len(second) < 2 else 0.0, color=colour)
            ax.lines[-1].set_label(label or "_")
        if aim is not None:
            ax.plot(aim.at[first.key], getattr(aim.numbers, name), marker="x", color=MODEL, ms=6, ls="")
            if name in aim.wanted:
                ax.axhline(aim.wanted[name], color=MODEL, lw=0.6, ls=":")
        ax.set(xlabel=f"{first.key} ({first.unit or '1'})", ylabel=SCAN_LABELS[name])
    if second:
        panels[PREDICTION_SHOWN[0]].legend(title=second[0].key, fontsize="small")
    varied = " and ".join(one.key for one in scan.varied)
    aimed = "" if aim is None else "; the cross is the point nearest to the wanted numbers"
    return f"What {varied} do to the test, by the specimen's static curve{aimed}."
