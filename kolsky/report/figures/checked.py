"""Figures of a shot before anything is run: force, and flyer or pictures, on one clock; three times of it."""

import numpy as np

from kolsky.base.arrays import FloatArray
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
from kolsky.shot.records import ForceChannel, PicturedShot, Shot

TIMES = (SHAPE, FORCE, MODEL)
"""Colours of the three times."""
PLACES = ("first", "static", "last")
"""Panels of three pictures."""
PERCENT = 100.0


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


def caption_of_force(shot: Shot | PicturedShot) -> str:
    """Return what the caption says of the force."""
    said = "(a) Force at every sample, compression positive"
    return said + (
        "; grey: the baseline, which gives its zero and noise" if isinstance(shot.force, ForceChannel) else ""
    )


def caption(shot: Shot) -> str:
    """Return the caption."""
    said = caption_of_force(shot)
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


def draw_force(shot: Shot | PicturedShot, panels: Panels) -> None:
    """Draw the force over the time of the panel below."""
    ax = panels["force"]
    label_panel(ax, "a")
    label_panel(panels["motion"], "b")
    if isinstance(shot.force, ForceChannel):
        ax.axvspan(*(MS * end for end in shot.force.baseline), color=GREY, alpha=0.3, lw=0.0)
    ax.plot(MS * shot.force.time, shot.force.raw_force(), color=MEASURED, lw=0.5)
    ax.set_ylabel("Force $F$ (N)")
    panels["motion"].set_xlabel("Time on the shot’s clock $t$ (ms)")


def on_one_clock(panels: Panels, *times: FloatArray) -> None:
    """Give force and motion one axis of time, so that a wrong clock is seen."""
    both = MS * np.concatenate(times)
    for panel in (panels["force"], panels["motion"]):
        panel.set_xlim(both.min(), both.max())


def draw(shot: Shot, panels: Panels) -> None:
    """Draw the signals on one clock and the outline."""
    draw_force(shot, panels)
    ax, low = panels["force"], panels["motion"]
    label_panel(panels["outline"], "c")
    for panel in (ax, low):
        panel.axvspan(*(MS * end for end in shot.window), color=BAND, alpha=0.2, lw=0.0)
    if isinstance(shot.flyer, FlyerMotion):
        low.plot(MS * shot.flyer.time, MM * shot.flyer.displacement, "o", ms=1.6, mew=0.0, color=MEASURED)
        low.set_ylabel("Flyer (mm)")
    else:
        low.plot(MS * shot.flyer.time, shot.flyer.velocity, color=MEASURED, lw=0.5)
        low.set_ylabel("Front face (m/s)")
    _draw_outline(shot, panels)
    on_one_clock(panels, shot.force.time, shot.flyer.time)


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


def caption_of_pictures(shot: PicturedShot) -> str:
    """Return the caption."""
    return (
        f"{caption_of_force(shot)}. (b) Mean difference of each picture from the first of its camera, in per "
        "cent of white, on the same clock; grey: the frames that are declared static, in which it is level. "
        "It must rise before the force does, or with it. (c), (d), (e) Camera 0 in the first frame, in the "
        "last static one, which must look alike, and in the last. Flyer and outline are not measured."
    )


def draw_pictures(shot: PicturedShot, panels: Panels) -> None:
    """Draw force and change of the pictures on one clock, and three pictures."""
    draw_force(shot, panels)
    low, found = panels["motion"], shot.pictures.changes
    low.axvspan(MS * found.time[0], MS * found.rest_end, color=GREY, alpha=0.3, lw=0.0)
    for camera, (values, colour) in enumerate(zip(found.change, (SHAPE, FORCE), strict=True)):
        low.plot(
            MS * found.time, PERCENT * values, "o", ms=1.6, mew=0.0, color=colour, label=f"camera {camera}"
        )
    low.set_ylabel("Change (%)")
    low.legend(loc="upper left", markerscale=2.0)
    on_one_clock(panels, shot.force.time, found.time)
    for name, mark, (time, picture) in zip(PLACES, "cde", found.shown, strict=False):
        ax = panels[name]
        ax.imshow(picture, cmap="gray", vmin=0.0, vmax=1.0, interpolation="none")
        ax.set_title(f"{MS * time:.3f} ms".replace("-", "−"), loc="right", pad=2.5)
        ax.set_xlabel("$x$ (px)")
        label_panel(ax, mark)
    for name in PLACES[len(found.shown) :]:
        note_empty(panels[name], "no picture")
    panels[PLACES[0]].set_ylabel("$y$ (px)")


FIGURES: tuple[FigureKind[Shot], ...] = (
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

OF_PICTURES: tuple[FigureKind[PicturedShot], ...] = (
    FigureKind(
        name="checked-pictures",
        width=PAGE,
        height=lambda shot: 145.0,
        caption=caption_of_pictures,
        panels=lambda shot: [["force"] * 3, ["motion"] * 3, list(PLACES)],
        draw=draw_pictures,
        mosaic={"height_ratios": [1.0, 1.0, 1.5]},
    ),
)
