"""The largest strain that a bar bears elastically: by its yield strength, or by what it is made of."""

import numpy as np

from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray

LARGEST_STRAIN = {"metal": 0.02, "polymer": 0.1}
"""Strain that no elastic bar bears [-]: maraging steel yields at 1.3 %, titanium and aluminium alloys below
1 %, glassy polymers at 3 to 8 %. The signal's unit or sensitivity is wrong there, unless the bar yielded."""
POLYMER = 20e9
"""Young's modulus below which a bar counts as one of a polymer [Pa]."""


def check_elastic(strain: FloatArray, bar: Bar, interval: float, gauge: str) -> None:
    """Refuse strains that the bar cannot have borne elastically.

    Means over the time a wave needs across the bar's diameter must stay below the yield strength over the
    modulus or, where none is declared, below `LARGEST_STRAIN`.

    Parameters
    ----------
    strain
        Strain of the bar after the baseline [-], shape [n].
    bar
        The bar.
    interval
        Sampling interval [s].
    gauge
        Whose strain it is, for the message.

    Raises
    ------
    ValueError
        With the largest strain, its stress and the limit.
    """
    kind = "polymer" if bar.youngs_modulus < POLYMER else "metal"
    limit = LARGEST_STRAIN[kind]
    words = f"{100.0 * limit:g} %, more than any bar of {kind} bears elastically"
    if bar.yield_strength is not None:
        limit = bar.yield_strength / bar.youngs_modulus
        words = f"{limit:.3g}, of its yield strength of {1e-6 * bar.yield_strength:.4g} MPa"
    width = max(1, min(strain.size, round(bar.diameter / bar.wave_speed / interval)))
    largest = float(np.abs(moving_mean(strain, width)).max())
    if largest > limit:
        raise ValueError(
            f"{gauge}: the largest strain of the bar is {largest:.3g}, a stress of "
            f"{1e-6 * largest * bar.youngs_modulus:.4g} MPa; it must be below {words}. Cure: check the unit "
            "of the recording (mV for V, microstrain for strain), strain per volt or the bridge, and the "
            "modulus"
        )
