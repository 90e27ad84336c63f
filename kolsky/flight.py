"""The flyer's flight from its rigid motion: direction of its velocity, tilt, and where symmetry ends.

Each component of displacement and rotation is fitted by `kolsky.flyer.fit_flyer`, whose position and
velocity are those of one smooth path from rest; directions and rates follow from the paths. Components are
taken as independent of each other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.body_motion import BodyMotion
from dic.outcome import FrameOutcome
from kolsky.flyer import fit_flyer
from kolsky.flyerpath import FlyerPath
from kolsky.records import FloatArray, FlyerMotion


@dataclass(frozen=True)
class Flight:
    """Smooth paths of the flyer's displacement and rotation, from rest."""

    toward: FlyerPath
    """Displacement toward the specimen, against y [m]."""
    lateral: tuple[FlyerPath, FlyerPath]
    """Displacements along x and Z [m]."""
    turn: tuple[FlyerPath, FlyerPath]
    """Rotations about x and Z, which tilt the flyer's face [rad]; units of length in their docstrings
    stand for rad."""

    def velocity(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Velocity toward the specimen, along x, along Z [m/s] and its sigma, both [n, 3]."""
        paths = (self.toward, *self.lateral)
        return (
            np.stack([path.velocity(time) for path in paths], axis=-1),
            np.stack([path.sigma_velocity(time) for path in paths], axis=-1),
        )

    def orientation(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angle of the velocity vector to the compression axis [rad] and its sigma, both [n].

        ``phi = atan2(|v across|, v toward the specimen)``, 0 along the axis, its cosine is the paper's
        Fig. 6. The sigma is the noise of the velocity across over the speed, the root mean square of all
        its directions: an angle below it is not told from 0, and an angle is never negative.
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


def flyer_motion(body: BodyMotion, t: ArrayLike) -> FlyerMotion:
    """The flyer's displacement toward the specimen, against y, in its VALID frames.

    Parameters
    ----------
    body
        Motion of the flyer in the test frame.
    t
        Frame times on the shot's clock [s], shape [n_frames].

    Raises
    ------
    ValueError
        If there are not as many times as frames.
    """
    time, ok = _times(body, t)
    return FlyerMotion(time[ok], -body.displacement[ok, 1], body.displacement_sigma[ok, 1])


def fit_flight(body: BodyMotion, t: ArrayLike, *, start: float) -> Flight:
    """Fit smooth paths to the rigid motion of a flyer that rests until `start`.

    Parameters
    ----------
    body
        Motion of the flyer in the test frame.
    t
        Frame times on the shot's clock [s], shape [n_frames].
    start
        A time in the static frames [s].

    Raises
    ------
    ValueError
        As `kolsky.flyer.fit_flyer`, and if there are not as many times as frames.
    """
    time, ok = _times(body, t)

    def path(value: FloatArray, sigma: FloatArray) -> FlyerPath:
        return fit_flyer(FlyerMotion(time[ok], value[ok], sigma[ok]), start=start)

    u, u_sigma, r, r_sigma = body.displacement, body.displacement_sigma, body.rotation, body.rotation_sigma
    return Flight(
        toward=path(-u[:, 1], u_sigma[:, 1]),
        lateral=(path(u[:, 0], u_sigma[:, 0]), path(u[:, 2], u_sigma[:, 2])),
        turn=(path(r[:, 0], r_sigma[:, 0]), path(r[:, 2], r_sigma[:, 2])),
    )


@dataclass(frozen=True)
class SymmetryEnd:
    """Where the flyer leaves the direction that it had just after separating."""

    reference: FloatArray
    """Unit direction just after separation: toward the specimen, x, Z [-], shape [3]."""
    share: FloatArray
    """Part of the velocity across the reference over the speed [-], shape [n_times]."""
    sigma: FloatArray
    """Its standard uncertainty from the noise of the velocity [-], shape [n_times]."""
    row: int | None
    """First time at which symmetry has ended, None if it has not."""


def symmetry_end(
    flight: Flight,
    time: ArrayLike,
    *,
    separation: float,
    over: float,
    share: float,
    coverage: float = 2.0,
    times_in_row: int = 3,
) -> SymmetryEnd:
    """Find where the flyer's velocity leaves its direction just after separation.

    Symmetry has ended at the first of `times_in_row` successive times at which the part of the velocity
    across the reference direction, over the speed, exceeds `share` by more than `coverage` of its sigmas.
    A flyer that comes to rest loses its direction to the noise, which is no end of symmetry; one that is
    pushed back along the axis keeps it.

    Parameters
    ----------
    flight
        The flyer's paths.
    time
        Times, usually of the frames [s], increasing, shape [n_times].
    separation
        Time at which the flyer has separated from the bar [s].
    over
        Span after it whose displacement gives the reference direction [s].
    share
        Part of the velocity that may lie across the reference direction [-], in (0, 1).
    coverage
        Sigmas by which it must be exceeded [-].
    times_in_row
        Successive times that must agree.

    Raises
    ------
    ValueError
        Options out of range, or a span outside the paths.
    """
    at = np.asarray(time, dtype=np.float64)
    if not 0.0 < share < 1.0 or not over > 0.0 or not coverage >= 0.0 or times_in_row < 1:
        raise ValueError(
            f"share must be in (0, 1), over > 0 s, coverage >= 0 and times_in_row >= 1, got {share}, {over},"
            f" {coverage}, {times_in_row}"
        )
    paths = (flight.toward, *flight.lateral)
    span = np.array([separation, separation + over])
    moved = np.array([np.diff(path.position(span))[0] for path in paths])
    reference = moved / np.linalg.norm(moved)
    v, s = flight.velocity(at)
    speed = np.linalg.norm(v, axis=1)
    across = v - np.outer(v @ reference, reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = across / np.linalg.norm(across, axis=1, keepdims=True)
        part = np.linalg.norm(across, axis=1) / speed
        sigma = np.sqrt(np.sum((unit * s) ** 2, axis=1)) / speed
    beyond = (at >= separation) & (part - coverage * sigma > share)
    run = np.convolve(beyond, np.ones(times_in_row), mode="full")[times_in_row - 1 :] == times_in_row
    return SymmetryEnd(reference, part, sigma, int(np.argmax(run)) if run.any() else None)


def _times(body: BodyMotion, t: ArrayLike) -> tuple[FloatArray, NDArray[np.bool_]]:
    time = np.asarray(t, dtype=np.float64)
    if time.shape != body.outcome.shape:
        raise ValueError(f"t has shape {time.shape}, must be {body.outcome.shape}: one time a frame")
    return time, np.asarray(body.outcome == FrameOutcome.VALID)
