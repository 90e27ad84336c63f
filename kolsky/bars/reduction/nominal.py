"""Strain, rate and its derivative of a specimen between faces whose paths are known."""

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.flyer.path import FlyerPath
from kolsky.bars.records import History
from kolsky.base.arrays import FloatArray


def path_strain(path: FlyerPath, time: ArrayLike, *, length: float) -> tuple[History, History, History]:
    """Nominal compression, its rate and its second derivative under a moving face; the other one rests.

    Parameters
    ----------
    path
        The moving face, toward the specimen; before its start it rests.
    time
        Times, not after the path's end [s], shape [n].
    length
        Length of the specimen before the test [m].

    Returns
    -------
    tuple of History
        In [-], [1/s] and [1/s^2].

    Raises
    ------
    ValueError
        If the length is not positive or a time is after the path's end.
    """
    if not length > 0.0:
        raise ValueError(f"length is {length:g} m, must be > 0 m")
    t = np.asarray(time, dtype=np.float64)
    moving = t >= path.start
    at = t[moving]

    def history(value: FloatArray, sigma: FloatArray, unit: str) -> History:
        whole = [np.zeros(t.shape) for _ in range(2)]
        for into, part in zip(whole, (value, sigma), strict=True):
            into[moving] = part / length
        return History(whole[0], whole[1], unit)

    return (
        history(path.position(at), path.sigma_position(at), "1"),
        history(path.velocity(at), path.sigma_velocity(at), "1/s"),
        history(path.acceleration(at), path.sigma_acceleration(at), "1/s^2"),
    )
