"""Chi-square over the plane of two free parameters, from the runs: all of it, and near the optimum."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.tri import CubicTriInterpolator, Triangulation, UniformTriRefiner

from kolsky.base.arrays import FloatArray
from kolsky.inverse.result import Identification
from kolsky.report.figures.base import (
    BAND,
    MEASURED,
    PAGE,
    ROUTES,
    FigureKind,
    Panels,
    letter,
    smooth_bar,
    weighted_chi2,
)
from kolsky.report.nomenclature import axis_label, route_label


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "Joint χ² of the runs on the surrogate’s mesh (circles) over the smallest of them, with the weights "
        "of the final search, in the plane of the two free parameters, interpolated between the runs and "
        "nowhere else; crosses: runs that did not complete. Left: the whole design; right: the box of the "
        "last refinement (dashed on the left). Stars: the optima, all but that of the cost Φ corrected to "
        "the refined mesh, so they lie off the valley by that mesh’s shift; bars: the k = 2 intervals."
    )


def applies(result: Identification) -> bool:
    """Whether exactly two parameters are free."""
    return len(result.design.names) == 2


def draw(result: Identification, panels: Panels) -> None:
    """Draw filled contours of log10 chi-square, the runs and the optima."""
    design = result.design
    curves = {curve.parameter: curve for curve in result.curves}
    whole, near = panels["whole"], panels["near"]
    box = None
    if set(design.names) <= set(curves):
        box = np.array([[curves[name].x[0], curves[name].x[-1]] for name in design.names])
    _plane(whole, result, np.column_stack([design.lower, design.upper]))
    letter(whole, "a")
    letter(near, "b")
    if box is None:
        near.set_axis_off()
    else:
        _plane(near, result, box)
        (left, right), (low, high) = box
        whole.add_patch(Rectangle((left, low), right - left, high - low, fill=False, ls="--", ec="white"))
    if result.routes:
        _figure(whole).legend(*whole.get_legend_handles_labels(), loc="outside upper center", ncols=4)


def _plane(ax: Axes, result: Identification, box: FloatArray) -> None:
    design = result.design
    first, second = (result.estimates[name] for name in design.names)
    ax.set_xlabel(axis_label(first.name, first.unit))
    ax.set_ylabel(axis_label(second.name, second.unit))
    chi2 = weighted_chi2(result)
    here = ((design.points >= box[:, 0]) & (design.points <= box[:, 1])).all(axis=1)
    coarse = here & (np.array(design.stage) != "check")
    done = coarse & np.isfinite(chi2)
    if done.any():
        level = np.log10(chi2 / np.nanmin(np.where(coarse, chi2, np.nan)))
        # Two refinements can repeat a point, which would be a triangle without area.
        _, single = np.unique(design.points[done], axis=0, return_index=True)
        _contours(ax, design.points[done][single], level[done][single], box)
    ax.plot(*design.points[done].T, "o", ms=2.2, mfc="white", mec=MEASURED, mew=0.4)
    lost = coarse & ~np.isfinite(chi2)
    if lost.any():  # an empty line that is not clipped would lie at the figure's corner for the layout
        ax.plot(*design.points[lost].T, "x", ms=3.0, mew=0.7, color=MEASURED, clip_on=False)
    for route in result.routes:
        at = [route.parameters[name] for name in design.names]
        colour = ROUTES.get(route.name, BAND)
        if route.name == "joint":
            style: dict[str, Any] = {"fmt": "none", "ecolor": "white", "elinewidth": 0.8}
            ax.errorbar(at[0], at[1], xerr=2.0 * first.sigma, yerr=2.0 * second.sigma, **style)
        ax.plot(*at, "*", ms=6, mfc=colour, mec="white", mew=0.4, label=route_label(route.name))
    ax.set_xlim(*box[0])
    ax.set_ylim(*box[1])


def _contours(ax: Axes, points: FloatArray, level: FloatArray, box: FloatArray) -> None:
    x, y = points.T
    if len(points) < 4 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return
    # Triangles and curvature are those of the unit box, or the wider parameter would decide alone.
    low, span = box[:, 0], box[:, 1] - box[:, 0]
    unit = Triangulation((x - low[0]) / span[0], (y - low[1]) / span[1])
    fine, smooth = UniformTriRefiner(unit).refine_field(
        level, CubicTriInterpolator(unit, level, kind="geom"), subdiv=3
    )
    plane = Triangulation(low[0] + span[0] * fine.x, low[1] + span[1] * fine.y, fine.triangles)
    drawn = ax.tricontourf(plane, np.maximum(smooth, 0.0), levels=12, cmap="cividis")
    label = r"$\log_{10}\,\chi^2/\chi^2_\mathrm{min}$ (–)"
    smooth_bar(_figure(ax).colorbar(drawn, ax=ax, label=label, pad=0.02))


def _figure(ax: Axes) -> Figure:
    figure = ax.get_figure(root=True)
    assert figure is not None  # an axes of a report always lies in one
    return figure


KIND = FigureKind(
    name="contour",
    width=PAGE,
    height=lambda result: 78.0,
    caption=caption,
    panels=lambda result: [["whole", "near"]],
    draw=draw,
    applies=applies,
)
