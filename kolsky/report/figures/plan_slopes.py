"""How force and outline change with each parameter."""

import numpy as np

from kolsky.report.figures.base import BAND, FORCE, GREY, MS, PAGE, UM, FigureKind, Panels, letter
from kolsky.report.figures.maps import draw_map
from kolsky.report.nomenclature import name_of
from kolsky.studies.planning.plan import Plan

CHANGE = 0.01
"""Change of a parameter that is drawn, over its scale."""
LETTERS = "abcdefghijklmnop"


def caption(plan: Plan) -> str:
    """What is seen."""
    changes = ", ".join(_said(plan, j) for j in range(len(plan.names)))
    reach = 100.0 * plan.information.sensitivity.reach
    return (
        "Change of the transmitted force (top) and of the outline (bottom) with each parameter, for "
        f"{changes}: straight lines through runs within {reach:g} % of the parameter’s scale. Band: "
        "± what the lines leave out of the force, over that change; ringing is most of it. White: no free "
        "surface at that height."
    )


def _said(plan: Plan, j: int) -> str:
    slopes, name = plan.information.sensitivity, name_of(plan.names[j])
    unit = "" if name.unit == "1" else f" {name.unit}"
    return f"Δ{name.symbol} = {CHANGE * slopes.scale[j] * name.factor:.3g}{unit}"


def draw(plan: Plan, panels: Panels) -> None:
    """Draw a line over a map for each parameter."""
    slopes = plan.information.sensitivity
    letters = iter(LETTERS)
    time = MS * slopes.grid.times
    for j, name in enumerate(plan.names):
        step = CHANGE * slopes.scale[j]
        top, low = panels[f"{name} force"], panels[f"{name} outline"]
        letter(top, next(letters))
        change = step * slopes.force_slope[j]
        left = CHANGE / slopes.reach * slopes.force_left[j]
        top.fill_between(time, change - left, change + left, color=BAND, alpha=0.35, lw=0.0)
        top.axhline(0.0, color=GREY, lw=0.5)
        top.plot(time, change, color=FORCE)
        top.set(xlabel="Time (ms)", ylabel=rf"$\Delta F$ with $\Delta {name_of(name).tex}$ (N)")
        change_of_radius = UM * step * slopes.radius_slope[j]
        shown = np.where(np.isfinite(slopes.radius), change_of_radius, np.nan)
        draw_map(low, slopes.grid, shown, rf"$\Delta Z$ with $\Delta {name_of(name).tex}$ (µm)")
        top.set_xlim(low.get_xlim())
        letter(low, next(letters))
        if j > 0:
            low.set_ylabel("")


KIND: FigureKind[Plan] = FigureKind(
    name="plan-slopes",
    width=PAGE,
    height=lambda plan: 92.0,
    caption=caption,
    panels=lambda plan: [[f"{name} {part}" for name in plan.names] for part in ("force", "outline")],
    draw=draw,
    mosaic={"height_ratios": [1.0, 1.35]},
)
