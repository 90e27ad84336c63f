"""Figure of a shot before anything is run: force and flyer on one clock, the outline at three times."""

import numpy as np

from kolsky.base.records import FlyerMotion
from kolsky.report.figures.base import (
    BAND,
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
    note_empty,
)
from kolsky.shot.records import ForceChannel, Shot, ShotBase

TIMES = (SHAPE, FORCE, MODEL)
"""Colours of the three times."""


def three_frames(shot: Shot) -> list[int]:
    """Return the first, the middle and the last frame of the window that have points of the outline."""
    line = shot.centre_line
    if line is None:
        return []
    inside = (line.time >= shot.window[0]) & (line.time <= shot.window[1])
    frames = np.unique(line.frame[inside])
    if not frames.size:
        return []
    chosen = (0, frames.size // 2, frames.size - 1)
    return list(dict.fromkeys(int(frames[i]) for i in chosen))


def caption(shot: ShotBase) -> str:
    """Return the caption."""
    said = "(a) Force at every sample, compression positive"
    if isinstance(shot.force, ForceChannel):
        said += "; grey: the baseline, which gives its zero and noise"
    if not isinstance(shot, Shot):
        return f"{said}. Flyer and outline are still in the pictures: `kolsky dic` measures them."
    moves = (
        "displacement of the flyer" if isinstance(shot.flyer, FlyerMotion) else "velocity of the front face"
    )
    said += (
        f". (b) The {moves} on the same clock: the force must begin when it does, or a wave’s travel later. "
        "Blue: the window that is simulated and compared."
    )
    if three_frames(shot):
        said += (
            " (c) The outline at three times, and the side of the declared specimen at rest (dashed), which "
            "the first must follow."
        )
    return said


def draw(shot: ShotBase, panels: Panels) -> None:
    """Draw the signals on one clock and the outline."""
    ax = panels["force"]
    label_panel(ax, "a")
    label_panel(panels["motion"], "b")
    label_panel(panels["outline"], "c")
    time, force = shot.force.time, shot.force.raw_force()
    if isinstance(shot.force, ForceChannel):
        ax.axvspan(*(MS * end for end in shot.force.baseline), color=GREY, alpha=0.3, lw=0.0)
    ax.plot(MS * time, force, color=MEASURED, lw=0.5)
    ax.set_ylabel("Force $F$ (N)")
    low = panels["motion"]
    low.set_xlabel("Time on the shot’s clock $t$ (ms)")
    if not isinstance(shot, Shot):
        for name in ("motion", "outline"):
            note_empty(panels[name], "in the pictures")
        return
    for panel in (ax, low):
        panel.axvspan(*(MS * end for end in shot.window), color=BAND, alpha=0.2, lw=0.0)
    if isinstance(shot.flyer, FlyerMotion):
        low.plot(MS * shot.flyer.time, MM * shot.flyer.displacement, "o", ms=1.6, mew=0.0, color=MEASURED)
        low.set_ylabel("Flyer (mm)")
    else:
        low.plot(MS * shot.flyer.time, shot.flyer.velocity, color=MEASURED, lw=0.5)
        low.set_ylabel("Front face (m/s)")
    _draw_outline(shot, panels)
    both = np.concatenate([time, shot.flyer.time])
    for panel in (ax, low):  # one axis of time for both: a wrong clock is seen
        panel.set_xlim(MS * both.min(), MS * both.max())


def _draw_outline(shot: Shot, panels: Panels) -> None:
    """Draw the outline at three times beside the declared specimen."""
    ax, line = panels["outline"], shot.centre_line
    if line is None or not three_frames(shot):
        note_empty(ax, "no outline was measured")
        return
    radius, length = MM * shot.specimen.radius, MM * shot.specimen.length
    ax.plot([0.0, radius, radius, 0.0], [0.0, 0.0, length, length], color=GREY, ls="--", lw=0.8)
    for colour, frame in zip(TIMES, three_frames(shot), strict=False):
        at = line.frame == frame
        when = f"{MS * float(line.time[at][0]):.3f} ms"
        ax.plot(MM * line.Z[at], MM * line.y[at], "o", ms=2.2, mew=0.0, color=colour, label=when)
    ax.set_xlabel("Distance from the axis $Z$ (mm)")
    ax.set_ylabel("Height $y$ (mm)")
    ax.set_xlim(left=0.0)
    ax.margins(y=0.06)
    ax.legend(loc="center left")


FIGURES: tuple[FigureKind[ShotBase], ...] = (
    FigureKind(
        name="checked-shot",
        width=PAGE,
        height=lambda shot: 85.0,
        caption=caption,
        panels=lambda shot: [["force", "outline"], ["motion", "outline"]],
        draw=draw,
        mosaic={"width_ratios": [1.35, 1.0]},
    ),
)
