"""Force and shape misfit against the stiffness factor, from runs and from surrogates."""

from kolsky.report.figures.base import FORCE, GREY, MEASURED, PAGE, SHAPE, FigureKind, Panels, letter
from kolsky.report.nomenclature import axis_label
from kolsky.studies.trends import Trends


def caption(result: Trends) -> str:
    """What is seen."""
    return (
        "Effect of the stiffness on (a) Φ_F, Eq. (M.4), and (b) Φ_S, Eq. (M.3). Filled: the "
        f"{len(result.surrogates.runs.x)} runs that the surrogates are built from; open: runs that they have "
        "not seen. Solid: misfit of the histories that the surrogate of the response predicts; dashed: "
        "radial basis functions through the misfits themselves, as in the paper."
    )


def draw(result: Trends, panels: Panels) -> None:
    """Draw both misfits."""
    s = result.surrogates
    rows = (
        ("force", s.runs.phi_force, s.between.phi_force, FORCE, r"Force misfit $\Phi_F$ (N)"),
        ("shape", s.runs.phi_shape, s.between.phi_shape, SHAPE, r"Shape misfit $\Phi_S$ (–)"),
    )
    for i, (key, (name, runs, between, colour, label)) in enumerate(zip("ab", rows, strict=True)):
        ax = panels[name]
        ax.plot(s.x, s.by_cost[i], color=GREY, ls="--", label="surrogate of the misfit")
        ax.plot(s.x, s.by_response[i], color=colour, label="surrogate of the response")
        ax.plot(s.runs.x, runs, "o", color=MEASURED, ms=3, mew=0.0, label="runs")
        ax.plot(s.between.x, between, "o", mfc="white", mec=MEASURED, mew=0.6, ms=3, label="runs not seen")
        ax.set(xlabel=axis_label("stiffness_factor"), ylabel=label, xlim=(s.x[0], s.x[-1]))
        ax.set_ylim(bottom=min(0.0, 1.1 * float(s.by_cost[i].min())))
        letter(ax, key)
    panels["shape"].legend(loc="upper right")


KIND: FigureKind[Trends] = FigureKind(
    name="trend-stiffness",
    width=PAGE,
    height=lambda result: 64.0,
    caption=caption,
    panels=lambda result: [["force", "shape"]],
    draw=draw,
)
