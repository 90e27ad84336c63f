"""Figures of several shots identified together: each shot's own stiffness, the curve the impacts ask for."""

import numpy as np

from kolsky.inverse.joint_result import JointResult
from kolsky.inverse.parameters import MOVED
from kolsky.report.figures.base import BAND, COLUMN, GREY, KPA, MEASURED, MODEL, Panels, figure


@figure(COLUMN, 62.0, [["shots"]], applies=lambda result: MOVED in result.estimates)
def joint_shots(result: JointResult, panels: Panels) -> str:
    ax, e = panels["shots"], result.estimates[MOVED]
    half = result.expanded[MOVED]
    ax.axhspan(e.value - half, e.value + half, color=BAND, alpha=0.4, lw=0.0)
    ax.axhline(e.value, color=MODEL, lw=0.9)
    number = np.arange(1, len(result.shots) + 1)
    factors = [p.factor + e.mesh_correction for p in result.shots]
    bars = [2.0 * p.sigma_factor for p in result.shots]
    ax.errorbar(number, factors, yerr=bars, fmt="o", ms=3.0, lw=0.7, color=MEASURED)
    ax.set_xticks(number, [p.name for p in result.shots], rotation=30, ha="right")
    ax.set_xlim(0.5, len(number) + 0.5)
    ax.set_ylabel("Stiffness factor $m$")
    ax.margins(y=0.2)
    scatter = 0.0 if result.scatter is None else result.scatter.value
    return (
        "Stiffness factor of each shot, the shared one times its own most likely part of the scatter; bars: "
        "±2u of that part. Line and band: the shared factor with its 95 % interval. "
        f"Scatter: {100.0 * scatter:.2g} %."
    )


@figure(COLUMN, 62.0, [["curve"]], applies=lambda result: result.curve is not None)
def joint_curve(result: JointResult, panels: Panels) -> str:
    ax, c = panels["curve"], result.curve
    assert c is not None  # the figure applies to no other
    sign = -1.0 if c.stretch[-1] < 1.0 else 1.0
    strain = sign * (c.stretch - 1.0)
    lower, upper = KPA * sign * c.band
    factor = np.exp(np.interp(strain, sign * c.strain, np.log(c.factor)))
    ax.fill_between(strain, lower, upper, color=BAND, alpha=0.4, lw=0.0)
    ax.plot(strain, KPA * sign * c.stress, color=MODEL, lw=1.1, label="asked for by the impacts")
    ax.plot(strain, KPA * sign * c.stress / factor, "--", color=MEASURED, lw=0.9, label="slow curve")
    nodes = np.interp(sign * c.strain, strain, KPA * sign * c.stress)
    by_data = c.prior_share < 0.5
    for rows, colour in ((by_data, MODEL), (~by_data, GREY)):
        ax.plot((sign * c.strain)[rows], nodes[rows], "o", ms=3.2, color=colour, clip_on=False)
    ax.set(xlabel="Nominal strain" + (", compressive" if sign < 0.0 else ""), ylabel="Nominal stress (kPa)")
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    ax.legend(loc="upper left")
    return (
        "Nominal stress identified from the impacts, with its k = 2 band, and the slow curve (dashed). Dots: "
        "nodes; grey ones, which smoothness determines more than the data."
    )
