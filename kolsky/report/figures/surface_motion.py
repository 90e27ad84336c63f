"""Figures of measured motion: kymograph of the outline, displacement and flight of the flyer."""

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection

from kolsky.bars.flyer.flight import FlightOfSpecimen
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    DOTS,
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    UM,
    Panels,
    colour_bar,
    figure,
)
from kolsky.report.picture_views import SurfaceView


@figure(
    PAGE,
    68.0,
    [["picture", "radius"]],
    applies=lambda view: view.result.centre.Z.size > 0 and view.kymograph.size > 0,
    letters=True,
)
def kymograph(view: SurfaceView, panels: Panels) -> str:
    result, body = view.result, view.result.specimen
    time = MS * result.t
    half = 0.5 * float(np.median(np.diff(time)))
    ax = panels["picture"]
    rows = view.kymograph.shape[0]
    greys = view.kymograph[np.isfinite(view.kymograph)]
    low, high = np.percentile(greys, [0.5, 99.5]) if greys.size else (0.0, 1.0)
    style: dict[str, Any] = {"cmap": "gray", "vmin": low, "vmax": max(high, low + 1.0)}
    extent = (time[0] - half, time[-1] + half, rows - 0.5, -0.5)
    ax.imshow(view.kymograph, aspect="auto", interpolation="none", extent=extent, **style)
    middle = np.abs(body.surface.X[:, 0])
    column = body.cell[np.argmin(middle), 0]
    for point in np.flatnonzero(body.cell[:, 0] == column):
        ax.plot(time, body.pixels[0][:, point, 1], color=MODEL, lw=0.5)
    ax.set(xlabel="Time (ms)", ylabel="Row of camera 0 (px)")
    ax.set_ylim(rows - 0.5, -0.5)

    ax, line = panels["radius"], result.centre
    corners, radii = [], []
    for frame in np.unique(line.frame):
        of = line.frame == frame
        y, Z = MM * line.y[of], MM * line.Z[of]
        if y.size < 2:
            continue
        # Each point represents the heights half-way to its neighbours.
        between = 0.5 * (y[1:] + y[:-1])
        edges = np.concatenate([[2.0 * y[0] - between[0]], between, [2.0 * y[-1] - between[-1]]])
        left, right = (np.full(y.size, time[frame] + side) for side in (-half, half))
        low, high = edges[:-1], edges[1:]
        corners.append(np.stack([left, low, right, low, right, high, left, high], axis=1).reshape(-1, 4, 2))
        radii.append(Z)
    ax.set(xlabel="Time (ms)", ylabel="Height $y$ (mm)", xlim=(time[0] - half, time[-1] + half))
    if corners:
        style = {"cmap": "viridis", "lw": 0.0, "antialiased": False, "rasterized": True}
        colours = PolyCollection(list(np.concatenate(corners)), array=np.concatenate(radii), **style)
        ax.add_collection(colours)
        ax.autoscale_view(scalex=False)
        colour_bar(colours, ax, "Radius $Z$ (mm)", aspect=25, pad=0.02)
    return (
        "Kymograph of the outline (x = 0). (a) Its column in the pictures of camera 0 through time, and the "
        "rows in which the points nearest to it were found. (b) Measured radius Z at height y above the "
        "transmission platen; white: no valid point."
    )


@figure(
    COLUMN,
    105.0,
    [["displacement"], ["velocity"], ["sigma"]],
    applies=lambda view: (
        view.result.axial_displacement is not None and view.result.axial_displacement.t.size > 2
    ),
    sharex=True,
    height_ratios=[1.2, 1.2, 0.7],
    letters=True,
)
def flyer(view: SurfaceView, panels: Panels) -> str:
    result, travel = view.result, view.result.axial_displacement
    assert travel is not None  # checked by `applies`
    time = MS * travel.t
    end = MS * result.t[result.static].max(initial=result.t[0])
    for ax in panels.values():
        ax.axvspan(MS * result.t[0], end, color=GREY, alpha=0.2, lw=0.0)
    ax = panels["displacement"]
    ax.errorbar(time, MM * travel.displacement, yerr=2.0 * MM * travel.sigma, color=MEASURED, **DOTS)
    ax.set_ylabel("Displacement (mm)")
    ax = panels["velocity"]
    step = np.diff(travel.t)
    velocity = np.diff(travel.displacement) / step
    noise = np.hypot(travel.sigma[1:], travel.sigma[:-1]) / step
    ax.errorbar(0.5 * (time[1:] + time[:-1]), velocity, yerr=2.0 * noise, color=SHAPE, **DOTS)
    ax.set_ylabel("Velocity (m/s)")
    ax = panels["sigma"]
    ax.plot(time, UM * travel.sigma, color=MEASURED)
    ax.set_ylim(bottom=0.0)
    ax.set(xlabel="Time (ms)", ylabel="σ (µm)")
    return (
        "Flyer. (a) Displacement toward the specimen, and (b) its difference quotients from frame to "
        "frame, both with ±2σ; grey: static frames. (c) Standard deviation of one displacement."
    )


COVERAGE = 2.0
"""Half width of the bands in standard uncertainties."""


@figure(
    COLUMN,
    130.0,
    [["motion"], ["angle"], ["tilt"]],
    applies=lambda view: isinstance(view.flight, FlightOfSpecimen),
    letters=True,
)
def flight(view: SurfaceView, panels: Panels) -> str:
    result = view.flight
    assert isinstance(result, FlightOfSpecimen)  # checked by `applies`
    t, path = result.time, result.flight.toward
    ms = MS * t
    ax = panels["motion"]
    rate, spread = path.velocity(t) / result.length, path.sigma_velocity(t) / result.length
    ax.fill_between(ms, rate - COVERAGE * spread, rate + COVERAGE * spread, color=BAND, alpha=0.5, lw=0.0)
    ax.plot(ms, rate, color=SHAPE, label="strain rate")
    ax.set_ylabel("Nominal strain rate (1/s)")
    ax.set_ylim(0.0, 1.25 * float(rate.max()))
    strain = ax.twinx()
    strain.plot(ms, path.position(t) / result.length, "--", color=MODEL, label="strain")
    strain.set_ylabel("Nominal strain (1)")
    strain.set_ylim(0.0, 1.0)
    strain.tick_params(axis="x", labelbottom=False)
    lines = [*ax.get_lines(), *strain.get_lines()]
    ax.legend(lines, [str(line.get_label()) for line in lines], loc="upper left", ncols=2)

    ax = panels["angle"]
    known = result.known
    angle, spread = (np.degrees(values[known]) for values in result.flight.orientation(t))
    low, high = np.maximum(angle - COVERAGE * spread, 0.0), angle + COVERAGE * spread
    ax.fill_between(ms[known], low, high, color=BAND, alpha=0.5, lw=0.0)
    ax.plot(ms[known], angle, color=MEASURED)
    firm = high[spread < np.degrees(0.1)]
    ax.set_ylim(0.0, 1.1 * float(firm.max() if firm.size else 90.0) + 0.2)
    ax.set_ylabel(r"Angle $\varphi$ (°)")

    ax = panels["tilt"]
    tilt, spread = (values[known] for values in result.flight.tilt(t))
    for k, (name, colour, style) in enumerate((("about $x$", SHAPE, "-"), ("about $Z$", MODEL, "--"))):
        low, high = (1e3 * (tilt[:, k] + side * COVERAGE * spread[:, k]) for side in (-1.0, 1.0))
        ax.fill_between(ms[known], low, high, color=colour, alpha=0.2, lw=0.0)
        ax.plot(ms[known], 1e3 * tilt[:, k], style, color=colour, label=name)
    ax.set(xlabel="Time (ms)", ylabel="Rotation (mrad)")
    ax.margins(y=0.25)  # room for the legend
    ax.legend(loc="lower left", ncols=2)
    for name, ax in panels.items():
        ax.set_xlim(ms[0], ms[-1])
        if name != "tilt":
            ax.tick_params(labelbottom=False)
        if result.end is not None:
            ax.axvline(MS * result.end, color=MEASURED, ls=":")
    text = (
        "(a) Nominal strain of the specimen and its rate, from the flyer's path. (b) Angle between the "
        "flyer's velocity and the compression axis. (c) Rotation of the flyer about x and Z. Bands: two "
        "standard uncertainties."
    )
    return text if result.end is None else f"{text} Dotted: symmetry ends."
