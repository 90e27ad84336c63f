"""Figures of several shots identified together: each shot's own stiffness, the curve the impacts ask for."""

import numpy as np

from kolsky.inverse.joint_result import JointResult
from kolsky.inverse.parameters import MOVED
from kolsky.report.figures.base import BAND, COLUMN, GREY, MEASURED, MODEL, FigureKind, Panels

KPA = 1e-3


def _caption_shots(found: JointResult) -> str:
    """Return the caption."""
    scatter = 0.0 if found.scatter is None else found.scatter.value
    return (
        "Stiffness factor of each shot, the shared one times its own most likely part of the scatter; bars: "
        "±2u of that part. Line and band: the shared factor with its 95 % interval. "
        f"Scatter: {100.0 * scatter:.2g} %."
    )


def _draw_shots(found: JointResult, panels: Panels) -> None:
    """Draw the shots over their number."""
    ax, e = panels["shots"], found.estimates[MOVED]
    half = found.expanded[MOVED]
    ax.axhspan(e.value - half, e.value + half, color=BAND, alpha=0.4, lw=0.0)
    ax.axhline(e.value, color=MODEL, lw=0.9)
    number = np.arange(1, len(found.shots) + 1)
    ax.errorbar(
        number,
        [p.factor + e.mesh_correction for p in found.shots],
        yerr=[2.0 * p.sigma_factor for p in found.shots],
        fmt="o",
        ms=3.0,
        lw=0.7,
        color=MEASURED,
    )
    ax.set_xticks(number, [p.name for p in found.shots], rotation=30, ha="right")
    ax.set_xlim(0.5, len(number) + 0.5)
    ax.set_ylabel("Stiffness factor $m$")
    ax.margins(y=0.2)


def _caption_curve(found: JointResult) -> str:
    """Return the caption."""
    return (
        "Nominal stress that the impacts ask for, with its k = 2 band, and the slow curve (dashed). Dots: "
        "nodes; grey ones, of which smoothness tells more than the data."
    )


def _draw_curve(found: JointResult, panels: Panels) -> None:
    """Draw the curve over the nominal strain, compression to the right."""
    ax, c = panels["curve"], found.curve
    assert c is not None  # the figure applies to no other
    sign = -1.0 if c.stretch[-1] < 1.0 else 1.0
    strain = sign * (c.stretch - 1.0)
    lower, upper = KPA * sign * c.band
    factor = np.exp(np.interp(strain, sign * c.strain, np.log(c.factor)))
    ax.fill_between(strain, lower, upper, color=BAND, alpha=0.4, lw=0.0)
    ax.plot(strain, KPA * sign * c.stress, color=MODEL, lw=1.1, label="asked for by the impacts")
    ax.plot(strain, KPA * sign * c.stress / factor, "--", color=MEASURED, lw=0.9, label="slow curve")
    told = c.prior_share < 0.5
    stress = np.interp(sign * c.strain, strain, KPA * sign * c.stress)
    ax.plot((sign * c.strain)[told], stress[told], "o", ms=3.2, color=MODEL, clip_on=False)
    ax.plot((sign * c.strain)[~told], stress[~told], "o", ms=3.2, color=GREY, clip_on=False)
    ax.set_xlabel("Nominal strain" + (", compressive" if sign < 0.0 else ""))
    ax.set_ylabel("Nominal stress (kPa)")
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    ax.legend(loc="upper left")


FIGURES: tuple[FigureKind[JointResult], ...] = (
    FigureKind(
        name="joint-shots",
        width=COLUMN,
        height=lambda found: 62.0,
        caption=_caption_shots,
        panels=lambda found: [["shots"]],
        draw=_draw_shots,
        applies=lambda found: MOVED in found.estimates,
    ),
    FigureKind(
        name="joint-curve",
        width=COLUMN,
        height=lambda found: 62.0,
        caption=_caption_curve,
        panels=lambda found: [["curve"]],
        draw=_draw_curve,
        applies=lambda found: found.curve is not None,
    ),
)
