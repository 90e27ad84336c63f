"""Inertia of a specimen between bars: what it adds to the stress, whether it is taken out, and what is left.

The motion is that of the bars' faces, by three waves: the strain rate, averaged over the time that a wave
needs to cross the thicker bar's diameter, and its difference quotient.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from kolsky.bars.audit import Switches, known_key
from kolsky.bars.records import Correction, History, Reduction
from kolsky.bars.reduction.inertia import audited, axial_by_analysis, correct_radial_inertia
from kolsky.bars.reduction.validity import Validity, validity
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray

WAY = "three waves"
"""The analysis whose motion is taken."""
KEYS = ("radial inertia", "axial inertia")
"""Switches of the corrections."""


@dataclass(frozen=True)
class SpecimenMotion:
    """Motion of a specimen between two bars, compression positive."""

    rate: History
    """Averaged nominal strain rate [1/s], shape [n]."""
    second: History
    """Its derivative [1/s^2], shape [n]."""
    back: History
    """Acceleration of the back face in the direction of the incident wave [m/s^2], shape [n]."""


def averaged_samples(reduction: Reduction, bars: Mapping[str, Bar]) -> int:
    """Samples in the time that a wave needs to cross the thicker bar's diameter, odd: centred means."""
    step = float(reduction.time[1] - reduction.time[0])
    return max(3, round(max(bar.diameter / bar.wave_speed for bar in bars.values()) / step) | 1)


def specimen_motion(reduction: Reduction, bars: Mapping[str, Bar]) -> SpecimenMotion:
    """Averaged rate, its derivative, and the back face's acceleration.

    Parameters
    ----------
    reduction
        The reduction.
    bars
        The bars by side.
    """
    step = float(reduction.time[1] - reduction.time[0])
    width = averaged_samples(reduction, bars)

    def averaged(history: History) -> FloatArray:
        return moving_mean(history.value, width)

    def slope(history: History, unit: str) -> History:
        # A central difference of means of `width` white samples keeps the two at either end.
        return History(np.gradient(averaged(history), step), history.sigma / (width * step), unit)

    rate = reduction.rate[WAY]
    return SpecimenMotion(
        rate=History(averaged(rate), rate.sigma / np.sqrt(width), rate.unit),
        second=slope(rate, "1/s^2"),
        back=slope(reduction.back_velocity, "m/s^2"),
    )


def inertial_share(reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar]) -> float:
    """Largest stress of radial and axial inertia over the largest stress, by three waves [-]."""
    added = inertial_stress(reduction, specimen, specimen_motion(reduction, bars))
    largest = float(np.abs(moving_mean(reduction.stress[WAY].value, averaged_samples(reduction, bars))).max())
    return float(np.abs(added).max()) / largest if largest > 0.0 else np.inf


def inertial_stress(reduction: Reduction, specimen: Specimen, motion: SpecimenMotion) -> FloatArray:
    """What radial and axial inertia add to the nominal stress by three waves [Pa], shape [n]."""
    stress = reduction.stress[WAY]
    plain, _ = correct_radial_inertia(stress, reduction.strain[WAY], motion.rate, motion.second, specimen)
    axial = axial_by_analysis(motion.second.value, specimen, motion.back.value)[WAY]
    return np.asarray(stress.value - plain.value - axial)


def corrections_that_act(
    reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar], switches: Switches, *, share: float
) -> dict[str, str]:
    """Which of `KEYS` are applied: key -> why. What is not stated is on for a soft specimen.

    Parameters
    ----------
    reduction
        The reduction before these corrections.
    specimen
        The specimen before the test.
    bars
        The bars by side.
    switches
        What the shot states.
    share
        Share of the stress from which on inertia counts [-]; a specimen that reaches it is soft.

    Returns
    -------
    dict
        An entry for each key of `KEYS`; the reason begins with "on" or "off".
    """
    part = inertial_share(reduction, specimen, bars)
    size = f"inertia reaches {100.0 * part:.2g} % of the largest stress, the limit is {100.0 * share:g} %"
    found = {}
    for key in KEYS:
        if known_key(key) in switches.stated:
            found[key] = f"{'on' if switches[key] else 'off'}, as the shot states; {size}"
        elif key == "radial inertia" and part > share:
            found[key] = f"on: the specimen is soft, {size}"
        else:
            found[key] = f"off by default; {size}"
    return found


def correct_inertia(
    reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar], acts: Mapping[str, str]
) -> tuple[Reduction, tuple[Correction, ...]]:
    """The stresses without the inertia of the specimen, where that is asked for.

    Parameters
    ----------
    reduction
        The reduction.
    specimen
        The specimen before the test; its density counts here.
    bars
        The bars by side.
    acts
        As `corrections_that_act` gave it for the test as declared.

    Returns
    -------
    tuple of Reduction and Correction
        Both entries of the log, applied or not; their sizes are those of the stress by three waves.
    """
    motion = specimen_motion(reduction, bars)
    strain = reduction.strain[WAY]
    on = {key: acts.get(key, "off").startswith("on") for key in KEYS}
    stress, radial = dict(reduction.stress), []
    for way, history in reduction.stress.items():
        stress[way], entry = correct_radial_inertia(
            history, strain, motion.rate, motion.second, specimen, apply=on["radial inertia"]
        )
        radial.append(entry)
    change = axial_by_analysis(motion.second.value, specimen, motion.back.value)
    noise = axial_by_analysis(motion.second.sigma, specimen, motion.back.sigma)
    reason = (
        f"{1e3 * specimen.length:.4g} mm of {specimen.density:.4g} kg/m^3, second derivative of the strain "
        f"up to {np.abs(motion.second.value).max():.3g} 1/s^2"
    )
    axial = audited("axial inertia", "axial inertia", change[WAY], "Pa", on["axial inertia"], reason)
    if on["axial inertia"]:
        stress = {
            way: History(h.value + change[way], np.hypot(h.sigma, noise[way]), h.unit)
            for way, h in stress.items()
        }
    entries = (radial[list(reduction.stress).index(WAY)], axial)
    said = tuple(replace(e, reason=f"{e.reason}; {acts.get(e.key, 'off')}") for e in entries)
    return (replace(reduction, stress=stress) if any(on.values()) else reduction), said


def valid_span(
    reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar], *, share: float, tension: bool
) -> Validity:
    """The span in which imbalance and inertia, before its correction, stay within a share of the stress.

    Parameters
    ----------
    reduction
        The reduction before corrections of inertia, compression positive.
    specimen
        The specimen before the test.
    bars
        The bars by side.
    share
        The share [-].
    tension
        Whether the specimen is pulled.
    """
    sign = -1.0 if tension else 1.0
    added = sign * inertial_stress(reduction, specimen, specimen_motion(reduction, bars))
    step = float(reduction.time[1] - reduction.time[0])
    width = min(averaged_samples(reduction, bars), reduction.time.size // 3)
    front, back, strain = (
        replace(h, value=sign * h.value)
        for h in (reduction.front_force, reduction.back_force, reduction.strain[WAY])
    )
    return validity(
        reduction.time, front, back, strain,
        inertial_stress=added, area=specimen.area, share=share, average=width * step,
    )  # fmt: skip
