"""Figures of measured motion: kymograph of the outline, displacement and flight of the flyer."""

import numpy as np
from matplotlib.collections import PolyCollection

from kolsky.bars.flyer.flight import FlightOfSpecimen
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    UM,
    FigureKind,
    Panels,
    label_panel,
    smooth_bar,
)
from kolsky.report.picture_views import SurfaceView


def _caption_kymograph(view: SurfaceView) -> str:
    """Return the caption."""
    return (
        "Kymograph of the outline (x = 0). (a) Its column in the pictures of camera 0 through time, and the "
        "rows in which the points nearest to it were found. (b) Measured radius Z at height y above the "
        "transmission platen; white: no valid point."
    )


def _draw_kymograph(view: SurfaceView, panels: Panels) -> None:
    """Draw the column of all pictures, and the radius over height and time."""
    result, body = view.result, view.result.specimen
    time = MS * result.t
    half = 0.5 * float(np.median(np.diff(time)))
    ax = panels["picture"]
    rows = view.kymograph.shape[0]
    seen = view.kymograph[np.isfinite(view.kymograph)]
    low, high = np.percentile(seen, [0.5, 99.5]) if seen.size else (0.0, 1.0)
    ax.imshow(
        view.kymograph,
        cmap="gray",
        vmin=low,
        vmax=max(high, low + 1.0),
        aspect="auto",
        interpolation="none",
        extent=(time[0] - half, time[-1] + half, rows - 0.5, -0.5),
    )
    middle = np.abs(body.surface.X[:, 0])
    column = body.cell[np.argmin(middle), 0]
    for point in np.flatnonzero(body.cell[:, 0] == column):
        ax.plot(time, body.pixels[0][:, point, 1], color=MODEL, lw=0.5)
    ax.set(xlabel="Time (ms)", ylabel="Row of camera 0 (px)")
    ax.set_ylim(rows - 0.5, -0.5)
    label_panel(ax, "a")

    ax, line = panels["radius"], result.centre
    corners, radii = [], []
    for frame in np.unique(line.frame):
        of = line.frame == frame
        y, Z = MM * line.y[of], MM * line.Z[of]
        if y.size < 2:
            continue
        # Each point stands for the height half-way to its neighbours.
        between = 0.5 * (y[1:] + y[:-1])
        edges = np.concatenate([[2.0 * y[0] - between[0]], between, [2.0 * y[-1] - between[-1]]])
        left, right = (np.full(y.size, time[frame] + side) for side in (-half, half))
        low, high = edges[:-1], edges[1:]
        corners.append(np.stack([left, low, right, low, right, high, left, high], axis=1).reshape(-1, 4, 2))
        radii.append(Z)
    ax.set(xlabel="Time (ms)", ylabel="Height $y$ (mm)", xlim=(time[0] - half, time[-1] + half))
    if corners:
        colours = PolyCollection(
            list(np.concatenate(corners)),
            array=np.concatenate(radii),
            cmap="viridis",
            lw=0.0,
            antialiased=False,
            rasterized=True,
        )
        ax.add_collection(colours)
        ax.autoscale_view(scalex=False)
        bar = ax.figure.colorbar(colours, ax=ax, aspect=25, pad=0.02)  # type: ignore[union-attr]
        bar.set_label("Radius $Z$ (mm)")
        smooth_bar(bar)
    label_panel(ax, "b")


def _caption_flyer(view: SurfaceView) -> str:
    """Return the caption."""
    return (
        "Flyer. (a) Displacement toward the specimen, and (b) its difference quotients from frame to "
        "frame, both with ±2σ; grey: static frames. (c) Standard deviation of one displacement."
    )


def _draw_flyer(view: SurfaceView, panels: Panels) -> None:
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
    label_panel(ax, "a")
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
    label_panel(ax, "b")
    ax = panels["sigma"]
    ax.plot(time, UM * travel.sigma, color=MEASURED)
    ax.set_ylim(bottom=0.0)
    ax.set(xlabel="Time (ms)", ylabel="σ (µm)")
    label_panel(ax, "c")


COVERAGE = 2.0
"""Half width of the bands in standard uncertainties."""


def _caption_flight(shown: FlightOfSpecimen) -> str:
    """Return the caption."""
    text = (
        "(a) Nominal strain of the specimen and its rate, from the flyer's path. (b) Angle between the "
        "flyer's velocity and the compression axis. (c) Rotation of the flyer about x and Z. Bands: two "
        "standard uncertainties."
    )
    return text if shown.end is None else f"{text} Dotted: symmetry ends."


def _draw_flight(shown: FlightOfSpecimen, panels: Panels) -> None:
    """Draw strain and rate, the angle, the tilt."""
    t, path = shown.time, shown.flight.toward
    ms = MS * t
    ax = panels["motion"]
    rate, spread = path.velocity(t) / shown.length, path.sigma_velocity(t) / shown.length
    ax.fill_between(ms, rate - COVERAGE * spread, rate + COVERAGE * spread, color=BAND, alpha=0.5, lw=0.0)
    ax.plot(ms, rate, color=SHAPE, label="strain rate")
    ax.set_ylabel("Nominal strain rate (1/s)")
    ax.set_ylim(0.0, 1.25 * float(rate.max()))
    other = ax.twinx()
    other.plot(ms, path.position(t) / shown.length, "--", color=MODEL, label="strain")
    other.set_ylabel("Nominal strain (1)")
    other.set_ylim(0.0, 1.0)
    other.tick_params(axis="x", labelbottom=False)
    lines = [*ax.get_lines(), *other.get_lines()]
    ax.legend(lines, [str(line.get_label()) for line in lines], loc="upper left", ncols=2)

    ax = panels["angle"]
    known = shown.known
    angle, spread = (np.degrees(values[known]) for values in shown.flight.orientation(t))
    ax.fill_between(
        ms[known],
        np.maximum(angle - COVERAGE * spread, 0.0),
        angle + COVERAGE * spread,
        color=BAND,
        alpha=0.5,
        lw=0.0,
    )
    ax.plot(ms[known], angle, color=MEASURED)
    firm = (angle + COVERAGE * spread)[spread < np.degrees(0.1)]
    ax.set_ylim(0.0, 1.1 * float(firm.max() if firm.size else 90.0) + 0.2)
    ax.set_ylabel(r"Angle $\varphi$ (°)")

    ax = panels["tilt"]
    tilt, spread = (values[known] for values in shown.flight.tilt(t))
    for k, (name, colour, style) in enumerate((("about $x$", SHAPE, "-"), ("about $Z$", MODEL, "--"))):
        low, high = (1e3 * (tilt[:, k] + side * COVERAGE * spread[:, k]) for side in (-1.0, 1.0))
        ax.fill_between(ms[known], low, high, color=colour, alpha=0.2, lw=0.0)
        ax.plot(ms[known], 1e3 * tilt[:, k], style, color=colour, label=name)
    ax.set_ylabel("Rotation (mrad)")
    ax.set_xlabel("Time (ms)")
    ax.margins(y=0.25)  # room for the legend
    ax.legend(loc="lower left", ncols=2)
    for mark, name in zip("abc", ("motion", "angle", "tilt"), strict=True):
        label_panel(panels[name], mark)
        panels[name].set_xlim(ms[0], ms[-1])
        if name != "tilt":
            panels[name].tick_params(labelbottom=False)
        if shown.end is not None:
            panels[name].axvline(MS * shown.end, color=MEASURED, ls=":")


def flight_of(view: SurfaceView) -> FlightOfSpecimen:
    """Return the flight of a view that has one."""
    assert isinstance(view.flight, FlightOfSpecimen)  # `applies`
    return view.flight


FLIGHT: FigureKind[FlightOfSpecimen] = FigureKind(
    name="flight",
    width=COLUMN,
    height=lambda shown: 130.0,
    caption=_caption_flight,
    panels=lambda shown: [["motion"], ["angle"], ["tilt"]],
    draw=_draw_flight,
)
FIGURES: tuple[FigureKind[SurfaceView], ...] = (
    FigureKind(
        name="kymograph",
        width=PAGE,
        height=lambda view: 68.0,
        caption=_caption_kymograph,
        panels=lambda view: [["picture", "radius"]],
        draw=_draw_kymograph,
        applies=lambda view: view.result.centre.Z.size > 0 and view.kymograph.size > 0,
    ),
    FigureKind(
        name="flyer",
        width=COLUMN,
        height=lambda view: 105.0,
        caption=_caption_flyer,
        panels=lambda view: [["displacement"], ["velocity"], ["sigma"]],
        draw=_draw_flyer,
        mosaic={"sharex": True, "height_ratios": [1.2, 1.2, 0.7]},
        applies=lambda view: (
            view.result.axial_displacement is not None and view.result.axial_displacement.t.size > 2
        ),
    ),
    FigureKind(
        name=FLIGHT.name,
        width=FLIGHT.width,
        height=lambda view: FLIGHT.height(flight_of(view)),
        caption=lambda view: FLIGHT.caption(flight_of(view)),
        panels=lambda view: FLIGHT.panels(flight_of(view)),
        draw=lambda view, panels: FLIGHT.draw(flight_of(view), panels),
        applies=lambda view: isinstance(view.flight, FlightOfSpecimen),
    ),
)
