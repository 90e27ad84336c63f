"""Shape misfit and cost of a run against Poisson's ratio."""

import numpy as np

from kolsky.report.figures.base import COLUMN, GREY, SHAPE, FigureKind, Panels
from kolsky.report.nomenclature import axis_label
from kolsky.studies.trends import Trends


def caption(result: Trends) -> str:
    """What is seen."""
    return (
        "Shape misfit Φ_S, Eq. (M.3), and time steps of a run, over those at ν = 0.49, against Poisson’s "
        f"ratio at m = {result.stiffness:g} on {result.mesh[0]} × {result.mesh[1]} elements; all steps cost "
        "the same. The axis is logarithmic in the distance from 1/2."
    )


def draw(result: Trends, panels: Panels) -> None:
    """Draw two lines over one axis."""
    ax, runs = panels["all"], result.poisson
    distance = 0.5 - runs.x
    ax.plot(distance, runs.phi_shape, "o-", color=SHAPE, label=r"$\Phi_S$")
    cost = ax.twinx()
    cost.plot(distance, runs.steps / runs.steps[0], "s--", color=GREY, mfc="white", label="cost")
    ax.set_xscale("log")
    ax.invert_xaxis()
    shown = np.array([0.49, 0.495, 0.498, 0.499, 0.4995, 0.4999])
    ax.set_xticks(0.5 - shown, [f"{nu:g}" for nu in shown])
    ax.minorticks_off()
    ax.tick_params(right=False)
    cost.tick_params(axis="y", colors="#555555")
    ax.set(xlabel=axis_label("poisson"), ylabel=r"Shape misfit $\Phi_S$ (–)", ylim=(0.0, None))
    cost.set(ylabel="Cost over that at 0.49 (–)", ylim=(0.0, None))
    lines = [*ax.get_lines(), *cost.get_lines()]
    ax.legend(lines, [str(line.get_label()) for line in lines], loc="upper center")


KIND: FigureKind[Trends] = FigureKind(
    name="trend-poisson",
    width=COLUMN,
    height=lambda result: 62.0,
    caption=caption,
    panels=lambda result: [["all"]],
    draw=draw,
)
