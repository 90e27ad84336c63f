"""Inertia corrections: radial and axial inertia of the specimen, and a mass between gauge and specimen."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dic.basics import check_interval, check_shape
from kolsky.bars.audit import Switches, correction_of
from kolsky.bars.flyer.path import FlyerPath
from kolsky.bars.records import Correction, History, Quantity, Reduction
from kolsky.bars.reduction.validity import Validity, validity
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray


def radial_pressure(
    strain: ArrayLike, rate: ArrayLike, second: ArrayLike, *, density: float, radius: float
) -> FloatArray:
    """Mean pressure on the faces of a disc from its radial inertia [Pa].

    An incompressible disc has the initial radius a0 and stays homogeneous under the nominal compression e.
    Its radial velocity is ``r e' / (2 (1 - e))``, and its radial acceleration ``r / 2 (e'' / (1 - e) + 3 e'^2
    / (2 (1 - e)^2))``. The side surface at ``a^2 = a0^2 / (1 - e)`` is free. By radial equilibrium, the
    pressure falls as ``a^2 - r^2``. Its mean is

    ``p = (rho a0^2 / 8) (e'' / (1 - e)^2 + 3 e'^2 / (2 (1 - e)^3))``.

    The small-strain term is in H. Kolsky, Proc. Phys. Soc. B 62 (1949) 676. The finite strain is in S. K.
    Samanta, J. Mech. Phys. Solids 19 (1971) 117 and T. L. Warren, M. J. Forrestal, Exp. Mech. 50 (2010) 1253.
    """
    e, e1, e2 = (np.asarray(x, dtype=np.float64) for x in (strain, rate, second))
    if e.size and not e.max() < 1.0:
        raise ValueError(
            f"a nominal compression must be < 1, got {e.max():.6g}: nothing would be left. Cure: "
            "check the unit of the recordings, the gauges' calibration and the specimen's length"
        )
    left = 1.0 - e
    return np.asarray(density * radius**2 / 8.0 * (e2 / left**2 + 1.5 * e1**2 / left**3))


def correct_radial_inertia(
    stress: History,
    strain: History,
    rate: History,
    second: History,
    specimen: Specimen,
    *,
    apply: bool = True,
) -> tuple[History, Correction]:
    """Nominal stress without the share of radial inertia. The share is Eq. of `radial_pressure` over 1 - e.

    The force of the pressure is ``p A0 / (1 - e)``, because the face has grown. Its nominal stress is ``p /
    (1 - e)``. The uncertainties of strain, rate and second derivative are taken as independent.

    ``stress``: nominal stress [Pa], compression positive. ``strain``, ``rate``, ``second``: nominal
    compression [-], [1/s], [1/s^2]. ``apply``: False returns the stress unchanged. Raises ValueError for the
    reasons of `radial_pressure`, and if shapes differ.
    """
    for name, history in (("strain", strain), ("rate", rate), ("second", second)):
        check_shape(stress.value.shape, **{name: history.value, f"sigma of {name}": history.sigma})
    rho, a0 = specimen.density, specimen.radius
    left = 1.0 - strain.value
    p = radial_pressure(strain.value, rate.value, second.value, density=rho, radius=a0)
    factor = rho * a0**2 / 8.0
    by_strain = factor * (3.0 * second.value / left**4 + 6.0 * rate.value**2 / left**5)
    by_rate, by_second = factor * 3.0 * rate.value / left**4, factor / left**3
    sigma = np.sqrt(
        stress.sigma**2
        + (by_strain * strain.sigma) ** 2
        + (by_rate * rate.sigma) ** 2
        + (by_second * second.sigma) ** 2
    )
    reason = (
        f"incompressible homogeneous disc, {1e3 * a0:.4g} mm radius, {rho:.4g} kg/m^3, rate up to"
        f" {np.abs(rate.value).max():.3g} 1/s, its derivative up to {np.abs(second.value).max():.3g} 1/s^2"
    )
    change = -p / left
    log = correction_of("radial inertia", "radial inertia", change, applied=apply, unit="Pa", reason=reason)
    return (History(stress.value + change, sigma, "Pa") if apply else stress), log


def axial_stress(
    second: ArrayLike, *, density: float, length: float, back_acceleration: ArrayLike = 0.0
) -> FloatArray:
    """Mean nominal stress along a specimen minus that at its back face, by axial inertia [Pa].

    A specimen of length L is compressed homogeneously by e, and its back face has the acceleration a_b. At
    the height Y above that face, the material has the acceleration ``a_b + e'' Y``. The force there is the
    back force plus the rate of momentum of the material between. Its mean over Y is the back stress plus
    ``rho L (a_b / 2 + L e'' / 6)``. At the front face, it is the back stress plus ``rho L (a_b + L e'' /
    2)``. With the first-order radial term, this is the correction of E. D. H. Davies, S. C. Hunter, J. Mech.
    Phys. Solids 11 (1963) 155. D. A. Gorham, J. Phys. D 22 (1989) 1888 gives the convective terms.
    """
    e2, a = np.asarray(second, dtype=np.float64), np.asarray(back_acceleration, dtype=np.float64)
    return np.asarray(density * length * (a / 2.0 + length * e2 / 6.0))


def axial_by_analysis(second: ArrayLike, specimen: Specimen, back: ArrayLike) -> dict[str, FloatArray]:
    """Mean nominal stress along a specimen minus the stress of each analysis, by axial inertia [Pa].

    One wave gives the stress at the back face, two waves that at the front, three waves the mean of both. Let
    s be `axial_stress`. The front stress exceeds the back stress by ``d = rho L (a_b + L e'' / 2)``. The
    differences are therefore s for one wave, s - d for two, and s - d / 2 for three. The last one is ``-rho
    L^2 e'' / 12``.

    ``second``: second derivative of the nominal compression [1/s^2], shape [n]. ``back``: acceleration of the
    back face in the direction of the incident wave [m/s^2], shape [n] or scalar.
    """
    rho, length = specimen.density, specimen.length
    mean = axial_stress(second, density=rho, length=length, back_acceleration=back)
    across = rho * length * (np.asarray(back, dtype=float) + 0.5 * length * np.asarray(second, dtype=float))
    return {"one wave": mean, "two waves": mean - across, "three waves": mean - 0.5 * across}


def correct_axial_inertia(
    back_stress: History, second: History, specimen: Specimen, *, apply: bool = True
) -> tuple[History, Correction]:
    """Mean nominal stress along the specimen from that at its resting back face, see `axial_stress`.

    ``back_stress``: by one wave [Pa]. ``second``: second derivative of the nominal compression [1/s^2].
    """
    rho, length = specimen.density, specimen.length
    change = axial_stress(second.value, density=rho, length=length)
    sigma = np.sqrt(back_stress.sigma**2 + (rho * length**2 / 6.0 * second.sigma) ** 2)
    log = _axial_entry(change, second, specimen, applied=apply)
    return (History(back_stress.value + change, sigma, "Pa") if apply else back_stress), log


def _axial_entry(change: FloatArray, second: History, specimen: Specimen, *, applied: bool) -> Correction:
    reason = (
        f"{1e3 * specimen.length:.4g} mm of {specimen.density:.4g} kg/m^3, second derivative of the strain up"
        f" to {np.abs(second.value).max():.3g} 1/s^2"
    )
    return correction_of("axial inertia", "axial inertia", change, applied=applied, unit="Pa", reason=reason)


WAY = "three waves"
"""The analysis of the motion that is used."""
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


def _averaged_samples(reduction: Reduction, bars: Mapping[str, Bar]) -> int:
    """Samples of centred means, odd: the time of a wave across the thicker bar's diameter."""
    step = float(reduction.time[1] - reduction.time[0])
    return max(3, round(max(bar.diameter / bar.wave_speed for bar in bars.values()) / step) | 1)


def specimen_motion(reduction: Reduction, bars: Mapping[str, Bar]) -> SpecimenMotion:
    """Averaged rate, its derivative, and the acceleration of the back face."""
    step = float(reduction.time[1] - reduction.time[0])
    width = _averaged_samples(reduction, bars)

    def averaged(history: History) -> FloatArray:
        return moving_mean(history.value, width)

    def slope(history: History, unit: str) -> History:
        # In a central difference of means of `width` white samples, the two samples at either end remain.
        return History(np.gradient(averaged(history), step), history.sigma / (width * step), unit)

    rate = reduction.rate[WAY]
    return SpecimenMotion(
        rate=History(averaged(rate), rate.sigma / np.sqrt(width), rate.unit),
        second=slope(rate, "1/s^2"),
        back=slope(reduction.back_velocity, "m/s^2"),
    )


def inertial_share(reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar]) -> float:
    """Largest stress of radial and axial inertia divided by the largest stress, by three waves [-]."""
    added = inertial_stress(reduction, specimen, specimen_motion(reduction, bars))
    width = _averaged_samples(reduction, bars)
    largest = float(np.abs(moving_mean(reduction.stress[WAY].value, width)).max())
    return float(np.abs(added).max()) / largest if largest > 0.0 else np.inf


def inertial_stress(reduction: Reduction, specimen: Specimen, motion: SpecimenMotion) -> FloatArray:
    """Contribution of radial and axial inertia to the nominal stress by three waves [Pa], shape [n]."""
    stress = reduction.stress[WAY]
    plain, _ = correct_radial_inertia(stress, reduction.strain[WAY], motion.rate, motion.second, specimen)
    axial = axial_by_analysis(motion.second.value, specimen, motion.back.value)[WAY]
    return np.asarray(stress.value - plain.value - axial)


def corrections_that_act(
    reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar], switches: Switches, *, share: float
) -> dict[str, str]:
    """The entries of `KEYS` that are applied: key -> reason, which begins with "on" or "off".

    Without a given switch, a correction is on for a soft specimen: one in which inertia reaches the share of
    the stress. ``reduction``: before these corrections.
    """
    part = inertial_share(reduction, specimen, bars)
    size = f"inertia reaches {100.0 * part:.2g} % of the largest stress, the limit is {100.0 * share:g} %"
    found = {}
    for key in KEYS:
        if key in switches.stated:
            found[key] = f"{'on' if switches[key] else 'off'}, as the shot states; {size}"
        elif key == "radial inertia" and part > share:
            found[key] = f"on: the specimen is soft, {size}"
        else:
            found[key] = f"off by default; {size}"
    return found


def correct_inertia(
    reduction: Reduction, specimen: Specimen, bars: Mapping[str, Bar], acts: Mapping[str, str]
) -> tuple[Reduction, tuple[Correction, ...]]:
    """The stresses corrected for the inertia of the specimen, if the switches are on, and the log.

    Both entries are in the log, applied or not. Their sizes are those of the stress by three waves.
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
    axial = _axial_entry(change[WAY], motion.second, specimen, applied=on["axial inertia"])
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
    """The span in which imbalance and uncorrected inertia stay within a share of the stress.

    ``reduction``: before corrections of inertia, compression positive.
    """
    sign = -1.0 if tension else 1.0
    added = sign * inertial_stress(reduction, specimen, specimen_motion(reduction, bars))
    step = float(reduction.time[1] - reduction.time[0])
    width = min(_averaged_samples(reduction, bars), reduction.time.size // 3)
    front, back, strain = (
        replace(h, value=sign * h.value)
        for h in (reduction.front_force, reduction.back_force, reduction.strain[WAY])
    )
    return validity(
        reduction.time, front, back, strain,
        inertial_stress=added, area=specimen.area, share=share, average=width * step,
    )  # fmt: skip


def path_acceleration(path: FlyerPath, time: ArrayLike) -> History:
    """Acceleration of a face with a known path and its standard uncertainty [m/s^2].

    The path is from `kolsky.bars.flyer.path.fit_flyer`, or from `kolsky.bars.flyer.front_path.front_path` for
    the interface velocity of bar waves. ``time``: times, not after the path's end [s]. Before the path's
    start the face is at rest.
    """
    t = np.asarray(time, dtype=np.float64)
    moving = t >= path.start
    value, sigma = np.zeros(t.shape), np.zeros(t.shape)
    value[moving], sigma[moving] = path.acceleration(t[moving]), path.sigma_acceleration(t[moving])
    return History(value, sigma, "m/s^2")


def compensate_mass(
    force: History,
    acceleration: History,
    mass: Quantity,
    *,
    apply: bool = True,
    source: str = "the face's motion",
) -> tuple[History, Correction]:
    """Force on the specimen from that at a gauge, with a moving mass between: ``F = F_gauge - m a``.

    ``acceleration``: of the mass in the direction of the incident wave [m/s^2], at the force's times.
    ``apply``: False returns the force unchanged. The correction is still measured. Raises ValueError if the
    mass is not positive, or if shapes differ.
    """
    check_interval("(0, inf) kg", **{mass.name: mass.value})
    check_shape(force.value.shape, acceleration=acceleration.value)
    a = acceleration.value
    change = -mass.value * a
    sigma = np.sqrt(force.sigma**2 + (mass.value * acceleration.sigma) ** 2 + (mass.sigma * a) ** 2)
    reason = (
        f"{1e3 * mass.value:.4g} g between the incident gauge and the specimen, acceleration from {source} up"
        f" to {np.abs(a).max():.3g} m/s^2"
    )
    log = correction_of(
        "mass compensation, incident", "mass", change, applied=apply, unit=force.unit, reason=reason
    )
    return (History(force.value + change, sigma, force.unit) if apply else force), log
