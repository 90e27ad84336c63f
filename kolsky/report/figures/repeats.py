"""Repeated tests: every stress-strain curve, their mean and its confidence band."""

from kolsky.bars.reduction.repeated_tests import RepeatedTests
from kolsky.report.figures.base import BAND, COLUMN, GREY, MEASURED, FigureKind, Panels
from kolsky.report.figures.waves import stress_scale


def caption(mean: RepeatedTests) -> str:
    """What is seen."""
    return (
        f"Nominal stress against nominal strain of {mean.repeats.count} tests (grey), their mean and its 95 "
        "% confidence band, with the scatter between tests and what they have in common."
    )


def draw(mean: RepeatedTests, panels: Panels) -> None:
    """Draw the tests, the mean and the band."""
    ax, together = panels["curve"], mean.repeats
    factor, unit = stress_scale(together.mean)
    for number, row in enumerate(together.values):
        ax.plot(together.axis, factor * row, color=GREY, lw=0.5, label="" if number else "tests")
    low, high = mean.band()
    ax.fill_between(together.axis, factor * low, factor * high, color=BAND, alpha=0.4, lw=0.0, label="95 %")
    ax.plot(together.axis, factor * together.mean, color=MEASURED, lw=1.0, label="mean")
    ax.set(xlabel="Nominal strain (–)", ylabel=f"Nominal stress ({unit})")
    ax.legend(loc="best")


KIND: FigureKind[RepeatedTests] = FigureKind(
    name="repeats",
    width=COLUMN,
    height=lambda mean: 70.0,
    caption=caption,
    panels=lambda mean: [["curve"]],
    draw=draw,
)
