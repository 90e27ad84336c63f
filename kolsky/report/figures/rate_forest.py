"""Every shot by each route, their mean, and the mean without each of them."""

import numpy as np

from kolsky.report.figures.base import BAND, MEASURED, PAGE, ROUTES, FigureKind, Panels, letter
from kolsky.report.labels import shortened
from kolsky.studies.rates.records import GroupRates

DRAWN = ("joint", "force only", "shape only")
STEP = 0.22
"""Distance of the routes of one shot, in rows."""


def caption(group: GroupRates) -> str:
    """What is seen."""
    return (
        "Left: stiffness factor of each shot, slowest first, by force and shape together with ±2u of the"
        " whole budget, and by each alone with ±2 of the standard uncertainty of its residuals; the diamond"
        " is the mean, as wide as its 95 % interval. Right: the mean and its 95 % interval without each shot"
        " in turn. Open circles do not count."
    )


def draw(group: GroupRates, panels: Panels) -> None:
    """Draw the forest and the leave-one-out."""
    left, right = panels["shots"], panels["without"]
    letter(left, "a")
    letter(right, "b")
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
                    label=name if row == rows[0] else "",
                )
    names = [shortened(shot.name, 24) for shot in group.shots]
    left.set_yticks([*rows, 0], [*names, "mean"])
    for ax in (left, right):
        ax.set_ylim(-0.6, count + 0.7)
        ax.tick_params(axis="y", which="both", left=False, right=False)
        ax.set_xlabel("Stiffness factor $m$ (–)")
    right.set_yticks([])
    if group.pooled is not None:
        p = group.pooled
        low, high = p.interval
        for ax in (left, right):
            ax.axvspan(low, high, color=BAND, alpha=0.25, lw=0.0)
        left.fill([low, p.mean, high, p.mean], [0, 0.25, 0, -0.25], color=MEASURED, lw=0.0)
        right.fill([low, p.mean, high, p.mean], [0, 0.25, 0, -0.25], color=MEASURED, lw=0.0)
        place = {shot.name: row for shot, row in zip(group.shots, rows, strict=True)}
        for shot, fit in zip(group.counted, p.leave_one_out, strict=True):
            if fit is None:
                continue
            mean, (start, end) = float(fit.coefficients[0]), fit.interval(0)
            right.plot([start, end], [place[shot.name]] * 2, color=MEASURED, lw=0.8)
            right.plot(mean, place[shot.name], "D", color=MEASURED, ms=3)
    left.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.1, 1.0), borderaxespad=0.1)


KIND: FigureKind[GroupRates] = FigureKind(
    name="rate-forest",
    width=PAGE,
    height=lambda group: 32.0 + 7.5 * len(group.shots),
    caption=caption,
    panels=lambda group: [["shots", "without"]],
    draw=draw,
    mosaic={"width_ratios": [1.2, 1.0]},
    applies=lambda group: any(np.isfinite(shot.m) for shot in group.shots),
)
