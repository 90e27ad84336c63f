"""Test frame: the cylinder of the specimen at rest, and its end."""

from dataclasses import dataclass

import numpy as np

from dic.arrays import FloatArray
from dic.bodies.ends import refined_end
from dic.bodies.follow import TrackedBody
from dic.chain.inspect_images import Inputs
from dic.chain.settings import ChainError
from dic.images import Pictures
from dic.outcome import PointOutcome
from dic.result import Placement
from dic.surfaces import Cylinder, fit_cylinder, overlap_factor, static_mean, test_frame

MOST_AVERAGED = 50
"""Static pictures that are averaged to find the specimen's edge."""

FEWEST_POINTS = 10
"""Points of the flyer that tell its radius."""


@dataclass(frozen=True)
class RestState:
    """State of the specimen at rest."""

    placement: Placement
    """The test frame, and the cylinder it was taken from."""
    rest: list[int]
    """Static frames in which both cameras saw the specimen."""
    edges: int
    """Cameras in which its end was found."""
    platen: float | None = None
    """Radius of the platens, that of the flyer [m]; None: not known."""


def fit_test_frame(inputs: Inputs, body: TrackedBody, flyer: TrackedBody | None = None) -> RestState:
    """Fit the test frame to the specimen at rest.

    Parameters
    ----------
    inputs
        The pictures and cameras.
    body
        The specimen, followed.
    flyer
        The flyer, followed: both platens are taken to have its radius; None: not known.

    Raises
    ------
    ChainError
        If no point was found by both cameras at rest, or the points lie on no cylinder.
    """
    rig, settings = inputs.rig, inputs.settings
    rest = _rest_frames(inputs, body)
    position, covariance = static_mean(body.reconstruction, rest)
    known = np.isfinite(position).all(axis=1)
    try:
        overlap = overlap_factor(body.points[known], settings.subset)
        free = fit_cylinder(position[known], covariance[known], overlap=overlap)
        cylinder = free
        if settings.radius is not None:
            cylinder = fit_cylinder(
                position[known], covariance[known], overlap=overlap, radius=settings.radius
            )
        means = (_mean_picture(inputs.pictures[0], rest), _mean_picture(inputs.pictures[1], rest))
        platen = _platen(flyer, cylinder)
        zero, zero_sigma, edges = refined_end(
            means, rig, cylinder, settings.zero, settings.direction, platen=platen
        )
        frame = test_frame(cylinder, rig, toward_flyer=settings.direction, zero=zero, zero_sigma=zero_sigma)
    except ValueError as error:
        raise ChainError(f"the specimen at rest gives no test frame: {error}") from error
    placement = Placement(
        frame=frame,
        radius=free.radius,
        radius_sigma=float(free.sigma[4]),
        rms=cylinder.rms,
        chi2_per_dof=cylinder.chi2_per_dof,
        n_points=int(cylinder.used.sum()),
    )
    return RestState(placement=placement, rest=rest, edges=edges, platen=platen)


def _platen(flyer: TrackedBody | None, cylinder: Cylinder) -> float | None:
    """Radius of the flyer's side, from its points in the frame in which they were chosen [m]."""
    if flyer is None:
        return None
    r = flyer.reconstruction
    valid = r.outcome[flyer.material] == PointOutcome.VALID
    if valid.sum() < FEWEST_POINTS:
        return None
    across = (r.position[flyer.material, valid] - cylinder.point) @ cylinder.basis[:2].T
    return float(np.median(np.hypot(*across.T)))


def _rest_frames(inputs: Inputs, body: TrackedBody) -> list[int]:
    """Static frames in which both cameras saw the body."""
    seen = np.any(body.reconstruction.outcome == PointOutcome.VALID, axis=1)
    rest: list[int] = np.flatnonzero(inputs.static & seen).tolist()
    if not rest:
        failed = [f"{gate.name} {count}" for gate, count in body.stereo.count().items() if count]
        raise ChainError(
            f"no point of the specimen was found by both cameras at rest; of {len(body.points)} points the "
            f"match between the cameras failed by {', '.join(failed)}: check the calibration, the crop "
            "offsets and which camera is which"
        )
    return rest


def _mean_picture(pictures: Pictures, frames: list[int]) -> FloatArray:
    """The mean of some static pictures, at most `MOST_AVERAGED`."""
    chosen = frames[:MOST_AVERAGED]
    total = np.zeros(pictures.shape)
    for frame in chosen:
        total += pictures.frame(frame)
    return total / len(chosen)
