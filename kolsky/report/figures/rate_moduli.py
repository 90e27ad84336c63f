"""Slow tests, relaxation, oscillation and shots on one axis of time: Fig. 11 of Mates et al. (2012)."""

from collections.abc import Sequence
from dataclasses import dataclass

from kolsky.material.relaxation.time_scales import ApparentModuli
from kolsky.report.figures.base import BAND, COLUMN, MODEL, FigureKind, Panels

KPA = 1e-3
COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#000000", "#56B4E9")
MARKERS = "osD^v<>"


@dataclass(frozen=True)
class TimeScales:
    """What is drawn on one axis."""

    tests: Sequence[ApparentModuli]
    """Each test's own moduli, see `kolsky.material.relaxation.time_scales.apparent_moduli`."""
    fitted: ApparentModuli | None = None
    """The fitted model, its modulus and uncertainty from
    `kolsky.material.relaxation.time_scales.fitted_modulus`."""


def caption(shown: TimeScales) -> str:
    """What is seen."""
    fitted = "" if shown.fitted is None else " Line and band: the fitted model with ±2u."
    return (
        "Modulus of rubber elasticity, Eq. (M.9), that each test shows by itself, against the mean age of "
        "the strain: the time of holding after a step, half the duration of a steady ramp, 1/ω of an "
        f"oscillation. Bars: ±2u.{fitted}"
    )


def draw(shown: TimeScales, panels: Panels) -> None:
    """Draw points with bars, and the model behind them."""
    ax = panels["moduli"]
    if shown.fitted is not None:
        age, modulus, sigma = shown.fitted.age, KPA * shown.fitted.modulus, KPA * shown.fitted.sigma
        ax.fill_between(age, modulus - 2.0 * sigma, modulus + 2.0 * sigma, color=BAND, alpha=0.4, lw=0.0)
        ax.plot(age, modulus, color=MODEL, label=shown.fitted.label)
    for k, test in enumerate(shown.tests):
        ax.errorbar(
            test.age, KPA * test.modulus, yerr=2.0 * KPA * test.sigma, fmt=MARKERS[k % len(MARKERS)], ms=2.6,
            lw=0.6, color=COLOURS[k % len(COLOURS)], label=test.label,
        )  # fmt: skip
    ax.set_xscale("log")
    ax.set_xlabel("Mean age of the strain (s)")
    ax.set_ylabel("Modulus $E_a$ (kPa)")
    ax.legend(loc="best")
    ax.margins(x=0.05, y=0.15)


KIND: FigureKind[TimeScales] = FigureKind(
    name="rate-moduli",
    width=COLUMN,
    height=lambda shown: 66.0,
    caption=caption,
    panels=lambda shown: [["moduli"]],
    draw=draw,
    applies=lambda shown: len(shown.tests) > 0,
)
