"""Figures of a simulated shot: comparison with force and outline, residuals, and fields."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kolsky.inverse.result import FORCE as FORCE_CHANNEL
from kolsky.inverse.result import NOISE, OUTLINE, Identification, worst_imbalance
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    DOTS,
    FORCE,
    GREEN,
    GREY,
    MEASURED,
    MJ,
    MM,
    MODEL,
    MS,
    PAGE,
    PAPER,
    SHAPE,
    UM,
    YELLOW,
    Cells,
    Panels,
    colour_bar,
    figure,
    largest,
    note_empty,
)
from kolsky.report.scene.drawing import draw_cut, evenly_spaced
from kolsky.report.scene.scene_data import FIELDS, has_scene, scene_of
from kolsky.results.numbers import percent, plain

RIGHT = "correct model, k = 2"
"""Label of the band of the residual of a correct model."""


def right_model(result: Identification, channel: str) -> str:
    """Return the sentence of a caption that explains the band of a channel's residual."""
    fit = next((one for one in result.fit if one.channel == channel), None)
    if fit is None:
        return "The band is k = 2 of the measured noise alone: the goodness of fit was not recorded."
    others = [source for source in fit.predicted if source != NOISE]
    added = f" with the root mean square left by {', '.join(others)}" if others else ""
    limit = f"limit {plain(fit.limit, 2)}" if np.isfinite(fit.limit) else "no limit"
    return (
        f"The band is the residual expected of a correct model, k = 2: the noise of each value{added}. The "
        "verdict "
        f"compares the residual with the same spread: {plain(fit.excess, 2)} of it, {limit}."
    )


@figure(
    COLUMN,
    68.0,
    [["force"], ["residual"]],
    applies=lambda result: result.comparison.force_time.size > 0,
    sharex=True,
    height_ratios=[1.7, 1.0],
)
def force(result: Identification, panels: Panels) -> str:
    c = result.comparison
    time = MS * c.force_time
    top, low = panels["force"], panels["residual"]
    top.plot(MS * c.recorded.time, c.recorded.force, color=GREY, lw=0.3, alpha=0.6, label="recorded")
    top.plot(time, c.force_measured, "o", color=MEASURED, ms=1.6, mew=0.0, label="bin means")
    top.plot(time, c.force_model, color=MODEL, label="simulated")
    top.set_ylabel("Force $F$ (N)")
    top.legend(loc="upper left")

    band = 2.0 * result.spread(FORCE_CHANNEL)
    low.fill_between(time, -band, band, color=BAND, alpha=0.4, lw=0.0, label=RIGHT)
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, c.force_model - c.force_measured, color=MODEL, lw=0.8)
    low.set(xlabel="Time $t$ (ms)", ylabel=r"$F_\mathrm{sim} - F_\mathrm{meas}$ (N)")
    low.legend(loc="lower left", ncols=2)
    if time.size > 1:
        half = 0.5 * (time[1] - time[0])
        low.set_xlim(time[0] - half, time[-1] + half)
    low.margins(y=0.25)
    return (
        "Force on the transmission platen: every recorded sample, means over bins and the simulation at the "
        "optimum (top); simulated minus measured force of each bin (bottom). Compression is positive. "
        + right_model(result, FORCE_CHANNEL)
    )


def _has_outline(result: Identification) -> bool:
    return result.comparison.centre_line.time.size > 0


@figure(COLUMN, 68.0, [["outline"], ["residual"]], applies=_has_outline, height_ratios=[1.7, 1.0])
def outline(result: Identification, panels: Panels) -> str:
    c, line = result.comparison, result.comparison.centre_line
    top, low = panels["outline"], panels["residual"]
    for frame, style in zip(chosen_frames(result)[1::2], (":", "--", "-"), strict=False):
        rows = np.flatnonzero(line.frame == frame)
        rows = rows[np.argsort(line.y[rows], kind="stable")]
        y = MM * line.y[rows]
        time = f"{MS * line.time[rows[0]]:.2f} ms"
        top.plot(y, MM * c.Z_model[rows], style, color=MODEL, label=f"simulated, {time}")
        top.plot(y, MM * line.Z[rows], "o", color=MEASURED, ms=1.6, mew=0.0, label=f"_measured, {time}")
    top.set(xlabel="Height $y$ (mm)", ylabel="Outline $Z$ (mm)")
    top.legend(loc="upper right")

    left_over, spread = UM * (c.Z_model - line.Z), UM * result.spread(OUTLINE)
    counted = c.inside & np.isfinite(left_over)
    frames = [counted & (line.frame == frame) for frame in np.unique(line.frame[counted])]
    times = np.array([MS * line.time[rows][0] for rows in frames])
    band = np.array([2.0 * np.sqrt(np.mean(spread[rows] ** 2)) for rows in frames])
    ends = np.array([np.percentile(left_over[rows], [2.5, 50.0, 97.5]) for rows in frames]).reshape(-1, 3)
    low.fill_between(times, -band, band, color=BAND, alpha=0.4, lw=0.0, label=RIGHT)
    low.axhline(0.0, color=GREY, lw=0.5)
    low.vlines(times, ends[:, 0], ends[:, 2], color=MODEL, lw=0.4, alpha=0.6)
    low.plot(times, ends[:, 1], color=MODEL, lw=0.8)
    low.set(xlabel="Time $t$ (ms)", ylabel=r"$\Delta Z$ (µm)")
    low.legend(loc="lower left")
    if times.size > 1:
        low.set_xlim(times[0], times[-1])
    else:
        note_empty(low, "fewer than two simulated outlines")
    low.margins(y=0.25)
    return (
        "Outline on the camera side over the height above the transmission platen at three times, measured "
        "(points) and simulated (lines, top); ΔZ, simulated minus measured Z of each frame: median (line) "
        "and the middle 95 % of its points (bars, bottom). " + right_model(result, OUTLINE)
    )


def cells(time: NDArray[np.float64], frame: NDArray[np.int64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rectangles half-way to the neighbours in time and height, shape [n, 4, 2], in the given units."""
    frames, first = np.unique(frame, return_index=True)
    step = float(np.median(np.diff(time[first]) / np.diff(frames))) if frames.size > 1 else 1e-5
    corners = np.empty((time.size, 4, 2))
    for number in frames:
        rows = np.flatnonzero(frame == number)
        rows = rows[np.argsort(y[rows])]
        gaps = np.diff(y[rows]) if rows.size > 1 else np.array([0.1 * abs(y[rows[0]])])
        low = y[rows] - 0.5 * np.concatenate([gaps[:1], gaps])
        high = y[rows] + 0.5 * np.concatenate([gaps, gaps[-1:]])
        if rows.size == 1:
            low, high = low[:1], high[:1]
        left, right = time[rows] - 0.5 * step, time[rows] + 0.5 * step
        loop = ((left, low), (right, low), (right, high), (left, high))
        corners[rows] = np.stack([np.stack(corner, axis=-1) for corner in loop], axis=1)
    return corners


@figure(COLUMN, 62.0, [["map"]], applies=_has_outline)
def shape_residual(result: Identification, panels: Panels) -> str:
    c, line, response, ax = result.comparison, result.comparison.centre_line, result.response, panels["map"]
    ax.set(xlabel="Time $t$ (ms)", ylabel="Height $y$ (mm)")
    left_over = UM * (c.Z_model - line.Z)
    inside = c.inside & np.isfinite(left_over)
    limit = float(np.percentile(np.abs(left_over[inside]), 99.0)) if inside.any() else 1.0
    corners: Any = cells(MS * line.time, line.frame, MM * line.y)[inside]
    # Edges in the colour of the face: without them, viewers show white seams between the cells.
    mapped = Cells(corners, array=left_over[inside], cmap="RdBu_r", edgecolors="face", linewidths=0.1)
    mapped.set_clim(-limit, limit)
    ax.add_collection(mapped)
    if not inside.any():
        note_empty(ax, "no simulated outline")
    if (~c.inside).any() and inside.any():
        ax.plot(MS * line.time[~c.inside], MM * line.y[~c.inside], "x", color=MEASURED, ms=1.6, mew=0.4)
    for end in (np.min, np.max):
        ax.plot(MS * response.surface_times, MM * end(response.surface_y[0], axis=1), color=MEASURED, lw=0.7)
    if line.time.size:
        ax.set_xlim(MS * line.time.min(), MS * line.time.max())
    ax.set_ylim(0.0, 1.03 * MM * max(largest(line.y, 1e-3), largest(response.surface_y, 1e-3)))
    colour_bar(mapped, ax, r"$Z_\mathrm{sim} - Z_\mathrm{meas}$ (µm)", extend="both", pad=0.02)
    outside = int((~result.comparison.inside).sum())
    counted = f"{outside} point{'' if outside == 1 else 's'} outside the model’s range"
    marks = f"crosses: {counted}, not counted" if outside else f"{counted}"
    return (
        "Simulated minus measured Z over height and time, one cell a measured point; the colour scale ends "
        f"at the 99th percentile of its size. Lines: the ends of the simulated specimen; {marks}."
    )


OUTLINES = 6


def chosen_frames(result: Identification) -> NDArray[np.int64]:
    """Frame numbers at equal distances through the window, with the last one, shape [<= 6]."""
    frames = np.unique(result.comparison.centre_line.frame)
    if frames.size <= OUTLINES:
        return frames
    return frames[np.round(np.arange(1, OUTLINES + 1) * (frames.size - 1) / OUTLINES).astype(int)]


@figure(
    PAGE,
    105.0,
    [[f"{row} {column}" for column in range(OUTLINES)] for row in ("outline", "residual")],
    applies=_has_outline,
    sharey=True,
    height_ratios=[1.25, 1.0],
    letters=[f"outline {column}" for column in range(OUTLINES)],
)
def profiles(result: Identification, panels: Panels) -> str:
    c, line, response = result.comparison, result.comparison.centre_line, result.response
    frames = chosen_frames(result)
    left_over = UM * (c.Z_model - line.Z)
    radii = MM * np.concatenate([line.Z, c.Z_model[c.inside]])
    limits = (radii.min() - 0.3, radii.max() + 0.3) if radii.size else (0.0, 1.0)
    band = 2.0 * UM * result.spread(OUTLINE)
    reach = 1.15 * largest((np.abs(left_over) + band)[np.isin(line.frame, frames)])
    for column in range(OUTLINES):
        top, low = panels[f"outline {column}"], panels[f"residual {column}"]
        top.set_xlabel("$Z$ (mm)")
        low.set_xlabel(r"$\Delta Z$ (µm)")
        top.set_xlim(*limits)
        low.axvline(0.0, color=GREY, lw=0.5)
        low.set_xlim(-reach, reach)
        if column == 0:
            top.set_ylabel("Height $y$ (mm)")
            low.set_ylabel("Height $y$ (mm)")
        if column >= frames.size:
            continue
        rows = line.frame == frames[column]
        time = line.time[rows][0]
        top.text(0.95, 0.965, f"{MS * time:.2f} ms", transform=top.transAxes, ha="right", va="top")
        # The model's outline was sampled at the times of the frames; it is drawn only at these times.
        nearest = int(np.argmin(np.abs(response.surface_times - time)))
        if abs(response.surface_times[nearest] - time) < 1e-9:
            r, y = response.surface_r[0, nearest], response.surface_y[0, nearest]
            top.plot(MM * r, MM * y, color=MODEL, label="simulated")
        else:
            order = np.argsort(line.y[rows])
            top.plot(MM * c.Z_model[rows][order], MM * line.y[rows][order], color=MODEL, label="simulated")
        y = MM * line.y[rows]
        top.errorbar(
            MM * line.Z[rows], y, xerr=2.0 * MM * line.sigma[rows], label="measured", color=MEASURED, **DOTS
        )
        order = np.argsort(y)
        low.fill_betweenx(y[order], -band[rows][order], band[rows][order], color=BAND, alpha=0.4, lw=0.0)
        low.plot(left_over[rows], y, "o", color=MEASURED, ms=1.6, mew=0.0)
    # The specimen is shortest in the last picture: that panel has free space above it.
    panels[f"outline {max(frames.size, 1) - 1}"].legend(loc="upper right", bbox_to_anchor=(1.0, 0.9))
    return (
        "Outline of the specimen on the camera side at six times: measured points with ±2σ of their noise "
        "and the simulated side surface (top); ΔZ, simulated minus measured Z of the same points, and the "
        "band of the residual expected of a correct model, k = 2 (bottom). y is the height above the "
        "transmission platen."
    )


PARTS = {
    "elastic": SHAPE,
    "kinetic": BAND,
    "damping": FORCE,
    "viscous": GREY,
    "friction": PAPER,
    "hourglass": YELLOW,
    "hourglass_damping": MODEL,
    "impact": GREEN,
}


@figure(COLUMN, 78.0, [["ledger"], ["residual"]], sharex=True, height_ratios=[2.8, 1.0])
def energy(result: Identification, panels: Panels) -> str:
    ledger, time = result.response.energy, MS * result.response.surface_times
    top, low = panels["ledger"], panels["residual"]
    scale = largest(ledger.external[0])
    # most tests have no relaxation; a part of zero is left out of the legend
    parts = [name for name in PARTS if name != "viscous" or (np.abs(ledger.viscous[0]) > 0.0).any()]
    shares = [largest(getattr(ledger, name)[0], default=0.0) / scale for name in parts]
    labels = [
        f"{name.replace('_', ' ')}, {percent(share)}" for name, share in zip(parts, shares, strict=True)
    ]
    stack = [MJ * getattr(ledger, name)[0] for name in parts]
    ended = np.isfinite(ledger.external[0])
    if not ended.any():
        note_empty(top, "no simulation completed")
    colours = [PARTS[name] for name in parts]
    top.stackplot(time[ended], [part[ended] for part in stack], labels=labels, colors=colours, lw=0.0)
    top.plot(time, MJ * ledger.external[0], color=MEASURED, lw=0.8, label="work of the platens")
    top.set_ylabel("Energy $W$ (mJ)")
    if ended.any():
        top.legend(loc="upper left", reverse=True)
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, 100.0 * ledger.residual[0] / scale, color=MEASURED, lw=0.8)
    low.set(xlabel="Time $t$ (ms)", ylabel="Residual (%)")
    if time.size:
        low.set_xlim(time[0], time[-1])
    low.margins(y=0.2)
    worst = percent(worst_imbalance(result.response))
    return (
        "Energy ledger of the check run: the work of both platens (line) and the energies into which it "
        "is divided (areas, stacked), and the share that is not accounted for, over the largest work; "
        f"its largest size is {worst}. The legend gives each part’s largest share of that work."
    )


STILLS = 3
"""Number of pictures of the specimen."""


@figure(PAGE, 42.0, [[f"scene {column}" for column in range(STILLS)]], applies=has_scene)
def scene(result: Identification, panels: Panels) -> str:
    stage = scene_of(result, chosen=lambda n: evenly_spaced(n, STILLS))
    axes = [panels[f"scene {column}"] for column in range(STILLS)]
    for k, (ax, time) in enumerate(zip(axes, stage.times, strict=False)):
        drawn = draw_cut(ax, stage, k)
        ax.set_xlabel(f"$r$ (mm) at {MS * time:.2f} ms")
    axes[0].set_ylabel("$y$ (mm)")
    colour_bar(drawn, axes, FIELDS[stage.field].label, location="bottom", aspect=50, shrink=0.5)
    return (
        "The check run, cut along the axis, between the platens, coloured by the smallest principal stretch. "
        "Points: the measured outline in the nearest frame, on both sides."
    )
