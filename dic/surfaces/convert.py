"""From points in the rig's frame to the history of a surface in the test frame."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dic.arrays import BoolArray, FloatArray
from dic.outcome import PointOutcome
from dic.stereo.reconstruction import Reconstruction
from dic.surfaces.frame import SpecimenFrame
from dic.surfaces.surface_history import SurfaceHistory


def referenced(reconstruction: Reconstruction, reference: Sequence[int] = (0,)) -> BoolArray:
    """Points that are valid in at least one of the reference frames, shape [n_points]."""
    return np.asarray(np.any(reconstruction.outcome[list(reference)] == PointOutcome.VALID, axis=0))


def static_mean(
    reconstruction: Reconstruction, frames: Sequence[int], *, shared: float = 0.5
) -> tuple[FloatArray, FloatArray]:
    """Mean positions over frames in which nothing moves, and their covariances.

    The noise of the material picture is the same in every frame and does not average out. In a match of
    two pictures of the same noise it is half the variance.

    Parameters
    ----------
    reconstruction
        Points in the rig's frame.
    frames
        The static frames.
    shared
        Share of the variance that all frames have in common [-].

    Returns
    -------
    NDArray
        Positions [m], shape [n_points, 3]; NaN for a point that is valid in none of the frames.
    NDArray
        Covariances [m²], shape [n_points, 3, 3]; likewise.

    Raises
    ------
    ValueError
        No frames, or `shared` outside [0, 1].
    """
    if not len(frames) or not 0.0 <= shared <= 1.0:
        raise ValueError(f"frames must be given and shared be in [0, 1], got {list(frames)} and {shared}")
    valid = reconstruction.outcome[list(frames)] == PointOutcome.VALID
    count = np.where(valid.any(axis=0), valid.sum(axis=0), np.nan)
    position = np.where(valid[..., None], reconstruction.position[list(frames)], 0.0)
    covariance = np.where(valid[..., None, None], reconstruction.covariance[list(frames)], 0.0)
    share = (shared + (1.0 - shared) / count) / count
    return position.sum(axis=0) / count[:, None], covariance.sum(axis=0) * share[:, None, None]


def to_surface(
    reconstruction: Reconstruction,
    frame: SpecimenFrame,
    t: ArrayLike,
    *,
    reference: Sequence[int] = (0,),
    points: BoolArray | None = None,
) -> SurfaceHistory:
    """Express reconstructed points in the test frame.

    Parameters
    ----------
    reconstruction
        Points in the rig's frame.
    frame
        The test frame.
    t
        Times of the frames on the shot's clock [s], shape [n_frames].
    reference
        Frames, static ones, whose mean gives the reference positions.
    points
        Which points to take, shape [n_points]; None takes all. `referenced` tells which can be taken.

    Returns
    -------
    SurfaceHistory
        With the noise of the matches as sigma; what all points have in common through the frame is
        `SpecimenFrame.sigma`, and through the calibration the covariance of the rig.

    Raises
    ------
    ValueError
        If a point has no valid position in any reference frame, or shapes do not fit.
    """
    known = referenced(reconstruction, reference)
    taken = np.ones(known.size, dtype=bool) if points is None else np.asarray(points, dtype=bool)
    if taken.shape != known.shape:
        raise ValueError(f"points has shape {taken.shape}, must be {known.shape}")
    lost = int(np.sum(taken & ~known))
    if lost:
        raise ValueError(
            f"{lost} of {int(taken.sum())} points are valid in none of the reference frames "
            f"{list(reference)} and have no reference position; name more static frames, or leave them out: "
            "points=referenced(reconstruction, reference)"
        )
    position = frame.positions(reconstruction.position[:, taken])
    X = frame.positions(static_mean(reconstruction, reference)[0][taken])
    variance = frame.variances(reconstruction.covariance[:, taken])
    outcome = reconstruction.outcome[:, taken]
    lost_here = (outcome != PointOutcome.VALID)[..., None]
    with np.errstate(invalid="ignore"):  # a negative variance becomes NaN, which a valid point may not have
        sigma = np.sqrt(np.where(lost_here, np.nan, variance))
    return SurfaceHistory(
        t=np.asarray(t, dtype=np.float64),
        X=X,
        u=np.where(lost_here, np.nan, position - X),
        sigma=sigma,
        outcome=outcome,
    )
