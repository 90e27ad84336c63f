"""Figures of measured points: on the images by uncertainty and epipolar error, and those lost."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from dic.outcome import FrameOutcome, PointOutcome
from kolsky.base.arrays import FloatArray
from kolsky.report.figures.base import (
    FORCE,
    GREY,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    label_panel,
    smooth_bar,
)
from kolsky.report.surface_view import SurfaceView

LOST = "#CC79A7"


def panels_of(view: SurfaceView) -> list[list[str]]:
    """Return one panel per picture."""
    return [[f"frame {k}" for k in range(max(len(view.pictures), 1))]]


def height_of(view: SurfaceView) -> float:
    """Return the height of a row of pictures with the legend below it [mm]."""
    if not view.pictures:
        return 30.0
    rows, columns = next(iter(view.pictures.values())).shape
    return float(np.clip((PAGE - 12.0) / len(view.pictures) * rows / columns + 21.0, 30.0, 230.0))


def frames_in(view: SurfaceView, panels: Panels) -> list[tuple[int, Axes]]:
    """Draw the pictures and return frame and panel of each."""
    drawn: list[tuple[int, Axes]] = []
    rates = {name: panel for name, panel in panels.items() if name.startswith("frame ")}
    for (frame, picture), ax, mark in zip(view.pictures.items(), rates.values(), "abcdefgh", strict=False):
        low, high = np.percentile(np.asarray(picture, dtype=np.float64), [0.5, 99.5])
        ax.imshow(picture, cmap="gray", vmin=low, vmax=max(high, low + 1), interpolation="none")
        ax.set_xlim(-0.5, picture.shape[1] - 0.5)
        ax.set_ylim(picture.shape[0] - 0.5, -0.5)
        ax.set_xlabel("$x$ (px)")
        if not drawn:
            ax.set_ylabel("$y$ (px)")
        else:
            ax.tick_params(labelleft=False)
        label_panel(ax, mark)
        ax.set_title(f"{MS * view.result.t[frame]:.3f} ms", loc="right", pad=2.5)
        drawn.append((frame, ax))
    return drawn


def marker(view: SurfaceView) -> float:
    """Return the size of markers that do not overlap [points]."""
    points = view.result.specimen.points
    if len(points) < 2 or not view.pictures:
        return 2.0
    step = float(np.min(np.diff(np.unique(points[:, 0]))) if np.unique(points[:, 0]).size > 1 else 5.0)
    columns = next(iter(view.pictures.values())).shape[1]
    width = (PAGE - 12.0) / len(view.pictures) * 72.0 / 25.4
    return float(np.clip(0.72 * step * width / columns, 0.5, 4.0))


def last_places(view: SurfaceView, frame: int) -> FloatArray:
    """Return the last places in camera 0 of the points that are lost in a frame [px], shape [n, 2]."""
    body = view.result.specimen
    lost = np.flatnonzero(~body.surface.valid[frame])
    seen = np.asarray(np.isfinite(body.pixels[0][: frame + 1, lost]).all(axis=2))
    last = frame - np.argmax(seen[::-1], axis=0)
    return np.asarray(body.pixels[0][last, lost][seen.any(axis=0)])


def caption_sigma(view: SurfaceView) -> str:
    """Return the caption."""
    return (
        "Camera 0 at some times, with the valid points of the specimen coloured by the larger of both "
        "cameras' "
        "standard deviations of their place; crosses: last places of the points that are lost at that time."
    )


def draw_sigma(view: SurfaceView, panels: Panels) -> None:
    """Draw the pictures, the points and one colour bar."""
    body = view.result.specimen
    drawn = frames_in(view, panels)
    if not drawn:
        return
    sigma = np.fmax(*body.match_sigma)
    shown = np.concatenate([sigma[frame][body.surface.valid[frame]] for frame, _ in drawn])
    low, high = (0.0, 1.0) if shown.size == 0 else np.percentile(shown, [1.0, 99.0])
    size = marker(view)
    points: Any = None
    for frame, ax in drawn:
        valid = body.surface.valid[frame]
        x, y = body.pixels[0][frame, valid].T
        points = ax.scatter(
            x,
            y,
            c=sigma[frame, valid],
            s=size**2,
            vmin=low,
            vmax=max(high, low * 1.01),
            cmap="plasma",
            lw=0.0,
        )
        lost = last_places(view, frame)
        ax.plot(*lost.T, "x", color=LOST, ms=size, mew=0.5, clip_on=True)
    figure = drawn[0][1].figure
    bar = figure.colorbar(  # type: ignore[union-attr]
        points, ax=[ax for _, ax in drawn], location="bottom", shrink=0.5, aspect=45, pad=0.02, extend="both"
    )
    bar.set_label("Standard deviation of a match (px)")
    bar.locator = MaxNLocator(6)
    bar.update_ticks()
    smooth_bar(bar)


STEPS = (0.05, 0.1)
"""Epipolar distances at which the colour changes [px]."""
EPIPOLAR_COLOURS = (SHAPE, FORCE, MODEL)
"""Colours below, between and above the steps."""


def caption_epipolar(view: SurfaceView) -> str:
    """Return the caption."""
    body = view.result.specimen
    size = np.abs(body.epipolar[body.surface.valid])
    low, high = (100.0 * float(np.mean(size > step)) if size.size else 0.0 for step in STEPS)
    return (
        "Camera 0 at some times, with the valid points of the specimen coloured by the distance of camera "
        "1's point from the epipolar line. Over all frames its rms is "
        f"{body.epipolar_rms:.3f} px; {low:.2g} % of the points exceed {STEPS[0]:g} px, {high:.2g} % exceed "
        f"{STEPS[1]:g} px. Crosses: last places of the points that are lost at that time."
    )


def draw_epipolar(view: SurfaceView, panels: Panels) -> None:
    """Draw the pictures, the points and one legend."""
    body, size = view.result.specimen, marker(view)
    drawn = frames_in(view, panels)
    for frame, ax in drawn:
        valid = body.surface.valid[frame]
        kind = np.searchsorted(STEPS, np.abs(body.epipolar[frame, valid]))
        places = body.pixels[0][frame, valid]
        for number, colour in enumerate(EPIPOLAR_COLOURS):
            ax.plot(*places[kind == number].T, "o", color=colour, ms=size, mew=0.0)
        ax.plot(*last_places(view, frame).T, "x", color=LOST, ms=size, mew=0.5)
    names = (f"below {STEPS[0]:g} px", f"{STEPS[0]:g} to {STEPS[1]:g} px", f"above {STEPS[1]:g} px")
    handles = [
        *(
            Line2D([], [], marker="o", ls="", color=c, ms=3.5, label=n)
            for c, n in zip(EPIPOLAR_COLOURS, names, strict=True)
        ),
        Line2D([], [], marker="x", ls="", color=LOST, ms=3.5, label="lost"),
    ]
    if drawn:
        drawn[0][1].figure.legend(
            handles=handles, loc="outside lower center", ncols=4, title="Epipolar distance"
        )


OUTCOME_COLOURS = {
    PointOutcome.OUT_OF_VIEW: "#56B4E9",
    PointOutcome.LOW_CONTRAST: "#F0E442",
    PointOutcome.NOT_CONVERGED: "#E69F00",
    PointOutcome.LOW_CORRELATION: "#D55E00",
    PointOutcome.STEREO_MISMATCH: "#CC79A7",
    PointOutcome.NO_FIRST_GUESS: "#000000",
    PointOutcome.AT_END: "#0072B2",
    PointOutcome.OFF_SURFACE: "#009E73",
}


def words(outcome: PointOutcome | FrameOutcome) -> str:
    """Return an outcome in words, e.g. "low correlation"."""
    return outcome.name.lower().replace("_", " ")


def caption_lost(view: SurfaceView) -> str:
    """Return the caption."""
    return (
        "(a) Share of the frames in which each point of the specimen was found, at its place in the first "
        "picture of camera 0. (b) Points of the specimen that were not found, by outcome; grey bands: frames "
        "of which a picture could not be used."
    )


def draw_lost(view: SurfaceView, panels: Panels) -> None:
    """Draw the map and the history."""
    body, result = view.result.specimen, view.result
    ax = panels["map"]
    share = body.surface.valid.mean(axis=0)
    points = ax.scatter(
        body.points[:, 0],
        body.points[:, 1],
        c=100.0 * share,
        s=9.0,
        vmin=0.0,
        vmax=100.0,
        cmap="cividis",
        lw=0.0,
    )
    ax.set_aspect("equal")
    ax.invert_yaxis()
    ax.set(xlabel="$x$ (px)", ylabel="$y$ (px)")
    bar = ax.figure.colorbar(points, ax=ax, aspect=25, pad=0.02)  # type: ignore[union-attr]
    bar.set_label("Frames with the point (%)")
    smooth_bar(bar)
    label_panel(ax, "a")

    ax = panels["history"]
    time = MS * result.t
    half = 0.5 * float(np.median(np.diff(time)))
    for frame in np.flatnonzero(result.outcome != FrameOutcome.VALID):
        ax.axvspan(time[frame] - half, time[frame] + half, color=GREY, alpha=0.35, lw=0.0)
    between = 0.5 * (time[1:] + time[:-1])
    edges = np.concatenate([[time[0] - half], between, [time[-1] + half]])
    bottom, usable = np.zeros(time.size), result.outcome == FrameOutcome.VALID
    found = body.outcomes()
    for outcome, colour in OUTCOME_COLOURS.items():
        if outcome not in found:
            continue
        count = np.where(usable, np.sum(body.surface.outcome == outcome, axis=1), 0.0)
        ax.stairs(
            bottom + count, edges, baseline=bottom, fill=True, color=colour, label=words(outcome), lw=0.0
        )
        bottom += count
    ax.set(
        xlabel="Time (ms)",
        ylabel=f"Points lost, of {body.surface.n_points}",
        xlim=(time[0] - half, time[-1] + half),
    )
    ax.set_ylim(0.0, max(1.25 * bottom.max(), 1.0))
    if bottom.any():
        ax.legend(loc="upper left")
    else:
        ax.text(0.5, 0.5, "none was lost", transform=ax.transAxes, ha="center", color=GREY)
    label_panel(ax, "b")


FIGURES: tuple[FigureKind[SurfaceView], ...] = (
    FigureKind(
        name="overlay-sigma",
        width=PAGE,
        height=height_of,
        caption=caption_sigma,
        panels=panels_of,
        draw=draw_sigma,
        applies=lambda view: bool(view.pictures),
    ),
    FigureKind(
        name="overlay-epipolar",
        width=PAGE,
        height=height_of,
        caption=caption_epipolar,
        panels=panels_of,
        draw=draw_epipolar,
        applies=lambda view: bool(view.pictures),
    ),
    FigureKind(
        name="lost-points",
        width=PAGE,
        height=lambda view: 62.0,
        caption=caption_lost,
        panels=lambda view: [["map", "history"]],
        draw=draw_lost,
        mosaic={"width_ratios": [1.0, 1.35]},
    ),
)
