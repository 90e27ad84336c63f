"""Relaxation, oscillation, temperature sweeps and shots of one material: moduli on one axis, Prony series."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from explicit.materials import MaterialLaw, neo_hookean
from kolsky.joint.slow_schema import SlowList
from kolsky.material.curves.uniaxial import gaussian_strain
from kolsky.material.relaxation.evidence import DynamicTest, Evidence, HistoryTest
from kolsky.material.relaxation.prony_fit import required_branches
from kolsky.material.relaxation.rate_fit import RateFit, RateVerdict
from kolsky.material.relaxation.temperature import Superposition
from kolsky.material.relaxation.time_scales import (
    ApparentModuli,
    apparent_moduli,
    dynamic_modulus,
    fitted_modulus,
)
from kolsky.studies.rates.records import RatedShot

POINTS = 80
"""Points of the fitted curve over time."""
POOR = 2.0
"""Chi-square over degrees of freedom of the fit from which on it is remarked."""


@dataclass(frozen=True)
class SlowDynamics:
    """What slow tests and shots of one material tell of its rate dependence."""

    tests: tuple[Evidence, ...]
    """The tests that the series is fitted to."""
    sweeps: Mapping[str, Superposition]
    """Temperature sweeps by name."""
    moduli: tuple[ApparentModuli, ...]
    """Moduli of each test by itself, then those of the shots."""
    law: MaterialLaw
    """The long-term law, up to the fitted factor."""
    declared: bool
    """True if the list declares it; else it is neo-Hookean."""
    verdict: RateVerdict
    """Prony series with 0, 1, 2, ... branches."""
    fitted: ApparentModuli
    """E(t) of the series that the data ask for."""
    remarks: tuple[str, ...]
    """What a reader must know."""

    @property
    def fit(self) -> RateFit:
        """The series that the data ask for."""
        return self.verdict.fit

    @property
    def young(self) -> float:
        """Long-term Young's modulus [Pa]."""
        return self.fit.model.factor * 3.0 * float(self.law.initial_shear_modulus)


def analyse(slow: SlowList, shots: Sequence[RatedShot] = (), *, at_most: int = 3) -> SlowDynamics:
    """Place all tests on one axis of time and fit a Prony series to the slow ones.

    Parameters
    ----------
    slow
        The slow tests.
    shots
        Identified shots of the same material; they are placed on the axis and take no part in the fit.
    at_most
        Most branches that are tried.

    Raises
    ------
    ValueError
        If no test is left, or there are fewer values than a series has constants.
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
    if fit.scatter > POOR:
        cause = "the law" if slow.law else "the neo-Hookean law (the list has no [law])"
        remarks.append(
            f"the series leaves a chi-square of {fit.scatter:.3g} per degree of freedom: {cause}, the"
            " declared sigmas or a relaxation that changes with strain; the uncertainties are widened by it"
        )
    moduli += [shot_modulus(shot) for shot in shots]
    ages = np.concatenate([one.age for one in moduli] or [np.array(slow.tests[0].time_scales)])
    age = np.geomspace(ages.min(), ages.max(), POINTS)
    value, sigma = fitted_modulus(fit, young, age)
    fitted = ApparentModuli("Prony series", age, np.zeros(POINTS), value, sigma)
    return SlowDynamics(
        slow.tests, slow.sweeps, tuple(moduli), law, slow.law is not None, verdict, fitted, tuple(remarks)
    )


def shot_modulus(shot: RatedShot) -> ApparentModuli:
    """The point of an identified shot, Eq. (M.1): m times the mean E_a of its curve over its strains.

    Raises
    ------
    ValueError
        If its strain history or its curve is empty.
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
    return dynamic_modulus(
        factor=shot.m,
        sigma_factor=shot.sigma,
        young=float(moduli.mean()),
        strain=-largest if compression else largest,
        duration=end - begin,
        label=shot.name,
    )


def _scale(tests: Sequence[Evidence], moduli: Sequence[ApparentModuli]) -> float:
    """A shear modulus of the size of the measured ones [Pa]; the fit's factor is on it."""
    seen = [float(np.median(one.modulus)) for one in moduli if one.modulus.size]
    if not seen:
        seen = [float(np.abs(test.values[np.isfinite(test.sigma)]).max()) for test in tests]
    return max(float(np.median(seen)), 1.0) / 3.0


def _sweep_remarks(name: str, sweep: Superposition) -> list[str]:
    """Why a sweep is not used, or what is doubtful of it."""
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
        said.append(f"{name}: two temperatures do not tell the constants of Eq. (V.5); the shift is as found")
    return said
