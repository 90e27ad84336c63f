"""Chi-square over the plane of two free parameters, from the runs themselves."""

from typing import Any

import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation, UniformTriRefiner

from kolsky.identification import Identification
from kolsky.report.figures.base import BAND, COLUMN, MEASURED, ROUTES, FigureKind, Panels, smooth_bar
from kolsky.report.nomenclature import axis_label, route_label


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "Joint noise-weighted χ² of the runs over its value at the optimum, in the plane of the two free "
        "parameters, interpolated linearly between the runs (circles) and nowhere else; crosses: runs that "
        "did not complete. Bars: the k = 2 intervals."
    )


def applies(result: Identification) -> bool:
    """Whether exactly two parameters are free."""
    return len(result.design.names) == 2


def draw(result: Identification, panels: Panels) -> None:
    """Draw filled contours of log10 chi-square, the runs and the optima."""
    ax, design = panels["plane"], result.design
    first, second = (result.estimates[name] for name in design.names)
    ax.set_xlabel(axis_label(first.name, first.unit))
    ax.set_ylabel(axis_label(second.name, second.unit))
    level = np.log10((design.chi2_force + design.chi2_shape) / result.terms.chi2)
    done = np.isfinite(level)
    # Repeated runs of one point (the refined mesh) would be a triangle without area.
    _, single = np.unique(design.points[done], axis=0, return_index=True)
    x, y = design.points[done][single].T
    if single.size >= 4 and np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
        # Triangles are chosen in units of the box, or the wider parameter would decide alone.
        span = design.upper - design.lower
        triangles = Triangulation(x / span[0], y / span[1]).triangles
        plane = Triangulation(x, y, triangles)
        z = level[done][single]
        fine, smooth = UniformTriRefiner(plane).refine_field(z, LinearTriInterpolator(plane, z), subdiv=3)
        drawn = ax.tricontourf(fine, smooth, levels=12, cmap="cividis")
        figure = ax.get_figure()
        assert figure is not None  # an axes of a report always lies in one
        bar = figure.colorbar(drawn, ax=ax, label=r"$\log_{10}\,\chi^2/\chi^2_\mathrm{opt}$ (–)", pad=0.02)
        smooth_bar(bar)
    ax.plot(*design.points[done].T, "o", ms=2.6, mfc="white", mec=MEASURED, mew=0.5)
    ax.plot(*design.points[~done].T, "x", ms=3.0, mew=0.7, color=MEASURED, clip_on=False)
    for route in result.routes:
        at = [route.parameters[name] for name in design.names]
        colour = ROUTES.get(route.name, BAND)
        if route.name == "joint":
            style: dict[str, Any] = {"fmt": "none", "ecolor": "white", "elinewidth": 0.8}
            ax.errorbar(at[0], at[1], xerr=2.0 * first.sigma, yerr=2.0 * second.sigma, **style)
        ax.plot(*at, "*", ms=5, mfc=colour, mec="white", mew=0.4, label=route_label(route.name))
    ax.set_xlim(design.lower[0], design.upper[0])
    ax.set_ylim(design.lower[1], design.upper[1])
    if result.routes:
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


KIND = FigureKind(
    name="contour",
    width=COLUMN,
    height=lambda result: 72.0,
    caption=caption,
    panels=lambda result: [["plane"]],
    draw=draw,
    applies=applies,
)
