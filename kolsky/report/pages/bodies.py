"""Pages of whole specimens, fitted to force curves or a displacement field, and of a pressurised actuator."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from explicit.materials.law import ParameterSpec
from kolsky.bodies.actuator_bending import SearchEnd, relative_bend
from kolsky.bodies.specimen_fit import ConstantVerdict, cross_table
from kolsky.report.body_views import ActuatorView, SheetView, SpecimenView
from kolsky.report.figures.base import BAR
from kolsky.report.pages.rendering import draw_figures, render_page, sentences
from kolsky.results import numbers


def render_specimen(shown: SpecimenView | SheetView, inputs: Mapping[str, str]) -> str:
    """Return the page as HTML text."""
    sheet = isinstance(shown, SheetView)
    tests: Sequence[str] = () if isinstance(shown, SheetView) else shown.tests
    table: list[tuple[str, list[str]]] = []
    if isinstance(shown, SpecimenView):
        values = cross_table(shown.fits, tests)
        table = [
            (fit.name, [numbers.plain(v) for v in row]) for fit, row in zip(shown.fits, values, strict=True)
        ]
    return render_page(
        "specimen.html",
        kind="Sheet in a slow test" if sheet else "Whole specimens in slow tests",
        heading=shown.name,
        subject="fitted constants",
        warnings=sentences(shown.warnings),
        constants=constant_rows(shown),
        tests=list(tests),
        table=table,
        facts=list(specimen_rows(shown).items()),
        figures=draw_figures(shown),
        inputs=list(inputs.items()),
    )


def _shown_value(spec: ParameterSpec, value: float | None) -> str:
    """A constant as text, moduli in kPa."""
    if value is None or not np.isfinite(value):
        return numbers.NOTHING
    return f"{numbers.plain(1e-3 * value)} kPa" if spec.unit == "Pa" else numbers.plain(value)


def constant_rows(view: SpecimenView | SheetView) -> list[dict[str, Any]]:
    """Rows of the table of constants."""
    if isinstance(view, SheetView):
        return _sheet_rows(view)
    rows = []
    for fit in view.fits:
        for spec, one in zip(fit.constants.free_specs, fit.intervals.estimates, strict=True):
            ends = None if one.sigma is None else (one.low, one.high)
            found = one.verdict is ConstantVerdict.IDENTIFIED
            rows.append(_constant_row(fit.name, spec, one.value, ends, one.verdict.value, found))
    return rows


def _constant_row(
    fit: str,
    spec: ParameterSpec,
    value: float,
    ends: tuple[float | None, float | None] | None,
    verdict: str,
    found: bool,
) -> dict[str, Any]:
    interval = (_shown_value(spec, end) for end in ends or ())
    return {
        "Fit": fit,
        "Constant": spec.name,
        "Value": _shown_value(spec, value),
        "Interval, 95 %": " to ".join(interval) or numbers.NOTHING,
        "Verdict": verdict,
        "lost": not found,
    }


def _sheet_rows(view: SheetView) -> list[dict[str, Any]]:
    fit = view.fit
    parts = [name for name, fits in (("field", fit.adequate), ("force", fit.force_explained)) if not fits]
    words = f"of a model that does not explain the {' and the '.join(parts)}" if parts else "identified"
    found = zip(fit.constants.free_specs, fit.values.tolist(), fit.sigma.tolist(), fit.at_bound, strict=True)
    return [
        _constant_row("all steps", spec, value, None, "at its bound", False)
        if bound
        else _constant_row(
            "all steps", spec, value, (value - 1.96 * sigma, value + 1.96 * sigma), words, fit.explained
        )
        for spec, value, sigma, bound in found
    ]


def specimen_rows(shown: SpecimenView | SheetView) -> dict[str, str]:
    """The numbers of a result as terminal and page show them."""
    if isinstance(shown, SheetView):
        fit = shown.fit
        data = fit.problem.data
        return {
            "kinematics": fit.problem.sheet.kinematics.replace("_", " "),
            "steps": str(len(data.pad)),
            "misfit of the displacements": f"{numbers.percent(float(fit.misfit.min()))} to "
            f"{numbers.percent(float(fit.misfit.max()))}",
            "misfit of the force": f"{numbers.percent(fit.force_misfit)}, noise alone "
            f"{numbers.percent(fit.force_noise)}",
            "noise of a point": f"{1e6 * data.sigma_displacement:.3g} µm",
            "simulations": str(fit.simulations),
        }
    rows = {}
    for one in shown.fits:
        intervals = one.intervals
        rows[one.name] = (
            f"{one.constants.law}, {' + '.join(one.fitted)}; χ² / degrees of freedom "
            f"{one.found.chi2 / intervals.degrees:.3g}, {one.found.simulations} simulations, "
            f"{one.found.ended}"
        )
    return rows


def render_actuator(shown: ActuatorView, inputs: Mapping[str, str]) -> str:
    """Return the page as HTML text."""
    return render_page(
        "actuator.html",
        kind="Pressurised actuator",
        heading=shown.name,
        subject="bend",
        warnings=sentences(shown.warnings),
        tables=tables(shown),
        figures=draw_figures(shown),
        inputs=list(inputs.items()),
    )


def _degrees(value: float) -> str:
    return numbers.NOTHING if np.isnan(value) else f"{np.degrees(value):.2f}°"


Rows = Iterator[tuple[dict[str, str], bool]]
"""Texts by the headings of their columns, and True if the row's result is missing."""


def bends(view: ActuatorView) -> Rows:
    """Bend at the declared pressures."""
    for one in view.directions:
        relative = None if one.healed is None else relative_bend(one)
        slopes = one.pristine.slopes().sum(axis=1)
        for number, k in enumerate(one.asked):
            cells = {
                "Gravity": one.name,
                "Pressure (bar)": f"{BAR * float(one.pristine.pressures[k].max()):.3g}",
                "Bend": _degrees(float(one.pristine.angle[k])),
                "Slope (°/bar)": f"{np.degrees(slopes[k]) / BAR:.4g}",
                "Bend, healed": numbers.NOTHING if one.healed is None else _degrees(one.healed.angle[k]),
                "Healed less pristine": "–" if relative is None else numbers.percent(relative[number]),
            }
            yield cells, bool(one.overlapping[k])


def contacts(view: ActuatorView) -> Rows:
    """Contact of neighbouring chambers."""
    for one in view.directions:
        contact = one.touching
        if contact is None:
            continue
        steps = np.flatnonzero(contact.force > 0.0)
        bar = BAR * one.pristine.pressures.max(axis=1)
        cells = {
            "Gravity": one.name,
            "Touching from the step at": "not at all" if steps.size == 0 else f"{bar[steps[0]]:.3g} bar",
            "Force at the largest pressure (N)": f"{contact.force[-1]:.3g}",
            "Deepest (µm)": f"{1e6 * contact.depth.max():.2g}",
            "Smallest gap of facing points (mm)": f"{1e3 * one.gap.min():.3g}",
        }
        yield cells, False


def forces(view: ActuatorView) -> Rows:
    """Forces on planes and on the support of a blocked set."""
    for one in view.directions:
        for name, each in one.forces.items():
            for k in one.asked:
                cells = {
                    "Gravity": one.name,
                    "Pressure (bar)": f"{BAR * float(one.pristine.pressures[k].max()):.3g}",
                    "On": name,
                    "Force (N)": f"{np.linalg.norm(each[k]):.4g}",
                    "x, y, z (N)": ", ".join(f"{x:.4g}" for x in each[k]),
                }
                yield cells, False


def _marker_rows(view: ActuatorView) -> Rows:
    """Root mean square distance of the markers, as in Table 4 of the paper."""
    for one in view.markers:
        cells = {
            "Gravity": one.gravity,
            "Pressure (bar)": f"{BAR * one.pressure:.3g}",
            "RMSE (mm)": f"{1e3 * one.rmse:.3f}",
            "Noise (mm)": f"{1e3 * one.sigma:.3f}",
            "Bend measured": _degrees(one.measured_angle),
            "Explained by the noise": "yes" if one.explained else "no",
        }
        yield cells, not one.explained


def stiffness(view: ActuatorView) -> Rows:
    """The factor of all moduli, fitted to the markers."""
    fit = view.stiffness
    if fit is not None:
        cells = {
            "Markers": "all",
            "Factor": f"{fit.factor:.4f}",
            "Interval, 95 %": f"{fit.low:.4f} to {fit.high:.4f}",
            "χ² / degrees of freedom": f"{fit.chi2 / fit.degrees:.3g}",
            "Explained by the noise": "yes" if fit.explained else "no",
        }
        yield cells, not (fit.explained and fit.converged)


def inversions(view: ActuatorView) -> Rows:
    """Pressures for target bends."""
    for name, each in view.inversions.items():
        for one in each:
            bars = ", ".join(f"{BAR * p:.4g}" for p in one.pressures)
            cells = {
                "Gravity": name,
                "Wanted": _degrees(one.angle),
                "Pressure (bar)": numbers.NOTHING if np.isnan(one.pressures).any() else bars,
                "Bend there": _degrees(one.found),
                "Outcome": one.ended.value,
                "Equilibria": str(one.equilibria),
            }
            yield cells, one.ended is not SearchEnd.YES


def loops(view: ActuatorView) -> Rows:
    """Benchmark of the loop."""
    for name, run in view.closed.items():
        made = view.reductions[name]
        reduced = made.model.reduced
        wall, processor = (
            " / ".join(f"{1e3 * time:.2f}" for time in (np.median(times), times.max()))
            for times in (run.wall, run.processor)
        )
        elements = f"{len(reduced.model.mesh.cells)} → {len(reduced.sample.cells)}"
        cells = {
            "Gravity": name,
            "Elements and modes": f"{elements}, {reduced.modes} modes",
            "Error of the reduction": _degrees(made.largest_error),
            "Ticks": f"{run.rate:g} Hz × {run.time[-1] + 1.0 / run.rate:g} s",
            "Wall time, median / worst (ms)": wall,
            "Processor time (ms)": processor,
            "Late, held, bounded": f"{run.late}, {int(run.held.sum())}, {int(run.bounded.sum())}",
            "Error once settled": ", ".join(_degrees(e) for e in run.settled_error()),
        }
        yield cells, bool(run.late or run.held.any())


TABLES: dict[str, Callable[[ActuatorView], Rows]] = {
    "Bend at the declared pressures": bends,
    "Contact of neighbouring chambers": contacts,
    "Forces on the outside": forces,
    "Markers: measured less simulated": _marker_rows,
    "Factor of all moduli fitted to the markers": stiffness,
    "Pressures for wanted bends": inversions,
    "Closed loop with a simulated plant": loops,
}
"""Tables of the page by their captions."""


def tables(view: ActuatorView) -> list[dict[str, Any]]:
    """Tables of the page with rows, each with caption and headings."""
    made = []
    for caption, rows_of in TABLES.items():
        if rows := list(rows_of(view)):
            made.append({"caption": caption, "rows": [{**cells, "lost": lost} for cells, lost in rows]})
    return made


def actuator_rows(view: ActuatorView) -> dict[str, str]:
    """The numbers of a result as the terminal shows them."""
    words = {}
    for table in tables(view):
        for row in table["rows"]:
            (_, first), (head, second), *pairs = ((key, cell) for key, cell in row.items() if key != "lost")
            key = f"{first}, {second}" + (" bar" if head.endswith("(bar)") else "")
            key = key if key not in words else f"{key}, {table['caption'].split(':')[0].lower()}"
            words[key] = "; ".join(f"{head[:1].lower()}{head[1:]} {cell}" for head, cell in pairs)
    return words
