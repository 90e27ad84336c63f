"""Slow tests, relaxation, oscillation and shots on one axis: apparent moduli over the time they were felt.

The apparent modulus is that of rubber elasticity, E_a = 3 P / (lam - lam^-2) with the nominal stress P,
Eq. (M.9), which takes the strain out of a neo-Hookean solid (Fig. 11 of Mates et al. 2012). The time is the
mean age of the strain,

    age(t) = (1 / ln lam(t)) int_0^t (t - s) d ln lam(s),                                              (V.4)

the time of holding after a step, and half of the duration of a steady ramp. An oscillation is felt for
1 / omega: E'(omega) and E(1 / omega) differ by less than the loss modulus.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.material.relaxation.evidence import DynamicTest, HistoryTest
from kolsky.material.relaxation.rate_fit import RateFit

SETBACK = 0.01
"""Share of the largest strain that a held one may go back by: noise of the strain is no unloading [-]."""
LEAST_STRAIN = 0.02
"""Least |lam - 1| a sample needs [-]: below, noise and contact outweigh the modulus."""


@dataclass(frozen=True)
class ApparentModuli:
    """Moduli of one test."""

    label: str
    """Name of the test."""
    age: FloatArray
    """Mean age of the strain, Eq. (V.4) [s], shape [n]."""
    strain: FloatArray
    """Nominal strain lam - 1; 0 for an oscillation [-], shape [n]."""
    modulus: FloatArray
    """E_a, Eq. (M.9), or E' [Pa], shape [n]."""
    sigma: FloatArray
    """Its standard uncertainty from that of the stress [Pa], shape [n]."""

    @property
    def rate(self) -> FloatArray:
        """Strain over age [1/s], 0 for an oscillation, shape [n]."""
        return np.asarray(np.abs(self.strain) / self.age)


def apparent_moduli(test: HistoryTest | DynamicTest) -> ApparentModuli:
    """The moduli that a slow test, a relaxation or an oscillation shows by itself.

    Samples without a measured stress, and those strained by less than `LEAST_STRAIN`, show none.

    Raises
    ------
    ValueError
        If a history turns back by more than `SETBACK`, after which its strain has no age, or no sample is
        strained enough.
    """
    if isinstance(test, DynamicTest):
        return ApparentModuli(
            label=test.label,
            age=1.0 / test.angular_frequency,
            strain=np.zeros(len(test.angular_frequency)),
            modulus=test.storage.copy(),
            sigma=test.sigma_storage.copy(),
        )
    strain = np.log(test.stretch)
    side = 1.0 if strain[np.argmax(np.abs(strain))] > 0.0 else -1.0
    most = side * np.maximum.accumulate(side * strain)
    back = np.abs(strain - most) > SETBACK * np.abs(strain).max()
    if back.any():
        k = int(np.argmax(back))
        raise ValueError(
            f"{test.label}: the stretch turns back at sample {k} ({test.time[k]:g} s); give what comes before"
        )
    strain = most
    rise = np.diff(strain, prepend=0.0)
    # Between the samples the strain rises steadily: its middle is the age of that part.
    middle = 0.5 * (test.time + np.concatenate([test.time[:1], test.time[:-1]]))
    shown = np.isfinite(test.sigma) & (np.abs(test.stretch - 1.0) >= LEAST_STRAIN)
    if not shown.any():
        raise ValueError(
            f"{test.label}: no sample has a measured stress and a strain of {LEAST_STRAIN:g} or more"
        )
    age = test.time - np.cumsum(rise * middle) / np.where(strain == 0.0, 1.0, strain)
    shown &= age > 0.0
    if not shown.any():
        raise ValueError(f"{test.label}: every sample was taken at the moment of a step, where age is 0")
    lam = test.stretch[shown]
    gauss = 3.0 / (lam - lam**-2)
    return ApparentModuli(
        label=test.label,
        age=age[shown],
        strain=lam - 1.0,
        modulus=gauss * test.stress[shown],
        sigma=np.abs(gauss) * test.sigma[shown],
    )


def dynamic_modulus(
    *, factor: float, sigma_factor: float, young: float, strain: float, duration: float, label: str
) -> ApparentModuli:
    """The point of a shot: E_a,dyn = m E_a,qs, Eq. (M.1).

    Parameters
    ----------
    factor, sigma_factor : float
        The identified m and its standard uncertainty [-].
    young : float
        E_a,qs of the curve that m multiplies [Pa].
    strain : float
        Largest nominal strain in the window, tension-positive [-].
    duration : float
        Length of the window [s]; the strain's age is half of it.
    label : str
        Name of the shot.

    Raises
    ------
    ValueError
        If the duration, the modulus or the factor is not positive.
    """
    for name, value in (("duration", duration), ("young", young), ("factor", factor)):
        if not 0.0 < value < np.inf:
            raise ValueError(f"{name} must be > 0 and finite, got {value}")
    row = (0.5 * duration, strain, factor * young, sigma_factor * young)
    return ApparentModuli(label, *(np.array([value]) for value in row))


def fitted_modulus(
    fit: RateFit, young: float, age: Sequence[float] | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """E(t) of a fit over the same axis, with its standard uncertainty [Pa].

    Parameters
    ----------
    fit : RateFit
        From `kolsky.material.relaxation.prony_fit`.
    young : float
        Initial modulus of the long-term law, 3 mu_0 [Pa].
    age : array, shape [n]
        Times after a step of strain [s].

    Returns
    -------
    tuple of array, shape [n]
        Modulus and standard uncertainty, by the covariance of the logarithms.
    """
    t = np.asarray(age, dtype=float)
    n = len(fit.values) // 2
    factor, c, tau = fit.values[0], fit.values[1 : n + 1], fit.values[n + 1 :]
    x = t[:, None] / tau
    parts = c * np.exp(-x)
    modulus = factor * young * (1.0 + parts.sum(axis=1))
    slopes = np.column_stack([modulus, factor * young * parts, factor * young * parts * x])
    return modulus, np.sqrt(np.einsum("ki,ij,kj->k", slopes, fit.covariance, slopes))
