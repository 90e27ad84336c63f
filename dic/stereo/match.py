"""Points of camera 0 found in camera 1, on surfaces that curve, seen from far apart."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation.settings import Correlation
from dic.correlation.stack import Noise, PictureStack
from dic.correlation.warp import Shape
from dic.outcome import PointOutcome
from dic.stereo.gates import Gate, GateValues, failed_gates, measure_gates
from dic.stereo.guided import guided_match
from dic.stereo.pair import Pair
from dic.stereo.settings import StereoGates, StereoSearch


@dataclass(frozen=True)
class StereoMatch:
    """Places of camera 0's points in camera 1, one row a point; rows not VALID hold the last try."""

    points: FloatArray
    """Places in the material picture (x, y) [px], shape [n, 2]."""
    warp: FloatArray
    """Total warps from the material picture to camera 1's, shape [n, 12]."""
    covariance: FloatArray
    """Of the position in camera 1 from the noise of both pictures [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""
    failed: IntArray
    """Gates not passed, a sum of `Gate` members, shape [n]."""
    gate_values: GateValues
    """The number behind each gate."""

    @property
    def valid(self) -> BoolArray:
        """Points that passed every gate, shape [n]."""
        return np.asarray(self.outcome == PointOutcome.VALID)

    def count(self) -> dict[Gate, int]:
        """Number of points that failed each gate; a point may fail several."""
        return {gate: int(np.sum(self.failed & int(gate) != 0)) for gate in Gate}


def match_stereo(
    picture0: ArrayLike,
    picture1: ArrayLike,
    points: ArrayLike,
    rig: StereoRig,
    settings: Correlation,
    *,
    noise: float | Noise | tuple[float | Noise, float | Noise],
    reference_warp: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    search: StereoSearch | None = None,
    gates: StereoGates | None = None,
    device: str = "cpu",
) -> StereoMatch:
    """Find points of camera 0's picture in camera 1's, and judge every match by gates of their own.

    A few seeds are looked for along their whole epipolar curves, their subsets deformed as facets of several
    slopes would be seen; the other points follow from neighbours, the most reliable first, with affine
    shape functions; the shape function of `settings` has the last word. See
    :doc:`/theory/stereo_matching`.

    Parameters
    ----------
    picture0, picture1
        Grey values of one instant, shapes [rows, columns]; the cameras' pictures may differ in shape.
    points
        Places in the material picture (x, y) [px], shape [n, 2].
    rig
        The cameras, for these pictures (`StereoRig.cropped`).
    settings
        Of the match; its shape function must be AFFINE or QUADRATIC.
    noise
        Standard deviation of a grey value, of both pictures or of each [grey].
    reference_warp
        Total warps from the material picture to `picture0`, shape [n, 12]; a row with a NaN is a point that
        camera 0 has lost. None: `picture0` is the material picture.
    mask
        Pixels of the material picture that belong to the specimen, shape [rows, columns]; None: all.
    search
        Where first guesses are looked for.
    gates
        What a match must pass.
    device
        Where pictures are correlated, "cpu" or "cuda".

    Returns
    -------
    StereoMatch
        One row a point. A point that fails a gate is a STEREO_MISMATCH, one that was not matched in the first
        place keeps the outcome of the match.

    Raises
    ------
    ValueError
        A rigid shape function, shapes that do not fit, points or pictures that are not finite.
    """
    search, gates = search or StereoSearch(), gates or StereoGates()
    if settings.shape < Shape.AFFINE:
        raise ValueError("shape must be AFFINE or QUADRATIC: two cameras never see a surface undeformed")
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise ValueError(f"points must be finite and have shape [n, 2], got {points.shape}")
    reference = (
        np.zeros((len(points), 12)) if reference_warp is None else np.array(reference_warp, dtype=float)
    )
    if reference.shape != (len(points), 12):
        raise ValueError(f"reference_warp must have shape {(len(points), 12)}, got {reference.shape}")
    pictures = tuple(np.asarray(picture, dtype=np.float32) for picture in (picture0, picture1))
    noises = noise if isinstance(noise, tuple) else (noise, noise)
    stacks = tuple(
        PictureStack.prepare(picture[None], noise=grey, prefilter=settings.prefilter, device=device)
        for picture, grey in zip(pictures, noises, strict=True)
    )
    known = np.all(np.isfinite(reference), axis=1)
    pair = Pair(
        rig=rig,
        pictures=(pictures[0], pictures[1]),
        stacks=(stacks[0], stacks[1]),
        points=points[known],
        reference=reference[known],
        mask=None if mask is None else np.asarray(mask),
        settings=settings,
        search=search,
        gates=gates,
    )
    return _spread(_judged(pair), points, known)


def _judged(pair: Pair) -> StereoMatch:
    """The match of a pair, and the verdict of its gates."""
    match = guided_match(pair)
    gate_values = measure_gates(pair, match)
    valid = match.outcome == PointOutcome.VALID
    failed = np.where(
        valid, failed_gates(gate_values, pair.gates, pair.search.distances), int(Gate.CORRELATION)
    )
    outcome = np.where(valid & (failed != 0), int(PointOutcome.STEREO_MISMATCH), match.outcome)
    outcome[valid & (failed & int(Gate.VIEW) != 0)] = PointOutcome.OUT_OF_VIEW
    return StereoMatch(pair.points, match.warp, match.covariance, match.zncc, outcome, failed, gate_values)


def _spread(part: StereoMatch, points: FloatArray, known: BoolArray) -> StereoMatch:
    """The result for all points: those that camera 0 has lost had nothing to start from."""
    if known.all():
        return part

    def whole(values: NDArray, fill: float) -> NDArray:
        result = np.full((len(points), *values.shape[1:]), fill, dtype=values.dtype)
        result[known] = values
        return result

    gate_values = GateValues(**{name: whole(value, np.inf) for name, value in vars(part.gate_values).items()})
    return StereoMatch(
        points=points,
        warp=whole(part.warp, 0.0),
        covariance=whole(part.covariance, 0.0),
        zncc=whole(part.zncc, 0.0),
        outcome=whole(part.outcome, int(PointOutcome.NO_FIRST_GUESS)),
        failed=whole(part.failed, int(Gate.CORRELATION)),
        gate_values=gate_values,
    )
