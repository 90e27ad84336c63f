"""The profile likelihood of each free parameter with the threshold of its 95 % interval."""

import numpy as np

from kolsky.identification import Identification
from kolsky.report.figures.base import BAND, GREY, MEASURED, MODEL, PAGE, FigureKind, Panels, letter
from kolsky.report.nomenclature import axis_label

COLUMNS = 3
THRESHOLD = 3.84


def caption(result: Identification) -> str:
    """What is seen."""
    others = ", the other parameters re-optimised at every point" if len(result.profiles) > 1 else ""
    return (
        f"Profile likelihood of each free parameter from the noise of force and shape{others}: the rise of "
        "−2 ln L over its smallest value and over the factor by which residuals that are correlated in time "
        "raise the parameter’s variance. Dashed: 3.84, where the 95 % interval (band) ends; dotted: the answer."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw a panel a parameter."""
    for number, profile in enumerate(result.profiles):
        ax = panels[profile.name]
        if len(result.profiles) > 1:
            letter(ax, "abcdefghijkl"[number])
        low, high = profile.interval
        left, right = profile.values[0], profile.values[-1]
        low, high = (left if np.isnan(low) else low), (right if np.isnan(high) else high)
        ax.axvspan(low, high, color=BAND, alpha=0.35, lw=0.0)
        ax.axhline(THRESHOLD, color=GREY, lw=0.7, ls="--")
        ax.axvline(result.estimates[profile.name].value, color=MEASURED, lw=0.6, ls=":")
        ax.plot(profile.values, profile.rise / profile.correlation, "o-", color=MODEL, ms=1.8, mew=0.0)
        margin = 0.6 * (high - low)
        ax.set_xlim(max(left, low - margin), min(right, high + margin))
        ax.set_ylim(0.0, 2.5 * THRESHOLD)
        ax.set_xlabel(axis_label(profile.name, result.estimates[profile.name].unit))
        ax.set_ylabel(r"Rise of $-2\,\ln L$ (–)" if number % COLUMNS == 0 else "")
        if number % COLUMNS:
            ax.tick_params(labelleft=False)
        ax.locator_params(axis="x", nbins=5)


def panels(result: Identification) -> list[list[str]]:
    """Three parameters a row."""
    names = [profile.name for profile in result.profiles]
    names += ["."] * (-len(names) % COLUMNS)
    return [names[i : i + COLUMNS] for i in range(0, len(names), COLUMNS)]


KIND = FigureKind(
    name="likelihood",
    width=PAGE,
    height=lambda result: 52.0 * -(-len(result.profiles) // COLUMNS),
    caption=caption,
    panels=panels,
    draw=draw,
    applies=lambda result: bool(result.profiles),
)
