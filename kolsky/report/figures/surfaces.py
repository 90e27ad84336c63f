"""Figures of surfaces from pictures: points and their uncertainty, speckles, fields, motion of the flyer."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, PercentFormatter
from numpy.typing import NDArray

from dic.chain.remarks import Speckles
from dic.outcome import FrameOutcome
from kolsky.bars.flyer.flight import FlightOfSpecimen
from kolsky.base.arrays import FloatArray
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    DOTS,
    FORCE,
    GREY,
    LETTERS,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    PAPER,
    SHAPE,
    UM,
    FigureKind,
    Panels,
    colour_bar,
    few_ticks,
    figure,
    label_text,
    note_empty,
    picture_height,
    show_picture,
    show_points,
)
from kolsky.report.picture_views import ALIVE, OUTCOME_COLOURS, FullFieldView, SurfaceView

LOST_COLOUR = PAPER


def _overlay(draw: Callable[[SurfaceView, Panels], str]) -> FigureKind[SurfaceView]:
    """A row of pictures with the legend below it."""
    return figure(
        PAGE,
        lambda view: picture_height(
            next(iter(view.pictures.values())).shape, (PAGE - 12.0) / len(view.pictures), 21.0, 30.0, 230.0
        ),
        lambda view: [[f"frame {k}" for k in range(len(view.pictures))]],
        applies=lambda view: bool(view.pictures),
        letters=True,
    )(draw)


def frames_in(view: SurfaceView, panels: Panels) -> list[tuple[int, Axes]]:
    """Draw the pictures and return frame and panel of each."""
    drawn: list[tuple[int, Axes]] = []
    for (frame, picture), ax in zip(view.pictures.items(), panels.values(), strict=False):
        show_picture(ax, picture)
        ax.set_xlim(-0.5, picture.shape[1] - 0.5)
        ax.set_ylim(picture.shape[0] - 0.5, -0.5)
        if not drawn:
            ax.set_ylabel("$y$ (px)")
        else:
            ax.tick_params(labelleft=False)
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


def _last_places(view: SurfaceView, frame: int) -> FloatArray:
    """Return the last places in camera 0 of the points lost in a frame [px], shape [n, 2]."""
    body = view.result.specimen
    points = np.flatnonzero(~body.surface.valid[frame])
    seen = np.asarray(np.isfinite(body.pixels[0][: frame + 1, points]).all(axis=2))
    last = frame - np.argmax(seen[::-1], axis=0)
    return np.asarray(body.pixels[0][last, points][seen.any(axis=0)])


@_overlay
def overlay_sigma(view: SurfaceView, panels: Panels) -> str:
    body = view.result.specimen
    drawn = frames_in(view, panels)
    sigma = np.fmax(*body.match_sigma)
    shown = np.concatenate([sigma[frame][body.surface.valid[frame]] for frame, _ in drawn])
    low, high = (0.0, 1.0) if shown.size == 0 else np.percentile(shown, [1.0, 99.0])
    size = marker(view)
    points: Any = None
    for frame, ax in drawn:
        valid = body.surface.valid[frame]
        places = body.pixels[0][frame, valid]
        points = show_points(
            ax, places, sigma[frame, valid], low, max(high, 1.01 * low), s=size**2, cmap="plasma"
        )
        last = _last_places(view, frame)
        ax.plot(*last.T, "x", color=LOST_COLOUR, ms=size, mew=0.5, clip_on=True)
    below: dict[str, Any] = {"location": "bottom", "shrink": 0.5, "aspect": 45, "pad": 0.02, "extend": "both"}
    axes = [ax for _, ax in drawn]
    colour_bar(points, axes, "Standard deviation of a match (px)", ticks=MaxNLocator(6), **below)
    return (
        "Camera 0 at some times, with the valid points of the specimen coloured by the larger of both "
        "cameras' standard deviations of their place; crosses: last places of the points that are lost at "
        "that time."
    )


EPIPOLAR_STEPS = (0.05, 0.1)
"""Epipolar distances at which the colour changes [px]."""
EPIPOLAR_COLOURS = (SHAPE, FORCE, MODEL)
"""Colours below, between and above the steps."""


@_overlay
def overlay_epipolar(view: SurfaceView, panels: Panels) -> str:
    body, size = view.result.specimen, marker(view)
    drawn = frames_in(view, panels)
    for frame, ax in drawn:
        valid = body.surface.valid[frame]
        kind = np.searchsorted(EPIPOLAR_STEPS, np.abs(body.epipolar[frame, valid]))
        places = body.pixels[0][frame, valid]
        for number, colour in enumerate(EPIPOLAR_COLOURS):
            ax.plot(*places[kind == number].T, "o", color=colour, ms=size, mew=0.0)
        ax.plot(*_last_places(view, frame).T, "x", color=LOST_COLOUR, ms=size, mew=0.5)
    names = (
        f"below {EPIPOLAR_STEPS[0]:g} px",
        f"{EPIPOLAR_STEPS[0]:g} to {EPIPOLAR_STEPS[1]:g} px",
        f"above {EPIPOLAR_STEPS[1]:g} px",
    )
    marks = [("o", *both) for both in zip(EPIPOLAR_COLOURS, names, strict=True)] + [
        ("x", LOST_COLOUR, "lost")
    ]
    handles = [Line2D([], [], marker=mark, ls="", color=c, ms=3.5, label=label) for mark, c, label in marks]
    drawn[0][1].figure.legend(handles=handles, loc="outside lower center", ncols=4, title="Epipolar distance")
    distance = np.abs(body.epipolar[body.surface.valid])
    low, high = (100.0 * float(np.mean(distance > step)) if distance.size else 0.0 for step in EPIPOLAR_STEPS)
    return (
        "Camera 0 at some times, with the valid points of the specimen coloured by the distance of camera "
        f"1's point from the epipolar line. Over all frames its rms is {body.epipolar_rms:.3f} px; {low:.2g} "
        f"% of the points exceed {EPIPOLAR_STEPS[0]:g} px, {high:.2g} % exceed {EPIPOLAR_STEPS[1]:g} px. "
        "Crosses: last places of the points that are lost at that time."
    )


@figure(PAGE, 62.0, [["map", "history"]], width_ratios=[1.0, 1.35], letters=True)
def lost_points(view: SurfaceView, panels: Panels) -> str:
    body, result = view.result.specimen, view.result
    ax = panels["map"]
    share = body.surface.valid.mean(axis=0)
    points = show_points(ax, body.points, 100.0 * share, 0.0, 100.0, s=9.0, cmap="cividis")
    ax.set(aspect="equal", xlabel="$x$ (px)", ylabel="$y$ (px)")
    ax.invert_yaxis()
    colour_bar(points, ax, "Frames with the point (%)", aspect=25, pad=0.02)

    ax = panels["history"]
    time = MS * result.t
    half = 0.5 * float(np.median(np.diff(time)))
    for frame in np.flatnonzero(result.outcome != FrameOutcome.VALID):
        ax.axvspan(time[frame] - half, time[frame] + half, color=GREY, alpha=0.35, lw=0.0)
    between = 0.5 * (time[1:] + time[:-1])
    edges = np.concatenate([[time[0] - half], between, [time[-1] + half]])
    bottom, usable = np.zeros(time.size), result.outcome == FrameOutcome.VALID
    outcomes = body.outcomes()
    for outcome, colour in OUTCOME_COLOURS.items():
        if outcome.ok or outcome not in outcomes:
            continue
        top = bottom + np.where(usable, np.sum(body.surface.outcome == outcome, axis=1), 0.0)
        words = outcome.name.lower().replace("_", " ")
        ax.stairs(top, edges, baseline=bottom, fill=True, color=colour, label=words, lw=0.0)
        bottom = top
    ax.set(xlabel="Time (ms)", ylabel=f"Points lost, of {body.surface.n_points}")
    ax.set_xlim(time[0] - half, time[-1] + half)
    ax.set_ylim(0.0, max(1.25 * bottom.max(), 1.0))
    if bottom.any():
        ax.legend(loc="upper left")
    else:
        note_empty(ax, "none was lost")
    return (
        "(a) Share of the frames in which each point of the specimen was found, at its place in the first "
        "picture of camera 0. (b) Points of the specimen that were not found, by outcome; grey bands: frames "
        "of which a picture could not be used."
    )


MILLI_PIXELS = 1e3
"""Factor from px to mpx."""


def _cameras(view: SurfaceView) -> list[tuple[int, Speckles]]:
    """Cameras with known speckles: number and speckles."""
    return [(camera, speckle) for camera, speckle in enumerate(view.speckles) if speckle is not None]


FLOOR_PARTS = ("picture", "floor", "share")


def _floor_height(found: Speckles) -> float:
    return picture_height(found.picture.shape, 0.30 * PAGE, 17.0, 40.0, 200.0)


def _draw_floor(result: Speckles, picture: Axes, floor: Axes, share: Axes) -> None:
    """Draw speckles, the predicted floor over them, and the share of the subsets that reach a floor."""
    quality = result.quality
    show_picture(picture, result.picture)
    finite = MILLI_PIXELS * quality.floor[np.all(np.isfinite(quality.floor), axis=2)]
    worst = MILLI_PIXELS * quality.floor.max(axis=2)
    ends = np.percentile(finite.max(axis=1), [1.0, 99.0]) if finite.size else (0.0, 1.0)
    floor.set_facecolor(GREY)
    drawn = floor.imshow(
        worst, cmap="plasma", vmin=ends[0], vmax=max(ends[1], 1.01 * ends[0]), interpolation="nearest"
    )
    floor.set_xlabel("$x$ (px)")
    picture.set_ylabel("$y$ (px)")
    floor.tick_params(labelleft=False)
    colour_bar(drawn, floor, "Predicted floor (mpx)", location="bottom", aspect=25, pad=0.02, extend="both")

    parts = np.arange(1, len(finite) + 1) / max(len(finite), 1)
    for k, (name, colour, style) in enumerate((("$x$", MEASURED, "-"), ("$y$", MODEL, "--"))):
        share.step(np.sort(finite[:, k]), parts, style, color=colour, where="post", label=name)
    if quality.wanted is not None:
        share.axvline(MILLI_PIXELS * quality.wanted, color=BAND, ls=":", label="asked for")
    share.set_xlim(0.0, 1.15 * max(float(ends[1]), MILLI_PIXELS * (quality.wanted or 0.0)))
    share.set_ylim(0.0, 1.0)
    share.yaxis.set_major_formatter(PercentFormatter(1.0))
    share.set(xlabel="Floor (mpx)", ylabel="Share of the subsets")
    share.legend(loc="upper left")


def _floor_caption(found: Speckles, places: tuple[str, str, str]) -> str:
    quality = found.quality
    text = (
        f"{places[0]} The speckles. {places[1]} Predicted standard deviation of a match with a subset of "
        f"{quality.subset} px centred there, the larger of x and y, from the noise of the static frames. "
        f"{places[2]} Share of the subsets that reach a floor."
    )
    return text if quality.wanted is None else f"{text} Dotted: the wanted floor."


@figure(
    PAGE,
    lambda view: sum(_floor_height(found) for _, found in _cameras(view)),
    lambda view: [[f"{part} {camera}" for part in FLOOR_PARTS] for camera, _ in _cameras(view)],
    applies=lambda view: bool(_cameras(view)),
    letters=True,
)
def speckles(view: SurfaceView, panels: Panels) -> str:
    for camera, found in _cameras(view):
        _draw_floor(found, *(panels[f"{part} {camera}"] for part in FLOOR_PARTS))
        panels[f"picture {camera}"].set_title(f"camera {camera}", loc="right", pad=2.5)
    return "Mean static pictures of the cameras. " + _floor_caption(
        _cameras(view)[0][1], ("Left:", "Middle:", "Right:")
    )


@figure(PAGE, _floor_height, [[*FLOOR_PARTS]], letters=True)
def speckle_floor(result: Speckles, panels: Panels) -> str:
    _draw_floor(result, *(panels[part] for part in FLOOR_PARTS))
    return _floor_caption(result, ("(a)", "(b)", "(c)"))


STRAINS = {"exx": "$E_{xx}$ (%)", "eyy": "$E_{yy}$ (%)", "exy": "$E_{xy}$ (%)"}
HISTORY_LINES = (MEASURED, MODEL, SHAPE, BAND, GREY)
"""Colours of extensometers, in turn."""


def _field_unit(view: FullFieldView) -> tuple[float, str]:
    """Factor and name of the unit of lengths."""
    return (MM, "mm") if view.result.unit == "m" else (1.0, "px")


class _Maps(NamedTuple):
    """Values of one frame, each at its points in the picture."""

    picture: NDArray[np.generic] | None
    at: FloatArray
    """Positions of the points, NaN where lost [px], shape [n_points, 2]."""
    values: dict[str, FloatArray]
    """Values by the label of the colour bar, in the order of the panels, each of shape [n_points]."""
    step: float
    """Distance of neighbouring points [px]."""


ROOM = 21.0
"""Room around the points [px]."""
MAP_WIDTH = 0.23 * PAGE
"""Width of a map without its colour bar [mm]."""


def _maps_height(at: FloatArray) -> float:
    known = at[np.isfinite(at).all(axis=1)]
    x, y = (np.ptp(known, axis=0) if len(known) else np.ones(2)) + 2.0 * ROOM
    return float(np.clip(2.0 * (MAP_WIDTH * y / x + 27.0), 60.0, 220.0))


def _draw_maps(maps: _Maps, panels: Panels) -> None:
    for (words, values), ax in zip(maps.values.items(), panels.values(), strict=True):
        if maps.picture is not None:
            show_picture(ax, maps.picture)
        ax.set_aspect("equal")
        ax.set(xlabel="$x$ (px)", ylabel="$y$ (px)")
        chosen = np.isfinite(maps.at).all(axis=1) & np.isfinite(values)
        if not chosen.any():
            note_empty(ax, "no point has a value")
            continue
        (x0, y0), (x1, y1) = maps.at[chosen].min(axis=0) - ROOM, maps.at[chosen].max(axis=0) + ROOM
        ax.set_xlim(x0, x1)
        ax.set_ylim(y1, y0)
        few_ticks(ax, 4)
        low, high = np.percentile(values[chosen], [1.0, 99.0])
        if high - low < 1e-9 * max(abs(high), 1.0):
            low, high = low - 0.5, high + 0.5
        size = 72.0 / 25.4 * MAP_WIDTH * maps.step / max(x1 - x0, 1.0)
        style: dict[str, Any] = {"s": max(0.9 * size, 0.8) ** 2, "cmap": "viridis", "rasterized": True}
        points = show_points(ax, maps.at[chosen], values[chosen], low, high, **style)
        colour_bar(points, ax, words, location="bottom", aspect=30, ticks=MaxNLocator(4))


@figure(
    PAGE,
    lambda view: _maps_height(view.result.pixels[0, view.frame]),
    lambda view: [["u", "v", "." if view.result.kind == "plane" else "w"], [*STRAINS]],
    letters=True,
)
def full_field(view: FullFieldView, panels: Panels) -> str:
    result, k, (factor, unit) = view.result, view.frame, _field_unit(view)
    valid, facts, last = result.surface.valid[k], result.facts, LETTERS[len(panels) - 4]
    names = "uv" if result.kind == "plane" else "uvw"
    motion = {
        f"${name}$ ({unit})": np.where(valid, factor * result.surface.u[k, :, i], np.nan)
        for i, name in enumerate(names)
    }
    strain = {label: 100.0 * result.strain.value[k, :, i] for i, label in enumerate(STRAINS.values())}
    _draw_maps(_Maps(view.picture, result.pixels[0, k], motion | strain, facts.get("step", 5)), panels)
    return (
        f"Frame {view.frame} of camera 0 with (a) to ({last}) the displacements since the reference and, "
        f"below, the Green-Lagrange strains over gauges of {facts.get('strain_gauge', 0):g} px; subsets "
        f"of {facts.get('subset')} px, {facts.get('step')} px apart. Colours span 98 % of the values."
    )


def _shown_frame(view: SurfaceView) -> int:
    """The last frame with at least half of the points, of those with pictures if there are any."""
    count = view.result.specimen.n_valid
    usable = np.flatnonzero(count >= max(1.0, ALIVE * count.max()))
    shown = [frame for frame in view.pictures if frame in usable]
    return int(shown[-1] if shown else usable[-1])


@figure(
    PAGE,
    lambda view: _maps_height(view.result.specimen.pixels[0][_shown_frame(view)]),
    [["u", "v", "w"], [*STRAINS]],
    applies=lambda view: bool((view.result.specimen.n_valid > 0).any()),
    letters=True,
)
def surface_fields(view: SurfaceView, panels: Panels) -> str:
    result, k = view.result, _shown_frame(view)
    body = result.specimen
    valid, step = body.surface.valid[k], np.diff(np.unique(body.points[:, 0]))
    motion = {
        f"${name}$ (mm)": np.where(valid, MM * body.surface.u[k, :, i], np.nan)
        for i, name in enumerate("UVW")
    }
    words = (r"$E_{\theta\theta}$ (%)", "$E_{yy}$ (%)", r"$E_{\theta y}$ (%)")
    strain = {label: 100.0 * result.strain.value[k, :, i] for i, label in enumerate(words)}
    spacing = float(step.min()) if step.size else 5.0
    _draw_maps(_Maps(view.pictures.get(k), body.pixels[0][k], motion | strain, spacing), panels)
    return (
        f"Frame {k} of camera 0 with the displacements of the specimen's surface since the reference, (a) U "
        "across the axis, (b) V along it toward the flyer, (c) W toward the cameras, and the Green-Lagrange "
        "strains (d) around the axis, (e) along it and (f) in shear, over gauges of "
        f"{result.strain.gauge:g} px. Colours span 98 % of the values."
    )


def _history_panels(view: FullFieldView) -> list[list[str]]:
    return [["mean", "extensometers"] if view.result.extensions else ["mean"]] + (
        [["radius", "radius"] if view.result.extensions else ["radius"]] if view.result.cylinder else []
    )


@figure(
    PAGE,
    lambda view: 110.0 if view.result.cylinder else 60.0,
    _history_panels,
    applies=lambda view: bool(view.result.surface.n_frames > 1),
    letters=True,
)
def histories(view: FullFieldView, panels: Panels) -> str:
    result = view.result
    t, label = (MS * result.surface.t, "$t$ (ms)") if result.timed else (result.surface.t, "frame")
    mean, ax = 100.0 * result.mean_strain, panels["mean"]
    for k, (name, colour) in enumerate(zip(("xx", "yy", "xy"), (MODEL, MEASURED, GREY), strict=True)):
        ax.plot(t, mean[:, k], ".-", color=colour, label=f"$E_{{{name}}}$", markersize=3)
    ax.set(xlabel=label, ylabel="mean strain (%)")
    ax.legend(frameon=False)
    if result.extensions:
        ax = panels["extensometers"]
        factor, unit = _field_unit(view)
        for k, one in enumerate(result.extensions):
            colour = HISTORY_LINES[k % len(HISTORY_LINES)]
            ax.errorbar(
                t, factor * one.elongation, 2.0 * factor * one.sigma, fmt=".-", color=colour, markersize=3,
                label=label_text(one.name, 24), elinewidth=0.8,
            )  # fmt: skip
        ax.set(xlabel=label, ylabel=f"elongation ({unit})")
        ax.legend(frameon=False)
    if result.cylinder is not None:
        ax = panels["radius"]
        ax.errorbar(t, MM * result.cylinder.radius, 2.0 * MM * result.cylinder.sigma, fmt=".", color=MEASURED)
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.set(xlabel=label, ylabel="radius (mm)")
    if not result.timed:
        for ax in panels.values():
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    text = f"{'(a) ' if len(panels) > 1 else ''}Mean of the strains of all points."
    if view.result.extensions:
        text += " (b) Virtual extensometers."
    if view.result.cylinder is not None:
        text += (
            f" ({'c' if view.result.extensions else 'b'}) Radius of the cylinder that fits each frame best."
        )
    return text + " Bars: ± 2 standard deviations from the noise of the matches."


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
