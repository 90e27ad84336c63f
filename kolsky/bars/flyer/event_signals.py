"""Events of a flyer in its force signals: the end of the joint's pull, an impact, the push-back."""

from dataclasses import dataclass

import numpy as np

from kolsky.bars.flyer.kink import find_kink
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray

RINGING = 20e-6
"""Default span over which transducer signals are averaged [s]: longer than a flyer of 25 mm rings."""
CERTAIN = 25.0
"""Fall of chi-square from which on a kink is one: five standard deviations."""
EXCURSION = 3.0
"""A jump of the transducer's signal is an impact when it is so many times the largest of the flight."""


@dataclass(frozen=True)
class Event:
    """One event, found or not."""

    name: str
    """"full speed", "separation", "arrest", "push-back", "second impact" or "end of symmetry"."""
    time: float | None
    """Its time on the shot's clock [s]; None if it was not found."""
    sigma: float | None
    """Standard uncertainty of the time [s]; None if it was not found."""
    how: str
    """Method by which it was found, or the reason why it was not."""


def end_of_dip(signal: Signal, after: float, before: float, ringing: float) -> Event | None:
    """The kink at the end of the tensile dip of a flyer's transducer.

    Parameters
    ----------
    signal
        Force at the transducer, compression positive [N].
    after, before
        Times between which the joint may let go [s].
    ringing
        Span over which the signal is averaged [s].

    Returns
    -------
    Event or None
        Without a name; None if there is no dip below five sigmas and 5 % of the drive, or no kink behind it.
    """
    t, force, sigma = moving_average(signal, ringing)
    near = np.flatnonzero((t >= after - ringing) & (t <= before))
    driven = force[(t >= signal.start) & (t <= after)]
    if near.size < 12 or not driven.size:
        return None
    bottom = int(near[np.argmin(force[near])])
    if not force[bottom] < -max(5.0 * sigma, 0.05 * float(driven.max())):
        return None
    end = min(before, t[bottom] + 4.0 * max(t[bottom] - after, 2.0 * ringing))
    use = (t >= t[bottom] + 0.5 * ringing) & (t <= end)
    if use.sum() < 8:
        return None
    kink = find_kink(
        t[use],
        force[use],
        np.full(int(use.sum()), sigma),
        (t[use][2], t[use][-3]),
        degree=0,
        power=1,
        begins=False,
    )
    if kink.gain < CERTAIN or kink.change > 0.0:
        return None
    # The average rounds a corner over its span: known to that span's standard deviation at best.
    spread = float(np.hypot(kink.sigma, ringing / np.sqrt(12.0)))
    return Event("", kink.time, spread, "the tensile dip of the flyer's transducer ends")


def first_jump(signal: Signal, after: float, rest: float, ringing: float) -> Event | None:
    """First jump of a signal against its own past average, far beyond those of the flight.

    Parameters
    ----------
    signal
        Force at the transducer [N].
    after
        When the flyer turned back [s]; the last four tenths of its way there tell what it does in flight.
    rest
        A time before it moved [s].
    ringing
        Span of the past average [s].

    Returns
    -------
    Event or None
        Without a name; None if nothing jumps.
    """
    n = max(2, round(ringing / signal.interval))
    total = np.cumsum(np.concatenate([[0.0], signal.value]))
    past = (total[n:-1] - total[: -n - 1]) / n  # the mean of the n samples before each
    t, step = signal.time[n:], signal.value[n:] - past
    calm = (t > after - 0.4 * (after - rest)) & (t < after)
    if not calm.any():
        return None
    limit = max(EXCURSION * float(np.abs(step[calm]).max()), 8.0 * signal.sigma)
    beyond = np.flatnonzero((t > after) & (np.abs(step) > limit))
    if not beyond.size:
        return None
    i = int(beyond[0])
    # It began between the last sample within the flight's own excursions and this one.
    calm_before = np.flatnonzero(np.abs(step[:i]) <= limit / EXCURSION)
    start = float(t[calm_before[-1]]) if calm_before.size else float(t[i])
    width = max(float(t[i]) - start, signal.interval)
    time = float(t[i]) - 0.5 * width
    return Event(
        "", time, width / np.sqrt(12.0), "the flyer's transducer jumps beyond three times its flight"
    )


def find_push_back(arrest: Event, impact: Event, transmitted: Signal | None, ringing: float) -> Event:
    """The transmitted force falls to half its peak after the arrest.

    Parameters
    ----------
    arrest, impact
        The events on either side, found or not.
    transmitted
        Transmitted force, compression positive [N].
    ringing
        Span over which it is averaged [s].
    """
    name = "push-back"
    if arrest.time is None:
        return Event(name, None, None, "no arrest of the flyer was found")
    if transmitted is None:
        return Event(name, None, None, "needs the transmitted force")
    t, force, sigma = moving_average(transmitted, ringing)
    use = t <= (t[-1] if impact.time is None else impact.time - 0.5 * ringing)
    t, force = t[use], force[use]
    half = 0.5 * float(force.max())
    below = np.flatnonzero((t > arrest.time) & (force <= half))
    if not below.size or below[0] == 0:
        return Event(name, None, None, "the transmitted force does not fall to half its peak in the record")
    i = int(below[0])
    around = (t >= t[i] - 2.0 * ringing) & (t <= t[i] + 2.0 * ringing)
    slope, level = np.polyfit(t[around] - t[i], force[around], 1)
    scatter = max(sigma, float(np.std(force[around] - np.polyval([slope, level], t[around] - t[i]))))
    time = float(t[i] + (half - level) / slope)
    return Event(
        name, time, float(scatter / abs(slope)), "transmitted force falls to half its peak after the arrest"
    )


def back_face_velocity(time: FloatArray, force: Signal, bar: Bar, ringing: float) -> FloatArray:
    """Velocity of the bar's face under a force: what it sends, and twice what comes back from a free end.

    Parameters
    ----------
    time
        Times [s], shape [n].
    force
        Force on the face, compression positive [N]; nothing before its record.
    bar
        The bar.
    ringing
        Span over which the force is averaged [s].

    Returns
    -------
    NDArray
        Into the bar [m/s], shape [n].
    """
    at, F, _ = moving_average(force, ringing)
    returns = range(1, int((time[-1] - at[0]) / bar.round_trip) + 1)
    echoes = [np.interp(time - k * bar.round_trip, at, F, left=0.0) for k in returns]
    return np.asarray(
        (np.interp(time, at, F, left=0.0) + 2.0 * sum(echoes, np.zeros(time.size))) / bar.impedance
    )


def moving_average(signal: Signal, span: float) -> tuple[FloatArray, FloatArray, float]:
    """Times and centred moving averages of a signal over a span, and the noise of one.

    Raises
    ------
    ValueError
        If the signal is shorter than the span.
    """
    n = 2 * round(0.5 * span / signal.interval) + 1
    if n >= signal.value.size:
        raise ValueError(
            f"{signal.name or 'the signal'} has {signal.value.size} samples, an average over {span:.3g} s {n}"
        )
    value = np.convolve(signal.value, np.full(n, 1.0 / n), mode="valid")
    noise = signal.sigma * min(1.0, float(np.sqrt(signal.memory / n)))
    return signal.time[n // 2 : n // 2 + value.size], value, noise
