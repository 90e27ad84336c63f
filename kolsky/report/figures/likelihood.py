"""The profile likelihood of each free parameter with the threshold of its 95 % interval."""

import numpy as np

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import BAND, COLUMN, GREY, MEASURED, MODEL, FigureKind, Panels, letter
from kolsky.report.nomenclature import axis_label

THRESHOLD = 3.84


def caption(result: Identification) -> str:
    """What is seen."""
    others = ", the other parameters re-optimised at every point" if len(result.profiles) > 1 else ""
    return (
        f"Profile likelihood of each free parameter from the noise of force and shape{others}: the rise of "
        "−2 ln L over its smallest value and over the factor by which residuals that are correlated in time "
        "raise the parameter’s variance. Dashed: 3.84, where the 95 % interval (band) ends; dotted: the "
        "answer."
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
        rise = profile.rise / profile.correlation
        side = np.where(np.arange(rise.size) < np.argmin(rise), -1.0, 1.0)
        if rise.min() < 0.0:  # a rough one, on which a lower point than the optimum was found
            ax.plot(profile.values, rise, color=MODEL)
        else:  # nearly a parabola between its points: its signed root is nearly straight
            fine = np.linspace(left, right, 2001)
            ax.plot(fine, np.interp(fine, profile.values, side * np.sqrt(rise)) ** 2, color=MODEL)
        ax.plot(profile.values, rise, "o", color=MODEL, ms=1.8, mew=0.0)
        margin = 0.6 * (high - low)
        ax.set_xlim(max(left, low - margin), min(right, high + margin))
        ax.set_ylim(min(0.0, rise.min()), 2.5 * THRESHOLD)
        ax.set_xlabel(axis_label(profile.name, result.estimates[profile.name].unit))
        ax.set_ylabel(r"Rise of $-2\,\ln L$ (–)")
        ax.locator_params(axis="x", nbins=5)


KIND = FigureKind(
    name="likelihood",
    width=COLUMN,
    height=lambda result: 46.0 * len(result.profiles),
    caption=caption,
    panels=lambda result: [[profile.name] for profile in result.profiles],
    draw=draw,
    applies=lambda result: bool(result.profiles),
)
