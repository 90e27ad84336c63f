"""Inertia of the specimen: its contribution to the stress, radially and along the axis.

Compression is positive. A function returns the corrected history and a `Correction`; a correction that is
switched off is measured all the same.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.records import Correction, History
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray


def radial_pressure(
    strain: ArrayLike, rate: ArrayLike, second: ArrayLike, *, density: float, radius: float
) -> FloatArray:
    """Mean pressure on the faces of a disc from its radial inertia [Pa].

    An incompressible disc of initial radius a0 that stays homogeneous under the nominal compression e has
    the radial velocity ``r e' / (2 (1 - e))`` and therefore the radial acceleration
    ``r / 2 (e'' / (1 - e) + 3 e'^2 / (2 (1 - e)^2))``. Radial equilibrium with a free side surface at
    ``a^2 = a0^2 / (1 - e)`` gives a pressure that falls as ``a^2 - r^2``, whose mean is

    ``p = (rho a0^2 / 8) (e'' / (1 - e)^2 + 3 e'^2 / (2 (1 - e)^3))``.

    H. Kolsky, Proc. Phys. Soc. B 62 (1949) 676 has the small-strain term, S. K. Samanta, J. Mech. Phys.
    Solids 19 (1971) 117 and T. L. Warren, M. J. Forrestal, Exp. Mech. 50 (2010) 1253 the finite strain.

    Parameters
    ----------
    strain, rate, second
        Nominal compression [-] and its first and second derivative [1/s], [1/s^2], shape [n].
    density
        Density of the specimen [kg/m^3].
    radius
        Its radius before the test [m].

    Raises
    ------
    ValueError
        If a strain is 1 or more.
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
    """Nominal stress without the share of radial inertia, Eq. of `radial_pressure` over 1 - e.

    The force of the pressure is ``p A0 / (1 - e)``, as the face has grown; its nominal stress is
    ``p / (1 - e)``. The uncertainties of strain, rate and second derivative are taken as independent.

    Parameters
    ----------
    stress
        Nominal stress [Pa], compression positive.
    strain, rate, second
        Nominal compression [-], [1/s], [1/s^2].
    specimen
        The specimen before the test.
    apply
        False leaves the stress as it is.

    Raises
    ------
    ValueError
        As `radial_pressure`, and if shapes differ.
    """
    one_shape(stress.value, (strain, rate, second))
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
    log = audited("radial inertia", "radial inertia", change, "Pa", apply, reason)
    return (History(stress.value + change, sigma, "Pa") if apply else stress), log


def axial_stress(
    second: ArrayLike, *, density: float, length: float, back_acceleration: ArrayLike = 0.0
) -> FloatArray:
    """Mean nominal stress along a specimen above that at its back face, from axial inertia [Pa].

    A homogeneous compression e of a specimen of length L whose back face accelerates by a_b gives the
    material at the height Y above that face the acceleration ``a_b + e'' Y``; the force there is the back
    one plus the momentum of what lies between. Its mean over Y is the back stress plus
    ``rho L (a_b / 2 + L e'' / 6)``; at the front face it is ``rho L (a_b + L e'' / 2)`` above. With the
    first-order radial term this is the correction of E. D. H. Davies, S. C. Hunter, J. Mech. Phys. Solids 11
    (1963) 155; D. A. Gorham, J. Phys. D 22 (1989) 1888 has the convective ones.

    Parameters
    ----------
    second
        Second derivative of the nominal compression [1/s^2], shape [n].
    density
        Density of the specimen [kg/m^3].
    length
        Its length before the test [m].
    back_acceleration
        Of the back face in the direction of the incident wave [m/s^2], shape [n] or scalar.
    """
    e2, a = np.asarray(second, dtype=np.float64), np.asarray(back_acceleration, dtype=np.float64)
    return np.asarray(density * length * (a / 2.0 + length * e2 / 6.0))


def axial_by_analysis(second: ArrayLike, specimen: Specimen, back: ArrayLike) -> dict[str, FloatArray]:
    """Mean nominal stress along a specimen less what each analysis has for it, from axial inertia [Pa].

    One wave has the stress at the back face, two waves that at the front, three waves the mean of both. With
    `axial_stress` s and the front stress ``rho L (a_b + L e'' / 2)`` above the back one, they lack s,
    s less that, and s less half of it: ``-rho L^2 e'' / 12`` for three waves.

    Parameters
    ----------
    second
        Second derivative of the nominal compression [1/s^2], shape [n].
    specimen
        The specimen before the test.
    back
        Acceleration of the back face in the direction of the incident wave [m/s^2], shape [n] or scalar.
    """
    rho, length = specimen.density, specimen.length
    mean = axial_stress(second, density=rho, length=length, back_acceleration=back)
    across = rho * length * (np.asarray(back, dtype=float) + 0.5 * length * np.asarray(second, dtype=float))
    return {"one wave": mean, "two waves": mean - across, "three waves": mean - 0.5 * across}


def correct_axial_inertia(
    back_stress: History,
    second: History,
    specimen: Specimen,
    *,
    back_acceleration: History | None = None,
    apply: bool = True,
) -> tuple[History, Correction]:
    """Mean nominal stress along the specimen from that at its back face, see `axial_stress`.

    Parameters
    ----------
    back_stress
        Nominal stress at the transmission side (one wave) [Pa].
    second
        Second derivative of the nominal compression [1/s^2].
    specimen
        The specimen before the test.
    back_acceleration
        Of the back face [m/s^2]; a face at rest if left out.
    apply
        False leaves the stress as it is.

    Raises
    ------
    ValueError
        If shapes differ.
    """
    rest = History(np.zeros_like(second.value), np.zeros_like(second.value), "m/s^2")
    a = rest if back_acceleration is None else back_acceleration
    one_shape(back_stress.value, (second, a))
    rho, length = specimen.density, specimen.length
    change = axial_stress(second.value, density=rho, length=length, back_acceleration=a.value)
    sigma = np.sqrt(
        back_stress.sigma**2
        + (rho * length**2 / 6.0 * second.sigma) ** 2
        + (rho * length / 2.0 * a.sigma) ** 2
    )
    reason = (
        f"{1e3 * length:.4g} mm of {rho:.4g} kg/m^3, second derivative of the strain up to"
        f" {np.abs(second.value).max():.3g} 1/s^2"
    )
    log = audited("axial inertia", "axial inertia", change, "Pa", apply, reason)
    return (History(back_stress.value + change, sigma, "Pa") if apply else back_stress), log


def audited(name: str, key: str, change: FloatArray, unit: str, apply: bool, reason: str) -> Correction:
    """The audit log's entry of a change over all samples, applied or not."""
    return Correction(
        name=name,
        key=key,
        applied=apply,
        size=float(np.abs(change).max(initial=0.0)),
        rms=float(np.sqrt(np.mean(change**2))) if change.size else 0.0,
        unit=unit,
        reason=reason,
    )


def one_shape(like: FloatArray, histories: Sequence[History]) -> None:
    """Refuse histories that have not one value at each of the times of an array.

    Raises
    ------
    ValueError
        Naming the count and the unit.
    """
    for history in histories:
        if history.value.shape != like.shape or history.sigma.shape != like.shape:
            raise ValueError(
                f"every history needs one value at each of {like.size} times, got {history.value.size}"
                f" in {history.unit}"
            )
