"""The smooth path of what moves the front face: the flyer in the frames, or the face of the incident bar."""

from dataclasses import replace

from kolsky.bars.flyer.fit import fit_flyer
from kolsky.bars.flyer.front_path import front_path
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.records import FlyerMotion, FrontVelocity


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
        return fit_flyer(motion, start=start)
    return front_path(replace(motion, sigma_gain=0.0))
