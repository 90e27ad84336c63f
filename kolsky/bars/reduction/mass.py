"""The mass between a gauge and the specimen: its acceleration from three sources, and its force.

Compression is positive, and so is motion in the direction of the incident wave. A correction that is
switched off is measured all the same.
"""

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.flyer.path import FlyerPath
from kolsky.bars.records import BarSignal, Correction, History, Quantity
from kolsky.bars.reduction.inertia import audited, one_shape

SIDES = ("incident", "transmission")


def path_acceleration(path: FlyerPath, time: ArrayLike) -> History:
    """Acceleration of a face whose path is known, by image correlation or from bar waves.

    Parameters
    ----------
    path
        Smooth path from rest: `kolsky.bars.flyer.fit.fit_flyer`, or `kolsky.bars.flyer.front_path.front_path`
        for the interface velocity of bar waves.
    time
        Times, not after the path's end; before its start the face rests [s], shape [n].

    Returns
    -------
    History
        Acceleration and its standard uncertainty [m/s^2].

    Raises
    ------
    ValueError
        If a time is after the path's end.
    """
    t = np.asarray(time, dtype=np.float64)
    moving = t >= path.start
    value, sigma = np.zeros(t.shape), np.zeros(t.shape)
    value[moving], sigma[moving] = path.acceleration(t[moving]), path.sigma_acceleration(t[moving])
    return History(value, sigma, "m/s^2")


def gradient_acceleration(
    near: BarSignal, far: BarSignal, time: ArrayLike, *, sigma_gain: float, sigma_distance: float = 0.0
) -> History:
    """Acceleration of a bar midway between two gauges, from the gradient of its strain.

    Newton's second law for the piece of bar between them: ``rho A d dv/dt = E A (eps_up - eps_down)``, so
    ``a = c0^2 (eps_up - eps_down) / d``, upstream minus downstream. The difference stands for the gradient
    up to ``(omega d / c0)^2 / 24`` of it.

    Parameters
    ----------
    near, far
        Strains at two stations of one bar, `near` closer to the specimen.
    time
        Times that both signals cover [s], shape [n].
    sigma_gain
        Standard uncertainty of the ratio of the two gauges' gains [-].
    sigma_distance
        Standard uncertainty of the distance between the stations [m].

    Raises
    ------
    ValueError
        If the stations are not on one bar with `near` nearer, a time is not covered, or a sigma is negative.
    """
    t = np.asarray(time, dtype=np.float64)
    d = far.position - near.position
    if near.side != far.side or near.bar != far.bar or not d > 0.0:
        raise ValueError(
            f"the two gauges must be on one bar, `near` nearer to the specimen; got {near.side} bar at"
            f" {near.position:g} m and {far.side} bar at {far.position:g} m"
        )
    _not_negative(sigma_gain=sigma_gain, sigma_distance=sigma_distance)
    values = []
    for signal in (near, far):
        s = signal.strain
        if t.size and not (s.start <= t.min() and t.max() <= s.end):
            raise ValueError(
                f"{s.name or 'a gauge'} spans {s.start:.9g} to {s.end:.9g} s, asked for {t.min():.9g} to"
                f" {t.max():.9g} s; keep the times inside both records"
            )
        values.append(np.interp(t, s.time, s.value))
    speed2 = near.bar.wave_speed**2
    sign = 1.0 if near.side == "incident" else -1.0
    a = sign * speed2 * (values[1] - values[0]) / d
    noise = speed2 / d * np.hypot(near.strain.sigma, far.strain.sigma)
    gain = speed2 / d * sigma_gain * 0.5 * np.abs(values[0] + values[1])
    return History(a, np.sqrt(noise**2 + gain**2 + (a * sigma_distance / d) ** 2), "m/s^2")


def compensate_mass(
    time: ArrayLike,
    force: History,
    acceleration: History,
    mass: Quantity,
    *,
    side: str = "incident",
    sigma_time: float = 0.0,
    apply: bool = True,
    source: str = "the face's motion",
) -> tuple[History, Correction]:
    """Force on the specimen from that at a gauge, with a moving mass between the two.

    ``F = F_gauge - m a`` before the specimen and ``F = F_gauge + m a`` behind it, where the mass is pushed
    by the specimen.

    Parameters
    ----------
    time
        Times of the histories on one clock [s], shape [n], increasing.
    force
        Force at the gauge [N].
    acceleration
        Acceleration of the mass in the direction of the incident wave [m/s^2].
    mass
        Mass between the sensing plane and the specimen [kg].
    side
        Where the gauge is: "incident" or "transmission".
    sigma_time
        Standard uncertainty of the acceleration's clock against the force's [s].
    apply
        False leaves the force as it is; the correction is measured all the same.
    source
        Where the acceleration is from, for the audit log.

    Raises
    ------
    ValueError
        If shapes differ, the mass is not positive, a sigma is negative, or the side is unknown.
    """
    t = np.asarray(time, dtype=np.float64)
    one_shape(t, (force, acceleration))
    _not_negative(sigma_time=sigma_time, sigma_mass=mass.sigma)
    if not mass.value > 0.0:
        raise ValueError(f"{mass.name} is {mass.value:g} kg, must be > 0 kg")
    if side not in SIDES:
        raise ValueError(f"side is {side!r}, must be one of {', '.join(SIDES)}")
    a = acceleration.value
    change = -mass.value * a if side == "incident" else mass.value * a
    jerk = np.gradient(a, t)
    sigma = np.sqrt(
        force.sigma**2
        + (mass.value * acceleration.sigma) ** 2
        + (mass.sigma * a) ** 2
        + (mass.value * jerk * sigma_time) ** 2
    )
    reason = (
        f"{1e3 * mass.value:.4g} g between the {side} gauge and the specimen, acceleration from {source} up"
        f" to {np.abs(a).max():.3g} m/s^2, clocks known to {1e6 * sigma_time:.2g} us"
    )
    log = audited(f"mass compensation, {side}", "mass", change, force.unit, apply, reason)
    return (History(force.value + change, sigma, force.unit) if apply else force), log


def _not_negative(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value >= 0.0):
            raise ValueError(f"{name} is {value:g}, must be finite and >= 0")
