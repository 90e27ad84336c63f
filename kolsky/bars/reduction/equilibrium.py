"""Force equilibrium of a specimen: R(t), the span in which it holds, and how long it took to get there."""

from dataclasses import dataclass
from math import ceil, hypot, log, sqrt

import numpy as np

from kolsky.bars.records import Reduction
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.arrays import BoolArray, FloatArray

ALLOWANCE = 0.05
"""|R| up to which a specimen counts as in equilibrium (Ravichandran and Subhash 1994)."""
LEAST_FORCE = 5.0
"""Multiple of its averaged noise below which a mean force says nothing of R."""


@dataclass(frozen=True)
class Equilibrium:
    """Force equilibrium of a test: its time span, its largest imbalance, the time to reach it."""

    span: tuple[float, float] | None
    """Longest time span in which |R| stays within the allowance [s]; None if there is none."""
    allowance: float
    """The allowance [-]."""
    ring_up: float | None
    """Time from the arrival of the incident wave at the specimen to the span's beginning [s]."""
    transits: float | None
    """The same in transits of a wave through the specimen [-]; None without its wave speed."""
    worst: float | None
    """Largest |R| within the span [-]; above the allowance where a shorter excursion was bridged."""
    reason: str
    """In words: the span, or why there is none."""


def imbalance(
    front: FloatArray, back: FloatArray, sigma_front: float, sigma_back: float, *, width: int = 1
) -> FloatArray:
    """R(t) = 2 (F1 - F2) / (F1 + F2), Eq. (R.10), of forces averaged over `width` samples.

    Parameters
    ----------
    front, back
        Forces at the two faces [N], shape [n].
    sigma_front, sigma_back
        Standard deviations of one sample's noise [N].
    width
        Samples over which the forces are averaged first, >= 1.

    Returns
    -------
    ndarray
        R [-], shape [n]; inf where the mean force is below `LEAST_FORCE` times its own noise.
    """
    first, second = moving_mean(front, width), moving_mean(back, width)
    mean = 0.5 * (first + second)
    noise = 0.5 * hypot(sigma_front, sigma_back) / sqrt(width)
    least = max(LEAST_FORCE * noise, 1e-9 * float(np.abs(mean).max(initial=0.0)))
    heard = np.abs(mean) > least
    result = np.full(front.size, np.inf)
    result[heard] = (first[heard] - second[heard]) / mean[heard]
    return result


def balanced_span(
    time: FloatArray, ratio: FloatArray, *, allowance: float = ALLOWANCE, bridge: float = 0.0
) -> tuple[float, float] | None:
    """Longest span in which |R| stays within the allowance.

    Parameters
    ----------
    time
        Times [s], shape [n].
    ratio
        R [-], shape [n].
    allowance
        Largest |R| [-], > 0.
    bridge
        Excursions no longer than this do not end a span [s].

    Returns
    -------
    tuple of float or None
        First and last time [s].

    Raises
    ------
    ValueError
        If the allowance is not greater than 0.
    """
    if not allowance > 0.0:
        raise ValueError(f"the allowance of R = {allowance} must be greater than 0")
    runs = _runs(np.abs(ratio) <= allowance)
    merged: list[list[int]] = []
    for first, last in runs:
        if merged and time[first] - time[merged[-1][1]] <= bridge:
            merged[-1][1] = last
        else:
            merged.append([first, last])
    if not merged:
        return None
    first, last = max(merged, key=lambda run: run[1] - run[0])
    return (float(time[first]), float(time[last])) if last > first else None


def elastic_transits(impedance_ratio: float, *, allowance: float = ALLOWANCE) -> int:
    """Transits after which an elastic specimen under a step is in equilibrium.

    Eq. (R.11): with r = (1 - beta) / (1 + beta), equal bars and a step of the incident wave, the forces at
    the faces after m transits are 1 - r^m and 1 - r^(m + 1) of the last, and
    R = 2 r^m (1 - r) / (2 - r^m (1 + r)). A slower rise takes fewer transits from its end, more from its
    beginning.

    Parameters
    ----------
    impedance_ratio
        Impedance rho c A of the specimen over that of the bars, beta, in (0, 1].
    allowance
        Largest |R| [-], > 0.

    Returns
    -------
    int
        The smallest m.

    Raises
    ------
    ValueError
        If an argument is outside its range.
    """
    if not 0.0 < impedance_ratio <= 1.0:
        raise ValueError(f"the impedance ratio of specimen and bars = {impedance_ratio} must be in (0, 1]")
    if not allowance > 0.0:
        raise ValueError(f"the allowance of R = {allowance} must be greater than 0")
    r = (1.0 - impedance_ratio) / (1.0 + impedance_ratio)
    if r == 0.0:
        return 1
    power = 2.0 * allowance / (2.0 * (1.0 - r) + allowance * (1.0 + r))
    return max(0, ceil(log(power) / log(r) - 1e-9))


def report_equilibrium(
    reduction: Reduction,
    *,
    specimen_length: float,
    allowance: float = ALLOWANCE,
    specimen_wave_speed: float | None = None,
) -> Equilibrium:
    """Force equilibrium of a reduction.

    Parameters
    ----------
    reduction
        The reduction, with its R and its span; its time 0 is the arrival of the incident wave.
    specimen_length
        Length of the specimen [m].
    allowance
        The allowance the span was found with [-].
    specimen_wave_speed
        Wave speed in the specimen [m/s], where it is known.

    Returns
    -------
    Equilibrium

    Notes
    -----
    Davies and Hunter (1963) ask for pi transits before a plastic specimen is taken as uniform; an elastic
    one takes longer the softer it is against the bars, Eq. (R.11).
    """
    if reduction.balanced is None:
        finite = np.abs(reduction.imbalance[np.isfinite(reduction.imbalance)])
        least = f"the smallest is {finite.min():.3g}" if finite.size else "the forces stay within their noise"
        reason = f"|R| is nowhere within {allowance:g}: {least}"
        return Equilibrium(None, allowance, None, None, None, reason)
    first, last = reduction.balanced
    inside = (reduction.time >= first) & (reduction.time <= last)
    within = np.abs(reduction.imbalance[inside])
    worst = float(within[np.isfinite(within)].max())
    ring_up = max(0.0, first)
    transits = None if specimen_wave_speed is None else ring_up * specimen_wave_speed / specimen_length
    count = "" if transits is None else f", {transits:.1f} transits of the specimen"
    reason = (
        f"|R| within {allowance:g} from {first:.4g} s to {last:.4g} s, "
        f"{ring_up:.3g} s after the wave's arrival{count}"
    )
    return Equilibrium(reduction.balanced, allowance, ring_up, transits, worst, reason)


def _runs(flag: BoolArray) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
