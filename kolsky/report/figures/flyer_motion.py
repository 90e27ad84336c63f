"""The flyer's displacement and velocity as the cameras saw them."""

import numpy as np

from kolsky.report.figures.base import COLUMN, GREY, MEASURED, MM, MS, SHAPE, UM, FigureKind, Panels, letter
from kolsky.report.view import SurfaceView


def caption(view: SurfaceView) -> str:
    """What is seen."""
    return (
        "Flyer. (a) Displacement toward the specimen, and (b) its difference quotients from frame to "
        "frame, both with ±2σ; grey: static frames. (c) Standard deviation of one displacement."
    )


def draw(view: SurfaceView, panels: Panels) -> None:
    """Draw displacement, difference quotients and sigma."""
    result, travel = view.result, view.result.axial_displacement
    assert travel is not None  # `applies`
    time = MS * travel.t
    for ax in panels.values():
        ax.axvspan(
            MS * result.t[0],
            MS * result.t[result.static].max(initial=result.t[0]),
            color=GREY,
            alpha=0.2,
            lw=0.0,
        )
    ax = panels["displacement"]
    ax.errorbar(
        time,
        MM * travel.displacement,
        yerr=2.0 * MM * travel.sigma,
        fmt="o",
        ms=1.5,
        mew=0.0,
        color=MEASURED,
        elinewidth=0.5,
    )
    ax.set_ylabel("Displacement (mm)")
    letter(ax, "a")
    ax = panels["velocity"]
    step = np.diff(travel.t)
    velocity = np.diff(travel.displacement) / step
    noise = np.hypot(travel.sigma[1:], travel.sigma[:-1]) / step
    ax.errorbar(
        0.5 * (time[1:] + time[:-1]),
        velocity,
        yerr=2.0 * noise,
        fmt="o",
        ms=1.5,
        mew=0.0,
        color=SHAPE,
        elinewidth=0.5,
    )
    ax.set_ylabel("Velocity (m/s)")
    letter(ax, "b")
    ax = panels["sigma"]
    ax.plot(time, UM * travel.sigma, color=MEASURED)
    ax.set_ylim(bottom=0.0)
    ax.set(xlabel="Time (ms)", ylabel="σ (µm)")
    letter(ax, "c")


KIND: FigureKind[SurfaceView] = FigureKind(
    name="flyer",
    width=COLUMN,
    height=lambda view: 105.0,
    caption=caption,
    panels=lambda view: [["displacement"], ["velocity"], ["sigma"]],
    draw=draw,
    mosaic={"sharex": True, "height_ratios": [1.2, 1.2, 0.7]},
    applies=lambda view: (
        view.result.axial_displacement is not None and view.result.axial_displacement.t.size > 2
    ),
)
