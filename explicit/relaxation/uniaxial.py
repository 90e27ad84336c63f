"""Homogeneous uniaxial response to any history of stretch: the NumPy twin of the time loop's branches.

Incompressible, with stress-free sides: F = diag(lam, lam^-1/2, lam^-1/2). The pressure drops out of the
difference of the principal stresses, so the nominal stress is that of the Kirchhoff stresses' difference over
lam. Any `explicit.materials.MaterialLaw` serves.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.relaxation.prony import PronySeries


def uniaxial_stress(law: Any, stretch: ArrayLike) -> FloatArray:
    """Nominal stress of the law alone [Pa], tension-positive, shape of `stretch`."""
    lam = np.asarray(stretch, dtype=float)
    along, across = _deviators(law, lam)
    return np.asarray((along - across) / lam)


def prony_stress(law: Any, series: PronySeries, time: ArrayLike, stretch: ArrayLike) -> FloatArray:
    """Nominal stress along a history of stretch, Eq. (V.1).

    Between the samples the isochoric stress S of the law is taken as linear in time, for which the
    recursion of the branches is exact; the specimen was at rest, lam = 1, before the first sample. A step of
    strain is two samples at one time.

    Parameters
    ----------
    law
        The long-term law: an `explicit.materials.MaterialLaw`.
    series : PronySeries
        The branches.
    time : array, shape [n]
        Times, not descending [s].
    stretch : array, shape [n]
        Stretch at these times [-].

    Returns
    -------
    array, shape [n]
        Nominal stress, tension-positive [Pa].

    Raises
    ------
    ValueError
        If the shapes differ, a time descends, or a stretch is not > 0.
    """
    t, lam = checked_history(time, stretch)
    along, across = _deviators(law, lam)
    # Second Piola-Kirchhoff: F^-1 tau F^-T; one component along the load, two equal ones across it.
    S = np.stack([along / lam**2, across * lam])
    total = S.copy()
    for strength, relaxation_time in zip(series.strengths, series.times, strict=True):
        total += strength * _branch(t, S, relaxation_time)
    return np.asarray((lam**2 * total[0] - total[1] / lam) / lam)


def checked_history(time: ArrayLike, stretch: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """A history as two float64 arrays.

    Raises
    ------
    ValueError
        As of `prony_stress`.
    """
    t, lam = np.asarray(time, dtype=float), np.asarray(stretch, dtype=float)
    if t.ndim != 1 or t.shape != lam.shape or t.size == 0:
        raise ValueError(f"a history needs as many stretches as times, got shapes {lam.shape} and {t.shape}")
    if not np.isfinite(t).all() or (np.diff(t) < 0.0).any():
        k = int(np.argmax(~np.isfinite(t) | (np.diff(t, prepend=t[0]) < 0.0)))
        raise ValueError(f"times must be finite and not descend, got {t[k]} s at sample {k}")
    if not (np.isfinite(lam) & (lam > 0.0)).all():
        k = int(np.argmin(np.isfinite(lam) & (lam > 0.0)))
        raise ValueError(f"stretch must be > 0 and finite, got {lam[k]} at sample {k}")
    return t, lam


def _branch(time: FloatArray, S: FloatArray, relaxation_time: float) -> FloatArray:
    """int exp(-(t - s) / tau) dS(s) for piecewise linear S, shape of S."""
    step = np.diff(time)
    x = step / relaxation_time
    decay = np.exp(-x)
    # (1 - exp(-x)) / x without cancellation, 1 where a step of strain takes no time
    gain = np.where(x > 0.0, -np.expm1(-x) / np.where(x > 0.0, x, 1.0), 1.0)
    rise = np.diff(S, axis=1)
    out = np.empty_like(S)
    out[:, 0] = S[:, 0]  # from rest to the first sample in no time
    for k in range(len(step)):
        out[:, k + 1] = decay[k] * out[:, k] + gain[k] * rise[:, k]
    return out


def _deviators(law: Any, lam: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Isochoric Kirchhoff stress along and across the load [Pa]."""
    nothing = np.zeros_like(lam)
    tau = np.asarray(law.stress(np.stack([1.0 / lam, lam**2, nothing, 1.0 / lam], axis=-1)))
    return tau[..., 1], tau[..., 0]
