"""Main effects: each misfit along each parameter, averaged over the others."""

from kolsky.report.figures.base import BAND, MEASURED, PAGE, SHAPE, FigureKind, Panels
from kolsky.report.nomenclature import axis_label, name_of
from kolsky.studies.sweep_analysis import SweepAnalysis

LABELS = {"Phi_F": r"$\Phi_F$ (N)", "Phi_S": r"$\Phi_S$ (–)", "Phi": r"$\Phi$ (–)"}


def caption(result: SweepAnalysis) -> str:
    """What is seen."""
    return (
        "Main effects: mean of a misfit over all other parameters (line) and where 80 % of it lie (band), "
        "along each parameter; points: the runs."
    )


def _shown(result: SweepAnalysis) -> list[str]:
    return [name for name, output in result.outputs.items() if output.surrogate is not None]


def draw(result: SweepAnalysis, panels: Panels) -> None:
    """Draw a row a misfit, a column a parameter."""
    shown = _shown(result)
    for name in shown:
        output = result.outputs[name]
        for i, parameter in enumerate(result.box.names):
            ax, effect, factor = panels[f"{name} {i}"], output.effects[parameter], name_of(parameter).factor
            ax.plot(factor * result.table.points[:, i], output.values, "o", color=MEASURED, ms=1.2, mew=0.0)
            ax.fill_between(factor * effect.x, effect.low, effect.high, color=BAND, alpha=0.4, lw=0.0)
            ax.plot(factor * effect.x, effect.mean, color=SHAPE)
            ax.set_xlim(factor * effect.x[0], factor * effect.x[-1])
            if result.box.logarithmic[i]:
                ax.set_xscale("log")
            if i == 0:
                ax.set_ylabel(LABELS[name])
            else:
                ax.tick_params(labelleft=False)
            if name == shown[-1]:
                ax.set_xlabel(axis_label(parameter))
            else:
                ax.tick_params(labelbottom=False)


KIND: FigureKind[SweepAnalysis] = FigureKind(
    name="sweep-effects",
    width=PAGE,
    height=lambda result: 12.0 + 36.0 * len(_shown(result)),
    caption=caption,
    panels=lambda result: [[f"{name} {i}" for i in range(result.box.dimension)] for name in _shown(result)],
    draw=draw,
    mosaic={"sharey": False},
    applies=lambda result: bool(_shown(result)),
)
