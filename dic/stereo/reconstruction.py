"""Two tracks of the same points, one a camera, to positions in space."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation.warp import apply, gradient
from dic.forks import cores
from dic.outcome import PointOutcome
from dic.stereo.rays import inverse, largest_eigenvalue, projection_slope
from dic.stereo.triangulation import Triangulation, triangulate
from dic.tracking.history import Track

MOST_COMMON = 0.9
"""Share of a camera's noise, in any direction, that it may have in common with the other."""
GATE, GATE_SIGMAS = 0.5, 5.0
"""Epipolar distance that a calibration is allowed [px], and that noise is, in its standard deviations."""
AT_ONCE = 20_000
"""Points of some frames that are reconstructed at once, which bounds the memory; few enough for the threads
to end together."""
THREADS = 4
"""Threads at most that do so side by side: what lies between takes some 80 MB in each."""
TINY = 1e-10
"""Variance that stands for none [px²]: that of triangulation for places that were chosen."""


@dataclass(frozen=True)
class Reconstruction:
    """Material points in the rig's frame, through the frames.

    NaN where the outcome is not VALID; but distances remain where both cameras found a point that does not
    meet, and pixels where that camera found it.
    """

    position: FloatArray
    """Places in the rig's frame [m], shape [n_frames, n_points, 3]."""
    covariance: FloatArray
    """Of the places, from the noise of the matches [m²], shape [n_frames, n_points, 3, 3]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's, signed [px],
    shape [n_frames, n_points]."""
    pixels: tuple[FloatArray, FloatArray]
    """Pixels of the points in the two cameras [px], each of shape [n_frames, n_points, 2]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n_frames, n_points]."""
    epipolar_sigma: FloatArray | None = None
    """Standard deviation of `epipolar` from the noise of the matches [px], NaN where that is,
    shape [n_frames, n_points]; None: not known."""


def reconstruct(
    rig: StereoRig,
    track0: Track,
    track1: Track,
    *,
    gate: float = GATE,
    gate_sigmas: float = GATE_SIGMAS,
    common: FloatArray | None = None,
) -> Reconstruction:
    """Positions in space of points that both cameras followed.

    A point that a camera lost ends with that camera's outcome, camera 0's first. One whose epipolar distance
    exceeds both `gate` and `gate_sigmas` of its own predicted standard deviation, or that would lie behind a
    camera, ends as STEREO_MISMATCH.

    Both tracks begin with one template, camera 0's material picture. Its noise makes them follow a place ε
    beside the one that was chosen, both the same one: with the deformation gradients F₀ and F₁ they are off
    by F₀ ε and F₁ ε, which moves the reconstructed point along the surface and not off it. What `common`
    says of ε is therefore taken out of the cameras' own noise, and comes back as the motion
    ``(G₀ F₀ + G₁ F₁) ε``, G the derivatives of the position by the pixels.

    Parameters
    ----------
    rig
        The cameras, for pictures with the crop of the tracks.
    track0, track1
        The same material points in the same frames, a row each, in camera 0 and in camera 1.
    gate
        Epipolar distance that a calibration is allowed [px]; infinite for none.
    gate_sigmas
        Epipolar distance that noise is allowed, in its standard deviations [-].
    common
        Covariance of ε in the material picture [px²], zero where the tracks have no template in common,
        shape [n_frames, n_points, 2, 2]; None: the tracks are independent. What exceeds a camera's whole
        noise in any direction is scaled down to it.

    Returns
    -------
    Reconstruction
        Its positions and covariances are NaN where the outcome is not VALID. Its epipolar distances remain
        wherever both cameras found a point, its pixels wherever that camera did: what `diagnose` reads.

    Raises
    ------
    ValueError
        Tracks of different shape, a gate that is not positive, a VALID point without a pixel or covariance,
        a lens distortion that cannot be undone.
    """
    if not (gate > 0.0 and gate_sigmas > 0.0):
        raise ValueError(f"gate and gate_sigmas must be positive, got {gate} px and {gate_sigmas}")
    if track0.outcome.shape != track1.outcome.shape:
        raise ValueError(
            f"the tracks have {track0.outcome.shape} and {track1.outcome.shape} frames and points, must "
            "have the same: follow one set of points through one set of frames in both cameras"
        )
    shape = track0.outcome.shape
    result = Reconstruction(
        position=np.full((*shape, 3), np.nan),
        covariance=np.full((*shape, 3, 3), np.nan),
        epipolar=np.full(shape, np.nan),
        pixels=(np.full((*shape, 2), np.nan), np.full((*shape, 2), np.nan)),
        outcome=np.zeros(shape, dtype=np.int64),
        epipolar_sigma=(sigma := np.full(shape, np.nan)),
    )
    frames = max(1, AT_ONCE // max(shape[1], 1))
    # some at a time: what lies between is ten times the result
    parts = [slice(first, first + frames) for first in range(0, shape[0], frames)]

    def fill(part: slice) -> None:
        sigma[part] = _reconstruct_part(result, part, rig, (track0, track1), (gate, gate_sigmas), common)

    if len(parts) == 1:
        fill(parts[0])
    else:
        with ThreadPoolExecutor(min(THREADS, cores(), len(parts))) as pool:
            list(pool.map(fill, parts))
    return result


def narrow_gates(found: Reconstruction, *, gate: float, gate_sigmas: float) -> None:
    """Make of a reconstruction, in place, what `reconstruct` would give with gates no wider than it had.

    Parameters
    ----------
    found
        What `reconstruct` gave.
    gate, gate_sigmas
        As there.

    Raises
    ------
    ValueError
        If the standard deviations of the epipolar distances are not known.
    """
    if found.epipolar_sigma is None:
        raise ValueError("the standard deviations of the epipolar distances are not known: reconstruct again")
    beyond = np.abs(found.epipolar) > np.maximum(gate, gate_sigmas * found.epipolar_sigma)
    end_points(found, beyond & (found.outcome == PointOutcome.VALID), PointOutcome.STEREO_MISMATCH)


def end_points(found: Reconstruction, points: BoolArray, outcome: PointOutcome) -> None:
    """End points of a reconstruction with an outcome, in place: a copy would be as large as all there is.

    Parameters
    ----------
    found
        The reconstruction.
    points
        Which points of which frames, shape [n_frames, n_points].
    outcome
        Their outcome.
    """
    found.position[points], found.covariance[points] = np.nan, np.nan
    found.outcome[points] = int(outcome)


def _reconstruct_part(
    result: Reconstruction,
    part: slice,
    rig: StereoRig,
    tracks: tuple[Track, Track],
    gates: tuple[float, float],
    common: FloatArray | None,
) -> FloatArray:
    """Fill in some frames of a result; the standard deviations of the epipolar distances there [px]."""
    found = [track.outcome[part] == PointOutcome.VALID for track in tracks]
    for camera, track in enumerate(tracks):
        result.pixels[camera][part] = _pixels(track, part, found[camera], camera)
    both = found[0] & found[1]
    seen = (result.pixels[0][part][both], result.pixels[1][part][both])
    noise = (tracks[0].covariance[part][both], tracks[1].covariance[part][both])
    if common is None:
        met = triangulate(rig, *seen, *noise)
    else:
        slopes = (gradient(tracks[0].warp[part][both]), gradient(tracks[1].warp[part][both]))
        noise, shared = _apart(noise, slopes, common[part][both])
        met = triangulate(rig, *seen, *noise)
        along = _along(rig, met, noise, slopes)
        met = met._replace(covariance=met.covariance + along @ shared @ np.swapaxes(along, -1, -2))
    allowed = np.maximum(gates[0], gates[1] * met.epipolar_sigma)
    fine = np.all(np.isfinite(met.position), axis=-1) & (np.abs(met.epipolar) <= allowed)

    outcome = np.where(found[0], tracks[1].outcome[part], tracks[0].outcome[part]).astype(np.int64)
    outcome[both] = np.where(fine, int(PointOutcome.VALID), int(PointOutcome.STEREO_MISMATCH))
    result.outcome[part] = outcome
    valid = outcome == PointOutcome.VALID
    result.position[part][valid], result.covariance[part][valid] = met.position[fine], met.covariance[fine]
    result.epipolar[part][both] = met.epipolar
    sigma = np.full(both.shape, np.nan)
    sigma[both] = met.epipolar_sigma
    return sigma


Pair = tuple[FloatArray, FloatArray]


def _apart(noise: Pair, slopes: Pair, common: FloatArray) -> tuple[Pair, FloatArray]:
    """The cameras' own noise without what they have in common [px²], and the latter in the material picture,
    each of shape [n, 2, 2]."""
    inside = [F @ common @ np.swapaxes(F, -1, -2) for F in slopes]
    most = np.zeros(len(common))
    for whole, part in zip(noise, inside, strict=True):
        most = np.maximum(most, largest_eigenvalue(inverse(whole + TINY * np.eye(2)) @ part))
    scale = (MOST_COMMON / np.maximum(most, MOST_COMMON))[:, None, None]
    own = [whole - scale * part for whole, part in zip(noise, inside, strict=True)]
    return (own[0], own[1]), scale * common


def _along(rig: StereoRig, met: Triangulation, noise: Pair, slopes: Pair) -> FloatArray:
    """Motion of the positions with their places in the material picture [m/px], shape [n, 3, 2]."""
    total = np.zeros((len(met.position), 3, 2))
    for camera, own, F in zip(rig.cameras, noise, slopes, strict=True):
        J = projection_slope(camera, met.position)
        total += met.covariance @ np.swapaxes(J, -1, -2) @ (inverse(own + TINY * np.eye(2)) @ F)
    return total


def _pixels(track: Track, part: slice, found: NDArray[np.bool_], camera: int) -> FloatArray:
    """Pixels of a camera's points in some frames [px], NaN where it lost them, shape [n, n_points, 2]."""
    where = apply(np.broadcast_to(track.points, (*found.shape, 2)), track.warp[part])
    bad = found & ~np.all(np.isfinite(where), axis=-1)
    if np.any(bad):
        frame, point = np.argwhere(bad)[0]
        raise ValueError(
            f"camera {camera}, frame {part.start + frame}, point {point} is VALID but lies at "
            f"{where[frame, point]} px: give it another outcome"
        )
    return np.asarray(np.where(found[..., None], where, np.nan))
