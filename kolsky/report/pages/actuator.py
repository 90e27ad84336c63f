"""Page of a pressurised actuator."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from kolsky.bodies.actuator_bending import SearchEnd, relative_bend
from kolsky.report.body_views import ActuatorView
from kolsky.report.figures import ACTUATORS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers

BAR = 1e-5


def render(shown: ActuatorView, inputs: Mapping[str, str]) -> str:
    """Return the page as HTML text; see `write_page`."""
    return render_page(
        "actuator.html",
        kind="Pressurised actuator",
        heading=shown.name,
        subject="bend",
        warnings=sentences(shown.warnings),
        tables=[table for table in tables(shown) if table["rows"]],
        figures=draw_figures(ACTUATORS.values(), shown),
        inputs=list(inputs.items()),
    )


write_page = page_writer(render)


def _degrees(value: float) -> str:
    return numbers.NOTHING if np.isnan(value) else f"{np.degrees(value):.2f}°"


def tables(view: ActuatorView) -> list[dict[str, Any]]:
    """Tables of the page: of each the caption, the heads and the rows."""
    return [bends(view), contacts(view), _marker_rows(view), stiffness(view), inversions(view), loops(view)]


def bends(view: ActuatorView) -> dict[str, Any]:
    """Bend at the declared pressures."""
    rows = []
    for one in view.directions:
        healed = None if one.healed is None else relative_bend(one)
        slopes = one.pristine.slopes().sum(axis=1)
        for number, k in enumerate(one.asked):
            rows.append(
                _row(
                    one.name,
                    f"{BAR * float(one.pristine.pressures[k].max()):.3g}",
                    _degrees(float(one.pristine.angle[k])),
                    f"{np.degrees(slopes[k]) / BAR:.4g}",
                    numbers.NOTHING if one.healed is None else _degrees(float(one.healed.angle[k])),
                    numbers.NOTHING if healed is None else numbers.percent(float(healed[number])),
                    lost=bool(one.overlapping[k]),
                )
            )
    heads = ["Gravity", "Pressure (bar)", "Bend", "Slope (°/bar)", "Bend, healed", "Healed less pristine"]
    return {"caption": "Bend at the declared pressures", "head": heads, "rows": rows}


def contacts(view: ActuatorView) -> dict[str, Any]:
    """Contact of neighbouring chambers."""
    rows = []
    for one in view.directions:
        found = one.touching
        if found is None:
            continue
        steps = np.flatnonzero(found.force > 0.0)
        bar = BAR * one.pristine.pressures.max(axis=1)
        rows.append(
            _row(
                one.name,
                "not at all" if steps.size == 0 else f"{bar[steps[0]]:.3g} bar",
                f"{found.force[-1]:.3g}",
                f"{1e6 * found.depth.max():.2g}",
                f"{1e3 * one.gap.min():.3g}",
            )
        )
    heads = [
        "Gravity", "Touching from the step at", "Force at the largest pressure (N)", "Deepest (µm)",
        "Smallest gap of facing points (mm)",
    ]  # fmt: skip
    return {"caption": "Contact of neighbouring chambers", "head": heads, "rows": rows}


def _marker_rows(view: ActuatorView) -> dict[str, Any]:
    """Root mean square distance of the markers, as Table 4 of the paper."""
    rows = [
        _row(
            one.gravity,
            f"{BAR * one.pressure:.3g}",
            f"{1e3 * one.rmse:.3f}",
            f"{1e3 * one.sigma:.3f}",
            _degrees(one.measured_angle),
            "yes" if one.explained else "no",
            lost=not one.explained,
        )
        for one in view.markers
    ]
    heads = [
        "Gravity",
        "Pressure (bar)",
        "RMSE (mm)",
        "Noise (mm)",
        "Bend measured",
        "Explained by the noise",
    ]
    return {"caption": "Markers: measured less simulated", "head": heads, "rows": rows}


def stiffness(view: ActuatorView) -> dict[str, Any]:
    """The factor of all moduli that the markers ask for."""
    found, rows = view.stiffness, []
    if found is not None:
        said = "yes" if found.explained else "no"
        rows.append(
            _row(
                "all", f"{found.factor:.4f}", f"{found.low:.4f} to {found.high:.4f}",
                f"{found.chi2 / found.degrees:.3g}", said, lost=not (found.explained and found.converged),
            )
        )  # fmt: skip
    heads = ["Markers", "Factor", "Interval, 95 %", "χ² / degrees of freedom", "Explained by the noise"]
    return {"caption": "Factor of all moduli fitted to the markers", "head": heads, "rows": rows}


def inversions(view: ActuatorView) -> dict[str, Any]:
    """Pressures for wanted bends."""
    rows = []
    for name, each in view.inversions.items():
        for one in each:
            found = one.pressures
            text = numbers.NOTHING if np.isnan(found).any() else ", ".join(f"{BAR * p:.4g}" for p in found)
            rows.append(
                _row(
                    name,
                    _degrees(one.angle),
                    text,
                    _degrees(one.found),
                    one.ended.value,
                    str(one.equilibria),
                    lost=one.ended is not SearchEnd.YES,
                )
            )
    heads = ["Gravity", "Wanted", "Pressure (bar)", "Bend there", "Outcome", "Equilibria"]
    return {"caption": "Pressures for wanted bends", "head": heads, "rows": rows}


def loops(view: ActuatorView) -> dict[str, Any]:
    """Benchmark of the loop."""
    rows = []
    for name, run in view.closed.items():
        made = view.reductions[name]
        reduced = made.model.reduced
        elements = f"{len(reduced.model.mesh.cells)} → {len(reduced.sample.cells)}"
        rows.append(
            _row(
                name,
                f"{elements}, {reduced.modes} modes",
                _degrees(made.largest_error),
                f"{run.rate:g} Hz × {run.time[-1] + 1.0 / run.rate:g} s",
                " / ".join(f"{1e3 * w:.2f}" for w in (np.median(run.wall), run.wall.max())),
                " / ".join(f"{1e3 * w:.2f}" for w in (np.median(run.processor), run.processor.max())),
                f"{run.late}, {int(run.held.sum())}, {int(run.bounded.sum())}",
                ", ".join(_degrees(e) for e in run.settled_error()),
                lost=bool(run.late or run.held.any()),
            )
        )
    heads = [
        "Gravity", "Elements and modes", "Error of the reduction", "Ticks",
        "Wall time, median / worst (ms)", "Processor time (ms)",
        "Late, held, bounded", "Error once settled",
    ]  # fmt: skip
    return {"caption": "Closed loop with a simulated plant", "head": heads, "rows": rows}


def _row(*cells: str, lost: bool = False) -> dict[str, Any]:
    return {"cells": list(cells), "lost": lost}


def printed(view: ActuatorView) -> dict[str, str]:
    """The numbers of a result as the terminal shows them."""
    found = {}
    for table in tables(view):
        for row in table["rows"]:
            cells = row["cells"]
            heads = table["head"][2:]
            key = f"{cells[0]}, {cells[1]}" + (" bar" if table["head"][1].endswith("(bar)") else "")
            key = key if key not in found else f"{key}, {table['caption'].split(':')[0].lower()}"
            pairs = zip(heads, cells[2:], strict=True)
            found[key] = "; ".join(f"{head[:1].lower()}{head[1:]} {cell}" for head, cell in pairs)
    return found
