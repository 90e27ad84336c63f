"""What each law leaves over, a panel for each of the best."""

from kolsky.material.fits.compare import Comparison
from kolsky.material.fits.modes import Mode
from kolsky.report.figures.base import GREY, PAGE, FigureKind, Panels
from kolsky.report.figures.material_fits import COLOURS, MARKERS, shown
from kolsky.report.figures.waves import stress_scale

ROW = 42.0
"""Height of a row of panels [mm]."""
COLUMNS = 3


def caption(comparison: Comparison) -> str:
    """What is seen."""
    return (
        "Law less measurement for the laws of the figure before, on one scale. What is left is smooth, not "
        "scattered, where a law misses the shape of a curve."
    )


def draw(comparison: Comparison, panels: Panels) -> None:
    """Draw the residuals of every test over its strain."""
    rows = shown(comparison)
    largest = max((p.residual for r in rows if r.fit for p in r.fit.parts), key=lambda x: abs(x).max())
    factor, unit = stress_scale(largest)
    several = len(comparison.tests) > 1
    for number, row in enumerate(rows):
        ax = panels[row.candidate.name]
        assert row.fit is not None
        ax.axhline(0.0, color=GREY, lw=0.5)
        for place, part in enumerate(row.fit.parts):
            order = part.test.strain.argsort()
            ax.plot(
                part.test.strain[order],
                factor * part.residual[order],
                "-" + MARKERS[place % len(MARKERS)],
                ms=2.0,
                mfc="none",
                mew=0.5,
                lw=0.6,
                markevery=max(1, len(order) // 25),
                color=COLOURS[place % len(COLOURS)],
                label=part.test.name if len(comparison.tests) <= len(COLOURS) else "",
            )
        ax.set_title(f"{row.candidate.name.replace('_', ' ')}: rmse {factor * row.fit.rmse:.3g} {unit}")
        if number % COLUMNS == 0:
            ax.set_ylabel(f"Law less measured ({unit})")
        shear = any(part.test.mode is Mode.SIMPLE_SHEAR for part in row.fit.parts)
        ax.set_xlabel("Nominal strain or shear (–)" if shear else "Nominal strain (–)")
    if several and len(comparison.tests) <= len(COLOURS):
        panels[rows[0].candidate.name].legend(loc="best")


def _mosaic(comparison: Comparison) -> list[list[str]]:
    names = [row.candidate.name for row in shown(comparison)]
    columns = min(COLUMNS, len(names))
    names += ["."] * (-len(names) % columns)
    return [names[k : k + columns] for k in range(0, len(names), columns)]


KIND: FigureKind[Comparison] = FigureKind(
    name="material-residuals",
    width=PAGE,
    height=lambda comparison: 10.0 + ROW * len(_mosaic(comparison)),
    caption=caption,
    panels=_mosaic,
    draw=draw,
    mosaic={"sharey": True},
)
