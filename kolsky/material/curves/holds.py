"""Strains that a record holds after a loading ramp: where the ramp ends, and what relaxes then."""

from dataclasses import dataclass

import numpy as np

from kolsky.material.curves.uniaxial import UniaxialTest

NEAR = 0.005
"""Share of the ramp's range within which of its end a strain is held [-]."""
LONG = 0.05
"""Share of the ramp's duration (of its samples where no time was recorded) beyond which a strain that stays
near the end is held: a steady ramp spends `NEAR` of its duration there [-]."""
LOSS = 0.01
"""Share of the stress that must relax for a hold to be told [-]."""


@dataclass(frozen=True)
class Hold:
    """A strain that was held after a ramp."""

    strain: float
    """The strain [-]."""
    duration: float | None
    """How long it was held [s]; None if no time was recorded."""
    samples: int
    """Samples in it."""
    first: float
    """Nominal stress at its beginning [Pa]."""
    last: float
    """And at its end [Pa]."""

    def remark(self, name: str) -> str:
        """What a reader of a curve without it must know."""
        long = f"{self.samples} samples" if self.duration is None else f"{self.duration:.4g} s"
        return (
            f"{name}: its strain is held at {self.strain:.3g} for {long} and the stress goes from"
            f" {1e-3 * self.first:.4g} to {1e-3 * self.last:.4g} kPa; this relaxation is not in the curve,"
            " `kolsky material relaxation` reads it"
        )


def without_hold(test: UniaxialTest, ramp: slice) -> tuple[slice, Hold | None]:
    """A ramp that ends where its strain is reached, and the hold after it.

    With noise the largest strain of a record lies somewhere in the hold, and the ramp up to it has stresses
    that have relaxed.

    Parameters
    ----------
    test
        The whole record.
    ramp
        One of its loading ramps.

    Returns
    -------
    tuple of slice and Hold or None
        The ramp to its first strain near the end if it is held there, else as it was.
    """
    strain = test.strain
    begin, stop = int(ramp.start), int(ramp.stop)
    top = float(strain[stop - 1])
    near = NEAR * (top - float(strain[begin:stop].min()))
    reached = begin + int(np.argmax(strain[begin:stop] >= top - near))
    left = np.flatnonzero(np.abs(strain[reached:] - top) > 2.0 * near)
    end = reached + int(left[0]) if left.size else strain.size
    if end - reached < 2:
        return ramp, None
    if test.time is None:
        share, duration = (end - reached) / max(1, reached - begin), None
    else:
        before = float(test.time[reached] - test.time[begin])
        duration = float(test.time[end - 1] - test.time[reached])
        share = duration / before if before > 0.0 else np.inf
    if share <= LONG:
        return ramp, None
    hold = Hold(
        float(strain[reached]),
        duration,
        end - reached,
        float(test.stress[reached]),
        float(test.stress[end - 1]),
    )
    return slice(begin, reached + 1), hold


def remarks_of(name: str, hold: Hold | None) -> tuple[str, ...]:
    """A hold in words, if anything relaxes in it."""
    if hold is None or abs(hold.last - hold.first) <= LOSS * abs(hold.first):
        return ()
    return (hold.remark(name),)
