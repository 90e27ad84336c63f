"""Page of whole specimens: fits to force curves, or of a sheet to a displacement field."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kolsky.bodies.specimen_constants import ConstantSpec
from kolsky.bodies.specimen_fit import ConstantVerdict
from kolsky.bodies.specimen_studies import cross_table
from kolsky.report.body_views import SheetView, SpecimenView
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers


def render(shown: SpecimenView | SheetView, inputs: Mapping[str, str]) -> str:
    """Return the page as HTML text."""
    sheet = isinstance(shown, SheetView)
    rows = sheet_rows(shown) if isinstance(shown, SheetView) else constant_rows(shown)
    tests: Sequence[str] = () if isinstance(shown, SheetView) else shown.tests
    table: list[tuple[str, list[str]]] = []
    if isinstance(shown, SpecimenView):
        values = cross_table(shown.fits, tests)
        table = [
            (fit.name, [numbers.plain(v) if np.isfinite(v) else numbers.NOTHING for v in row])
            for fit, row in zip(shown.fits, values, strict=True)
        ]
    return render_page(
        "specimen.html",
        kind="Sheet in a slow test" if sheet else "Whole specimens in slow tests",
        heading=shown.name,
        subject="fitted constants",
        warnings=sentences(shown.warnings),
        constants=rows,
        tests=list(tests),
        table=table,
        facts=list(printed(shown).items()),
        figures=draw_figures(shown),
        inputs=list(inputs.items()),
    )


write_page = page_writer(render)


def _shown_value(spec: ConstantSpec, value: float | None) -> str:
    """A constant as text, moduli in kPa."""
    if value is None or not np.isfinite(value):
        return numbers.NOTHING
    return f"{numbers.plain(1e-3 * value)} kPa" if spec.unit == "Pa" else numbers.plain(value)


def constant_rows(view: SpecimenView) -> list[dict[str, Any]]:
    """Rows of the table of constants."""
    rows = []
    for fit in view.fits:
        for spec, one in zip(fit.constants.free_specs, fit.intervals.estimates, strict=True):
            ends = f"{_shown_value(spec, one.low)} to {_shown_value(spec, one.high)}"
            rows.append(
                {
                    "fit": fit.name,
                    "name": one.name,
                    "value": _shown_value(spec, one.value),
                    "interval": ends if one.sigma is not None else numbers.NOTHING,
                    "verdict": one.verdict.value,
                    "ok": one.verdict is ConstantVerdict.IDENTIFIED,
                }
            )
    return rows


def sheet_rows(view: SheetView) -> list[dict[str, Any]]:
    """Rows of the table of constants of a sheet."""
    fit = view.fit
    parts = [name for name, fits in (("field", fit.adequate), ("force", fit.force_explained)) if not fits]
    words = f"of a model that does not explain the {' and the '.join(parts)}" if parts else "identified"
    return [
        {
            "fit": "all steps",
            "name": spec.name,
            "value": _shown_value(spec, float(value)),
            "interval": numbers.NOTHING
            if bound
            else f"{_shown_value(spec, float(value - 1.96 * sigma))} to "
            f"{_shown_value(spec, float(value + 1.96 * sigma))}",
            "verdict": "at its bound" if bound else words,
            "ok": fit.explained and not bound,
        }
        for spec, value, sigma, bound in zip(
            fit.constants.free_specs, fit.values, fit.sigma, fit.at_bound, strict=True
        )
    ]


def printed(shown: SpecimenView | SheetView) -> dict[str, str]:
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
