"""Figures of a planned test: its signals as Fig. 5 of Mates et al. (2012) has them, and a scan."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from kolsky.prediction.design import Aim, Scan
from kolsky.prediction.output import EVERY
from kolsky.prediction.predict import Prediction
from kolsky.report.figures.base import (
    FORCE,
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    label_panel,
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
"""Span of the running mean of forces inside short parts, which ring along their axis [s]."""
PANELS = ("bar", "velocity", "flyer", "transmitted", "path")
SHOWN = ("flyer_speed", "mean_rate", "largest_strain")
"""Numbers of a scan that are drawn, with their labels."""
LABELS = {
    "flyer_speed": "Flyer (m/s)",
    "mean_rate": "Mean strain rate (1/s)",
    "largest_strain": "Largest compression",
}


def caption(found: Prediction) -> str:
    """Return the caption."""
    stand_in = "" if found.response is not None else "; the specimen's static curve stands in for it"
    return (
        "The planned test from the striker's touch on; compression is positive, dotted lines are the events "
        "found in the signals. (a) Force at the middle of the incident bar. (b) Velocity of the flyer and of "
        "the incident bar's end. (c) Force inside the flyer, mean over 20 µs. (d) Force transmitted by the "
        f"specimen at its sensor, mean over 20 µs{stand_in}. (e) Paths of the flyer and of the bar's end; "
        "the right axis is the flyer's over the specimen's length."
    )


def draw(found: Prediction, panels: Panels) -> None:
    """Draw the five panels over one time axis."""
    bars, test = found.bars, found.test.declared
    step = float(bars.times[1])
    every = slice(None, None, max(1, round(EVERY / step)))
    time = MS * bars.times[every]
    end = bars.incident.velocity(test.incident.length)
    panels["bar"].plot(
        time, 1e-3 * bars.incident.force(0.5 * test.incident.length)[every], color=MEASURED, lw=0.7
    )
    panels["bar"].set_ylabel("Incident\nbar (kN)")
    velocity = panels["velocity"]
    velocity.plot(time, end[every], color=GREY, lw=0.6, label="bar's end")
    velocity.plot(time, _mean(bars.flyer_velocity, step)[every], color=MODEL, lw=0.9, label="flyer")
    velocity.set_ylabel("Velocity\n(m/s)")
    velocity.legend(loc="lower left", ncols=2)
    first = next(iter(test.flyer.values()))
    inside = _mean(bars.flyer.force(0.5 * first.length), step)
    panels["flyer"].plot(time, inside[every], color=FORCE, lw=0.8)
    panels["flyer"].set_ylabel("Flyer\n(N)")
    _limits(panels["flyer"], found, inside)
    passed = _mean(bars.transmission.force(found.test.sensor_depth()), step)
    panels["transmitted"].plot(time, passed[every], color=SHAPE, lw=0.8)
    panels["transmitted"].set_ylabel("Transmitted\n(N)")
    _limits(panels["transmitted"], found, passed)
    path = panels["path"]
    path.plot(time, (MM * np.cumsum(end) * step)[every], color=GREY, lw=0.6, label="bar's end")
    path.plot(time, MM * bars.flyer_path[every], color=MODEL, lw=0.9, label="flyer")
    path.set(xlabel="Time since the striker's touch (ms)", ylabel="Path\n(mm)")
    path.legend(loc="upper left", ncols=2)
    share = 100.0 / (MM * test.specimen.length)
    right = path.secondary_yaxis("right", functions=(_times(share), _times(1.0 / share)))
    right.set_ylabel("(%)")
    for name, letter in zip(PANELS, "abcde", strict=True):
        panels[name].set_xlim(0.0, time[-1])
        _mark(panels[name], found, named=name == "bar")
        label_panel(panels[name], letter)
        panels[name].tick_params(labelbottom=name == PANELS[-1])


def _times(factor: float) -> Callable[[Any], Any]:
    """A scale of an axis."""
    return lambda value: factor * np.asarray(value)


def _mark(ax: Axes, found: Prediction, *, named: bool) -> None:
    for name, words in MARKS.items():
        at = getattr(found.events, name)
        if not np.isfinite(at):
            continue
        ax.axvline(MS * at, color=GREY, lw=0.6, ls=":")
        if named:
            ax.annotate(
                words,
                (MS * at, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize="small",
            )


def _limits(ax: Axes, found: Prediction, signal: np.ndarray) -> None:
    """Leave the blow of bar and flyer out of the axes: limits from the flight, with room."""
    events, times = found.events, found.bars.times
    if not np.isfinite(events.separation):
        return
    last = events.second_impact if np.isfinite(events.second_impact) else times[-1]
    flight = signal[(times > events.separation + 2.0 * RINGING) & (times < last - 2.0 * RINGING)]
    if flight.size:
        low, high = float(flight.min()), float(flight.max())
        least = 0.01 * float(np.ptp(signal))  # of a flyer that carries no wave in flight
        room = 0.3 * max(high - low, least)
        ax.set_ylim(low - room, high + room)


def _mean(signal: np.ndarray, step: float) -> np.ndarray:
    n = max(1, round(RINGING / step))
    return np.convolve(signal, np.full(n, 1.0 / n), mode="same")


FIGURES = (
    FigureKind[Prediction](
        name="signals",
        width=PAGE,
        height=lambda found: 170.0,
        caption=caption,
        panels=lambda found: [[name] for name in PANELS],
        draw=draw,
    ),
)


def scan_caption(shown: tuple[Scan, Aim | None]) -> str:
    """Return the caption."""
    scan, aim = shown
    varied = " and ".join(one.key for one in scan.varied)
    aimed = "" if aim is None else "; the cross is the point that comes nearest to what is wanted"
    return f"What {varied} do to the test, by the specimen's static curve{aimed}."


def draw_scan(shown: tuple[Scan, Aim | None], panels: Panels) -> None:
    """Draw one number a panel over the first quantity, a line for each value of the second."""
    scan, aim = shown
    first, *rest = scan.varied
    others = np.unique(scan.points[:, 1]) if rest else [None]
    for name, letter in zip(SHOWN, "abc", strict=True):
        ax, values = panels[name], scan.column(name)
        for k, other in enumerate(others):
            rows = slice(None) if other is None else scan.points[:, 1] == other
            x, y = scan.points[rows, 0], values[rows]
            colour = str(0.7 * k / max(len(others) - 1, 1))
            label = None if other is None else f"{other:.4g} {rest[0].unit}"
            order = np.argsort(x, kind="stable")
            ax.plot(x[order], y[order], marker="o", ms=2.5, lw=0.8 if len(rest) < 2 else 0.0, color=colour)
            ax.lines[-1].set_label(label or "_")
        if aim is not None:
            ax.plot(aim.at[first.key], getattr(aim.numbers, name), marker="x", color=MODEL, ms=6, ls="")
            if name in aim.wanted:
                ax.axhline(aim.wanted[name], color=MODEL, lw=0.6, ls=":")
        ax.set(xlabel=f"{first.key} ({first.unit or '1'})", ylabel=LABELS[name])
        label_panel(ax, letter)
    if rest:
        panels[SHOWN[0]].legend(title=rest[0].key, fontsize="small")


SCAN_FIGURES = (
    FigureKind[tuple[Scan, Aim | None]](
        name="scan",
        width=PAGE,
        height=lambda shown: 62.0,
        caption=scan_caption,
        panels=lambda shown: [list(SHOWN)],
        draw=draw_scan,
    ),
)
