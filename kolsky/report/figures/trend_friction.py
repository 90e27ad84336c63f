"""Force and shape misfit over the plane of friction and stiffness."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from kolsky.report.figures.base import MEASURED, PAGE, FigureKind, Panels, letter, smooth_bar
from kolsky.report.nomenclature import axis_label
from kolsky.studies.trends import Plane, Trends


def caption(result: Trends) -> str:
    """What is seen."""
    return (
        "Effect of friction and stiffness on (a) Φ_F, Eq. (M.4), and (b) Φ_S, Eq. (M.3): radial basis "
        f"functions through the {len(result.plane.design)} runs of a full factorial (dots) on "
        f"{result.plane_mesh[0]} × {result.plane_mesh[1]} elements, faces and side sliding by Coulomb’s law. "
        "Star: the run with the smallest value."
    )


def draw(result: Trends, panels: Panels) -> None:
    """Draw both misfits."""
    plane = result.plane
    _surface(panels["force"], plane, plane.surface_force, plane.phi_force, r"Force misfit $\Phi_F$ (N)")
    _surface(panels["shape"], plane, plane.surface_shape, plane.phi_shape, r"Shape misfit $\Phi_S$ (–)")
    for key, ax in zip("ab", panels.values(), strict=True):
        letter(ax, key)


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
    smooth_bar(ax.figure.colorbar(drawn, ax=ax, label=label, pad=0.02))  # type: ignore[union-attr]


KIND: FigureKind[Trends] = FigureKind(
    name="trend-friction",
    width=PAGE,
    height=lambda result: 68.0,
    caption=caption,
    panels=lambda result: [["force", "shape"]],
    draw=draw,
)
