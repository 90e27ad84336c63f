"""Events of a flyer's test: full speed, separation, arrest, push-back, second impact, end of symmetry.

The flyer is held to the incident bar by a joint. The wave drives it to its full speed, the reflected tension
pulls at the joint until it breaks (separation), it flies into the specimen until it stands still (arrest), is
pushed back, and meets the bar again (second impact): Mates et al. (2012), Fig. 5. A displacement alone shows
the motion; joint and impact show best in the flyer's transducer, the push-back in the transmitted force.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from kolsky.bars.flyer.event_signals import (
    CERTAIN,
    RINGING,
    Event,
    back_face_velocity,
    end_of_dip,
    find_push_back,
    first_jump,
)
from kolsky.bars.flyer.fit import fit_flyer
from kolsky.bars.flyer.kink import Kink, find_kink
from kolsky.bars.flyer.path import FlyerPath
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion

JOINT_SPAN = 200e-6
"""Longest time from full speed to separation that is looked for [s]."""
AFTER_IMPACT = 8
"""Frames after a second impact from which its time is taken, where only the displacement shows it."""


class Ending(Protocol):
    """End of symmetry, as `kolsky.bars.flyer.flight.SymmetryEnd` offers it."""

    @property
    def row(self) -> int | None:
        """First frame at which symmetry has ended."""


@dataclass(frozen=True)
class FlyerEvents:
    """The events of a flyer's test in their order."""

    events: tuple[Event, ...]
    """Every event that was looked for, found or not."""
    path: FlyerPath
    """The flyer's path up to the second impact."""

    def __getitem__(self, name: str) -> Event:
        """The event of a name."""
        for event in self.events:
            if event.name == name:
                return event
        raise KeyError(f"{name!r} is none of {', '.join(event.name for event in self.events)}")

    @property
    def in_order(self) -> tuple[Event, ...]:
        """The events that were found, in order of time."""
        found = [event for event in self.events if event.time is not None]
        return tuple(sorted(found, key=lambda event: event.time or 0.0))

    @property
    def usable(self) -> tuple[float, str]:
        """Until when the data count [s], and what ends them: lost symmetry, second impact or the record."""
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
    symmetry: tuple[FloatArray, Ending] | None = None,
    ringing: float = RINGING,
) -> FlyerEvents:
    """Find the events of a flyer's test in what was recorded of it.

    Parameters
    ----------
    motion
        The flyer's displacement toward the specimen at the frames, on the shot's clock.
    rest
        A time in the static frames [s].
    incident
        Force at the flyer's transducer, compression positive [N].
    transmitted
        Transmitted force, compression positive [N].
    bar
        The transmission bar: the specimen's back face then moves as the transmitted force and its returns
        from the bar's free end have it, and the arrest is the flyer's relative to that face. At rest if left
        out; needs `transmitted`.
    symmetry
        Frame times [s] and what `kolsky.bars.flyer.flight.symmetry_end` found at them, where there are
        pictures.
    ringing
        Span over which the transducers' signals are averaged [s]; longer than the flyer rings.

    Returns
    -------
    FlyerEvents
        Each event with time, sigma and how it was found, or why it was not.

    Raises
    ------
    ValueError
        As `kolsky.bars.flyer.fit.fit_flyer`; if `ringing` is negative, or a bar is given without a force.
    """
    if not ringing >= 0.0:
        raise ValueError(f"ringing is {ringing:g} s, must be >= 0 s")
    if bar is not None and transmitted is None:
        raise ValueError("the motion of a transmission bar needs the transmitted force: give both or neither")
    impact = _second_impact(motion, _turning(motion), incident, rest, ringing)
    if impact.time is None:
        kept = motion
    else:
        # One frame more than sigma needs: the jump must not bend the path before it.
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
        _symmetry(symmetry),
    ]
    return FlyerEvents(tuple(events), path)


def second_impact(motion: FlyerMotion, *, rest: float) -> Event:
    """The flyer runs into the bar that it came from: a jump of its velocity after it turned back.

    Parameters
    ----------
    motion
        Its displacement at the frames.
    rest
        A time in the static frames [s].
    """
    return _second_impact(motion, _turning(motion), None, rest, RINGING)


def _turning(motion: FlyerMotion) -> int | None:
    """Frame of the largest displacement, None if the flyer still goes on at the end."""
    top = int(np.argmax(motion.displacement))
    back = motion.displacement[top] - motion.displacement[-1]
    return top if back > 5.0 * motion.sigma[top] else None


def _full_speed(path: FlyerPath) -> Event:
    """The acceleration's fall through zero at the largest velocity."""
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
    """The end of the joint's pull, in the transducer if there is one, else in the displacement."""
    name = "separation"
    if speed.time is None:
        return Event(name, None, None, speed.how)
    last = speed.time + JOINT_SPAN if arrest.time is None else min(speed.time + JOINT_SPAN, arrest.time)
    if incident is not None:
        found = end_of_dip(incident, speed.time, last, ringing)
        if found is not None:
            return replace(found, name=name)
    near = (motion.time >= speed.time) & (motion.time <= last + JOINT_SPAN)
    t = motion.time[near]
    if t.size < 9:
        return Event(name, None, None, "fewer than 9 frames follow full speed")
    kink = find_kink(
        t, motion.displacement[near], motion.sigma[near], (t[2], last), degree=2, power=2, begins=False
    )
    # The part that ends at the kink bends the path down: the joint slowed the flyer until then.
    if kink.gain > CERTAIN and kink.change < 0.0:
        return Event(name, kink.time, kink.sigma, "the flyer's deceleration by the joint ends (displacement)")
    seen = "neither transducer nor displacement show" if incident is not None else "the displacement shows no"
    return Event(name, None, None, f"{seen} pull of a joint after full speed; take full speed for it")


def _arrest(path: FlyerPath, speed: Event, force: Signal | None, bar: Bar | None, ringing: float) -> Event:
    """Zero of the velocity relative to the back face."""
    name = "arrest"
    if speed.time is None:
        return Event(name, None, None, speed.how)
    t = np.linspace(speed.time, path.end, 8 * path.knots.size)
    v, seen = path.velocity(t), "the velocity of the flyer's path falls through zero"
    if force is not None and bar is not None:
        v = v - back_face_velocity(t, force, bar, ringing)
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


def _second_impact(
    motion: FlyerMotion, turn: int | None, incident: Signal | None, rest: float, ringing: float
) -> Event:
    """The jump of the flyer's transducer, or of the slope of its displacement, after it turned back."""
    name = "second impact"
    if turn is None:
        return Event(name, None, None, "the flyer does not turn back in the record")
    if incident is not None:
        found = first_jump(incident, motion.time[turn], rest, ringing)
        if found is not None:
            return replace(found, name=name)
    kink = _slope_jump(motion, turn, motion.time.size)
    if kink is not None:
        # The contact goes on: only the frames next to it tell when it began.
        for _ in range(3):
            last = int(np.searchsorted(motion.time, kink.time)) + AFTER_IMPACT
            kink = _slope_jump(motion, turn, last) or kink
        # The speed changes within a frame, which no frame shows.
        frame = float(np.median(np.diff(motion.time)))
        sigma = float(np.hypot(kink.sigma, frame / np.sqrt(12.0)))
        return Event(name, kink.time, sigma, "the flyer's velocity jumps (displacement)")
    return Event(name, None, None, "neither velocity nor force jumps after the flyer turned back")


def _slope_jump(motion: FlyerMotion, turn: int, last: int) -> Kink | None:
    """The jump of the velocity toward the specimen, between turning back and a frame."""
    t, x, sigma = (array[turn:last] for array in (motion.time, motion.displacement, motion.sigma))
    if t.size < 12:
        return None
    kink = find_kink(t, x, sigma, (t[3], t[-3]), degree=4, power=1, begins=True, bends=True)
    return kink if kink.gain > CERTAIN and kink.change > 0.0 else None


def _symmetry(symmetry: tuple[FloatArray, Ending] | None) -> Event:
    name = "end of symmetry"
    if symmetry is None:
        return Event(name, None, None, "needs pictures: an exported displacement has one direction only")
    time, end = symmetry
    if end.row is None:
        return Event(name, None, None, "the flyer keeps its direction to the end of the pictures")
    row = end.row
    frame = float(time[row] - time[row - 1]) if row else float(time[1] - time[0])
    return Event(
        name, float(time[row]), frame / np.sqrt(12.0), "the velocity leaves its direction after separation"
    )
