"""The smooth path of what moves the front face: the flyer in the frames, or the face of the incident bar."""

from dataclasses import replace

import numpy as np

from kolsky.bars.flyer.events import second_impact
from kolsky.bars.flyer.fit import fit_flyer
from kolsky.bars.flyer.front_path import front_path
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion, FrontVelocity

FEWEST = 24
"""Moving frames below which no second impact is looked for."""


def fit(motion: FlyerMotion | FrontVelocity, *, start: float) -> FlyerPath:
    """The smooth path of a motion, its scale taken as exact.

    Parameters
    ----------
    motion
        Displacements at the frames, or velocities of the bar's face.
    start
        Last time at rest, from which a path of displacements begins [s].

    Raises
    ------
    ValueError
        If the record cannot be used.
    """
    if isinstance(motion, FlyerMotion):
        return fit_flyer(
            motion, start=start, covariance=_with_zero(motion, start), restart=blow(motion, start)
        )
    return front_path(replace(motion, sigma_gain=0.0))


def blow(motion: FlyerMotion, start: float) -> float | None:
    """Just before the second impact, if the displacements show one: a frame and two of its sigmas [s]."""
    moving = motion.time > start
    if int(moving.sum()) < FEWEST or int((~moving).sum()) < 1:
        return None
    impact = second_impact(motion, rest=start)
    if impact.time is None:
        return None
    return impact.time - 2.0 * (impact.sigma or 0.0) - float(np.median(np.diff(motion.time)))


def _with_zero(motion: FlyerMotion, start: float) -> FloatArray | None:
    """Covariance of the displacements with that of their zero, which all after the rest share [m²]."""
    if motion.zero_sigma == 0.0:
        return None
    moved = (motion.time > start).astype(np.float64)
    return np.asarray(np.diag(motion.sigma**2) + motion.zero_sigma**2 * np.outer(moved, moved))
