"""Figs. 7 to 10 of Mates et al. (2012): Poisson's ratio, damping, friction and stiffness, surrogates."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from contributed.paper_figures.trends import Plane, Trends
from kolsky.report.figures import by_name
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    FORCE,
    GREY,
    MEASURED,
    MODEL,
    MS,
    PAGE,
    PAPER,
    SHAPE,
    Panels,
    colour_bar,
    figure,
)
from kolsky.results.nomenclature import axis_label


@figure(COLUMN, 62.0, [["all"]])
def trend_poisson(result: Trends, panels: Panels) -> str:
    ax, runs = panels["all"], result.poisson
    distance = 0.5 - runs.x
    ax.plot(distance, runs.phi_shape, "o-", color=SHAPE, label=r"$\Phi_S$")
    cost = ax.twinx()
    cost.plot(distance, runs.steps / runs.steps[0], "s--", color=GREY, mfc="white", label="cost")
    ax.set_xscale("log")
    ax.invert_xaxis()
    ticks = np.array([0.49, 0.495, 0.498, 0.499, 0.4995, 0.4999])
    ax.set_xticks(0.5 - ticks, [f"{nu:g}" for nu in ticks])
    ax.minorticks_off()
    ax.tick_params(right=False)
    cost.tick_params(axis="y", colors="#555555")
    ax.set(xlabel=axis_label("poisson"), ylabel=r"Shape misfit $\Phi_S$ (–)", ylim=(0.0, None))
    cost.set(ylabel="Cost over that at 0.49 (–)", ylim=(0.0, None))
    lines = [*ax.get_lines(), *cost.get_lines()]
    ax.legend(lines, [str(line.get_label()) for line in lines], loc="upper center")
    return (
        "Shape misfit Φ_S, Eq. (M.3), and time steps of a run, over those at ν = 0.49, against Poisson’s "
        f"ratio at m = {result.stiffness:g} on {result.mesh[0]} × {result.mesh[1]} elements; all steps cost "
        "the same. The axis is logarithmic in the distance from 1/2."
    )


DAMPING_COLOURS = (BAND, SHAPE, FORCE, MODEL, PAPER)


@figure(PAGE, 68.0, [["whole", "begin"]], letters=True)
def trend_damping(result: Trends, panels: Panels) -> str:
    forces = result.damping
    time = MS * forces.time
    begin = time[0] + 0.4 * (time[-1] - time[0])
    for ax in panels.values():
        for beta, force, colour in zip(forces.damping, forces.simulated, DAMPING_COLOURS, strict=False):
            ax.plot(time, force, color=colour, lw=0.8, label=rf"$\beta$ = {1e6 * beta:g} µs")
        ax.plot(time, forces.measured, color=MEASURED, lw=0.6, ls="--", label="measured")
        ax.set(xlabel="Time (ms)", ylabel="Transmitted force (N)")
    panels["whole"].set_xlim(time[0], time[-1])
    panels["whole"].legend(loc="upper left")
    near = time <= begin
    low, high = forces.measured[near].min(), forces.measured[near].max()
    panels["begin"].set_xlim(time[0], begin)
    panels["begin"].set_ylim(low - 0.3 * (high - low), high + 0.5 * (high - low))
    return (
        f"Effect of the damping β on the simulated transmitted force at m = {result.stiffness:g}, beside the "
        "recorded one: the whole test (a), and the stretch in which it begins (b)."
    )


@figure(PAGE, 68.0, [["force", "shape"]], letters=True)
def trend_friction(result: Trends, panels: Panels) -> str:
    plane = result.plane
    _surface(panels["force"], plane, plane.surface_force, plane.phi_force, r"Force misfit $\Phi_F$ (N)")
    _surface(panels["shape"], plane, plane.surface_shape, plane.phi_shape, r"Shape misfit $\Phi_S$ (–)")
    return (
        "Effect of friction and stiffness on (a) Φ_F, Eq. (M.4), and (b) Φ_S, Eq. (M.3): radial basis "
        f"functions through the {len(result.plane.design)} runs of a full factorial (dots) on "
        f"{result.plane_mesh[0]} × {result.plane_mesh[1]} elements, faces and side sliding by Coulomb’s law. "
        "Star: the run with the smallest value."
    )


def _surface(
    ax: Axes, plane: Plane, surface: NDArray[np.float64], runs: NDArray[np.float64], label: str
) -> None:
    drawn = ax.contourf(*plane.axes, surface.T, levels=14, cmap="cividis")
    ax.contour(*plane.axes, surface.T, levels=drawn.levels, colors="white", linewidths=0.3)
    points = plane.design.points
    ax.plot(*points.T, ".", ms=2.6, mew=0.0, color=MEASURED, clip_on=False)
    ax.plot(*points[int(runs.argmin())], "*", ms=7, mfc="white", mec=MEASURED, mew=0.5, clip_on=False)
    first, second = plane.design.box.names
    ax.set(xlabel=axis_label(first), ylabel=axis_label(second))
    colour_bar(drawn, ax, label, pad=0.02)


@figure(PAGE, 64.0, [["force", "shape"]], letters=True)
def trend_stiffness(result: Trends, panels: Panels) -> str:
    s = result.surrogates
    rows = (
        ("force", s.runs.phi_force, s.between.phi_force, FORCE, r"Force misfit $\Phi_F$ (N)"),
        ("shape", s.runs.phi_shape, s.between.phi_shape, SHAPE, r"Shape misfit $\Phi_S$ (–)"),
    )
    for i, (name, runs, between, colour, label) in enumerate(rows):
        ax = panels[name]
        ax.plot(s.x, s.by_cost[i], color=GREY, ls="--", label="surrogate of the misfit")
        ax.plot(s.x, s.by_response[i], color=colour, label="surrogate of the response")
        ax.plot(s.runs.x, runs, "o", color=MEASURED, ms=3, mew=0.0, label="runs")
        ax.plot(s.between.x, between, "o", mfc="white", mec=MEASURED, mew=0.6, ms=3, label="runs not seen")
        ax.set(xlabel=axis_label("stiffness_factor"), ylabel=label, xlim=(s.x[0], s.x[-1]))
        ax.set_ylim(bottom=min(0.0, 1.1 * float(s.by_cost[i].min())))
    panels["shape"].legend(loc="upper right")
    return (
        "Effect of the stiffness on (a) Φ_F, Eq. (M.4), and (b) Φ_S, Eq. (M.3). Filled: the "
        f"{len(result.surrogates.runs.x)} runs that the surrogates are built from; open: runs that they "
        "were not built from. Solid: misfit of the histories that the surrogate of the response predicts; "
        "dashed: radial basis functions through the misfits themselves, as in the paper."
    )


TRENDS = by_name((trend_poisson, trend_damping, trend_friction, trend_stiffness))
"""The figures by name, in their order."""
