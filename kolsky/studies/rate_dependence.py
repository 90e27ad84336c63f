"""Rate dependence of one material: relaxation, oscillation, temperature sweeps and shots on one time axis.

Moduli and a Prony series, also as CSV tables and JSON.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dic.views import ResultViews
from explicit.materials import MaterialLaw, neo_hookean
from kolsky.inverse.slow_tests import SlowList
from kolsky.material.relaxation.rate_fit import (
    ApparentModuli,
    DynamicTest,
    Evidence,
    HistoryTest,
    RateFit,
    RateVerdict,
    apparent_moduli,
    fitted_modulus,
    required_branches,
)
from kolsky.material.relaxation.temperature import Superposition
from kolsky.material.uniaxial import gaussian_strain
from kolsky.studies.rate_models import (
    CURVE,
    POOR_FIT,
    ModelComparison,
    compare_slow,
    comparison_summary,
    comparison_table,
)
from kolsky.studies.rates.records import RatedShot

POINTS = 80
"""Points of the fitted curve over time."""


@dataclass(frozen=True)
class SlowDynamics(ResultViews):
    """Rate dependence of one material from slow tests and shots."""

    tests: tuple[Evidence, ...]
    sweeps: Mapping[str, Superposition]
    moduli: tuple[ApparentModuli, ...]
    """Moduli of each single test, followed by those of the shots."""
    law: MaterialLaw
    """The long-term law, without the fitted factor."""
    declared: bool
    """True if the list declares the law. Otherwise it is neo-Hookean."""
    verdict: RateVerdict
    comparison: ModelComparison
    """Comparison of elastic model, series and creeping network."""
    fitted: ApparentModuli
    """E(t) of the series with the number of branches that the data need."""
    remarks: tuple[str, ...]

    @property
    def fit(self) -> RateFit:
        """The series that the data need."""
        return self.verdict.fit

    @property
    def sentence(self) -> str:
        """The number of branches in words. No branch is needed if a curve of the strain fits equally well."""
        best = self.comparison.best
        return self.comparison.sentence if best.name == CURVE else self.verdict.sentence

    @property
    def young(self) -> float:
        """Long-term Young's modulus [Pa]."""
        return self.fit.model.factor * 3.0 * float(self.law.initial_shear_modulus)


def analyse_rate_dependence(
    slow: SlowList, shots: Sequence[RatedShot] = (), *, at_most: int = 3
) -> SlowDynamics:
    """Place all tests on one axis of time and fit a Prony series to the slow ones.

    ``shots``: identified shots of the same material. They are placed on the axis but not used in the fit.
    ``at_most``: largest number of branches tried.
    """
    remarks = [said for name, sweep in slow.sweeps.items() for said in _sweep_remarks(name, sweep)]
    if not slow.tests:
        raise ValueError("; ".join(["no test is left that a series can be fitted to", *remarks]))
    moduli: list[ApparentModuli] = []
    for test in slow.tests:
        assert isinstance(test, HistoryTest | DynamicTest)
        try:
            moduli.append(apparent_moduli(test))
        except ValueError as error:
            remarks.append(f"not on the axis of time: {error}")
    law = slow.law or neo_hookean(_scale(slow.tests, moduli))
    verdict = required_branches(law, slow.tests, at_most=at_most)
    fit, young = verdict.fit, 3.0 * float(law.initial_shear_modulus)
    if fit.scatter > POOR_FIT:
        cause = "the law" if slow.law else "the neo-Hookean law (the list has no [law])"
        remarks.append(
            f"the series leaves a chi-square of {fit.scatter:.3g} per degree of freedom: {cause}, the"
            " declared sigmas or a relaxation that changes with strain; the uncertainties are widened by it"
        )
    comparison = compare_slow(law, slow.tests, verdict.fits)
    moduli += [shot_modulus(shot) for shot in shots]
    ages = np.concatenate([one.age for one in moduli] or [np.array(slow.tests[0].time_scales)])
    age = np.geomspace(ages.min(), ages.max(), POINTS)
    value, sigma = fitted_modulus(fit, young, age)
    fitted = ApparentModuli("Prony series", age, np.zeros(POINTS), value, sigma)
    return SlowDynamics(
        slow.tests, slow.sweeps, tuple(moduli), law, slow.law is not None, verdict, comparison, fitted,
        tuple(remarks),
    )  # fmt: skip


def shot_modulus(shot: RatedShot) -> ApparentModuli:
    """The point of an identified shot, Eq. (M.1).

    It is m times the mean E_a of its curve over its strains. The age of the strain is half the window.
    """
    largest, curve = shot.history.largest, shot.quasi_static.curve
    strain = curve.stretch - 1.0
    compression = bool(strain[np.argmax(np.abs(strain))] < 0.0)
    size = np.abs(strain)
    inside = (size > 0.0) & (size <= largest * (1.0 + 1e-9)) & ((strain < 0.0) == compression)
    if not inside.any():
        raise ValueError(f"{shot.name}: its curve has no point below its largest strain, {largest:.3g}")
    moduli = 3.0 * np.abs(curve.stress[inside]) / gaussian_strain(size[inside], compression=compression)
    begin, end = shot.history.span
    young = float(moduli.mean())
    row = (0.5 * (end - begin), -largest if compression else largest, shot.m * young, shot.sigma * young)
    return ApparentModuli(shot.name, *(np.array([value]) for value in row))


def _scale(tests: Sequence[Evidence], moduli: Sequence[ApparentModuli]) -> float:
    """A shear modulus of the order of the measured ones [Pa]. The fitted factor refers to it."""
    seen = [float(np.median(one.modulus)) for one in moduli if one.modulus.size]
    if not seen:
        seen = [float(np.abs(test.values[np.isfinite(test.sigma)]).max()) for test in tests]
    return max(float(np.median(seen)), 1.0) / 3.0


def _sweep_remarks(name: str, sweep: Superposition) -> list[str]:
    """Reasons why a sweep is not used, or is doubtful."""
    if not sweep.determined:
        try:
            sweep.reduced()
        except ValueError as error:
            return [f"{error}; the sweep is not in the fit"]
    said = []
    if not sweep.one_curve:
        said.append(
            f"{name}: the curves do not fall on one another within their noise (chi-square per degree of"
            f" freedom {sweep.scatter:.3g}, probability {sweep.likely:.2g}): not thermorheologically simple,"
            " or the declared sigma is too small"
        )
    if sweep.C1 is not None and not sweep.law_holds:
        said.append(
            f"{name}: the law of Williams, Landel and Ferry leaves more than chance (probability"
            f" {sweep.law_likely:.2g}): the shifts are taken as found, temperature by temperature"
        )
    if sweep.C1 is None:
        said.append(
            f"{name}: two temperatures do not determine the constants of Eq. (V.5); the shift is as found"
        )
    return said


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
        "relaxation_models": comparison_table(found.comparison),
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
        "verdict": found.sentence,
        "branches": found.verdict.branches,
        "comparison": comparison_summary(found.comparison),
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
