"""The clock of a recording: first time and interval of samples that must be uniform."""

import numpy as np

from kolsky.base.records import Recording

LARGEST_JITTER = 0.01
"""Share of the interval by which a sample time may be off an even division."""


def uniform_clock(recording: Recording) -> tuple[float, float]:
    """First time and interval of a recording [s], which must be uniform.

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite, or a time is off an even division by 1 % of the interval.
    """
    time, value, name = recording.time, recording.value, recording.channel
    if time.shape != value.shape or time.ndim != 1 or time.size < 2:
        raise ValueError(
            f"{name}: time and value need one length of 2 or more, got {time.shape}, {value.shape}"
        )
    bad = np.flatnonzero(~(np.isfinite(time) & np.isfinite(value)))
    if bad.size:
        raise ValueError(
            f"{name}: sample {bad[0]} is ({time[bad[0]]} s, {value[bad[0]]}); every sample must be finite"
        )
    interval = float(time[-1] - time[0]) / (time.size - 1)
    if not interval > 0.0:
        raise ValueError(f"{name}: times must increase, got {time[0]:.9g} to {time[-1]:.9g} s")
    off = np.abs(time - time[0] - interval * np.arange(time.size))
    worst = int(np.argmax(off))
    if off[worst] > LARGEST_JITTER * interval:
        raise ValueError(
            f"{name}: sample {worst} is {off[worst] / interval:.3g} intervals off an even division, allowed"
            f" is {LARGEST_JITTER:g}; a rounded time column must be replaced by a stated start and interval"
        )
    return float(time[0]), interval
