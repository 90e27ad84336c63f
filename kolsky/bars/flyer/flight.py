"""Flight of a flyer from its rigid motion: velocity, direction, tilt, end of symmetry (paper, Fig. 6)."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from dic.basics import check_interval, check_shape
from dic.bodies.body_motion import BodyMotion
from dic.outcome import FrameOutcome
from dic.processes import run_parallel
from dic.result import StereoResult
from kolsky.bars.flyer.path import FEWEST_STATIC, FlyerPath, fit_flyer
from kolsky.base.arrays import FloatArray
from kolsky.base.hdf5 import adding_to, data, put
from kolsky.base.records import FlyerMotion

_LARGEST_LATERAL = 50e-6
"""Largest assumed lateral displacement of a body before its first known pose [m]."""
_LARGEST_ROTATION = 10e-3
"""Largest rotation of the body [rad]."""


@dataclass(frozen=True)
class Flight:
    """Smooth paths of the flyer's displacement and rotation, from rest."""

    toward: FlyerPath
    """Displacement toward the specimen, against y [m]."""
    lateral: tuple[FlyerPath, FlyerPath]
    """Displacements along x and Z [m]."""
    turn: tuple[FlyerPath, FlyerPath]
    """Rotations about x and Z, which tilt the flyer's face [rad]. In their docstrings, read rad for units of
    length."""

    def velocity(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Velocity toward the specimen, along x and along Z [m/s], and its sigma, both [n, 3]."""
        paths = (self.toward, *self.lateral)
        return (
            np.stack([path.velocity(time) for path in paths], axis=-1),
            np.stack([path.sigma_velocity(time) for path in paths], axis=-1),
        )

    def orientation(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angle of the velocity vector to the compression axis [rad] and its sigma, both [n].

        ``phi = atan2(|v across|, v toward the specimen)``, 0 along the axis. Its cosine is in the paper's
        Fig. 6. The sigma is the noise of the transverse velocity divided by the speed, as root mean square
        over all directions. An angle below its sigma is not distinguished from 0. An angle is never negative.
        """
        v, s = self.velocity(time)
        speed = np.linalg.norm(v, axis=-1)
        across = np.hypot(v[..., 1], v[..., 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            unit = np.where(across[..., None] > 0.0, v[..., 1:] / across[..., None], np.sqrt(0.5))
            along = np.sum((unit * s[..., 1:]) ** 2, axis=-1)  # noise of the part across, in its direction
            sigma = np.hypot(v[..., 0] * np.sqrt(along), across * s[..., 0]) / speed**2
        return np.arctan2(across, v[..., 0]), sigma

    def tilt_rate(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angular velocity about x and Z [rad/s] and its sigma, both [n, 2]."""
        return (
            np.stack([path.velocity(time) for path in self.turn], axis=-1),
            np.stack([path.sigma_velocity(time) for path in self.turn], axis=-1),
        )

    def tilt(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Rotation about x and Z from rest [rad] and its sigma, both [n, 2]."""
        return (
            np.stack([path.position(time) for path in self.turn], axis=-1),
            np.stack([path.sigma_position(time) for path in self.turn], axis=-1),
        )


def fit_flight(body: BodyMotion, t: ArrayLike, *, start: float, toward: FlyerMotion | None = None) -> Flight:
    """Fit smooth paths to the rigid motion of a flyer that rests until `start`.

    With fewer than three poses at rest, the flyer is assumed to have rested at its first poses, within
    `UNSEEN` and `UNTURNED`. Raises ValueError if `t` has not one time per frame, or as `fit_flyer`.
    """
    check_shape(body.outcome.shape, t=t)
    time, ok = np.asarray(t, dtype=np.float64), body.outcome == FrameOutcome.VALID
    u, r = body.displacement, body.rotation
    own = np.flatnonzero(ok)

    def path(values: FloatArray, component: int, reach: float) -> FlyerPath:
        C = body.covariance_of(component, own)
        at, value, noise = own, values[ok], _noise_of_one(C)
        unseen = np.flatnonzero(~ok & (time <= start))
        if (time[own] <= start).sum() < FEWEST_STATIC and unseen.size:
            at = np.concatenate([unseen, own])
            value = np.concatenate([np.full(unseen.size, value[:FEWEST_STATIC].mean()), value])
            noise = np.concatenate([np.full(unseen.size, reach * unseen.size**0.5), noise])
            C = block_diag(np.diag(noise[: unseen.size] ** 2), C)
        order = np.argsort(at)
        motion = FlyerMotion(time[at][order], value[order], noise[order])
        return fit_flyer(motion, start=start, covariance=C[np.ix_(order, order)])

    ahead, x, z, about_x, about_z = run_parallel(
        [
            partial(path, -u[:, 1], 4, _LARGEST_LATERAL)
            if toward is None
            else partial(fit_flyer, toward, start=start),
            partial(path, u[:, 0], 3, _LARGEST_LATERAL),
            partial(path, u[:, 2], 5, _LARGEST_LATERAL),
            partial(path, r[:, 0], 0, _LARGEST_ROTATION),
            partial(path, r[:, 2], 2, _LARGEST_ROTATION),
        ]
    )
    return Flight(toward=ahead, lateral=(x, z), turn=(about_x, about_z))


def _noise_of_one(covariance: FloatArray) -> FloatArray:
    """The independent part of each frame's noise, by the variance of second differences, shape [n]."""
    if len(covariance) < 3:
        return np.asarray(np.sqrt(np.diag(covariance)))
    inner = np.diag(np.diff(np.diff(covariance, n=2, axis=0), n=2, axis=1)) / 6.0  # 1, -2, 1 squared
    return np.sqrt(np.minimum(np.pad(inner, 1, mode="edge"), np.diag(covariance)))


@dataclass(frozen=True)
class SymmetryEnd:
    """Time at which the flyer leaves its direction just after separation."""

    reference: FloatArray
    """Unit direction just after separation: toward the specimen, x, Z [-], shape [3]."""
    share: FloatArray
    """Transverse part of the velocity relative to the reference direction, divided by the speed [-], shape
    [n_times]."""
    sigma: FloatArray
    """Its standard uncertainty from the noise of velocity and reference [-], shape [n_times]."""
    row: int | None
    """First time at which symmetry has ended; None if it has not."""


COVERAGE = 2.0
"""Number of sigmas by which the transverse velocity must exceed its share [-]."""


def symmetry_end(
    flight: Flight, time: ArrayLike, *, separation: float, over: float, share: float, times_in_row: int = 3
) -> SymmetryEnd:
    """Find the time at which the flyer's velocity leaves its direction just after separation.

    The relative transverse velocity is the component across the reference direction, divided by the speed.
    Symmetry ends at the first of `times_in_row` successive times at which it exceeds `share` by more than
    `COVERAGE` of its sigmas. When a flyer comes to rest, noise hides its direction; this is not an end of
    symmetry. A flyer that is pushed back along the axis keeps its direction.

    ``time``: times, usually of the frames [s], increasing, shape [n_times]. ``separation``: time at which the
    flyer has separated from the bar [s]. ``over``: span after separation; its displacement gives the
    reference direction [s]. ``share``: allowed transverse part of the velocity [-], in (0, 1).
    ``times_in_row``: number of successive times that must agree. Raises ValueError if an option is outside
    its range, or a span outside the paths.
    """
    check_interval("(0, 1)", share=share)
    check_interval("(0, inf) s", over=over)
    check_interval("[1, inf)", times_in_row=times_in_row)
    at = np.asarray(time, dtype=np.float64)
    paths = (flight.toward, *flight.lateral)
    span = np.array([separation, separation + over])
    moved = np.array([np.diff(path.position(span))[0] for path in paths])
    reference = moved / np.linalg.norm(moved)
    away = np.array([path.sigma_change(*span) for path in paths]) / np.linalg.norm(moved)
    v, s = flight.velocity(at)
    speed = np.linalg.norm(v, axis=1)
    across = v - np.outer(v @ reference, reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = across / np.linalg.norm(across, axis=1, keepdims=True)
        part = np.linalg.norm(across, axis=1) / speed
        own = np.sqrt(np.sum((unit * s) ** 2, axis=1)) / speed
        sigma = np.hypot(own, np.sqrt(np.sum((unit * away) ** 2, axis=1)))
    beyond = (at >= separation) & (part - COVERAGE * sigma > share)
    run = np.convolve(beyond, np.ones(times_in_row), mode="full")[times_in_row - 1 :] == times_in_row
    return SymmetryEnd(reference, part, sigma, int(np.argmax(run)) if run.any() else None)


SHARE = 0.05
"""Transverse part of the velocity above which symmetry has ended [-]: a twentieth, or 3°."""
_SPAN = 0.1
"""Displacement for the first direction, divided by the length of the specimen [-]. A new direction must last
over the same displacement. Warm air moves the flyer's image by hundredths of a pixel. Over a shorter travel,
this would look like a new direction."""
FEWEST_IN_ROW = 3
"""Smallest number of successive frames that must have another direction."""


@dataclass(frozen=True)
class FlightOfSpecimen:
    """The flight of a shot's flyer."""

    flight: Flight
    time: FloatArray
    """Frame times, beginning at rest [s], shape [n]."""
    length: float
    """Length of the specimen at rest [m]."""
    posed: float = -np.inf
    """Time of the first moving frame with a known pose [s]. Before it, directions and tilt are unknown."""
    separation: float = np.nan
    """Time of its greatest velocity [s]. After it, only the specimen exerts a force on the flyer."""
    symmetry: SymmetryEnd | None = None
    """End of symmetry by its direction; None if unknown."""

    @property
    def known(self) -> NDArray[np.bool_]:
        """Times at which direction and tilt are known, shape [n]."""
        return np.asarray(self.time >= self.posed)

    @property
    def end(self) -> float | None:
        """Time at which symmetry ends [s]; None if it does not end."""
        if self.symmetry is None or self.symmetry.row is None:
            return None
        return float(self.time[self.symmetry.row])


def flight_of(result: StereoResult, length: float) -> FlightOfSpecimen | str:
    """The flight of the flyer in a stereo result, or the reason why it is unknown.

    Separation is the time of the greatest velocity toward the specimen. The first direction is that of the
    displacement over a tenth of the specimen's length after it. It begins when the uncertainty of the lateral
    velocity is below `SHARE` of the speed. If this never happens, no end of symmetry is given.

    ``length``: length of the specimen at rest [m].
    """
    if result.axial_displacement is None or result.motion is None:
        return "its travel or its poses are not known"
    start = float(result.t[result.static][-1])
    travel = result.axial_displacement
    try:
        flight = fit_flight(
            result.motion,
            result.t,
            start=start,
            toward=FlyerMotion(travel.t, travel.displacement, travel.sigma),
        )
    except ValueError as error:
        return str(error)
    last = min(path.end for path in (flight.toward, *flight.lateral, *flight.turn))
    time = result.t[(result.t >= start) & (result.t <= last)]
    velocity, sigma = flight.velocity(time)
    fastest = int(np.argmax(velocity[:, 0] - 2.0 * sigma[:, 0]))  # not the one of the largest noise
    speed = float(velocity[fastest, 0])
    poses = result.t[(result.motion.outcome == FrameOutcome.VALID) & (result.t >= start)]
    posed = float(poses[0]) if poses.size else np.inf
    known = np.flatnonzero((time >= max(posed, time[fastest])) & np.all(sigma[:, 1:] < SHARE * speed, axis=1))
    symmetry = None
    if speed > 0.0 and known.size and time[known[0]] + _SPAN * length / speed <= last:
        over = _SPAN * length / speed
        symmetry = symmetry_end(
            flight,
            time,
            separation=float(time[known[0]]),
            over=over,
            share=SHARE,
            times_in_row=frames_in(over, time),
        )
    return FlightOfSpecimen(flight, time, length, posed, float(time[fastest]), symmetry)


def frames_in(span: float, time: FloatArray) -> int:
    """Number of successive frames that cover a span, at least `FEWEST_IN_ROW`.

    ``span``: time that the frames must cover [s]. ``time``: frame times [s], shape [n].
    """
    return max(FEWEST_IN_ROW, 1 + int(np.ceil(span / float(np.median(np.diff(time))) - 1e-9)))


def columns(found: FlightOfSpecimen) -> dict[str, FloatArray]:
    """The flight as columns with units, one row per frame from rest on. NaN if unknown."""
    t = found.time
    table = {"time (s)": t}

    def add(name: str, unit: str, value: FloatArray, sigma: FloatArray, *, posed: bool = True) -> None:
        known = found.known & np.isfinite(sigma) if posed else np.ones(t.size, dtype=bool)
        table[f"{name} ({unit})"] = np.where(known, value, np.nan)
        table[f"sigma of {name} ({unit})"] = np.where(known, sigma, np.nan)

    velocity, spread = found.flight.velocity(t)
    add("velocity toward the specimen", "m/s", velocity[:, 0], spread[:, 0], posed=False)
    for k, name in ((1, "velocity along x"), (2, "velocity along Z")):
        add(name, "m/s", velocity[:, k], spread[:, k])
    add("angle of the velocity to the axis", "rad", *found.flight.orientation(t))
    for what, unit, (value, sigma) in (
        ("rotation", "rad", found.flight.tilt(t)),
        ("angular velocity", "rad/s", found.flight.tilt_rate(t)),
    ):
        for k, axis in enumerate(("x", "Z")):
            add(f"{what} about {axis}", unit, value[:, k], sigma[:, k])
    if found.symmetry is not None:
        add(
            "velocity across the first direction over the speed",
            "1",
            found.symmetry.share,
            found.symmetry.sigma,
        )
    return table


def add_to(path: Path, found: FlightOfSpecimen) -> None:
    """Add the flight to the HDF5 file of a stereo result, as its group "flight".

    Raises OSError if the file cannot be written.
    """
    with adding_to(path) as entry:
        group = data(entry, "flight", "velocity toward the specimen", "time")
        for name, values in columns(found).items():
            plain, unit = name.rsplit(" (", 1)
            put(group, plain, values, unit.rstrip(")"))
        group.attrs["separation_s"], group.attrs["share"] = found.separation, SHARE
        if found.end is not None:
            group.attrs["symmetry_end_s"] = found.end


def printed(found: FlightOfSpecimen | str) -> dict[str, str]:
    """The summary of the flight as lines for a terminal."""
    rows = summary(found)
    table = {}
    if "flyer_velocity_m_s" in rows:
        table["flyer's velocity"] = (
            f"{rows['flyer_velocity_m_s']:.4f} ± {2 * rows['flyer_velocity_sigma_m_s']:.4f} m/s (k = 2), the "
            f"greatest, at {1e3 * rows['separation_s']:.4f} ms"
        )
    if "flight" in rows:
        return {**table, "flyer's flight": rows["flight"]}
    angle, spread = (np.degrees(rows[f"velocity_angle{which}_rad"]) for which in ("", "_sigma"))
    table["flyer's direction"] = f"{angle:.2f} ± {2 * spread:.2f}° off the axis (median over time, k = 2)"
    table["flyer's tilt"] = (
        f"{1e3 * rows['largest_tilt_rad']:.2f} ± {2e3 * rows['largest_tilt_sigma_rad']:.2f} mrad at most, "
        f"{rows['largest_tilt_rate_rad_s']:.1f} ± {2 * rows['largest_tilt_rate_sigma_rad_s']:.1f} rad/s"
    )
    end = rows["symmetry_end_s"]
    table["symmetry"] = (
        "lasts to the last frame" if end is None else f"ends at {1e3 * end:.4f} ms"
    ) + f" (velocity across its first direction under {100.0 * SHARE:g} %)"
    return table


def summary(found: FlightOfSpecimen | str) -> dict[str, Any]:
    """Summary of the flight: name and value, SI and JSON types."""
    if isinstance(found, str):
        return {"flight": f"not known: {found}"}
    at = np.array([found.separation])
    (velocity, _, _), (sigma, _, _) = (values[0] for values in found.flight.velocity(at))
    speeds = {
        "flyer_velocity_m_s": float(velocity),
        "flyer_velocity_sigma_m_s": float(sigma),
        "separation_s": found.separation,
    }
    if found.symmetry is None:
        return {**speeds, "flight": "its direction is never known to a twentieth of its speed"}
    known = found.time[found.known & (found.time >= found.separation) & (found.symmetry.sigma < SHARE)]
    angle, angle_sigma = found.flight.orientation(known)
    tilt, tilt_sigma = found.flight.tilt(known)
    rate, rate_sigma = found.flight.tilt_rate(known)
    turned, turning = (np.unravel_index(np.argmax(np.abs(values)), values.shape) for values in (tilt, rate))
    return {
        **speeds,
        "velocity_angle_rad": float(np.median(angle)),
        "velocity_angle_sigma_rad": float(np.median(angle_sigma)),
        "largest_tilt_rad": float(np.abs(tilt[turned])),
        "largest_tilt_sigma_rad": float(tilt_sigma[turned]),
        "largest_tilt_rate_rad_s": float(np.abs(rate[turning])),
        "largest_tilt_rate_sigma_rad_s": float(rate_sigma[turning]),
        "symmetry_end_s": found.end,
    }
