"""The wave that comes back from the far end of the bar, step by step, and how it depends on what left."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from explicit.arrays import FloatArray
from explicit.support import CharacteristicBar
from explicit.time_loop.boundary import BAR_HISTORY


class Source(NamedTuple):
    """Source of a returned wave: two neighbours among the stored values."""

    early: int
    """The step in which the earlier one left; -1 if nothing returns yet."""
    later: int
    """The step in which the later one left."""
    share: float
    """Share of the later one [-]."""


@dataclass
class ReturnedWave:
    """The wave that left in each step and, interpolated from it, the one that returned.

    The time loop stores `BAR_HISTORY` values of the outgoing wave in a round trip, each that of the first
    step at or after its time, and interpolates: each returned value is linear in two outgoing ones.
    """

    support: CharacteristicBar
    """The bar."""
    returned: list[float] = field(default_factory=list)
    """Wave h that returned in each step [m/s]."""
    outgoing: list[float] = field(default_factory=list)
    """Wave g that left in each step [m/s]."""
    sources: list[Source] = field(default_factory=list)
    """What returned in each step."""
    _stored: list[int] = field(default_factory=list)

    def arriving(self, elapsed: float) -> float:
        """The wave that returns in the next step, whose end is `elapsed` [s] after the start [m/s]."""
        source, wave = Source(-1, -1, 0.0), 0.0
        late = elapsed - self.support.round_trip
        if late > 0.0:
            place = late / self.support.round_trip * BAR_HISTORY
            k = int(place)
            source = Source(self._stored[k], self._stored[k + 1], place - k)
            wave = self.outgoing[source.early]
            wave += source.share * (self.outgoing[source.later] - wave)
        self.sources.append(source)
        self.returned.append(wave)
        return wave

    def record_outgoing(self, wave: float, elapsed: float) -> None:
        """Store the wave that left in that step [m/s]."""
        self.outgoing.append(wave)
        while len(self._stored) * self.support.round_trip / BAR_HISTORY <= elapsed:
            self._stored.append(len(self.outgoing) - 1)

    def check_segments(self, n_steps: int) -> None:
        """Refuse segments of `n_steps` steps if a wave returns within the segment that it left in.

        Raises
        ------
        ValueError
            If so; the message names the round trip and the cure.
        """
        later = np.array([source.later for source in self.sources], dtype=np.int64)
        inside = np.flatnonzero((later >= 0) & (later >= np.arange(len(later)) // n_steps * n_steps))
        if inside.size:
            raise ValueError(
                f"the wave returns from the bar within a segment of {n_steps} steps (round trip"
                f" {self.support.round_trip:.6g} s); use a smaller checkpoint_every"
            )

    def add_cotangent(self, first: int, cotangent: FloatArray, outgoing: FloatArray) -> None:
        """Add what the return in steps from `first` on contributes to the cotangent of what left."""
        for k, by_returned in enumerate(cotangent, start=first):
            early, later, share = self.sources[k]
            if early >= 0:
                outgoing[early] += (1.0 - share) * by_returned
                outgoing[later] += share * by_returned
