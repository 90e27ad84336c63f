"""Remarks on the signals of a test: pulses that come at impossible times, a drift that decides."""

from collections.abc import Iterable

import numpy as np

from kolsky.bars.budget.budget import Budget
from kolsky.bars.records import Reduction
from kolsky.bars.reduction.inputs import SIDES, WavesInput
from kolsky.bars.reduction.pulse_checks import PulseCheck
from kolsky.bars.signals.drift import DRIFTING

LARGEST_DELAY = 3.0
"""Offset of a pulse's arrival, in its own sigmas beyond two samples, above which a remark is made."""
LARGEST_TOE = 0.01
"""Strain before the stress rises, by the transmitted flank's tangent, above which a gap is remarked [-]."""
DOMINATES = 0.5
"""Share of a quoted value's variance from the zero and drift of the gauges above which it is remarked [-]."""
SMALL = 1e-3
"""Second-order term over a quoted value that does not matter, however small its uncertainty [-]."""


def arrival_remarks(
    reduction: Reduction, checks: tuple[PulseCheck, PulseCheck], given: WavesInput
) -> list[str]:
    """Remarks on pulses that arrive earlier or later than distances and wave speeds allow.

    The reflected pulse must come when predicted. The transmitted one must not come before; how late it comes
    depends on the specimen, so that it is late where the specimen was shortened by more than `LARGEST_TOE`
    before its stress rises.
    """
    found = []
    interval = float(reduction.time[1] - reduction.time[0])
    reflected, transmitted = checks
    if reflected.observed is None:
        found.append(f"no reflected pulse is found: {reflected.reason}")
    for name, check, sigma in zip(("reflected", "transmitted"), checks, way_sigmas(given), strict=True):
        allowed = LARGEST_DELAY * float(np.hypot(check.offset_sigma, sigma)) + 2.0 * interval
        late = name == "reflected" and check.offset > allowed
        if late or check.offset < -allowed:
            found.append(
                f"the {name} pulse arrives {1e6 * check.offset:+.2f} us from the time that the gauges' "
                f"distances and the wave speeds predict, and {1e6 * allowed:.2g} us can be explained; cure: "
                "check both, or measure the wave speed (kolsky wavespeed)"
            )
    if transmitted.observed is not None and transmitted.delay > 0.0:
        strain = np.abs(reduction.strain["three waves"].value)
        toe = float(np.interp(transmitted.delay, reduction.time, strain))
        if toe > LARGEST_TOE:
            found.append(
                f"the transmitted pulse rises {1e6 * transmitted.delay:.3g} us late, when the specimen is "
                f"shortened by {100 * toe:.2g} %: a gap, a face that is not plane, a wrong distance, or a "
                "material that begins so soft; cure: check the specimen's contact, its faces and the gauge's "
                "distance"
            )
    return found


def way_sigmas(given: WavesInput) -> tuple[float, float]:
    """Standard uncertainties of the predicted arrivals of the reflected and the transmitted pulse [s].

    Travel times x / c with the declared uncertainties of the gauges' distances, all alike, and of the wave
    speeds, u(c)/c directly or half of hypot(u(E)/E, u(rho)/rho).
    """
    stated = given.uncertainty
    speed = stated.get("bar_wave_speed", 0.0) or 0.5 * float(
        np.hypot(stated.get("bar_modulus", 0.0), stated.get("bar_density", 0.0))
    )
    distance = stated.get("gauge_distance", 0.0)
    ways = [
        (given.stations[side].position / given.bars[side].wave_speed, distance / given.bars[side].wave_speed)
        for side in SIDES
    ]
    (first, first_off), (second, second_off) = ways
    return (
        float(np.hypot(2.0 * first * speed, 2.0 * first_off)),
        float(np.hypot(np.hypot(first, second) * speed, np.hypot(first_off, second_off))),
    )


def drift_remarks(budget: Budget, quoted: Iterable[str]) -> list[str]:
    """Remarks on quoted values whose uncertainty the zero and the drift of the gauges decide."""
    found = []
    rows = [i for i, q in enumerate(budget.quantities) if q.name.rstrip("1234567890 ").endswith(DRIFTING)]
    for name in quoted:
        if name not in budget.value:
            continue
        variance = float(budget.sigma(name)) ** 2
        share = float((budget.contribution[name][rows] ** 2).sum()) / variance if variance > 0.0 else 0.0
        if share > DOMINATES and np.sqrt(variance) > SMALL * abs(float(budget.value[name])):
            found.append(
                f"the zero of the gauges and its drift decide the uncertainty of the {name} "
                f"({100 * share:.0f} % of its variance); cure: a longer baseline that ends shortly before "
                "the pulse, or a bridge that drifts less"
            )
    return found
