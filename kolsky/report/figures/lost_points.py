"""Which points were lost, when and why."""

import numpy as np

from dic.outcome import FrameOutcome, PointOutcome
from kolsky.report.figures.base import GREY, MS, PAGE, FigureKind, Panels, letter, smooth_bar
from kolsky.report.view import SurfaceView

COLOURS = {
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
    """An outcome as a reader wants it, e.g. "low correlation"."""
    return outcome.name.lower().replace("_", " ")


def caption(view: SurfaceView) -> str:
    """What is seen."""
    return (
        "(a) Share of the frames in which each point of the specimen was found, at its place in the first "
        "picture of camera 0. (b) Points of the specimen that were not found, by outcome; grey bands: frames "
        "of which a picture could not be used."
    )


def draw(view: SurfaceView, panels: Panels) -> None:
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
    letter(ax, "a")

    ax = panels["history"]
    time = MS * result.t
    half = 0.5 * float(np.median(np.diff(time)))
    for frame in np.flatnonzero(result.outcome != FrameOutcome.VALID):
        ax.axvspan(time[frame] - half, time[frame] + half, color=GREY, alpha=0.35, lw=0.0)
    between = 0.5 * (time[1:] + time[:-1])
    edges = np.concatenate([[time[0] - half], between, [time[-1] + half]])
    bottom, usable = np.zeros(time.size), result.outcome == FrameOutcome.VALID
    found = body.outcomes()
    for outcome, colour in COLOURS.items():
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
    letter(ax, "b")


KIND: FigureKind[SurfaceView] = FigureKind(
    name="lost-points",
    width=PAGE,
    height=lambda view: 62.0,
    caption=caption,
    panels=lambda view: [["map", "history"]],
    draw=draw,
    mosaic={"width_ratios": [1.0, 1.35]},
)
