"""Figure of the classical reduction of a flyer test: forces, strain and rate, stress and strain."""

import numpy as np
from matplotlib.axes import Axes

from kolsky.bars.result import FlyerResult
from kolsky.report.figures.base import (
    BAND,
    FORCE,
    GREY,
    MEASURED,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    label_panel,
)
from kolsky.report.figures.waves import band, stress_scale


def caption(result: FlyerResult) -> str:
    """Return the caption."""
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


def draw(result: FlyerResult, panels: Panels) -> None:
    """Draw the four panels."""
    _signals(panels["signals"], result)
    _forces(panels["forces"], panels["shares"], result)
    _strain(panels["strain"], panels["rate"], result)
    _curve(panels["curve"], result)
    for name, text in zip(("signals", "forces", "strain", "curve"), "abcd", strict=True):
        label_panel(panels[name], text)


def _signals(ax: Axes, result: FlyerResult) -> None:
    time = result.reduction.time
    for signal, colour in zip(result.signals[::-1], (SHAPE, MODEL), strict=False):
        ax.plot(MS * signal.time, signal.value, color=colour, lw=0.6, label=signal.name)
    found = [(name, at) for name, at, _, _ in result.events if at is not None]
    for number, (name, at) in enumerate(found):
        ax.axvline(MS * at, color=GREY, lw=0.6, ls=":")
        ax.annotate(
            name,
            (MS * at, 0.98 - 0.07 * (number % 3)),
            xycoords=("data", "axes fraction"),
            xytext=(2, 0),
            textcoords="offset points",
            va="top",
            color=GREY,
        )
    margin = 0.05 * (time[-1] - time[0])
    ax.set_xlim(MS * (time[0] - margin), MS * (time[-1] + margin))
    ax.set(xlabel="Time (ms)", ylabel="Force at the transducer (N)")
    ax.legend(loc="center right")


def _forces(ax: Axes, low: Axes, result: FlyerResult) -> None:
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


def _strain(ax: Axes, low: Axes, result: FlyerResult) -> None:
    r = result.reduction
    time = MS * r.time
    for axis, history, label in (
        (ax, r.strain["three waves"], "Strain (–)"),
        (low, r.rate["three waves"], "Rate (1/s)"),
    ):
        band(axis, time, history, 1.0, BAND)
        axis.plot(time, history.value, color=MEASURED, lw=0.8)
        axis.set_ylabel(label)
    ax.sharex(low)
    ax.tick_params(labelbottom=False)
    low.set_xlabel("Time (ms)")


def _curve(ax: Axes, result: FlyerResult) -> None:
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


FIGURES: tuple[FigureKind[FlyerResult], ...] = (
    FigureKind(
        name="flyer-test",
        width=PAGE,
        height=lambda result: 130.0,
        caption=caption,
        panels=lambda result: [
            ["signals", "forces"],
            ["signals", "shares"],
            ["strain", "curve"],
            ["rate", "curve"],
        ],
        draw=draw,
        mosaic={"height_ratios": [1.5, 1.0, 1.25, 1.25]},
    ),
)
