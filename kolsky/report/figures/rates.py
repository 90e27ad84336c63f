"""Figures of several shots: stiffness against strain rate, over time scales, and identified together."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from kolsky.inverse.joint_result import JointResult
from kolsky.inverse.parameters import MOVED
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    FORCE,
    GREY,
    KPA,
    MARKERS,
    MEASURED,
    MM,
    MODEL,
    PAGE,
    ROUTES,
    SERIES,
    Panels,
    figure,
    label_point,
    label_text,
    note_empty,
    plain_log_ticks,
)
from kolsky.results.nomenclature import route_label
from kolsky.studies.rates.records import GroupRates
from kolsky.studies.rates.scatter import SlopeVerdict

LINE_POINTS = 101


@figure(PAGE, 68.0, [["wide", "near"]], width_ratios=[1.25, 1.0], letters=True)
def rate_slope(group: GroupRates, panels: Panels) -> str:
    wide, near = panels["wide"], panels["near"]
    for ax in (wide, near):
        ax.set_xscale("log")
        ax.set(xlabel="Strain rate (1/s)", ylabel="Stiffness factor $m$ (–)")
    wide.axhline(1.0, color=GREY, lw=0.5)
    rates = sorted({s.quasi_static.rate for s in group.shots if s.quasi_static.rate is not None})
    for number, rate in enumerate(rates):
        label = "" if number else "quasi-static"
        wide.plot(rate, 1.0, "s", color=MEASURED, ms=3.5, label=label)
    low = min(s.history.true_rate[0] for s in group.shots)
    high = max(s.history.true_rate[1] for s in group.shots)
    for ax in (wide, near):
        _mean(ax, group, low / 1.15, high * 1.15)
        _line(ax, group)
        _shots(ax, group)
    slowest = min([low, *rates])
    wide.set_xlim(slowest / 3.0, high * 3.0)
    near.set_xlim(low / 1.3, high * 1.3)
    if not rates:  # from quasi-static to impact there are decades, so powers of ten are used
        _plain_rates(wide)
    _plain_rates(near)
    near.margins(y=0.25)
    _lever(wide, group)
    if group.pooled is not None:
        near.legend(loc="best", ncols=2)
    if rates:
        wide.legend(loc="best")
    line = group.slope
    claimed = line is not None and line.verdict is not SlopeVerdict.REFUSED
    through = (
        " Line: meta-regression on the logarithm of the rate with its 95 % band."
        if claimed
        else " Dashed: the line through the shots; their rates do not support it (see the conditions)."
    )
    return (
        "Stiffness factor m against nominal strain rate: each shot with ±2u (thick: errors of this shot "
        "only, thin: with shared errors) and, across, the range of the true rate inside the test; mean "
        "of the shots with its 95 % interval (band) and the interval of one more shot (dotted)."
        + ("" if line is None or line.fit is None else through)
        + " Left: on the scale of rates down to the quasi-static test, where m = 1 by definition; right: the"
        " shots alone. Open circles do not count."
    )


def _plain_rates(ax: Axes) -> None:
    """Label the rates with plain numbers. Within a factor of five, the labels lie at equal distances."""
    plain_log_ticks(ax.xaxis)
    low, high = ax.get_xlim()
    if high <= 5.0 * low:
        ax.xaxis.set_major_locator(MaxNLocator(3))


def _mean(ax: Axes, group: GroupRates, low: float, high: float) -> None:
    if group.pooled is None:
        return
    ax.fill_between([low, high], *group.pooled.interval, color=BAND, alpha=0.35, lw=0.0, label="mean, 95 %")
    ax.plot([low, high], [group.pooled.mean] * 2, color=BAND, lw=1.0)
    for end in group.pooled.prediction:
        ax.plot([low, high], [end, end], ":", color=BAND, lw=0.8)


def _line(ax: Axes, group: GroupRates) -> None:
    line = group.slope
    if line is None or line.fit is None:
        return
    rates = [shot.history.nominal_rate for shot in group.counted]
    x = np.linspace(np.log10(min(rates)), np.log10(max(rates)), LINE_POINTS)
    columns = np.column_stack([np.ones(LINE_POINTS), x - np.log10(line.reference)])
    y = columns @ line.fit.coefficients
    if line.verdict is SlopeVerdict.REFUSED:
        ax.plot(10.0**x, y, "--", color=GREY, lw=0.8, label="line, not carried")
        return
    ax.plot(10.0**x, y, color=MODEL, lw=1.0, label="line, 95 %")
    ax.fill_between(10.0**x, *line.band(x), color=MODEL, alpha=0.2, lw=0.0)


def _shots(ax: Axes, group: GroupRates) -> None:
    for shot in group.shots:
        if not np.isfinite(shot.m):
            continue
        rate = shot.history.nominal_rate
        ax.plot(shot.history.true_rate, [shot.m] * 2, color=GREY, lw=0.5)
        for sigma, width in ((shot.sigma, 0.7), (shot.sigma_own, 1.6)):
            ax.plot([rate] * 2, [shot.m - 2.0 * sigma, shot.m + 2.0 * sigma], color=MEASURED, lw=width)
        ax.plot(rate, shot.m, "o", color=MEASURED, ms=3.2, mfc=MEASURED if shot.counted else "white")


def _lever(ax: Axes, group: GroupRates) -> None:
    """Mark the range of rates of the shots, above the axis and below the data."""
    rates = [shot.history.nominal_rate for shot in group.counted]
    if len(rates) < 2:
        return
    place = ax.get_xaxis_transform()
    bottom, top = ax.get_ylim()
    ax.set_ylim(bottom - 0.25 * (top - bottom), top)  # room below all data
    ax.plot([min(rates), max(rates)], [0.04, 0.04], "|-", color=FORCE, ms=4, lw=1.2, transform=place)
    span = np.log10(max(rates) / min(rates))
    middle = float(np.sqrt(min(rates) * max(rates)))
    label_point(ax, f"{span:.2f} decade", (middle, 0.04), (0, 3), xycoords=place, ha="right", color=FORCE)


MOST_SHOTS_DRAWN = ("joint", "force only", "shape only")
SHOT_HEIGHT = 0.22
"""Distance between the routes of one shot, in rows."""


@figure(
    PAGE,
    lambda group: 32.0 + 7.5 * len(group.shots),
    [["shots"]],
    applies=lambda group: any(np.isfinite(shot.m) for shot in group.shots),
)
def rate_forest(group: GroupRates, panels: Panels) -> str:
    ax = panels["shots"]
    count = len(group.shots)
    rows = np.arange(count, 0, -1)
    for row, shot in zip(rows, group.shots, strict=True):
        routes = {route.name: route for route in shot.found.routes}
        for number, name in enumerate(MOST_SHOTS_DRAWN):
            whole = name == "joint" or (name not in routes and name == MOST_SHOTS_DRAWN[0])
            value, sigma = (shot.m, shot.sigma) if whole else (np.nan, np.nan)
            if not whole and name in routes:
                value = routes[name].parameters.get("stiffness_factor", np.nan)
                sigma = routes[name].sigma.get("stiffness_factor", np.nan)
            if np.isfinite(value):
                half = 2.0 * sigma if np.isfinite(sigma) else None
                colour, y = ROUTES[name], row + SHOT_HEIGHT * (1 - number)
                style: dict[str, Any] = {"color": colour, "mfc": colour if shot.counted else "white"}
                label = route_label(name) if row == rows[0] else ""
                ax.errorbar(value, y, xerr=half, fmt="o", ms=3, label=label, **style)
    names = [label_text(shot.name, 24) for shot in group.shots]
    ax.set_yticks([*rows, 0], [*names, "mean"])
    ax.set_ylim(-0.6, count + 0.7)
    ax.tick_params(axis="y", which="both", left=False, right=False)
    ax.set_xlabel("Stiffness factor $m$ (–)")
    if group.pooled is not None:
        mean, (low, high) = group.pooled.mean, group.pooled.interval
        ax.axvspan(low, high, color=BAND, alpha=0.25, lw=0.0)
        ax.fill([low, mean, high, mean], [0, 0.25, 0, -0.25], color=MEASURED, lw=0.0)
    ax.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.1, 1.0), borderaxespad=0.1)
    return (
        "Stiffness factor of each shot, slowest first, by force and outline together with ±2u of the whole "
        "budget, and by each alone with ±2 of the standard uncertainty of its residuals; the diamond is the "
        "mean, as wide as its 95 % interval. Open circles do not count."
    )


PANELS = {
    "stress": ("nominal stress", "Nominal stress (kPa)"),
    "secant": ("secant modulus", "Secant modulus (kPa)"),
    "tangent": ("tangent modulus", "Tangent modulus (kPa)"),
}


@figure(PAGE, 58.0, [list(PANELS)], applies=lambda group: len(group.stiffness) > 0, letters=True)
def rate_stiffness(group: GroupRates, panels: Panels) -> str:
    slow = _slow(group)
    for panel, (quantity, label) in PANELS.items():
        ax = panels[panel]
        ax.set_xscale("log")
        ax.set(xlabel="Strain rate (1/s)", ylabel=label)
        for k, at in enumerate(group.stiffness):
            if quantity not in at.quantities:
                continue
            colour, marker = SERIES[k % len(SERIES)], MARKERS[k % len(MARKERS)]
            value, sigma = (KPA * x for x in at.quantities[quantity])
            style: dict[str, Any] = {"color": colour, "fmt": marker, "ms": 2.8, "lw": 0.8}
            ax.errorbar(at.rates, value, yerr=2.0 * sigma, **style)
            end = int(np.argmax(at.rates))
            beyond: dict[str, Any] = {"va": "center", "annotation_clip": False}
            label_point(ax, f"{at.strain:g}", (at.rates[end], value[end]), (5, 0), color=colour, **beyond)
            if slow:
                base, spread = (KPA * x for x in at.baseline[quantity])
                ax.errorbar(slow, base, yerr=2.0 * spread, mfc="white", **style)
                ax.plot([slow, at.rates.min()], [base, base], ":", color=colour, lw=0.6)
        ax.set_yscale("log")
        plain_log_ticks(ax.yaxis, (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
        ax.margins(x=0.2, y=0.1)
        if not slow:
            _plain_rates(ax)
    return (
        "Nominal compressive stress, secant modulus and tangent modulus at fixed nominal strains (given "
        "next to each series; 0: the initial modulus) against nominal strain rate, ±2u. Filled: the shots,"
        " the quasi-static curve times m; open: the quasi-static curve itself"
        + (
            ", at its rate, and its level extended to theirs (dotted)."
            if _slow(group)
            else ". Its rate is not declared, so it is not drawn."
        )
    )


def _slow(group: GroupRates) -> float | None:
    """The quasi-static rate of the group, if all tests have the same one."""
    rates = {shot.quasi_static.rate for shot in group.counted}
    return rates.pop() if len(rates) == 1 else None


@figure(PAGE, 72.0, [["force", "shape"]], applies=lambda group: group.equal_strain is not None, letters=True)
def rate_equal_strain(group: GroupRates, panels: Panels) -> str:
    e = group.equal_strain
    assert e is not None  # checked by `applies`
    force, shape = panels["force"], panels["shape"]
    for number, shot in enumerate(group.counted):
        colour, marker = SERIES[number % len(SERIES)], MARKERS[number % len(MARKERS)]
        c, h = shot.found.comparison, shot.history
        inside = (c.force_time >= h.time[0]) & (c.force_time <= h.time[-1])
        strain = np.interp(c.force_time[inside], h.time, h.strain)
        label = f"{label_text(shot.name, 20)}, {h.nominal_rate:.3g} 1/s"
        force.plot(strain, c.force_measured[inside], color=colour, lw=0.7, label=label)
        force.plot(e.strains, e.force[number], marker, color=colour, ms=3.0, mec="white", mew=0.4)
        for outline in (s for s in e.shapes if s.shot == shot.name):
            shape.plot(MM * outline.y, MM * outline.model, color=colour, lw=0.5)
            shape.plot(MM * outline.y, MM * outline.Z, marker, color=colour, ms=1.8, mew=0.0)
    slow: dict[str, Any] = {"color": MEASURED, "lw": 0.9, "zorder": 5}
    force.plot(e.baseline_strain, e.baseline_force, "--", label="quasi-static × area", **slow)
    for strain in e.strains:
        force.axvline(strain, color=GREY, lw=0.3)
    force.set(xlabel="Nominal strain (–)", ylabel="Force $F$ (N)")
    shape.set(xlabel="Height $y$ (mm)", ylabel="Radius $Z$ (mm)")
    force.legend(loc="upper left")
    if not e.shapes:
        note_empty(shape, "no outline was measured")
    for strain in e.strains:
        outlines = [s for s in e.shapes if s.strain == strain]
        if outlines:
            last = max(outlines, key=lambda s: s.y[-1])
            end = (MM * last.y[-1], MM * last.Z[-1])
            label_point(shape, f"{strain:g}", end, (3, 0), va="center", color=GREY, annotation_clip=False)
    strains = ", ".join(f"{strain:g}" for strain in e.strains)
    return (
        "Left: transmitted force against nominal strain, bin means of every counted shot (lines), its values "
        "at the strains compared (markers), and the quasi-static stress times the undeformed area, as of a "
        "specimen that stays a cylinder (dashed). Waves, inertia and the held faces are in the shots’ "
        "forces: the distance between the lines is not a rate sensitivity. Right: outlines in the frames "
        f"nearest to the strains {strains}, measured (markers) and simulated (lines)."
    )


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
        "Stiffness factor of each shot, the shared factor times the most likely scatter of the shot; "
        "bars: ±2u of that part. Line and band: the shared factor with its 95 % interval. Scatter: "
        f"{100.0 * scatter:.2g} %."
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
