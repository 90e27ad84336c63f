"""The flyer's flight from its rigid motion: direction of its velocity, tilt, and where symmetry ends.

Each component of displacement and rotation is fitted by `kolsky.bars.flyer.fit.fit_flyer`, whose position and
velocity are those of one smooth path from rest; directions and rates follow from the paths. The smoothness is
judged by each frame's own noise; what frames have in common goes into the bands by their whole covariance.
Components are taken as independent of each other.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from dic.forks import side_by_side
from dic.outcome import FrameOutcome
from dic.rigid_body.body_motion import BodyMotion
from kolsky.bars.flyer.fit import FEWEST_STATIC, fit_flyer
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion

UNSEEN = 50e-6
"""Largest lateral displacement of a body before its poses are known [m]."""
UNTURNED = 10e-3
"""Largest rotation of it [rad]."""


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


def fit_flight(body: BodyMotion, t: ArrayLike, *, start: float, toward: FlyerMotion | None = None) -> Flight:
    """Fit smooth paths to the rigid motion of a flyer that rests until `start`.

    A flyer whose poses are known in fewer than three frames at rest is taken to have rested where its first
    ones are, within `UNSEEN` and `UNTURNED`.

    Parameters
    ----------
    body
        Motion of the flyer in the test frame.
    t
        Frame times on the shot's clock [s], shape [n_frames].
    start
        A time in the static frames [s].
    toward
        Its displacement toward the specimen, if that is known better or in more frames than `body` has it.

    Raises
    ------
    ValueError
        As `kolsky.bars.flyer.fit.fit_flyer`, and if there are not as many times as frames.
    """
    time, ok = _times(body, t)
    u, r = body.displacement, body.rotation
    own = np.flatnonzero(ok)

    def path(values: FloatArray, component: int, reach: float) -> FlyerPath:
        C = body.covariance_of(component, own)
        at, value, noise = own, values[ok], _own_noise(C)
        unseen = np.flatnonzero(~ok & (time <= start))
        if (time[own] <= start).sum() < FEWEST_STATIC and unseen.size:
            at = np.concatenate([unseen, own])
            value = np.concatenate([np.full(unseen.size, value[:FEWEST_STATIC].mean()), value])
            noise = np.concatenate([np.full(unseen.size, reach * unseen.size**0.5), noise])
            C = block_diag(np.diag(noise[: unseen.size] ** 2), C)
        order = np.argsort(at)
        motion = FlyerMotion(time[at][order], value[order], noise[order])
        return fit_flyer(motion, start=start, covariance=C[np.ix_(order, order)])

    ahead, x, z, about_x, about_z = side_by_side(
        [
            partial(path, -u[:, 1], 4, UNSEEN) if toward is None else partial(fit_flyer, toward, start=start),
            partial(path, u[:, 0], 3, UNSEEN),
            partial(path, u[:, 2], 5, UNSEEN),
            partial(path, r[:, 0], 0, UNTURNED),
            partial(path, r[:, 2], 2, UNTURNED),
        ]
    )
    return Flight(toward=ahead, lateral=(x, z), turn=(about_x, about_z))


def _own_noise(covariance: FloatArray) -> FloatArray:
    """Each frame's own part of the noise, by the variance of second differences, shape [n]."""
    if len(covariance) < 3:
        return np.asarray(np.sqrt(np.diag(covariance)))
    inner = np.diag(np.diff(np.diff(covariance, n=2, axis=0), n=2, axis=1)) / 6.0  # 1, -2, 1 squared
    return np.sqrt(np.minimum(np.pad(inner, 1, mode="edge"), np.diag(covariance)))


@dataclass(frozen=True)
class SymmetryEnd:
    """Time at which the flyer leaves the direction that it had just after separating."""

    reference: FloatArray
    """Unit direction just after separation: toward the specimen, x, Z [-], shape [3]."""
    share: FloatArray
    """Part of the velocity across the reference over the speed [-], shape [n_times]."""
    sigma: FloatArray
    """Its standard uncertainty from the noise of velocity and reference [-], shape [n_times]."""
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
    away = np.array([path.sigma_change(*span) for path in paths]) / np.linalg.norm(moved)
    v, s = flight.velocity(at)
    speed = np.linalg.norm(v, axis=1)
    across = v - np.outer(v @ reference, reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = across / np.linalg.norm(across, axis=1, keepdims=True)
        part = np.linalg.norm(across, axis=1) / speed
        own = np.sqrt(np.sum((unit * s) ** 2, axis=1)) / speed
        sigma = np.hypot(own, np.sqrt(np.sum((unit * away) ** 2, axis=1)))
    beyond = (at >= separation) & (part - coverage * sigma > share)
    run = np.convolve(beyond, np.ones(times_in_row), mode="full")[times_in_row - 1 :] == times_in_row
    return SymmetryEnd(reference, part, sigma, int(np.argmax(run)) if run.any() else None)


def _times(body: BodyMotion, t: ArrayLike) -> tuple[FloatArray, NDArray[np.bool_]]:
    time = np.asarray(t, dtype=np.float64)
    if time.shape != body.outcome.shape:
        raise ValueError(f"t has shape {time.shape}, must be {body.outcome.shape}: one time a frame")
    return time, np.asarray(body.outcome == FrameOutcome.VALID)
