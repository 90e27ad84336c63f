"""Figures of classical reductions: bar signals, bars brought together, repeated tests, and flyer tests."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from kolsky.bars.guides.propagation import BarsTogether
from kolsky.bars.records import FlyerResult, History, Reduction, WavesResult
from kolsky.bars.reduction.repeated_tests import RepeatedTests
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    FORCE,
    GREY,
    MEASURED,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    figure,
    label_point,
    largest,
    note_empty,
)
from kolsky.shot.bars import CheckedBars

US, MICRO = 1e6, 1e6
"""Factors from s to µs and from strain to µm/m."""
WAYS = {"one wave": (SHAPE, "-"), "two waves": (FORCE, "--"), "three waves": (MEASURED, "-")}
"""Colour and line style of each analysis."""
PULSES = {"incident": SHAPE, "reflected": MODEL, "transmitted": FORCE}


def _reduction(below: str) -> Callable[[Callable[[Any, Panels], str]], FigureKind[Any]]:
    """The panels of a reduced test; ``below``: name of the panel below the forces."""
    rows = [["signals", "forces"], ["signals", below], ["strain", "curve"], ["rate", "curve"]]
    letters = ("signals", "forces", "strain", "curve")
    return figure(PAGE, 130.0, rows, height_ratios=[1.5, 1.0, 1.25, 1.25], letters=letters)


def scale(values: np.ndarray, steps: tuple[tuple[float, str], ...]) -> tuple[float, str]:
    """Factor and unit of display: the largest unit in which the largest value is at least 1."""
    top = largest(values)
    for factor, unit in steps:
        if top * factor >= 1.0:
            return factor, unit
    return steps[-1]


def force_scale(values: np.ndarray) -> tuple[float, str]:
    """kN or N."""
    return scale(values, ((1e-3, "kN"), (1.0, "N")))


def stress_scale(values: np.ndarray) -> tuple[float, str]:
    """MPa, kPa or Pa."""
    return scale(values, ((1e-6, "MPa"), (1e-3, "kPa"), (1.0, "Pa")))


@_reduction("imbalance")
def waves(result: WavesResult, panels: Panels) -> str:
    _signals(panels["signals"], result)
    _forces(panels["forces"], panels["imbalance"], result)
    _strain(panels["strain"], panels["rate"], result.reduction, WAYS, US, "Time at the specimen (µs)")
    _curve(panels["curve"], result)
    balanced = result.reduction.balanced
    balance = (
        f"the forces are balanced from {US * balanced[0]:.4g} to {US * balanced[1]:.4g} µs (shaded)"
        if balanced
        else "the forces are never balanced"
    )
    return (
        f"Bar signals and their reduction; {result.load} is shown positive, bands are k = 2. (a) Strain at "
        f"the gauges with the windows of the pulses (by {result.windows.source}). (b) Forces on the front "
        f"and the back of the specimen, and their imbalance R = 2 (F₁ − F₂)/(F₁ + F₂); {balance}. (c) "
        "Nominal strain and strain rate. (d) Nominal stress against nominal strain by one-, two- and "
        "three-wave analysis, the band belongs to three waves."
    )


@figure(PAGE, 75.0, [["signals"]])
def checked_bars(shot: CheckedBars, panels: Panels) -> str:
    ax = panels["signals"]
    _signals(ax, shot)
    for station in shot.given.stations.values():
        ax.axvspan(*(US * end for end in station.baseline), color=GREY, alpha=0.2, lw=0.0)
    for check, name in zip(shot.checks, ("reflected", "transmitted"), strict=True):
        ax.axvline(US * check.predicted, color=PULSES[name], ls=":", lw=0.9)
    times = [end for station in shot.given.stations.values() for end in station.baseline]
    low, high = ax.get_xlim()
    ax.set_xlim(min(low, US * min(times)), max(high, US * max(times)))
    return (
        f"Strain at the gauges on the shot’s clock, {shot.given.load} positive, with the windows of the "
        f"pulses (by {shot.windows.source}), and the baselines (grey), which give zero and noise: no part of "
        "a pulse may lie in them. Dotted: where the reflected and the transmitted pulse are predicted by the "
        "distances and wave speeds."
    )


def _signals(ax: Axes, result: WavesResult | CheckedBars) -> None:
    for station, dash, label in (
        (result.incident, "-", "incident gauge"),
        (result.transmission, "--", "transmission gauge"),
    ):
        strain = station.strain
        ax.plot(US * strain.time, MICRO * strain.value, dash, color=MEASURED, lw=0.7, label=label)
    for row, (name, colour) in enumerate(PULSES.items()):
        first, last = getattr(result.windows, name)
        ax.axvspan(US * first, US * last, color=colour, alpha=0.16, lw=0.0)
        place = (0.5 * US * (first + last), 0.02 + 0.05 * (row % 2))
        style: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "ha": "center", "color": colour}
        label_point(ax, name, place, (0, 0), va="bottom", **style)
    spans = [getattr(result.windows, name) for name in PULSES]
    first, last = min(s[0] for s in spans), max(s[1] for s in spans)
    margin = 0.15 * (last - first)
    ax.set_xlim(US * (first - margin), US * (last + margin))
    ax.set(xlabel="Time at the gauge (µs)", ylabel="Strain (µm/m)")
    ax.margins(y=0.25)
    ax.legend(loc="upper right", ncols=2)


def band(ax: Axes, x: np.ndarray, history: History, factor: float, colour: str) -> None:
    """Shade the k = 2 band of a history, in units of `factor`."""
    half = 2.0 * factor * history.sigma
    ax.fill_between(
        x, factor * history.value - half, factor * history.value + half, color=colour, alpha=0.25, lw=0.0
    )


def _forces(ax: Axes, low: Axes, result: WavesResult) -> None:
    r = result.reduction
    time = US * r.time
    factor, unit = force_scale(np.concatenate([r.front_force.value, r.back_force.value]))
    for history, colour, dash, label in (
        (r.front_force, MODEL, "-", "front $F_1$"),
        (r.back_force, SHAPE, "--", "back $F_2$"),
    ):
        band(ax, time, history, factor, colour)
        ax.plot(time, factor * history.value, dash, color=colour, label=label)
    ax.set_ylabel(f"Force ({unit})")
    ax.legend(loc="best")
    ax.sharex(low)
    ax.tick_params(labelbottom=False)
    finite = np.where(np.abs(r.imbalance) <= 2.0, r.imbalance, np.nan)
    if np.isfinite(finite).any():
        low.plot(time, finite, color=MEASURED, lw=0.7)
    else:
        note_empty(low, "forces within their noise")
    low.axhline(0.0, color=GREY, lw=0.5)
    low.set_ylim(-1.0, 1.0)
    low.set(xlabel="Time at the specimen (µs)", ylabel="$R$ (–)")
    if r.balanced is not None:
        for axis in (ax, low):
            axis.axvspan(US * r.balanced[0], US * r.balanced[1], color=GREY, alpha=0.18, lw=0.0)


def _strain(
    ax: Axes, low: Axes, r: Reduction, ways: Mapping[str, tuple[str, str]], factor: float, label: str
) -> None:
    """Draw strain and rate over the time in units of `factor`. Bands are those of three waves."""
    time = factor * r.time
    for way, (colour, dash) in ways.items():
        if way not in r.strain:
            continue
        for axis, history in ((ax, r.strain[way]), (low, r.rate[way])):
            if way == "three waves":
                band(axis, time, history, 1.0, BAND)
            axis.plot(time, history.value, dash, color=colour, label=way, lw=0.8)
    ax.set_ylabel("Strain (–)")
    ax.sharex(low)
    ax.tick_params(labelbottom=False)
    if len(ways) > 1:
        ax.legend(loc="best")
    low.set(xlabel=label, ylabel="Rate (1/s)")


def _curve(ax: Axes, result: WavesResult) -> None:
    r = result.reduction
    factor, unit = stress_scale(np.concatenate([h.value for h in r.stress.values()]))
    for way, (colour, dash) in WAYS.items():
        if way not in r.stress:
            continue
        strain = r.strain[way].value
        if way == "three waves":
            band(ax, strain, r.stress[way], factor, BAND)
        ax.plot(strain, factor * r.stress[way].value, dash, color=colour, lw=0.8, label=way)
    balanced = r.balanced
    if balanced is not None and "three waves" in r.stress:
        inside = (r.time >= balanced[0]) & (r.time <= balanced[1])
        strain, stress = r.strain["three waves"].value[inside], r.stress["three waves"].value[inside]
        ax.plot(strain, factor * stress, color=GREY, lw=3.0, alpha=0.45, zorder=0, label="balanced")
    ax.set(xlabel="Nominal strain (–)", ylabel=f"Nominal stress ({unit})")
    ax.legend(loc="best")


@figure(COLUMN, 80.0, [["pulse"], ["residual"]], sharex=True, height_ratios=[2.0, 1.0])
def bars_together(result: BarsTogether, panels: Panels) -> str:
    top, low = panels["pulse"], panels["residual"]
    time = US * result.time
    top.plot(time, MICRO * result.measured, color=MEASURED, label="measured")
    top.plot(time, MICRO * (result.measured + result.residual), "--", color=MODEL, label="carried there")
    top.set_ylabel("Strain (µm/m)")
    top.legend(loc="best")
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, MICRO * result.residual, color=MODEL, lw=0.7)
    low.set(xlabel="Time (µs)", ylabel="Difference (µm/m)")
    return (
        "Bars together. Top: strain at the transmission gauge, and that of the incident gauge propagated "
        f"there by the first mode of Pochhammer and Chree with c₀ = {result.wave_speed:.1f} m/s and gain "
        f"{result.gain:.4f}. Bottom: their difference, {100.0 * result.rms:.2f} % rms of the peak; a plain "
        f"shift leaves {100.0 * result.plain_rms:.2f} %."
    )


@figure(COLUMN, 70.0, [["curve"]])
def repeats(mean: RepeatedTests, panels: Panels) -> str:
    ax = panels["curve"]
    factor, unit = stress_scale(mean.mean)
    for number, row in enumerate(mean.values):
        ax.plot(mean.axis, factor * row, color=GREY, lw=0.5, label="" if number else "tests")
    low, high = mean.band()
    ax.fill_between(mean.axis, factor * low, factor * high, color=BAND, alpha=0.4, lw=0.0, label="95 %")
    ax.plot(mean.axis, factor * mean.mean, color=MEASURED, lw=1.0, label="mean")
    ax.set(xlabel="Nominal strain (–)", ylabel=f"Nominal stress ({unit})")
    ax.legend(loc="best")
    return (
        f"Nominal stress against nominal strain of {mean.count} tests (grey), their mean and its 95 "
        "% confidence band, with the scatter between tests and what they have in common."
    )


@_reduction("shares")
def flyer_test(result: FlyerResult, panels: Panels) -> str:
    _flyer_signals(panels["signals"], result)
    _flyer_forces(panels["forces"], panels["shares"], result)
    three = {"three waves": WAYS["three waves"]}
    _strain(panels["strain"], panels["rate"], result.reduction, three, MS, "Time (ms)")
    _flyer_curve(panels["curve"], result)
    valid = "no time span is known to be valid for a classical curve"
    if result.valid is not None:
        first, last = (MS * t for t in result.valid)
        valid = f"a classical curve is valid from {first:.4g} to {last:.4g} ms (shaded)"
    return (
        "Flyer test; compression is positive, bands are k = 2. (a) Forces at the transducers, with the "
        "events found. (b) Forces on the specimen's faces after mass compensation, and the shares of the "
        "mean stress that inertia and the faces' difference have; beyond the axes lie forces while the flyer "
        f"is accelerated, and shares above 1000 % are left out; {valid}. (c) Nominal strain and strain "
        "rate from the flyer's motion. (d) Nominal stress against nominal strain by either force."
    )


def _flyer_signals(ax: Axes, result: FlyerResult) -> None:
    time = result.reduction.time
    for signal, colour in zip(result.signals[::-1], (SHAPE, MODEL), strict=False):
        ax.plot(MS * signal.time, signal.value, color=colour, lw=0.6, label=signal.name)
    events = [(name, at) for name, at, _, _ in result.events if at is not None]
    for number, (name, at) in enumerate(events):
        ax.axvline(MS * at, color=GREY, lw=0.6, ls=":")
        place = (MS * at, 0.98 - 0.07 * (number % 3))
        label_point(ax, name, place, (2, 0), xycoords=("data", "axes fraction"), va="top", color=GREY)
    margin = 0.05 * (time[-1] - time[0])
    ax.set_xlim(MS * (time[0] - margin), MS * (time[-1] + margin))
    ax.set(xlabel="Time (ms)", ylabel="Force at the transducer (N)")
    ax.legend(loc="center right")


def _flyer_forces(ax: Axes, low: Axes, result: FlyerResult) -> None:
    r = result.reduction
    time = MS * r.time
    if len(result.signals) > 1:
        band(ax, time, r.front_force, 1.0, MODEL)
        ax.plot(time, r.front_force.value, color=MODEL, lw=0.7, label="front $F_1$")
    ax.plot(time, r.back_force.value, color=SHAPE, lw=0.7, label="back $F_2$")
    top = 1.6 * float(np.abs(r.back_force.value).max())
    ax.set_ylim(-top, 1.3 * top)
    ax.set_ylabel("Force (N)")
    ax.legend(loc="upper center", ncols=2)
    ax.sharex(low)
    ax.tick_params(labelbottom=False)
    at = MS * result.inertia["time"]
    for name, colour in (("imbalance", MEASURED), ("inertia", FORCE)):
        share = np.where(result.inertia[name] <= 10.0, result.inertia[name], np.nan)
        low.plot(at, 100.0 * share, color=colour, lw=0.7, label=name)
    low.set_yscale("log")
    low.set_ylim(0.1, 1000.0)
    low.set(xlabel="Time (ms)", ylabel="Share (%)")
    low.legend(loc="lower center", ncols=2)
    if result.valid is not None:
        for axis in (ax, low):
            axis.axvspan(MS * result.valid[0], MS * result.valid[1], color=GREY, alpha=0.25, lw=0.0)


def _flyer_curve(ax: Axes, result: FlyerResult) -> None:
    r = result.reduction
    back, front = r.stress["one wave"], r.stress["two waves"]
    factor, unit = stress_scale(back.value)
    strain = r.strain["three waves"].value
    if len(result.signals) > 1:
        ax.plot(strain, factor * front.value, color=MODEL, lw=0.6, label="by the front force")
    ax.plot(strain, factor * back.value, color=SHAPE, lw=0.8, label="by the back force")
    top = 1.6 * factor * float(np.abs(back.value).max())
    ax.set_ylim(-top, top)
    ax.set(xlabel="Nominal strain (–)", ylabel=f"Nominal stress ({unit})")
    ax.legend(loc="lower right")
