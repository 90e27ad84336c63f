"""Figures of an actuator: shapes, bend over pressure, markers, the closed loop and its wall time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from kolsky.bodies.actuator_bending import path_angle
from kolsky.bodies.actuator_model import Bending
from kolsky.report.body_views import ActuatorView, outer_faces, side_view
from kolsky.report.figures.base import (
    BAR,
    FORCE,
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    Panels,
    figure,
    label_panel,
    label_point,
    label_text,
)

COLOURS = (SHAPE, MODEL, FORCE, GREY)
"""Colours of the directions of gravity, in turn."""
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


@figure(
    PAGE,
    lambda view: 60.0 * min(len(view.directions), MOST_DIRECTIONS),
    lambda view: [
        [f"{one.name} {k}" for k in range(len(one.asked[-3:]))] for one in view.directions[:MOST_DIRECTIONS]
    ],
    applies=lambda view: bool(view.directions),
)
def shapes(view: ActuatorView, panels: Panels) -> str:
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
    return "The actuator at the largest declared pressures, seen from the side, in the deformed state."


@figure(PAGE, 75.0, [["bend"]], applies=lambda view: bool(view.directions))
def bend(view: ActuatorView, panels: Panels) -> str:
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
            line = "--" if one.path is None else "+"
            ax.plot(bar, np.degrees(one.healed.angle), line, color=colour, lw=1.0, label=f"{name}, healed")
    ax.set(xlabel="pressure (bar)", ylabel="bending angle (°)")
    ax.legend(frameon=False, fontsize="small")
    healed = any(one.healed is not None for one in view.directions)
    text = "Bending angle over pressure in every direction of gravity; dots are the declared pressures."
    if any(one.path is not None for one in view.directions):
        text += (
            " Dotted: the path of equilibria by arc length, which a raised pressure leaves where it turns."
        )
    return text + (" Dashed: with the constants of the healed material." if healed else "")


@figure(
    PAGE,
    80.0,
    lambda view: [list(dict.fromkeys(one.gravity for one in view.markers))[:MOST_DIRECTIONS]],
    applies=lambda view: bool(view.markers),
    letters=True,
)
def markers(view: ActuatorView, panels: Panels) -> str:
    names = list(dict.fromkeys(one.gravity for one in view.markers))[:MOST_DIRECTIONS]
    for name in names:
        ax = panels[name]
        for one in view.markers:
            if one.gravity == name:
                ax.plot(*(MM * one.simulated.T), "--", color=SHAPE, lw=0.8)
                ax.plot(*(MM * one.measured.T), "x", color=MEASURED, ms=3)
                end = MM * one.simulated[-1]
                label_point(ax, f"{BAR * one.pressure:.3g} bar", end, (4, 0), fontsize="small")
        ax.set_aspect("equal")
        ax.set_title(label_text(name, 24), fontsize="medium")
        ax.set(xlabel="$x$ (mm)", ylabel="$z$ (mm)")
    return "Markers: measured centroids (crosses) and the simulated positions of the same points (dashed)."


@figure(PAGE, 70.0, [["motion"]], applies=lambda view: bool(view.motions))
def motion(view: ActuatorView, panels: Panels) -> str:
    ax = panels["motion"]
    for colour, one in zip(COLOURS, view.motions, strict=False):
        ax.plot(one.time, np.degrees(one.angle), "-", color=colour, lw=1.0, label=label_text(one.name, 20))
    ax.set(xlabel="time (s)", ylabel="bending angle (°)")
    ax.legend(frameon=False, fontsize="small")
    one = view.motions[0]
    return (
        f"Bending angle over time: the pressure rises to {BAR * float(one.pressure[-1]):.3g} bar and is "
        "held, with inertia and the declared damping."
    )


@figure(
    PAGE, 130.0, [["angle"], ["pressure"], ["wall"]], applies=lambda view: bool(view.closed), letters=True
)
def loop(view: ActuatorView, panels: Panels) -> str:
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
    return (
        "The closed loop with a simulated plant: (a) wanted angle, plant (lines) and what the camera gave "
        "(dots), (b) the pressure, (c) the wall time of the controller in each tick and the period, "
        f"{MS / run.rate:.3g} ms (dashed)."
    )
