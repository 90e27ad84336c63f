"""Events of a flyer test. Full speed, separation, arrest, push-back, second impact, end of symmetry.

Events are searched in the path and in the force signals. A kink is the time at which one part of a curve
ends.

A joint connects the flyer to the incident bar. The wave accelerates the flyer to its full speed. The
reflected tension loads the joint until it breaks (separation). The flyer compresses the specimen until it
stops (arrest). It is pushed back, and hits the bar again (second impact): Mates et al. (2012), Fig. 5. The
displacement shows only the motion. The flyer's transducer shows joint and impact best, the transmitted force
the push-back.
"""

from dataclasses import dataclass, replace

import numpy as np

from kolsky.bars.flyer.path import FlyerPath, fit_flyer
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion

STEPS = 80
"""Number of trial positions in the span, before the best one is refined."""


@dataclass(frozen=True)
class Kink:
    """The best position of a kink, and its significance."""

    time: float
    """Its time [s]."""
    sigma: float
    """Its standard uncertainty [s]; it is larger if the curve does not fit within its noise."""
    change: float
    """Factor of the part that ends or begins at the kink, in the unit of the data over s^power."""
    gain: float
    """Decrease of chi-square by the kink, divided by chi-square per degree of freedom with it [-]; about 2
    without a kink."""


def find_kink(
    time: FloatArray,
    value: FloatArray,
    sigma: FloatArray,
    span: tuple[float, float],
    *,
    degree: int,
    power: int,
    begins: bool,
    bends: bool = False,
) -> Kink:
    """Fit a polynomial plus ``|t - t_k|^power`` on one side of the kink by weighted least squares."""
    if time.size < degree + 6:
        raise ValueError(f"a kink needs at least {degree + 6} data, got {time.size}")
    if not span[0] < span[1]:
        raise ValueError(f"a kink needs a span to be looked for in, got {span[0]:.9g} to {span[1]:.9g} s")
    middle, half = 0.5 * (time[0] + time[-1]), 0.5 * (time[-1] - time[0])
    smooth = np.polynomial.polynomial.polyvander((time - middle) / half, degree) / sigma[:, None]
    y = value / sigma

    def equations(at: float) -> FloatArray:
        since = (time - at if begins else at - time) / half
        since = np.maximum(since, 0.0)
        parts = [since ** (power + more) / sigma for more in range(1 + bends)]
        return np.column_stack([smooth, *parts])

    from scipy.optimize import minimize_scalar  # loaded where it is of use

    def chi2(at: float) -> float:
        G = equations(at)
        rest = y - G @ np.linalg.lstsq(G, y, rcond=None)[0]
        return float(rest @ rest)

    grid = np.linspace(*span, STEPS + 1)
    step = float(grid[1] - grid[0])
    best = float(grid[np.argmin([chi2(at) for at in grid])])
    inside = (max(best - step, span[0]), min(best + step, span[1]))
    best = float(minimize_scalar(chi2, bounds=inside, method="bounded", options={"xatol": 1e-4 * step}).x)
    G = equations(best)
    solution = np.linalg.lstsq(G, y, rcond=None)[0]
    h = 1e-2 * step
    slope = (equations(best + h) - equations(best - h)) @ solution / (2.0 * h)
    J = np.column_stack([G, slope])
    size = np.linalg.norm(J, axis=0)
    size[size == 0.0] = 1.0
    variance = (np.linalg.pinv((J / size).T @ (J / size)) / np.outer(size, size))[-1, -1]
    straight = y - smooth @ np.linalg.lstsq(smooth, y, rcond=None)[0]
    left = chi2(best)
    growth = max(1.0, left / (y.size - J.shape[1]))
    return Kink(
        time=best,
        sigma=float(np.sqrt(growth * variance)),
        change=float(solution[degree + 1] / half**power),
        gain=(float(straight @ straight) - left) / growth,
    )


RINGING = 20e-6
"""Default span over which transducer signals are averaged [s]. It is longer than the ringing of a 25 mm
flyer."""
_CERTAIN = 25.0
"""Smallest decrease of chi-square for a kink: five standard deviations."""
EXCURSION = 3.0
"""A jump of the transducer's signal is an impact if it is this many times the largest jump of the flight."""


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
    """Method by which the event was found, or the reason why it was not found."""


def end_of_dip(signal: Signal, after: float, before: float, ringing: float) -> Event | None:
    """The kink at the end of the tensile dip of a flyer's transducer."""
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
    if kink.gain < _CERTAIN or kink.change > 0.0:
        return None
    # The average rounds a corner over its span. The corner is therefore uncertain by at least the standard
    # deviation of that span.
    spread = float(np.hypot(kink.sigma, ringing / np.sqrt(12.0)))
    return Event("", kink.time, spread, "the tensile dip of the flyer's transducer ends")


def first_jump(signal: Signal, after: float, rest: float, ringing: float) -> Event | None:
    """First jump of a signal relative to its past average.

    It must be far larger than the jumps during the flight.
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
    # The jump began between the last sample within the range of the flight and this sample.
    calm_before = np.flatnonzero(np.abs(step[:i]) <= limit / EXCURSION)
    start = float(t[calm_before[-1]]) if calm_before.size else float(t[i])
    width = max(float(t[i]) - start, signal.interval)
    time = float(t[i]) - 0.5 * width
    return Event(
        "", time, width / np.sqrt(12.0), "the flyer's transducer jumps beyond three times its flight"
    )


def find_push_back(arrest: Event, impact: Event, transmitted: Signal | None, ringing: float) -> Event:
    """The time at which the transmitted force falls to half its peak after the arrest."""
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


def _back_face_velocity(time: FloatArray, force: Signal, bar: Bar, ringing: float) -> FloatArray:
    """Velocity of the bar's face under a force: the emitted wave, plus twice its echoes from a free end."""
    at, F, _ = moving_average(force, ringing)
    returns = range(1, int((time[-1] - at[0]) / bar.round_trip) + 1)
    echoes = [np.interp(time - k * bar.round_trip, at, F, left=0.0) for k in returns]
    return np.asarray(
        (np.interp(time, at, F, left=0.0) + 2.0 * sum(echoes, np.zeros(time.size))) / bar.impedance
    )


def moving_average(signal: Signal, span: float) -> tuple[FloatArray, FloatArray, float]:
    """Times and centred moving averages of a signal over a span, and the noise of one average."""
    n = 2 * round(0.5 * span / signal.interval) + 1
    if n >= signal.value.size:
        raise ValueError(
            f"{signal.name or 'the signal'} has {signal.value.size} samples, an average over {span:.3g} s {n}"
        )
    value = np.convolve(signal.value, np.full(n, 1.0 / n), mode="valid")
    noise = signal.sigma * min(1.0, float(np.sqrt(signal.memory / n)))
    return signal.time[n // 2 : n // 2 + value.size], value, noise


_JOINT_SPAN = 200e-6
"""Longest time from full speed to separation in the search [s]."""
_AFTER_IMPACT = 8
"""Number of frames after a second impact for its time, if only the displacement shows it."""


@dataclass(frozen=True)
class FlyerEvents:
    """The events of a flyer's test in their order."""

    events: tuple[Event, ...]
    """Every event that was searched for, found or not."""
    path: FlyerPath
    """The flyer's path up to the second impact."""

    def __getitem__(self, name: str) -> Event:
        """The event of a name."""
        for event in self.events:
            if event.name == name:
                return event
        raise KeyError(f"{name!r} is not one of {', '.join(event.name for event in self.events)}")

    @property
    def usable(self) -> tuple[float, str]:
        """Last time at which the data are used [s], and the reason.

        The reason is lost symmetry, second impact or end of the record.
        """
        found = [
            (event.time, event.name)
            for event in self.events
            if event.time is not None and event.name in ("end of symmetry", "second impact")
        ]
        return min(found) if found else (self.path.end, "the record")


def flyer_events(
    motion: FlyerMotion,
    *,
    rest: float,
    incident: Signal | None = None,
    transmitted: Signal | None = None,
    bar: Bar | None = None,
    ringing: float = RINGING,
) -> FlyerEvents:
    """Find the events of a flyer's test in its records.

    Returns: each event with time, sigma and the method by which it was found, or why it was not found.

    ``motion``: the flyer's displacement toward the specimen at the frames, on the shot's clock. ``rest``: a
    time in the static frames [s]. ``incident``: force at the flyer's transducer, compression positive [N].
    ``transmitted``: transmitted force, compression positive [N]. ``bar``: the transmission bar. The motion of
    the specimen's back face is then computed from the transmitted force and its reflections from the bar's
    free end. Arrest is relative to that face. Needs `transmitted`. Without a bar, the face is at rest.
    ``ringing``: span over which the transducers' signals are averaged [s], longer than the flyer's ringing.
    """
    if not ringing >= 0.0:
        raise ValueError(f"ringing is {ringing:g} s, must be >= 0 s")
    if bar is not None and transmitted is None:
        raise ValueError("the motion of a transmission bar needs the transmitted force: give both or neither")
    impact = second_impact(motion, rest=rest, incident=incident, ringing=ringing)
    if impact.time is None:
        kept = motion
    else:
        # One frame more than sigma requires. Otherwise, the jump would bend the path in front of it.
        use = motion.time < impact.time - 2.0 * (impact.sigma or 0.0)
        kept = FlyerMotion(motion.time[use], motion.displacement[use], motion.sigma[use])
    path = fit_flyer(kept, start=rest)
    speed = _full_speed(path)
    arrest = _arrest(path, speed, transmitted, bar, ringing)
    events = [
        speed,
        _separation(kept, speed, arrest, incident, ringing),
        arrest,
        find_push_back(arrest, impact, transmitted, ringing),
        impact,
        Event(
            "end of symmetry", None, None, "needs pictures: an exported displacement has one direction only"
        ),
    ]
    return FlyerEvents(tuple(events), path)


def _turning(motion: FlyerMotion) -> int | None:
    """Frame of the largest displacement. None if the flyer still moves forward at the end."""
    top = int(np.argmax(motion.displacement))
    back = motion.displacement[top] - motion.displacement[-1]
    return top if back > 5.0 * motion.sigma[top] else None


def _full_speed(path: FlyerPath) -> Event:
    """The zero crossing of the acceleration at the largest velocity."""
    from scipy.optimize import brentq  # loaded where it is of use

    name, t = "full speed", np.linspace(path.start, path.end, 8 * path.knots.size)
    top = int(np.argmax(path.velocity(t)))
    if top in (0, t.size - 1):
        return Event(name, None, None, "the flyer still gains speed at the end of the record")
    low, high = t[top - 1], t[top + 1]
    a = path.acceleration([low, high])
    time = float(brentq(lambda x: float(path.acceleration(x)), low, high)) if a[0] > 0.0 > a[1] else t[top]
    jerk = abs(float(np.diff(a)[0])) / (high - low)
    sigma = float(path.sigma_acceleration(time)) / jerk
    frame = float(np.median(np.diff(path.knots)))
    sigma = float(np.hypot(sigma, frame / np.sqrt(12.0)))
    return Event(name, float(time), sigma, "largest velocity of the flyer's path: nothing drives it any more")


def _separation(
    motion: FlyerMotion, speed: Event, arrest: Event, incident: Signal | None, ringing: float
) -> Event:
    """The end of the joint's pull, from the transducer if there is one, otherwise from the displacement."""
    name = "separation"
    if speed.time is None:
        return Event(name, None, None, speed.how)
    last = speed.time + _JOINT_SPAN if arrest.time is None else min(speed.time + _JOINT_SPAN, arrest.time)
    if incident is not None:
        found = end_of_dip(incident, speed.time, last, ringing)
        if found is not None:
            return replace(found, name=name)
    near = (motion.time >= speed.time) & (motion.time <= last + _JOINT_SPAN)
    t = motion.time[near]
    if t.size < 9:
        return Event(name, None, None, "fewer than 9 frames follow full speed")
    kink = find_kink(
        t, motion.displacement[near], motion.sigma[near], (t[2], last), degree=2, power=2, begins=False
    )
    # The part that ends at the kink bends the path down: until then, the joint slowed the flyer.
    if kink.gain > _CERTAIN and kink.change < 0.0:
        return Event(name, kink.time, kink.sigma, "the flyer's deceleration by the joint ends (displacement)")
    seen = "neither transducer nor displacement show" if incident is not None else "the displacement shows no"
    return Event(name, None, None, f"{seen} pull of a joint after full speed; take full speed for it")


def _arrest(path: FlyerPath, speed: Event, force: Signal | None, bar: Bar | None, ringing: float) -> Event:
    """The zero of the velocity relative to the back face."""
    name = "arrest"
    if speed.time is None:
        return Event(name, None, None, speed.how)
    t = np.linspace(speed.time, path.end, 8 * path.knots.size)
    v, seen = path.velocity(t), "the velocity of the flyer's path falls through zero"
    if force is not None and bar is not None:
        v = v - _back_face_velocity(t, force, bar, ringing)
        seen = "the velocity of the flyer's path falls to that of the back face"
    below = np.flatnonzero(v <= 0.0)
    if not below.size or below[0] == 0:
        return Event(
            name,
            None,
            None,
            f"the flyer still moves toward the specimen at {v[-1]:.3g} m/s at the record's end",
        )
    i = int(below[0])
    time = float(t[i - 1] + (t[i] - t[i - 1]) * v[i - 1] / (v[i - 1] - v[i]))
    sigma = float(path.sigma_velocity(time) / abs(float(path.acceleration(time))))
    return Event(name, time, sigma, seen)


def second_impact(
    motion: FlyerMotion, *, rest: float, incident: Signal | None = None, ringing: float = RINGING
) -> Event:
    """The impact of the flyer on the incident bar: a jump of its transducer or, if that shows none, velocity.

    ``motion``: its displacement at the frames. ``rest``: a time in the static frames [s]. The other arguments
    are those of `flyer_events`.
    """
    name, turn = "second impact", _turning(motion)
    if turn is None:
        return Event(name, None, None, "the flyer does not turn back in the record")
    if incident is not None:
        found = first_jump(incident, motion.time[turn], rest, ringing)
        if found is not None:
            return replace(found, name=name)
    kink = _slope_jump(motion, turn, motion.time.size)
    if kink is not None:
        # The contact lasts for a time. Only the neighbouring frames determine its beginning.
        for _ in range(3):
            last = int(np.searchsorted(motion.time, kink.time)) + _AFTER_IMPACT
            kink = _slope_jump(motion, turn, last) or kink
        # The speed changes between two frames. No frame shows the change.
        frame = float(np.median(np.diff(motion.time)))
        sigma = float(np.hypot(kink.sigma, frame / np.sqrt(12.0)))
        return Event(name, kink.time, sigma, "the flyer's velocity jumps (displacement)")
    return Event(name, None, None, "velocity and force have no jump after the flyer turned back")


def _slope_jump(motion: FlyerMotion, turn: int, last: int) -> Kink | None:
    """The jump of the velocity toward the specimen, between the turning point and a frame."""
    t, x, sigma = (array[turn:last] for array in (motion.time, motion.displacement, motion.sigma))
    if t.size < 12:
        return None
    kink = find_kink(t, x, sigma, (t[3], t[-3]), degree=4, power=1, begins=True, bends=True)
    return kink if kink.gain > _CERTAIN and kink.change > 0.0 else None
