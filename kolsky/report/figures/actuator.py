"""Figures of an actuator: shapes, bend over pressure, markers, the closed loop and its wall time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from kolsky.bodies.actuator_bending import path_angle
from kolsky.bodies.actuator_model import Bending
from kolsky.report.body_views import ActuatorView, outer_faces, side_view
from kolsky.report.figures.base import (
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
    label_text,
)

COLOURS = (SHAPE, MODEL, FORCE, GREY)
"""Colours of the directions of gravity, in turn."""
BAR = 1e-5
MOST_DIRECTIONS = 3
"""Directions that have panels of their own; the tables have all."""
SHADES = 0.45, 0.9
"""Grey of faces across and along the line of sight."""


def draw_shape(ax: Axes, run: Bending, step: int) -> None:
    """Draw an actuator from the side at one step."""
    mesh = run.solution.model.mesh
    corners, facing = side_view(mesh.points + run.solution.displacements[step], outer_faces(mesh))
    low, high = SHADES
    grey = low + (high - low) * facing
    ax.add_collection(
        PolyCollection(
            list(MM * corners), facecolors=[(0.8 * g, 0.9 * g, g) for g in grey], edgecolors="0.3",
            linewidths=0.1,
        )
    )  # fmt: skip
    ax.set_aspect("equal")
    ax.autoscale_view()


def _draw_shapes(view: ActuatorView, panels: Panels) -> None:
    """Draw every direction at the declared pressures."""
    for number, one in enumerate(view.directions[:MOST_DIRECTIONS]):
        for k, step in enumerate(one.asked[-3:]):
            ax = panels[f"{one.name} {k}"]
            draw_shape(ax, one.pristine, int(step))
            bar = BAR * float(one.pristine.pressures[step].max())
            ax.set_title(f"{label_text(one.name, 16)}, {bar:.3g} bar", fontsize="small")
            ax.set_xlabel("$x$ (mm)")
            if k == 0:
                ax.set_ylabel("$z$ (mm)")
                label_panel(ax, "abc"[number])


def _caption_shapes(view: ActuatorView) -> str:
    """Return the caption."""
    return "The actuator at the largest declared pressures, seen from the side, in the deformed state."


def _draw_bend(view: ActuatorView, panels: Panels) -> None:
    """Draw the bend over pressure, and the healed one."""
    ax = panels["bend"]
    for colour, one in zip(COLOURS, view.directions, strict=False):
        run, name = one.pristine, label_text(one.name, 20)
        bar = BAR * run.pressures.max(axis=1)
        line = "-" if one.path is None else "."  # a line would join both sides of a snap
        ax.plot(bar, np.degrees(run.angle), line, color=colour, lw=1.0, ms=3, label=name)
        ax.plot(bar[one.asked], np.degrees(run.angle[one.asked]), "o", color=colour, ms=4)
        if one.path is not None:
            ax.plot(BAR * one.path.load, np.degrees(path_angle(one.path)), ":", color=colour, lw=1.0)
        if one.healed is not None:
            ax.plot(
                bar,
                np.degrees(one.healed.angle),
                "--" if one.path is None else "+",
                color=colour,
                lw=1.0,
                label=f"{name}, healed",
            )
    ax.set_xlabel("pressure (bar)")
    ax.set_ylabel("bending angle (°)")
    ax.legend(frameon=False, fontsize="small")


def _caption_bend(view: ActuatorView) -> str:
    """Return the caption."""
    healed = any(one.healed is not None for one in view.directions)
    said = "Bending angle over pressure in every direction of gravity; dots are the declared pressures."
    if any(one.path is not None for one in view.directions):
        said += (
            " Dotted: the path of equilibria by arc length, which a raised pressure leaves where it turns."
        )
    return said + (" Dashed: with the constants of the healed material." if healed else "")


def draw_markers(view: ActuatorView, panels: Panels) -> None:
    """Draw measured markers on the simulated ones."""
    names = list(dict.fromkeys(one.gravity for one in view.markers))[:MOST_DIRECTIONS]
    for number, name in enumerate(names):
        ax = panels[name]
        label_panel(ax, "abc"[number])
        for one in view.markers:
            if one.gravity == name:
                ax.plot(*(MM * one.simulated.T), "--", color=SHAPE, lw=0.8)
                ax.plot(*(MM * one.measured.T), "x", color=MEASURED, ms=3)
                end = MM * one.simulated[-1]
                ax.annotate(
                    f"{BAR * one.pressure:.3g} bar", end, xytext=(4, 0), textcoords="offset points",
                    fontsize="small",
                )  # fmt: skip
        ax.set_aspect("equal")
        ax.set_title(label_text(name, 24), fontsize="medium")
        ax.set_xlabel("$x$ (mm)")
        ax.set_ylabel("$z$ (mm)")


def _caption_markers(view: ActuatorView) -> str:
    """Return the caption."""
    return "Markers: measured centroids (crosses) and the simulated positions of the same points (dashed)."


def _draw_motion(view: ActuatorView, panels: Panels) -> None:
    """Draw the bend over time."""
    ax = panels["motion"]
    for colour, one in zip(COLOURS, view.motions, strict=False):
        ax.plot(one.time, np.degrees(one.angle), "-", color=colour, lw=1.0, label=label_text(one.name, 20))
    ax.set_xlabel("time (s)")
    ax.set_ylabel("bending angle (°)")
    ax.legend(frameon=False, fontsize="small")


def _caption_motion(view: ActuatorView) -> str:
    """Return the caption."""
    one = view.motions[0]
    return (
        f"Bending angle over time: the pressure rises to {BAR * float(one.pressure[-1]):.3g} bar and is "
        "held, with inertia and the declared damping."
    )


def _draw_loop(view: ActuatorView, panels: Panels) -> None:
    """Draw the loop: angles, pressure, wall times."""
    above, middle, below = panels["angle"], panels["pressure"], panels["wall"]
    for colour, (name, run) in zip(COLOURS, view.closed.items(), strict=False):
        above.plot(run.time, np.degrees(run.measured), ".", color=colour, ms=1, alpha=0.4)
        above.plot(run.time, np.degrees(run.angle), "-", color=colour, lw=1.0, label=label_text(name, 20))
        middle.plot(run.time, BAR * run.pressure, "-", color=colour, lw=0.8)
        below.plot(run.time, MS * run.wall, ".", color=colour, ms=1)
    run = next(iter(view.closed.values()))
    above.plot(run.time, np.degrees(run.wanted), "--", color=MEASURED, lw=0.8, label="wanted")
    below.axhline(MS / run.rate, color=MEASURED, lw=0.8, ls="--")
    above.set_ylabel("angle (°)")
    above.legend(frameon=False, fontsize="small", ncols=4)
    middle.set_ylabel("pressure (bar)")
    below.set_ylabel("wall time (ms)")
    below.set_yscale("log")
    below.set_xlabel("time (s)")
    for letter, ax in zip("abc", (above, middle, below), strict=True):
        label_panel(ax, letter)


def _caption_loop(view: ActuatorView) -> str:
    """Return the caption."""
    run = next(iter(view.closed.values()))
    return (
        "The closed loop with a simulated plant: (a) wanted angle, plant (lines) and what the camera gave "
        "(dots), "
        f"(b) the pressure, (c) the wall time of the controller in each tick and the period, "
        f"{MS / run.rate:.3g} ms (dashed)."
    )


FIGURES = (
    FigureKind(
        name="shapes",
        width=PAGE,
        height=lambda view: 60.0 * min(len(view.directions), MOST_DIRECTIONS),
        caption=_caption_shapes,
        panels=lambda view: [
            [f"{one.name} {k}" for k in range(len(one.asked[-3:]))]
            for one in view.directions[:MOST_DIRECTIONS]
        ],
        draw=_draw_shapes,
        applies=lambda view: bool(view.directions),
    ),
    FigureKind(
        name="bend",
        width=PAGE,
        height=lambda view: 75.0,
        caption=_caption_bend,
        panels=lambda view: [["bend"]],
        draw=_draw_bend,
        applies=lambda view: bool(view.directions),
    ),
    FigureKind(
        name="motion",
        width=PAGE,
        height=lambda view: 70.0,
        caption=_caption_motion,
        panels=lambda view: [["motion"]],
        draw=_draw_motion,
        applies=lambda view: bool(view.motions),
    ),
    FigureKind(
        name="markers",
        width=PAGE,
        height=lambda view: 80.0,
        caption=_caption_markers,
        panels=lambda view: [list(dict.fromkeys(one.gravity for one in view.markers))[:MOST_DIRECTIONS]],
        draw=draw_markers,
        applies=lambda view: bool(view.markers),
    ),
    FigureKind(
        name="loop",
        width=PAGE,
        height=lambda view: 130.0,
        caption=_caption_loop,
        panels=lambda view: [["angle"], ["pressure"], ["wall"]],
        draw=_draw_loop,
        applies=lambda view: bool(view.closed),
    ),
)
