"""Where and when the information about each parameter is, in the outline and in the force."""

import numpy as np

from kolsky.report.figures.base import FORCE, GREY, MM, MS, PAGE, FigureKind, Panels, letter
from kolsky.report.figures.maps import draw_map
from kolsky.report.nomenclature import name_of
from kolsky.studies.planning.plan import Plan

PER_MM_MS, PER_MS = 1e-6, 1e-3
"""From shares per m and s, and per s, to shares per mm and ms, and per ms."""
LETTERS = "abcdefghijklmnop"


def caption(plan: Plan) -> str:
    """What is seen."""
    several = len(plan.names) > 1
    together = " when all parameters are estimated together" if several else ""
    heights = any(plan.heights.values())
    return (
        "Where and when a measurement would tell most about each parameter" + together + ". Top: share of a "
        "parameter’s information in the outline at height y above the transmission platen and at a time, per "
        "mm and ms; white: nothing can be "
        "measured there"
        + (
            "; triangles: the best heights (D-optimal), "
            + ", ".join(str(n) for n in sorted(plan.heights))
            + " of them"
            if heights
            else ""
        )
        + ". Bottom: share in the force per ms"
        + (", and what it would be if the other parameters were known (dashed)." if several else ".")
    )


def draw(plan: Plan, panels: Panels) -> None:
    """Draw a map over a line for each parameter."""
    found = plan.information
    grid = found.sensitivity.grid
    force, outline = found.densities()
    alone, _ = found.densities(alone=True)
    letters = iter(LETTERS)
    for j, name in enumerate(plan.names):
        symbol = name_of(name).tex
        top, low = panels[f"{name} outline"], panels[f"{name} force"]
        letter(top, next(letters))
        label = f"Share on ${symbol}$ (1/(mm ms))"
        draw_map(top, grid, PER_MM_MS * outline[j], label, bottom=0.0)
        left, right = top.get_xlim()
        for count, choices in plan.heights.items():
            for choice in (c for c in choices if c.criterion == "D"):
                x = np.full(choice.places.size, left + (right - left) * (0.035 * count))
                top.plot(x, MM * choice.places, ">", color="white", ms=2.4, mew=0.0)
        top.set_xlim(left, right)
        time = MS * grid.times
        low.plot(time, PER_MS * force[j], color=FORCE, label="together")
        if len(plan.names) > 1:
            low.plot(time, PER_MS * alone[j], color=GREY, ls="--", lw=0.8, label="others known")
        low.set(xlabel="Time (ms)", xlim=top.get_xlim())
        low.set_ylim(bottom=0.0)
        low.set_ylabel(f"Share on ${symbol}$ (1/ms)")
        letter(low, next(letters))
        if j > 0:
            top.set_ylabel("")
        if j == 0 and len(plan.names) > 1:
            low.legend(loc="upper left")


KIND: FigureKind[Plan] = FigureKind(
    name="plan-information",
    width=PAGE,
    height=lambda plan: 92.0,
    caption=caption,
    panels=lambda plan: [[f"{name} {part}" for name in plan.names] for part in ("outline", "force")],
    draw=draw,
    mosaic={"height_ratios": [1.35, 1.0]},
)
