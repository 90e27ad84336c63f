"""Figures of shots at equal strain: stiffness, force and radius, and moduli over all time scales."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from kolsky.material.relaxation.time_scales import ApparentModuli
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    GREY,
    MEASURED,
    MM,
    MODEL,
    PAGE,
    FigureKind,
    Panels,
    label_panel,
    label_text,
    note_empty,
    plain_log_ticks,
)
from kolsky.studies.rates.records import GroupRates

KPA = 1e-3
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "osD^v<>"
PANELS = {
    "stress": ("nominal stress", "Nominal stress (kPa)"),
    "secant": ("secant modulus", "Secant modulus (kPa)"),
    "tangent": ("tangent modulus", "Tangent modulus (kPa)"),
}


def caption_stiffness(group: GroupRates) -> str:
    """Return the caption."""
    return (
        "Nominal compressive stress, secant modulus and tangent modulus at fixed nominal strains (given"
        " beside each series; 0: the initial modulus) against nominal strain rate, ±2u. Filled: the shots,"
        " the quasi-static curve times m; open: the quasi-static curve itself"
        + (
            ", at its own rate, and its level carried to theirs (dotted)."
            if _slow(group)
            else ". Its rate is not declared, so it is not drawn."
        )
    )


def draw_stiffness(group: GroupRates, panels: Panels) -> None:
    """Draw the three quantities."""
    slow = _slow(group)
    for number, (panel, (quantity, label)) in enumerate(PANELS.items()):
        ax = panels[panel]
        label_panel(ax, "abc"[number])
        ax.set_xscale("log")
        ax.set_xlabel("Strain rate (1/s)")
        ax.set_ylabel(label)
        for k, at in enumerate(group.stiffness):
            if quantity not in at.quantities:
                continue
            colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
            value, sigma = (KPA * x for x in at.quantities[quantity])
            style: dict[str, Any] = {"color": colour, "fmt": marker, "ms": 2.8, "lw": 0.8}
            ax.errorbar(at.rates, value, yerr=2.0 * sigma, **style)
            end = int(np.argmax(at.rates))
            ax.annotate(
                f"{at.strain:g}",
                (at.rates[end], value[end]),
                xytext=(5, 0),
                textcoords="offset points",
                va="center",
                color=colour,
                annotation_clip=False,
            )
            if slow:
                base, spread = (KPA * x for x in at.baseline[quantity])
                ax.errorbar(slow, base, yerr=2.0 * spread, mfc="white", **style)
                ax.plot([slow, at.rates.min()], [base, base], ":", color=colour, lw=0.6)
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.margins(x=0.2, y=0.1)
        if not slow:
            plain_log_ticks(ax)


def _slow(group: GroupRates) -> float | None:
    """The one quasi-static rate of the group, if there is one."""
    rates = {shot.quasi_static.rate for shot in group.counted}
    return rates.pop() if len(rates) == 1 else None


def caption_equal_strain(group: GroupRates) -> str:
    """Return the caption."""
    assert group.equal_strain is not None  # checked by `applies`
    strains = ", ".join(f"{e:g}" for e in group.equal_strain.strains)
    return (
        "Left: transmitted force against nominal strain, bin means of every counted shot (lines), its values"
        " at the strains compared (markers), and the quasi-static stress times the undeformed area, as of a"
        " specimen that stays a cylinder (dashed). Waves, inertia and the held faces are in the shots’"
        " forces: the distance between the lines is no rate sensitivity."
        f" Right: outlines in the frames nearest to the strains {strains}, measured (markers) and simulated"
        " (lines)."
    )


def draw_equal_strain(group: GroupRates, panels: Panels) -> None:
    """Draw force and outline."""
    e = group.equal_strain
    assert e is not None  # checked by `applies`
    force, shape = panels["force"], panels["shape"]
    label_panel(force, "a")
    label_panel(shape, "b")
    for number, shot in enumerate(group.counted):
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
        c, h = shot.found.comparison, shot.history
        inside = (c.force_time >= h.time[0]) & (c.force_time <= h.time[-1])
        strain = np.interp(c.force_time[inside], h.time, h.strain)
        label = f"{label_text(shot.name, 20)}, {h.nominal_rate:.3g} 1/s"
        force.plot(strain, c.force_measured[inside], color=colour, lw=0.7, label=label)
        force.plot(e.strains, e.force[number], marker, color=colour, ms=3.0, mec="white", mew=0.4)
        for outline in (s for s in e.shapes if s.shot == shot.name):
            shape.plot(MM * outline.y, MM * outline.model, color=colour, lw=0.5)
            shape.plot(MM * outline.y, MM * outline.Z, marker, color=colour, ms=1.8, mew=0.0)
    force.plot(
        e.baseline_strain,
        e.baseline_force,
        "--",
        color=MEASURED,
        lw=0.9,
        label="quasi-static × area",
        zorder=5,
    )
    for strain in e.strains:
        force.axvline(strain, color=GREY, lw=0.3)
    force.set(xlabel="Nominal strain (–)", ylabel="Force $F$ (N)")
    shape.set(xlabel="Height $y$ (mm)", ylabel="Radius $Z$ (mm)")
    force.legend(loc="upper left")
    if not e.shapes:
        note_empty(shape, "no outline was measured")
    for strain in e.strains:
        here = [s for s in e.shapes if s.strain == strain]
        if here:
            last = max(here, key=lambda s: s.y[-1])
            shape.annotate(
                f"{strain:g}",
                (MM * last.y[-1], MM * last.Z[-1]),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                color=GREY,
                annotation_clip=False,
            )


TEST_COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#000000", "#56B4E9")


@dataclass(frozen=True)
class TimeScales:
    """Apparent moduli of tests and of a fitted model, drawn over one axis of time."""

    tests: Sequence[ApparentModuli]
    """Each test's own moduli, see `kolsky.material.relaxation.time_scales.apparent_moduli`."""
    fitted: ApparentModuli | None = None
    """The fitted model, its modulus and uncertainty from
    `kolsky.material.relaxation.time_scales.fitted_modulus`."""


def caption_moduli(shown: TimeScales) -> str:
    """Return the caption."""
    fitted = "" if shown.fitted is None else " Line and band: the fitted model with ±2u."
    return (
        "Modulus of rubber elasticity, Eq. (M.9), that each test shows by itself, against the mean age of "
        "the strain: the time of holding after a step, half the duration of a steady ramp, 1/ω of an "
        f"oscillation. Bars: ±2u.{fitted}"
    )


def draw_moduli(shown: TimeScales, panels: Panels) -> None:
    """Draw points with bars, and the model behind them."""
    ax = panels["moduli"]
    if shown.fitted is not None:
        age, modulus, sigma = shown.fitted.age, KPA * shown.fitted.modulus, KPA * shown.fitted.sigma
        ax.fill_between(age, modulus - 2.0 * sigma, modulus + 2.0 * sigma, color=BAND, alpha=0.4, lw=0.0)
        ax.plot(age, modulus, color=MODEL, label=shown.fitted.label)
    for k, test in enumerate(shown.tests):
        ax.errorbar(
            test.age, KPA * test.modulus, yerr=2.0 * KPA * test.sigma, fmt=MARKERS[k % len(MARKERS)], ms=2.6,
            lw=0.6, color=TEST_COLOURS[k % len(TEST_COLOURS)], label=test.label,
        )  # fmt: skip
    ax.set_xscale("log")
    ax.set_xlabel("Mean age of the strain (s)")
    ax.set_ylabel("Modulus $E_a$ (kPa)")
    ax.legend(loc="best")
    ax.margins(x=0.05, y=0.15)


FIGURES: tuple[FigureKind[GroupRates], ...] = (
    FigureKind(
        name="rate-stiffness",
        width=PAGE,
        height=lambda group: 58.0,
        caption=caption_stiffness,
        panels=lambda group: [list(PANELS)],
        draw=draw_stiffness,
        applies=lambda group: len(group.stiffness) > 0,
    ),
    FigureKind(
        name="rate-equal-strain",
        width=PAGE,
        height=lambda group: 72.0,
        caption=caption_equal_strain,
        panels=lambda group: [["force", "shape"]],
        draw=draw_equal_strain,
        applies=lambda group: group.equal_strain is not None,
    ),
)
MODULI = FigureKind(
    name="rate-moduli",
    width=COLUMN,
    height=lambda shown: 66.0,
    caption=caption_moduli,
    panels=lambda shown: [["moduli"]],
    draw=draw_moduli,
    applies=lambda shown: len(shown.tests) > 0,
)
