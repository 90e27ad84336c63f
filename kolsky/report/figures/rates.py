"""Figures of stiffness against strain rate: the line through the shots, the shots one by one."""

import numpy as np
from matplotlib.axes import Axes

from kolsky.report.figures.base import (
    BAND,
    FORCE,
    GREY,
    MEASURED,
    MODEL,
    PAGE,
    ROUTES,
    FigureKind,
    Panels,
    label_panel,
    label_text,
    plain_log_ticks,
)
from kolsky.report.nomenclature import route_label
from kolsky.studies.rates.records import GroupRates
from kolsky.studies.rates.regression import SlopeVerdict

POINTS = 101


def caption_slope(group: GroupRates) -> str:
    """Return the caption."""
    line = group.slope
    claimed = line is not None and line.verdict is not SlopeVerdict.REFUSED
    through = (
        " Line: meta-regression on the logarithm of the rate with its 95 % band."
        if claimed
        else " Dashed: the line through the shots; their rates do not support it (see the conditions)."
    )
    return (
        "Stiffness factor m against nominal strain rate: each shot with ±2u (thick: what is its own, thin:"
        " with what it shares) and, across, the range of the true rate inside the test; mean of the shots"
        " with its 95 % interval (band) and the interval of one more shot (dotted)."
        + ("" if line is None or line.fit is None else through)
        + " Left: on the scale of rates down to the quasi-static test, where m = 1 by definition; right: the"
        " shots alone. Open circles do not count."
    )


def draw_slope(group: GroupRates, panels: Panels) -> None:
    """Draw both panels."""
    wide, near = panels["wide"], panels["near"]
    for ax, mark in ((wide, "a"), (near, "b")):
        label_panel(ax, mark)
        ax.set_xscale("log")
        ax.set_xlabel("Strain rate (1/s)")
        ax.set_ylabel("Stiffness factor $m$ (–)")
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
    if not rates:  # from quasi-static to impact there are decades, and powers of ten read better
        plain_log_ticks(wide)
    plain_log_ticks(near)
    near.margins(y=0.25)
    _lever(wide, group)
    if group.pooled is not None:
        near.legend(loc="best", ncols=2)
    if rates:
        wide.legend(loc="best")


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
    x = np.linspace(np.log10(min(rates)), np.log10(max(rates)), POINTS)
    columns = np.column_stack([np.ones(POINTS), x - np.log10(line.reference)])
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
    ax.annotate(
        f"{span:.2f} decade",
        (float(np.sqrt(min(rates) * max(rates))), 0.04),
        xytext=(0, 3),
        xycoords=place,
        textcoords="offset points",
        ha="right",
        color=FORCE,
    )


DRAWN = ("joint", "force only", "shape only")
STEP = 0.22
"""Distance of the routes of one shot, in rows."""


def caption_forest(group: GroupRates) -> str:
    """Return the caption."""
    without = " Right: the mean and its 95 % interval without each shot in turn." if _left_out(group) else ""
    return (
        f"{'Left: s' if without else 'S'}tiffness factor of each shot, slowest first, by force and outline"
        " together with ±2u of the whole budget, and by each alone with ±2 of the standard uncertainty of its"
        f" residuals; the diamond is the mean, as wide as its 95 % interval.{without}"
        " Open circles do not count."
    )


def _left_out(group: GroupRates) -> bool:
    """True if the mean is known without one of the shots; it takes three."""
    return group.pooled is not None and any(fit is not None for fit in group.pooled.leave_one_out)


def draw_forest(group: GroupRates, panels: Panels) -> None:
    """Draw the forest and the leave-one-out."""
    left, right = panels["shots"], panels.get("without")
    if right is not None:
        label_panel(left, "a")
        label_panel(right, "b")
    count = len(group.shots)
    rows = np.arange(count, 0, -1)
    for row, shot in zip(rows, group.shots, strict=True):
        routes = {route.name: route for route in shot.found.routes}
        for number, name in enumerate(DRAWN):
            whole = name == "joint" or (name not in routes and name == DRAWN[0])
            value, sigma = (shot.m, shot.sigma) if whole else (np.nan, np.nan)
            if not whole and name in routes:
                value = routes[name].parameters.get("stiffness_factor", np.nan)
                sigma = routes[name].sigma.get("stiffness_factor", np.nan)
            if np.isfinite(value):
                left.errorbar(
                    value,
                    row + STEP * (1 - number),
                    xerr=2.0 * sigma if np.isfinite(sigma) else None,
                    fmt="o",
                    ms=3,
                    color=ROUTES[name],
                    mfc=ROUTES[name] if shot.counted else "white",
                    label=route_label(name) if row == rows[0] else "",
                )
    names = [label_text(shot.name, 24) for shot in group.shots]
    left.set_yticks([*rows, 0], [*names, "mean"])
    for ax in panels.values():
        ax.set_ylim(-0.6, count + 0.7)
        ax.tick_params(axis="y", which="both", left=False, right=False)
        ax.set_xlabel("Stiffness factor $m$ (–)")
    if group.pooled is not None:
        p = group.pooled
        low, high = p.interval
        for ax in panels.values():
            ax.axvspan(low, high, color=BAND, alpha=0.25, lw=0.0)
            ax.fill([low, p.mean, high, p.mean], [0, 0.25, 0, -0.25], color=MEASURED, lw=0.0)
        place = {shot.name: row for shot, row in zip(group.shots, rows, strict=True)}
        for shot, fit in zip(group.counted, p.leave_one_out, strict=True):
            if fit is None or right is None:
                continue
            mean, (start, end) = float(fit.coefficients[0]), fit.interval(0)
            right.plot([start, end], [place[shot.name]] * 2, color=MEASURED, lw=0.8)
            right.plot(mean, place[shot.name], "D", color=MEASURED, ms=3)
    if right is not None:
        right.set_yticks([])
    left.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.1, 1.0), borderaxespad=0.1)


FIGURES: tuple[FigureKind[GroupRates], ...] = (
    FigureKind(
        name="rate-slope",
        width=PAGE,
        height=lambda group: 68.0,
        caption=caption_slope,
        panels=lambda group: [["wide", "near"]],
        draw=draw_slope,
        mosaic={"width_ratios": [1.25, 1.0]},
    ),
    FigureKind(
        name="rate-forest",
        width=PAGE,
        height=lambda group: 32.0 + 7.5 * len(group.shots),
        caption=caption_forest,
        panels=lambda group: [["shots", "shots", "without", "without"]] if _left_out(group) else [["shots"]],
        draw=draw_forest,
        applies=lambda group: any(np.isfinite(shot.m) for shot in group.shots),
    ),
)
