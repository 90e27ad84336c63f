"""A comparison of laws as tables and as JSON, for files, terminal and display."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from kolsky.base.files import columns_of, jsonable
from kolsky.material.fits.compare import Comparison, PathStability, Row
from kolsky.material.fits.fit import Fit, FitOutcome
from kolsky.material.fits.homogeneous import Mode
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.properties import Fracture, fracture, poissons_ratio, youngs_modulus

Columns = dict[str, list[Any]]

COSTLY = 1.1
"""Factor in the sum of squares above which the effect of a bound is reported [-]."""
CORRELATED = 1.0
"""Durbin-Watson number below which residuals are correlated."""


def tables(comparison: Comparison) -> dict[str, Columns]:
    """Columns by heading, of every table by name. Missing numbers are empty text."""
    names = ("law", "constant", "value (SI)", "u (SI)", "unit", "state")
    rows = ((row.candidate.name, *said) for row, f in _fitted(comparison) for said in _constants_of(f))
    paths = (
        {"law": row.candidate.name, **_path(path)} for row, _ in _fitted(comparison) for path in row.stability
    )
    return {
        "material_laws": _laws(comparison),
        "material_constants": columns_of((dict(zip(names, row, strict=True)) for row in rows), names),
        "material_errors": _errors(comparison),
        "material_stability": columns_of(paths, ("law", "mode", "direction", "outcome", "strain")),
        "material_curves": _curves(comparison),
    }


def as_json(comparison: Comparison, hashes: dict[str, str]) -> dict[str, Any]:
    """All results except the curves, in SI units."""
    best = comparison.best
    whole = {
        "tests": [
            {"name": t.name, "mode": t.mode.value, "points": len(t.stress)} | _properties(t)
            for t in comparison.tests
        ],
        "weighting": comparison.weighting.value,
        "bounded": comparison.bounded,
        "poisson": comparison.poisson,
        "best": None if best is None else best.candidate.name,
        "laws": [_row(row) for row in comparison.rows],
        "inputs": hashes,
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def _properties(test: HomogeneousTest) -> dict[str, Any]:
    """Young's modulus from 0 to 5 %, Poisson's ratio by regression, and fracture; None if missing."""
    uniaxial = test.mode is Mode.UNIAXIAL
    modulus = youngs_modulus(test.strain, test.stress) if uniaxial else None
    across = poissons_ratio(test.deformation, test.lateral) if uniaxial and test.lateral is not None else None
    broke = _fracture(test)[0]
    return {
        "youngs_modulus_to_5_percent": None if modulus is None else asdict(modulus),
        "poissons_ratio_by_regression": None if across is None else asdict(across),
        "fracture": None if broke is None else asdict(broke),
    }


def failure(row: Row) -> str:
    """Loss of stability of a law, in words."""
    if row.fit is None:
        return ""
    first = row.first_failure
    if first is not None:
        return str(first)
    lam = max(abs(math.log1p(path.strain)) for path in row.stability if path.direction != "shear")
    return f"stable to stretch {math.exp(lam):.3g}"


def _row(row: Row) -> dict[str, Any]:
    said: dict[str, Any] = {"law": row.candidate.name, "held": dict(row.candidate.held)}
    if row.fit is None:
        return {**said, "fit": None, "reason": row.reason}
    f = row.fit
    return {
        **said,
        "fit": {
            "constants": f.values,
            "sigma": f.sigma,
            "outcome": f.outcome.value,
            "at_bound": list(f.at_bound),
            "outside": list(f.law.outside()),
            "shear_modulus": f.law.shear_modulus,
            **{name: getattr(f, name) for name in _NUMBERS},
            "starts": len(f.ends),
            "starts_agreeing": f.agreeing,
        },
        "errors": [
            {"test": p.test.name, "rmse": p.rmse, "r_squared": p.r_squared, "relative_rms": p.relative_rms}
            for p in f.parts
        ],
        "stable_over_data": row.stable,
        "stability": [_path(path) for path in row.stability],
    }


_NUMBERS = (
    "youngs_modulus", "poisson", "bulk_modulus", "D1", "bounds_cost", "sse", "rmse", "r_squared", "aic",
    "bic", "durbin_watson",
)  # fmt: skip
"""Numbers of a `Fit` in JSON."""


def _path(path: PathStability) -> dict[str, Any]:
    return {
        "mode": path.mode.value,
        "direction": path.direction,
        "outcome": path.outcome.value,
        "strain": path.strain,
    }


def _fitted(comparison: Comparison) -> list[tuple[Row, Fit]]:
    return [(row, row.fit) for row in comparison.rows if row.fit is not None]


def _laws(comparison: Comparison) -> Columns:
    rows = _fitted(comparison)
    least = min((f.aic for _, f in rows), default=0.0)
    return {
        "law": [row.candidate.name for row, _ in rows],
        "free constants": [len(f.free) for _, f in rows],
        "initial Young's modulus (Pa)": [f.youngs_modulus for _, f in rows],
        "initial shear modulus (Pa)": [f.law.shear_modulus for _, f in rows],
        "Poisson's ratio": [0.5 if f.poisson is None else f.poisson for _, f in rows],
        "bulk modulus (Pa)": [f.bulk_modulus if math.isfinite(f.bulk_modulus) else "" for _, f in rows],
        "D1 (1/Pa)": [f.D1 for _, f in rows],
        "SSE (Pa^2)": [f.sse for _, f in rows],
        "RMSE (Pa)": [f.rmse for _, f in rows],
        "R squared": [f.r_squared for _, f in rows],
        "AIC": [f.aic for _, f in rows],
        "AIC less the least": [f.aic - least if math.isfinite(f.aic) else 0.0 for _, f in rows],
        "BIC": [f.bic for _, f in rows],
        "Durbin-Watson": [f.durbin_watson for _, f in rows],
        "constants are": [f.outcome.value for _, f in rows],
        "stable over the data": ["yes" if row.stable else "no" for row, _ in rows],
        "stability ends": [failure(row) for row, _ in rows],
    }


def _constants_of(f: Fit) -> Iterator[tuple[Any, ...]]:
    """Name, value, standard uncertainty, unit and state of each constant, and of a fitted Poisson's ratio."""
    rows = [(spec.name, f.values[spec.name], spec.unit) for spec in f.law.PARAMETERS]
    if "poisson" in f.free and f.poisson is not None:
        rows.append(("poisson", f.poisson, "1"))
    for name, value, unit in rows:
        state = "at a bound" if name in f.at_bound else "fitted" if name in f.free else "held"
        sigma = f.sigma[name] if state == "fitted" or name == "poisson" else math.nan
        yield name, value, sigma if math.isfinite(sigma) else "", unit, state


def _errors(comparison: Comparison) -> Columns:
    parts = [(row, part) for row, f in _fitted(comparison) for part in f.parts]
    return {
        "law": [row.candidate.name for row, _ in parts],
        "test": [p.test.name for _, p in parts],
        "mode": [p.test.mode.value for _, p in parts],
        "points": [len(p.residual) for _, p in parts],
        "SSE (Pa^2)": [p.sse for _, p in parts],
        "RMSE (Pa)": [p.rmse for _, p in parts],
        "R squared": [p.r_squared for _, p in parts],
        "relative rms": [p.relative_rms for _, p in parts],
    }


def _curves(comparison: Comparison) -> Columns:
    rows = _fitted(comparison)
    tests = comparison.tests
    made: Columns = {
        "test": [t.name for t in tests for _ in t.stress],
        "mode": [t.mode.value for t in tests for _ in t.stress],
        "nominal strain or amount of shear": [float(x) for t in tests for x in t.strain],
        "measured (Pa)": [float(x) for t in tests for x in t.stress],
    }
    for row, f in rows:
        made[f"{row.candidate.name} (Pa)"] = [float(x) for p in f.parts for x in p.predicted]
    return made


def remarks(found: Comparison) -> list[str]:
    """Warnings about a comparison: laws without a fit, ranks that differ, dependent residuals."""
    said = [f"{row.candidate.name} has no fit: {row.reason}" for row in found.rows if row.fit is None]
    said += [text for text in map(_broken, found.tests) if text]
    best = found.best
    if best is None or best.fit is None:
        return [*said, "no law is determined by these tests and stable over them"]
    first = found.rows[0]
    if first is not best:
        why = "is not stable over the data" if not first.stable else "has a higher BIC"
        if first.fit is not None and first.fit.outcome is FitOutcome.NOT_DETERMINED:
            why = "has constants that the data do not distinguish"
        if first.fit is not None and first.fit.outcome is FitOutcome.UNCONFIRMED:
            why = "has a minimum that only one start reached: raise --starts"
        said.append(f"{first.candidate.name} has the least AIC, but {why}")
    if best.fit.bounds_cost > COSTLY:
        said.append(
            f"the bounds of a positive energy cost {best.candidate.name} a factor of "
            f"{best.fit.bounds_cost:.3g} in the sum of squares ({', '.join(best.fit.at_bound)} at a "
            "bound): --free-bounds removes them; then check the stability"
        )
    if best.fit.durbin_watson < CORRELATED:
        said.append(
            f"residuals of {best.candidate.name} follow each other (Durbin-Watson "
            f"{best.fit.durbin_watson:.2g}): it misses the curve's shape, and the u of its constants, "
            "which assume independent points, are too small"
        )
    first_failure = best.first_failure
    if first_failure is not None:
        said.append(f"{best.candidate.name} beyond the data: {first_failure}")
    return said


def _fracture(test: HomogeneousTest) -> tuple[Fracture | None, int]:
    """A test's fracture, if there is one, and the number of its points after the largest stress."""
    sign = 1.0 if test.strain[np.argmax(np.abs(test.strain))] > 0.0 else -1.0
    after = test.stress.size - 1 - int(np.argmax(sign * test.stress))
    return fracture(sign * test.strain, sign * test.stress), after


def _broken(test: HomogeneousTest) -> str:
    """Remark on tests that continue after fracture; empty if there is none."""
    broke, after = _fracture(test)
    if broke is None:
        return ""
    return (
        f"{test.name} breaks at strain {broke.strain:.4g} ({1e-3 * broke.stress:.4g} kPa), and its {after}"
        " points after that are fitted too: leave them out of the file"
    )
