"""Synthetic identified shots with one rate each, for tests of evaluations over several shots."""

from dataclasses import replace

import numpy as np
from synthetic import displacement, synthetic

from kolsky.base.records import MaterialCurve
from kolsky.inverse.result import Identification, Verdict
from kolsky.studies.rates.records import QuasiStatic, RatedShot, StrainHistory

LENGTH, DIAMETER = 6.5e-3, 9.5e-3
SHEAR = 25e3  # shear modulus of the synthetic baseline, a neo-Hookean solid [Pa]


def baseline(rate: float | None = 0.01, *, source: str = "ab" * 32) -> QuasiStatic:
    """A neo-Hookean curve in compression: stress = mu (lambda - lambda^-2)."""
    stretch = np.linspace(1.0, 0.3, 141)
    stress = SHEAR * (stretch - stretch**-2.0)
    return QuasiStatic(MaterialCurve(stretch, stress, np.maximum(2e-3 * np.abs(stress), 1.0)), source, rate)


def found(name: str, m: float, *, parts: dict[str, float], numerical: float = 0.0) -> Identification:
    """The synthetic result with another stiffness factor and budget."""
    result = synthetic(shot=name)
    noise = float(np.sqrt(sum(s**2 for s in parts.values())))
    estimate = replace(
        result.estimates["stiffness_factor"], value=m, sigma_noise=noise, sigma_numerical=numerical,
        mesh_shift=-numerical, noise_parts=parts, numerical_parts={"mesh": numerical},
    )  # fmt: skip
    return replace(result, estimates={"stiffness_factor": estimate})


def history(rate: float, *, spread: float = 0.05) -> StrainHistory:
    """The motion of the synthetic result with another declared rate."""
    time = np.linspace(0.0, 1.5e-3, 301)
    return StrainHistory(
        time=time, strain=displacement(time) / LENGTH, span=(3e-5, 1.5e-3), nominal_rate=rate,
        sigma_rate=1e-3 * rate, true_rate=(0.9 * rate, 1.3 * rate), spread=spread,
    )  # fmt: skip


def rated(
    name: str,
    m: float,
    rate: float,
    *,
    own: float = 0.01,
    curve: float = 0.0,
    group: str = "all shots",
    verdict: Verdict = Verdict.IDENTIFIED,
    quasi_static: QuasiStatic | None = None,
    conditions: dict[str, str] | None = None,
) -> RatedShot:
    """One shot."""
    parts = {"force and shape": own, **({"material curve": curve} if curve else {})}
    result = found(name, m, parts=parts)
    estimate = replace(result.estimates["stiffness_factor"], outcome=verdict)
    return RatedShot(
        name=name,
        group=group,
        rig="the same rig",
        history=history(rate),
        quasi_static=quasi_static or baseline(),
        found=replace(result, estimates={"stiffness_factor": estimate}),
        specimen=(DIAMETER, LENGTH),
        conditions=conditions or {"mesh": "24 x 33", "damping": "2.5e-05"},
    )


MATES_RATES = np.array([340.0, 397.0, 405.0, 429.0, 422.0])
MATES_M = np.array([1.18, 1.04, 1.09, 0.94, 1.02])  # table 2 of Mates et al. (2012).
