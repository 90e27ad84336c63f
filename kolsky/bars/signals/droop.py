"""Droop of a piezoelectric transducer: its compensation, and its time constant from a decaying tail.

Charge leaks from transducer and amplifier with one time constant, so that a force that stays is seen to
fall. This is a high-pass filter of first order, whose inverse is Eq. (U.6).
"""

import numpy as np

from kolsky.bars.records import Quantity
from kolsky.bars.signals.noise import estimate_noise
from kolsky.base.arrays import FloatArray

FEWEST_TAIL = 50
"""Samples of a tail; fewer say little about its shape."""


def compensate_droop(
    time: FloatArray, value: FloatArray, time_constant: float, *, start: float
) -> FloatArray:
    """Signal of a transducer without droop, v + (1/tau) int v dt, Eq. (U.6).

    Parameters
    ----------
    time
        Increasing sample times [s], shape [n].
    value
        Samples above zero, in any unit, shape [n].
    time_constant
        Time in which the output of a constant force falls to 1/e [s], > 0.
    start
        Time from which on is integrated, the end of the rest [s], so that the baseline's noise is kept out.

    Raises
    ------
    ValueError
        If the time constant is not finite and positive.
    """
    check_time_constant(time_constant)
    first = int(np.searchsorted(time, start))
    lost = np.zeros(time.size)
    if first < time.size:
        from scipy.integrate import cumulative_trapezoid  # loaded where it is of use

        lost[first:] = cumulative_trapezoid(value[first:], time[first:], initial=0.0) / time_constant
    return value + lost


def droop_sigma(time: FloatArray, sigma: float, time_constant: float, *, start: float) -> FloatArray:
    """Standard deviation of compensated samples from white noise in the recorded ones, Eq. (U.7), shape [n].

    Raises
    ------
    ValueError
        If the time constant is not finite and positive.
    """
    check_time_constant(time_constant)
    first = int(np.searchsorted(time, start))
    factor = np.ones(time.size)
    h = np.diff(time[first:]) / time_constant
    if h.size:
        # Weights of the trapezoid rule up to sample k: w_0 = h_0/2, w_j = (h_(j-1) + h_j)/2, w_k = h_(k-1)/2.
        inner = np.concatenate([[0.5 * h[0]], 0.5 * (h[1:] + h[:-1])])
        factor[first + 1 :] = np.sqrt(np.cumsum(inner**2) + (1.0 + 0.5 * h) ** 2)
    return sigma * factor


def fit_time_constant(
    time: FloatArray, value: FloatArray, span: tuple[float, float], *, name: str
) -> Quantity:
    """Time constant of a transducer from the tail after a force that stays, v = A exp(-t / tau).

    Parameters
    ----------
    time
        Sample times [s], shape [n].
    value
        Samples above the zero of the rest, shape [n].
    span
        First and last time of a stretch with constant force [s].
    name
        Of the quantity, e.g. "transmission force, time constant".

    Returns
    -------
    Quantity
        Time constant [s] and its standard uncertainty from the residuals, their memory included.

    Raises
    ------
    ValueError
        If the tail has fewer than 50 samples, does not decay, or decays by too little to be told from noise.
    """
    inside = (time >= span[0]) & (time <= span[1])
    t, v = time[inside], value[inside]
    place = f"the tail {span[0]:.9g} to {span[1]:.9g} s"
    if t.size < FEWEST_TAIL:
        raise ValueError(
            f"{name}: {place} holds {t.size} samples, at least {FEWEST_TAIL} are needed; widen it"
        )
    from scipy.optimize import OptimizeWarning, curve_fit  # loaded where it is of use

    x = (t - t[0]) / (t[-1] - t[0])
    slope, level = np.polyfit(x, v, 1)
    rate = -slope / (level + 0.5 * slope)
    try:
        (A, rate), covariance = curve_fit(_tail, x, v, p0=(level, rate), jac=_tail_slopes)
    except (RuntimeError, OptimizeWarning) as error:
        raise ValueError(f"{name}: {place} is no exponential decay ({error}); choose another tail") from None
    residual = v - _tail(x, A, rate)
    memory = 1.0
    if np.ptp(residual) > 0.0:
        memory = max(estimate_noise(residual, freedom_lost=2).memory, 1.0)
    sigma = float(np.sqrt(covariance[1, 1] * memory))
    if not rate > 2.0 * sigma:
        raise ValueError(
            f"{name}: {place} falls by {rate:.3g} +- {sigma:.2g} of its height, which must be more than twice"
            " its uncertainty; record a longer tail of a constant force, or state the time constant"
        )
    length = float(t[-1] - t[0])
    return Quantity(
        name=name,
        value=length / float(rate),
        sigma=length / float(rate) ** 2 * sigma,
        unit="s",
        kind="A",
        freedom=max(t.size / memory - 2.0, 1.0),
    )


def check_time_constant(time_constant: float) -> None:
    """Check that a time constant is finite and positive.

    Raises
    ------
    ValueError
        If it is not finite and positive.
    """
    if not (np.isfinite(time_constant) and time_constant > 0.0):
        raise ValueError(f"the time constant of a droop must be finite and > 0 s, got {time_constant}")


def _tail(x: FloatArray, A: float, rate: float) -> FloatArray:
    return A * np.exp(-rate * x)


def _tail_slopes(x: FloatArray, A: float, rate: float) -> FloatArray:
    e = np.exp(-rate * x)
    return np.stack([e, -A * x * e], axis=1)
