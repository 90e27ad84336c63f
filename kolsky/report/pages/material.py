"""Pages of slow tests: laws fitted to the material, and its relaxation."""

from typing import Any

import numpy as np
from markupsafe import Markup

from kolsky.material.fits.compare import Comparison, Row
from kolsky.material.fits.fit import Fit
from kolsky.material.fits.tables import failure
from kolsky.report.pages.rendering import draw_figures, render_page
from kolsky.results import numbers
from kolsky.studies.rate_dependence import SlowDynamics


def render_fits(comparison: Comparison, hashes: dict[str, str], remarks: list[str]) -> str:
    """Return the page as HTML text."""
    rows = [(row, row.fit) for row in comparison.rows if row.fit is not None]
    best = comparison.best
    return render_page(
        "material.html",
        kind="Laws fitted to homogeneous tests",
        heading=", ".join(dict.fromkeys(test.mode.value for test in comparison.tests)),
        subject="laws of the material",
        remarks=remarks,
        best=None if best is None else _name(best),
        rows=law_rows(comparison),
        constants=[line for row, f in rows for line in constant_rows(row, f)],
        tests=[test.name for test in comparison.tests],
        errors=[
            {
                "law": _name(row),
                "cells": [f"{1e-3 * p.rmse:.3g} ({100.0 * p.relative_rms:.3g} %)" for p in f.parts],
            }
            for row, f in rows
        ],
        figures=draw_figures(comparison),
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


def law_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Rows of the table of laws, least AIC first."""
    rows = [(row, row.fit) for row in comparison.rows if row.fit is not None]
    least = min(f.aic for _, f in rows)
    return [
        {
            "Law": Markup("<b>{}</b>" if row is comparison.best else "{}").format(_name(row)),
            "Free": len(f.free),
            "E₀ (kPa)": f"{1e-3 * f.youngs_modulus:.4g}",
            "RMSE (kPa)": f"{1e-3 * f.rmse:.4g}",
            "R²": f"{f.r_squared:.5f}",
            "ΔAIC": f"{f.aic - least:.1f}",
            "Constants": f.outcome.value,
            "Drucker": failure(row),
        }
        for row, f in rows
    ]


def _name(row: Row) -> str:
    return row.candidate.name.replace("_", " ")


def constant_rows(row: Row, f: Fit) -> list[dict[str, str]]:
    """Rows of the table of a law's constants."""
    lines = []
    for spec in f.law.PARAMETERS:
        factor, unit = (1e-3, "kPa") if spec.unit == "Pa" else (1.0, "")
        value, U = numbers.plain(factor * f.values[spec.name], 5), ""
        if spec.name in f.free and spec.name not in f.at_bound:
            value, U = numbers.measured(factor * f.values[spec.name], 2.0 * factor * f.sigma[spec.name])
        state = "at a bound" if spec.name in f.at_bound else "" if spec.name in f.free else "held"
        lines.append(
            {
                "Law": _name(row),
                "Constant": Markup("<code>{}</code>").format(spec.name),
                "Value": value,
                "U": U,
                "Unit": unit,
                "Remark": state,
            }
        )
    return lines


def relaxation_tables(result: SlowDynamics) -> dict[str, list[dict[str, str]]]:
    """Rows of the tables of constants, temperature sweeps and moduli."""
    fit = result.fit
    units = {"factor": "", "strength": "", "time": "s"}
    constants = []
    for name, value in zip(fit.names, fit.values, strict=True):
        low, high = fit.interval(name)
        constants.append(
            {
                "Constant": name,
                "Value": numbers.plain(value, 4),
                "From": numbers.plain(low, 3),
                "To": numbers.plain(high, 3),
                "Unit": units[name.split()[0]],
                "Remark": "at a bound" if name in fit.at_bound else "",
            }
        )
    sweeps = []
    for name, one in result.sweeps.items():
        sigma = None if one.covariance is None else np.sqrt(np.diag(one.covariance))
        shown = one.law_holds and sigma is not None and one.C1 is not None and one.C2 is not None
        C1, U1 = numbers.measured(one.C1, 2.0 * sigma[0]) if shown else ("", "")  # type: ignore[index, arg-type]
        C2, U2 = numbers.measured(one.C2, 2.0 * sigma[1]) if shown else ("", "")  # type: ignore[index, arg-type]
        sweeps.append(
            {
                "Sweep": name,
                "T₀ (°C)": f"{one.sweep.reference - 273.15:.4g}",
                "Shifts": "determined" if one.determined else "not determined",
                "One curve": "yes" if one.one_curve else "no",
                "C₁": f"{C1} ± {U1}" if shown else "",
                "C₂ (K)": f"{C2} ± {U2}" if shown else "",
                "Law": "holds" if one.law_holds else "not fitted" if one.C1 is None else "does not hold",
            }
        )
    moduli = [
        {
            "Test": one.label,
            "Age of the strain (s)": f"{one.age.min():.3g} to {one.age.max():.3g}",
            "Nominal strain (–)": f"{one.strain.min():.3g} to {one.strain.max():.3g}",
            Markup(
                "E<sub>a</sub> (kPa)"
            ): f"{1e-3 * one.modulus.min():.4g} to {1e-3 * one.modulus.max():.4g}",
        }
        for one in result.moduli
    ]
    return {"constants": constants, "sweeps": sweeps, "moduli": moduli}


def render_relaxation(result: SlowDynamics, hashes: dict[str, str]) -> str:
    """Return the page as HTML text."""
    return render_page(
        "relaxation.html",
        kind="Rate dependence of slow tests",
        heading=", ".join(test.label for test in result.tests),
        subject="rate dependence of the material",
        remarks=list(result.remarks),
        sentence=result.sentence,
        young=numbers.plain(1e-3 * result.young, 4),
        **relaxation_tables(result),
        figures=draw_figures(result),
        settings=[
            ("law", type(result.law).__name__ + ("" if result.declared else ", not declared")),
            ("branches tried", str(len(result.verdict.fits) - 1)),
        ],
        inputs=list(hashes.items()),
    )
