"""Single displacements that are not those of a flyer: a frame exchanged, a digit lost in an export.

A flyer is heavy and its place at a frame is what the frames around say, but for noise and for what sets it in
motion within a few of them. A displacement that is off by more than both is no measurement of the flyer. It
is not left out (which frames there are is the recording's to say) but its sigma becomes its error, so that
nothing rests on it, and it is named.
"""

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray

STRAY_SIGMAS = 20.0
"""A displacement so many standard deviations away from what its neighbours say is stray, if it is also
`STRAY_STEPS` away."""
STRAY_STEPS = 3.0
"""The same in the largest step of the flyer from frame to frame: what sets it in motion bends its path by
less than one."""
MOST = 0.03
"""Largest share of the frames that can be stray; more of them are noise of another kind."""
MOST_AT_REST = 0.25
"""Largest share of the static frames that can be stray."""
LAST_AT_REST = 3
"""Last static frames that must be sound: a motion that begins in them is one."""
NEIGHBOURS = 6
"""Frames whose cubic says where the flyer is: with four, all five would contradict each other alike."""


def stray_frames(
    time: FloatArray, displacement: FloatArray, sigma: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Find displacements that their neighbours contradict.

    Parameters
    ----------
    time
        Times of the frames, increasing [s], shape [n].
    displacement
        Of the flyer [m], shape [n].
    sigma
        Standard deviations of the displacements [m], shape [n].

    Returns
    -------
    BoolArray
        Which displacements are stray, shape [n]; none if they are more than `MOST` of the frames.
    FloatArray
        How far each is from what the sound ones around it say [m], shape [n].
    """
    stray, off = np.zeros(time.size, dtype=bool), np.zeros(time.size)
    if time.size <= 2 * NEIGHBOURS or not (np.diff(time) > 0.0).all():
        return stray, off
    for _ in range(int(MOST * time.size) + 1):
        sound = np.flatnonzero(~stray)
        apart, spread = np.array([_apart(time, displacement, sound, row) for row in range(time.size)]).T
        scatter = np.maximum(1.4826 * np.median(np.abs(apart[sound]) / spread[sound]), sigma)
        step = np.quantile(np.abs(np.diff(displacement[sound])), 0.9)
        beyond = np.abs(apart) > np.maximum(STRAY_SIGMAS * scatter * spread, STRAY_STEPS * step)
        if not (beyond & ~stray).any():
            return stray, off
        worst = int(np.argmax(np.where(beyond & ~stray, np.abs(apart) / spread, 0.0)))
        stray[worst], off[worst] = True, apart[worst]
    return np.zeros(time.size, dtype=bool), np.zeros(time.size)


def stray_at_rest(displacement: FloatArray, sigma: FloatArray, limit: float) -> BoolArray:
    """Find displacements of static frames that the later static ones take back: a flyer does not return.

    Parameters
    ----------
    displacement
        Of the flyer in the static frames, in their order [m], shape [n].
    sigma
        Standard deviations [m], shape [n].
    limit
        A displacement so many of them from the median is off [-].

    Returns
    -------
    BoolArray
        Which displacements are stray, shape [n]; none if one of the last `LAST_AT_REST` is off, or more than
        `MOST_AT_REST` of all are.
    """
    off = np.abs(displacement - np.median(displacement)) > limit * sigma
    if off[-LAST_AT_REST:].any() or off.sum() > MOST_AT_REST * off.size:
        return np.zeros(off.size, dtype=bool)
    return np.asarray(off)


def _apart(time: FloatArray, displacement: FloatArray, sound: np.ndarray, row: int) -> tuple[float, float]:
    """A displacement minus that of the cubic through the nearest sound frames around it [m], and the standard
    deviation of that where every displacement has one of 1."""
    others = sound[sound != row]
    first = int(np.clip(np.searchsorted(others, row) - NEIGHBOURS // 2, 0, others.size - NEIGHBOURS))
    near = others[first : first + NEIGHBOURS]
    t = (time[near] - time[row]) / (time[near[-1]] - time[near[0]])
    shares = np.linalg.pinv(np.vander(t, 4, increasing=True))[0]  # of each in the cubic's value at the frame
    return float(displacement[row] - shares @ displacement[near]), float(
        np.hypot(1.0, np.linalg.norm(shares))
    )
