"""What slow tests tell of rate dependence, as CSV tables and as JSON."""

from typing import Any

import numpy as np

from kolsky.joint.slow_dynamics import SlowDynamics
from kolsky.material.relaxation.evidence import DynamicTest

KELVIN = 273.15
"""0 °C [K]."""


def tables(found: SlowDynamics) -> dict[str, dict[str, list[Any]]]:
    """CSV tables by the name of their file: columns by heading."""
    moduli, fit = found.moduli, found.fit
    made: dict[str, dict[str, list[Any]]] = {
        "relaxation_moduli": {
            "test": [one.label for one in moduli for _ in one.age],
            "mean age of the strain (s)": _joined([one.age for one in moduli]),
            "nominal strain (1)": _joined([one.strain for one in moduli]),
            "E_a (Pa)": _joined([one.modulus for one in moduli]),
            "u (Pa)": _joined([one.sigma for one in moduli]),
        },
        "relaxation_fit": {
            "time after a step (s)": found.fitted.age.tolist(),
            "E (Pa)": found.fitted.modulus.tolist(),
            "u (Pa)": found.fitted.sigma.tolist(),
        },
        "relaxation_constants": {
            "constant": list(fit.names),
            "value (SI)": fit.values.tolist(),
            "low end, k = 2": [fit.interval(name)[0] for name in fit.names],
            "high end, k = 2": [fit.interval(name)[1] for name in fit.names],
            "at a bound": [name in fit.at_bound for name in fit.names],
        },
    }
    oscillations = [test for test in found.tests if isinstance(test, DynamicTest)]
    if oscillations:
        rows = [test.predict(found.law, [fit.model])[0] for test in oscillations]
        half = [np.split(row, 2) for row in rows]
        made["relaxation_oscillation"] = {
            "test": [test.label for test in oscillations for _ in test.angular_frequency],
            "angular frequency, reduced (rad/s)": _joined([t.angular_frequency for t in oscillations]),
            "storage modulus (Pa)": _joined([test.storage for test in oscillations]),
            "u storage (Pa)": _joined([test.sigma_storage for test in oscillations]),
            "loss modulus (Pa)": _joined([test.loss for test in oscillations]),
            "u loss (Pa)": _joined([test.sigma_loss for test in oscillations]),
            "loss factor (1)": _joined([test.loss / test.storage for test in oscillations]),
            "storage modulus of the series (Pa)": _joined([one[0] for one in half]),
            "loss modulus of the series (Pa)": _joined([one[1] for one in half]),
        }
    if found.sweeps:
        sweeps = found.sweeps.items()
        made["relaxation_shifts"] = {
            "sweep": [name for name, one in sweeps for _ in one.shifts],
            "temperature (degC)": _joined([one.sweep.levels - KELVIN for _, one in sweeps]),
            "lg a_T, free (1)": _joined([one.shifts for _, one in sweeps]),
            "u (1)": _joined([one.sigma for _, one in sweeps]),
            "lg a_T, adopted (1)": _joined([one.adopted for _, one in sweeps]),
        }
    return made


def _joined(parts: list[Any]) -> list[float]:
    return [] if not parts else np.concatenate(parts).tolist()


def summary(found: SlowDynamics) -> dict[str, Any]:
    """The result for JSON, SI."""
    fit = found.fit
    return {
        "verdict": found.verdict.sentence,
        "branches": found.verdict.branches,
        "long_term_E": {
            "value": found.young,
            "interval": [found.young * end / float(fit.values[0]) for end in fit.interval("factor")],
            "unit": "Pa",
        },
        "constants": {
            name: {"value": float(value), "interval": list(fit.interval(name))}
            for name, value in zip(fit.names, fit.values, strict=True)
        },
        "chi_square_per_degree": fit.chi_square / max(1, fit.n_data - len(fit.values)),
        "law_declared": found.declared,
        "sweeps": {
            name: {
                "reference_degC": one.sweep.reference - KELVIN,
                "determined": one.determined,
                "one_curve": one.one_curve,
                "probability_one_curve": one.likely,
                "C1": one.C1,
                "C2_K": one.C2,
                "sigma_C1_C2": None if one.covariance is None else np.sqrt(np.diag(one.covariance)).tolist(),
                "law_holds": one.law_holds,
                "probability_law": one.law_likely,
            }
            for name, one in found.sweeps.items()
        },
        "remarks": list(found.remarks),
    }
