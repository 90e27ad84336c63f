"""Page of laws fitted to homogeneous tests."""

from typing import Any

from kolsky.material.fits.compare import Comparison, Row
from kolsky.material.fits.fit import Fit
from kolsky.material.fits.tables import failure
from kolsky.report.figures import MATERIALS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page
from kolsky.results import numbers


def render(comparison: Comparison, hashes: dict[str, str], remarks: list[str]) -> str:
    """Return the page as HTML text; see `write_page`."""
    rows = [(row, row.fit) for row in comparison.rows if row.fit is not None]
    best = comparison.best
    least = min(f.aic for _, f in rows)
    return render_page(
        "material.html",
        kind="Laws fitted to homogeneous tests",
        heading=", ".join(dict.fromkeys(test.mode.value for test in comparison.tests)),
        subject="laws of the material",
        remarks=remarks,
        best=None if best is None else best.candidate.name.replace("_", " "),
        rows=[_law(row, f, least, row is best) for row, f in rows],
        constants=[line for row, f in rows for line in _constants(row, f)],
        tests=[test.name for test in comparison.tests],
        errors=[
            {
                "law": row.candidate.name.replace("_", " "),
                "cells": [f"{1e-3 * p.rmse:.3g} ({100.0 * p.relative_rms:.3g} %)" for p in f.parts],
            }
            for row, f in rows
        ],
        figures=draw_figures(MATERIALS.values(), comparison),
        settings=[
            ("weighting of residuals", comparison.weighting.value),
            ("bounds", "energy positive at any deformation" if comparison.bounded else "the law exists"),
            (
                "volume",
                "incompressible" if comparison.poisson is None else f"ν = {comparison.poisson:g} at rest",
            ),
            *((test.name, f"{test.mode.value}, {len(test.stress)} points") for test in comparison.tests),
        ],
        inputs=list(hashes.items()),
    )


write_page = page_writer(render)


def _law(row: Row, f: Fit, least: float, best: bool) -> dict[str, Any]:
    return {
        "name": row.candidate.name.replace("_", " "),
        "best": best,
        "k": len(f.free),
        "E0": f"{1e-3 * f.youngs_modulus:.4g}",
        "rmse": f"{1e-3 * f.rmse:.4g}",
        "r2": f"{f.r_squared:.5f}",
        "aic": f"{f.aic - least:.1f}",
        "constants": f.outcome.value,
        "stability": failure(row),
    }


def _constants(row: Row, f: Fit) -> list[dict[str, str]]:
    lines = []
    for spec in f.law.PARAMETERS:
        factor, unit = (1e-3, "kPa") if spec.unit == "Pa" else (1.0, "")
        value, U = numbers.plain(factor * f.values[spec.name], 5), ""
        if spec.name in f.free and spec.name not in f.at_bound:
            value, U = numbers.measured(factor * f.values[spec.name], 2.0 * factor * f.sigma[spec.name])
        state = "at a bound" if spec.name in f.at_bound else "" if spec.name in f.free else "held"
        lines.append(
            {
                "law": row.candidate.name.replace("_", " "),
                "name": spec.name,
                "value": value,
                "U": U,
                "unit": unit,
                "state": state,
            }
        )
    return lines
