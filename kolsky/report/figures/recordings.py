"""Figures of the recordings on one clock: force, motion of the front face, picture pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from dic.outcome import FrameOutcome
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.pictures.picture_set import PicturePair
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    DOTS,
    FORCE,
    GREY,
    KPA,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    PAPER,
    SHAPE,
    UM,
    Panels,
    colour_bar,
    figure,
    note_empty,
    picture_height,
    show_picture,
    show_points,
)
from kolsky.shot.recordings import ShotRecordings
from kolsky.shot.records import ForceChannel, PicturedShot, Shot

if TYPE_CHECKING:
    from dic.result import Body


@figure(COLUMN, 60.0, [["signal"]], applies=lambda result: result.time.size > 0)
def raw_signals(result: ShotRecordings, panels: Panels) -> str:
    ax = panels["signal"]
    first, last = (MS * end for end in result.window)
    ax.axvspan(first, last, color=BAND, alpha=0.2, lw=0.0, label="window")
    if result.baseline is not None:
        first, last = (MS * end for end in result.baseline)
        ax.axvspan(first, last, color=MODEL, alpha=0.25, lw=0.0, label="baseline")
        ax.axhline(result.zero, color=MODEL, lw=0.7, ls="--", label="zero")
    ax.plot(MS * result.time, result.value, color=MEASURED, lw=0.4, label="recorded")
    if result.symmetry_end is not None:
        ax.axvline(MS * result.symmetry_end, color=GREY, lw=0.8, ls=":", label="end of symmetry")
    ax.set_xlabel("Time $t$ (ms)")
    ax.set_ylabel("Signal (V)" if result.unit == "V" else f"Force $F$ ({result.unit})")
    ax.margins(x=0.0)
    ax.legend(loc="upper left")
    if result.baseline is None:
        return (
            "Force on the specimen from the waves in the transmission bar, every sample; blue: the window "
            "that is simulated and compared. Compression is positive."
        )
    return (
        "Force channel as recorded, every sample, on the shot’s clock; orange: the baseline, which gives "
        "zero (dashed) and noise; blue: the window that is simulated and compared."
    )


@figure(
    COLUMN,
    105.0,
    [["displacement"], ["velocity"], ["residual"]],
    applies=lambda result: result.motion.measured_time.size > 1,
    sharex=True,
    height_ratios=[1.3, 1.2, 0.8],
    letters=True,
)
def flyer_path(result: ShotRecordings, panels: Panels) -> str:
    motion = result.motion
    first, last = (MS * end for end in result.window)
    for ax in panels.values():
        ax.axvspan(first, last, color=BAND, alpha=0.2, lw=0.0)
        if result.symmetry_end is not None:
            ax.axvline(MS * result.symmetry_end, color=GREY, lw=0.8, ls=":", label="end of symmetry")
    time, frames = MS * motion.time, MS * motion.measured_time
    ax, low = panels["velocity"], panels["residual"]
    band = 2.0 * motion.velocity_sigma
    ax.fill_between(time, motion.velocity - band, motion.velocity + band, color=MODEL, alpha=0.35, lw=0.0)
    if motion.is_velocity:
        ax.plot(frames, motion.measured, color=MEASURED, lw=0.4, label="measured")
    ax.plot(time, motion.velocity, color=MODEL, label="fitted")
    ax.set_ylabel("Velocity (m/s)")
    ax = panels["displacement"]
    if not motion.is_velocity:
        value, half = MM * motion.measured, 2.0 * MM * motion.sigma
        ax.errorbar(frames, value, yerr=half, color=MEASURED, label="measured", **DOTS)
    ax.plot(time, MM * motion.position, color=MODEL, label="fitted")
    ax.set_ylabel("Displacement (mm)")
    ax.legend(loc="upper left")
    factor, label = (1.0, "Residual (m/s)") if motion.is_velocity else (UM, "Residual (µm)")
    low.fill_between(
        frames, -2.0 * factor * motion.sigma, 2.0 * factor * motion.sigma, color=GREY, alpha=0.25, lw=0.0
    )
    low.plot(frames, factor * motion.residual, "o", ms=1.2, mew=0.0, color=MEASURED)
    low.set(xlabel="Time $t$ (ms)", ylabel=label)
    low.margins(x=0.01)
    if result.motion.is_velocity:
        return (
            "Front face, from the waves in the incident bar. (a) Its fitted displacement, (b) its velocity, "
            "measured and fitted with ±2σ, (c) measured minus fitted velocity. Blue: the window."
        )
    return (
        "Flyer. (a) Displacement toward the specimen at the frames and fitted path, (b) the path’s velocity "
        "with ±2σ, (c) measured minus fitted displacement with the ±2σ of the noise. Blue: the window."
    )


CAMERAS = ("left", "right")


@figure(
    PAGE,
    lambda result: picture_height(result.pair.pictures[0].shape, 0.5 * PAGE - 16.0, 57.0, 80.0, 185.0),
    [list(CAMERAS), ["quality", "lost"]],
    applies=lambda result: isinstance(result.pair, PicturePair),
    height_ratios=[1.7, 1.0],
    letters=True,
)
def picture_pair(result: ShotRecordings, panels: Panels) -> str:
    pair = result.pair
    assert isinstance(pair, PicturePair)  # checked by `applies`
    body, frame = pair.result.specimen, pair.frame
    valid = body.surface.valid[frame]
    sigma = [camera[frame, valid] for camera in body.match_sigma]
    low, high = np.percentile(np.concatenate(sigma), [1.0, 99.0])
    points: Any = None
    for number, name in enumerate(CAMERAS):
        ax = panels[name]
        picture = pair.pictures[number]
        show_picture(ax, picture, dark=True)
        ax.set(xlim=(-0.5, picture.shape[1] - 0.5), ylim=(picture.shape[0] - 0.5, -0.5), ylabel="$y$ (px)")
        places = body.pixels[number][frame]
        lines = places[_joined(body, valid)]
        ax.add_collection(LineCollection(list(lines), colors=SHAPE, linewidths=0.5))
        style: dict[str, Any] = {"s": 9.0, "cmap": "plasma", "lw": 0.4, "edgecolors": "white", "zorder": 3}
        points = show_points(ax, places[valid], sigma[number], low, max(high, 1.01 * low), **style)
        ax.set_title(f"camera {number}", loc="right", pad=2.5)
    beside: dict[str, Any] = {"aspect": 22, "pad": 0.02, "extend": "both", "ticks": MaxNLocator(5)}
    colour_bar(points, [panels[name] for name in CAMERAS], "Standard deviation (px)", **beside)
    _histories(pair, panels["quality"], panels["lost"])
    size = np.abs(body.epipolar[body.surface.valid])
    largest = f"{float(np.percentile(size, 99.0)):.3f} px" if size.size else "unknown"
    return (
        f"(a), (b) Cameras 0 and 1 at {MS * float(pair.result.t[frame]):.3f} ms, frame {frame} counted from "
        f"0, with the {int(body.n_valid[frame])} of {body.surface.n_points} points of the specimen that are "
        "valid there, joined to their neighbours and coloured by the standard deviation of their place in "
        "that picture. (c) Of the valid points of each frame: the median of the larger of both cameras’ "
        "standard deviations and the rms distance from the epipolar line, 99 % of all distances below "
        f"{largest}. (d) Points that are not valid."
    )


def _joined(body: Body, valid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Pairs of valid points that are neighbours in the grid, shape [n, 2]."""
    place = {tuple(cell): k for k, cell in enumerate(body.cell.tolist()) if valid[k]}
    ends = [
        (k, place[neighbour])
        for (column, row), k in place.items()
        for neighbour in ((column + 1, row), (column, row + 1))
        if neighbour in place
    ]
    return np.array(ends, dtype=np.int64).reshape(-1, 2)


def _histories(pair: PicturePair, quality: Axes, lost: Axes) -> None:
    result, body = pair.result, pair.result.specimen
    usable = (result.outcome == FrameOutcome.VALID) & (body.n_valid > 0)
    time, valid = MS * result.t[usable], body.surface.valid[usable]
    larger = np.where(valid, np.fmax(*body.match_sigma)[usable], np.nan)
    squares = np.where(valid, body.epipolar[usable] ** 2, np.nan)
    quality.plot(time, np.nanmedian(larger, axis=1), color=SHAPE, label="standard deviation")
    quality.plot(time, np.sqrt(np.nanmean(squares, axis=1)), color=MODEL, label="epipolar distance, rms")
    quality.set(xlabel="Time (ms)", ylabel="In a picture (px)")
    quality.set_ylim(bottom=0.0)
    lost.plot(time, body.surface.n_points - body.n_valid[usable], color=FORCE)
    lost.set(xlabel="Time (ms)", ylabel=f"Points not valid (of {body.surface.n_points})")
    lost.set_ylim(0.0, max(1.1 * float(np.max(body.surface.n_points - body.n_valid[usable])), 1.0))
    for ax in (quality, lost):
        ax.axvline(MS * float(result.t[pair.frame]), color=PAPER, lw=0.8, ls="--", label="(a), (b)")
    quality.legend(loc="best")


THREE_TIMES = (SHAPE, FORCE, MODEL)
"""Colours of the three times."""
FORCE_PLACES = ("first", "static", "last")
"""Panels of three pictures."""


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


def _caption_of_force(shot: Shot | PicturedShot) -> str:
    """Return the part of the caption about the force."""
    text = "(a) Force at every sample, compression positive"
    return text + (
        "; grey: the baseline, which gives its zero and noise" if isinstance(shot.force, ForceChannel) else ""
    )


def draw_force(shot: Shot | PicturedShot, panels: Panels) -> None:
    """Draw the force over the time of the panel below."""
    ax = panels["force"]
    if isinstance(shot.force, ForceChannel):
        ax.axvspan(*(MS * end for end in shot.force.baseline), color=GREY, alpha=0.3, lw=0.0)
    ax.plot(MS * shot.force.time, shot.force.raw_force(), color=MEASURED, lw=0.5)
    ax.set_ylabel("Force $F$ (N)")
    panels["motion"].set_xlabel("Time on the shot’s clock $t$ (ms)")


def on_one_clock(panels: Panels, *times: FloatArray) -> None:
    """Give force and motion a common time axis. A wrong clock is then visible."""
    time = MS * np.concatenate(times)
    for panel in (panels["force"], panels["motion"]):
        panel.set_xlim(time.min(), time.max())


@figure(
    PAGE,
    85.0,
    [["force", "outline"], ["motion", "outline"]],
    width_ratios=[1.35, 1.0],
    letters=("force", "motion", "outline"),
)
def checked_shot(shot: Shot, panels: Panels) -> str:
    draw_force(shot, panels)
    ax, low = panels["force"], panels["motion"]
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
    text = _caption_of_force(shot)
    moves = (
        "displacement of the flyer" if isinstance(shot.flyer, FlyerMotion) else "velocity of the front face"
    )
    text += (
        f". (b) The {moves} on the same clock: the force must begin when it does, or a wave’s travel later. "
        "Blue: the window that is simulated and compared."
    )
    if three_frames(shot):
        text += (
            " (c) The outline at three times, and the side of the declared specimen at rest (dashed), which "
            "the first must follow."
        )
    return text


def _draw_outline(shot: Shot, panels: Panels) -> None:
    """Draw the outline at three times with the declared specimen."""
    ax, line = panels["outline"], shot.centre_line
    if line is None or not three_frames(shot):
        note_empty(ax, "no outline was measured")
        return
    radius, length = MM * shot.specimen.radius, MM * shot.specimen.length
    ax.plot([0.0, radius, radius, 0.0], [0.0, 0.0, length, length], color=GREY, ls="--", lw=0.8)
    for colour, frame in zip(THREE_TIMES, three_frames(shot), strict=False):
        at = line.frame == frame
        when = f"{MS * float(line.time[at][0]):.3f} ms"
        ax.plot(MM * line.Z[at], MM * line.y[at], "o", ms=2.2, mew=0.0, color=colour, label=when)
    ax.set(xlabel="Distance from the axis $Z$ (mm)", ylabel="Height $y$ (mm)")
    ax.set_xlim(left=0.0)
    ax.margins(y=0.06)
    ax.legend(loc="center left")


@figure(COLUMN, 62.0, [["curve"]])
def checked_curve(shot: Shot | PicturedShot, panels: Panels) -> str:
    ax, curve = panels["curve"], shot.curve
    size = (-1.0 if curve.stretch[-1] < 1.0 else 1.0) * np.vstack([curve.stretch - 1.0, curve.stress])
    strain, stress, half = size[0], KPA * size[1], 2.0 * KPA * curve.total_sigma
    ax.fill_between(strain, stress - half, stress + half, color=BAND, alpha=0.4, lw=0.0)
    ax.plot(strain, stress, "o-", ms=2.2, mew=0.0, lw=0.8, color=MEASURED, label="quasi-static")
    other = curve.conditioned
    if other is not None:
        sign = -1.0 if other.stretch[-1] < 1.0 else 1.0
        ax.plot(sign * (other.stretch - 1.0), sign * KPA * other.stress, color=GREY, label="conditioned")
    side = "compressive" if curve.stretch[-1] < 1.0 else "tensile"
    ax.set(xlabel=f"Nominal {side} strain (–)", ylabel="Nominal stress (kPa)")
    text = f"Quasi-static curve with its ±2σ, as read: {curve.stretch.size} points."
    if isinstance(shot, Shot) and isinstance(shot.flyer, FlyerMotion):
        travelled, pressed = force_over_area(shot)
        ax.plot(travelled, KPA * pressed, color=FORCE, lw=0.6, label="this test: $F/A$")
        text += (
            " Orange: force over the specimen’s area against the flyer’s way over its length. Rate stiffens a"
            " soft material less than ten times; a thousand times is a wrong unit."
        )
    ax.legend(loc="upper left")
    return text


def force_over_area(shot: Shot) -> tuple[FloatArray, FloatArray]:
    """Return two quantities at the frames of the window: travel over length [-], and force over area [Pa].

    The travel is that of the flyer.
    """
    assert isinstance(shot.flyer, FlyerMotion)  # checked by the caller
    time = shot.flyer.time
    inside = (time >= shot.window[0]) & (time <= shot.window[1])
    zero = float(np.median(shot.flyer.displacement[time <= shot.window[0]]))
    force = np.interp(time[inside], shot.force.time, shot.force.raw_force())
    return (
        (shot.flyer.displacement[inside] - zero) / shot.specimen.length,
        force / (np.pi * shot.specimen.radius**2),
    )


@figure(
    PAGE,
    145.0,
    [["force"] * 3, ["motion"] * 3, list(FORCE_PLACES)],
    height_ratios=[1.0, 1.0, 1.5],
    letters=True,
)
def checked_pictures(shot: PicturedShot, panels: Panels) -> str:
    draw_force(shot, panels)
    low, changes = panels["motion"], shot.pictures.changes
    low.axvspan(MS * changes.time[0], MS * changes.rest_end, color=GREY, alpha=0.3, lw=0.0)
    for camera, (values, colour) in enumerate(zip(changes.change, (SHAPE, FORCE), strict=True)):
        low.plot(
            MS * changes.time, 100.0 * values, "o", ms=1.6, mew=0.0, color=colour, label=f"camera {camera}"
        )
    low.set_ylabel("Change (%)")
    low.legend(loc="upper left", markerscale=2.0)
    on_one_clock(panels, shot.force.time, changes.time)
    for name, (time, picture) in zip(FORCE_PLACES, changes.shown, strict=False):
        ax = panels[name]
        ax.imshow(picture, cmap="gray", vmin=0.0, vmax=1.0, interpolation="none")
        ax.set_title(f"{MS * time:.3f} ms".replace("-", "−"), loc="right", pad=2.5)
        ax.set_xlabel("$x$ (px)")
    for name in FORCE_PLACES[len(changes.shown) :]:
        note_empty(panels[name], "no picture")
    panels[FORCE_PLACES[0]].set_ylabel("$y$ (px)")
    return (
        f"{_caption_of_force(shot)}. (b) Mean difference of each picture from the first of its camera, in "
        "per cent of white, on the same clock; grey: the frames that are declared static, in which it is "
        "level. It must rise before the force does, or with it. (c), (d), (e) Camera 0 in the first frame, "
        "in the last static one, which must look alike, and in the last. Flyer and outline are not measured."
    )
