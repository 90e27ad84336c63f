"""Positions in space from two tracks of the same points, and the common errors of positions.

A calibration error shifts every position by S δθ, S = ∂X/∂θ. Its covariance ``S C_θ Sᵀ`` does not average out
over points. Errors that are correlated in space and time are estimated from the epipolar distances, which
contain no motion. Relative to its mean over time, the distance of a point has the covariance ``s² exp(-(r /
l)²) exp(-|dt| / tau)`` between points at distance r and frames at time lag dt. Points whose subsets share
pixels are not compared.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from dic.basics import BoolArray, FloatArray, IntArray
from dic.camera import PARAMETERS, Camera, StereoRig
from dic.correlation.subsets import apply, gradient
from dic.outcome import PointOutcome
from dic.processes import cores
from dic.stereo.geometry import Triangulation, inverse, largest_eigenvalue, projection_slope, triangulate
from dic.tracking.inputs import Track

MOST_COMMON = 0.9
"""Largest share of a camera's noise, in any direction, that is common to both cameras."""
GATE, GATE_SIGMAS = 0.5, 5.0
"""Allowed epipolar distance due to the calibration [px], and due to noise [standard deviations]."""
AT_ONCE = 20_000
"""Number of points times frames that are reconstructed at once. It limits the memory and balances the load of
the threads."""
THREADS = 4
"""Largest number of threads; each needs about 80 MB for intermediate results."""
TINY = 1e-10
"""Variance that replaces zero [px²], as in the triangulation of chosen positions."""


@dataclass(frozen=True)
class Reconstruction:
    """Material points in the rig's frame, through the frames.

    NaN where the outcome is not VALID, with two exceptions. Epipolar distances are kept where both cameras
    found a point, even if its rays do not meet. Pixels are kept where the camera found the point.
    """

    position: FloatArray
    """Positions in the rig's frame [m], shape [n_frames, n_points, 3]."""
    covariance: FloatArray
    """Covariance of the positions due to the noise of the matches [m²], shape [n_frames, n_points, 3, 3]."""
    epipolar: FloatArray
    """Signed distance of camera 1's point from the epipolar line of camera 0's point [px], shape [n_frames,
    n_points]."""
    pixels: tuple[FloatArray, FloatArray]
    """Pixels of the points in the two cameras [px], each of shape [n_frames, n_points, 2]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n_frames, n_points]."""
    epipolar_sigma: FloatArray | None = None
    """Standard deviation of `epipolar` due to the noise of the matches [px], shape [n_frames, n_points]; NaN
    where `epipolar` is NaN. None: not known."""


def reconstruct(
    rig: StereoRig,
    track0: Track,
    track1: Track,
    *,
    gate: float = GATE,
    gate_sigmas: float = GATE_SIGMAS,
    common: FloatArray | None = None,
) -> Reconstruction:
    """Reconstruct positions in space of points that were tracked in both cameras.

    A point that a camera lost has the outcome of this camera, of camera 0 if both lost it. A point is a
    STEREO_MISMATCH if its epipolar distance exceeds both `gate` and `gate_sigmas` predicted standard
    deviations, or if it would lie behind a camera.

    Both tracks begin with the same template from camera 0's material picture. Because of its noise, both
    tracks follow the same point at a distance ε from the chosen point. With the deformation gradients F₀ and
    F₁ their errors are F₀ ε and F₁ ε. These errors shift the reconstructed point along the surface. The
    covariance `common` of ε is therefore subtracted from the cameras' noise. It is added as the error ``(G₀
    F₀ + G₁ F₁) ε`` of the position; G are the derivatives of the position by the pixels.

    Parameters
    ----------
    rig
        The cameras, for the cropped pictures of the tracks.
    track0, track1
        Tracks of the same material points in the same frames, in camera 0 and in camera 1.
    gate
        Allowed epipolar distance due to the calibration [px]; infinite: no limit.
    gate_sigmas
        Allowed epipolar distance due to noise, in standard deviations [-].
    common
        Covariance of ε in the material picture [px²], shape [n_frames, n_points, 2, 2]; zero where the tracks
        have no common template. None: the tracks are independent. It is scaled down where it exceeds a
        camera's total noise in any direction.

    Returns
    -------
    Reconstruction
        Positions and covariances are NaN where the outcome is not VALID. Epipolar distances are kept where
        both cameras found a point, and pixels where the camera found it; `diagnose` uses them.

    Raises
    ------
    ValueError
        If the tracks have different shapes, a gate is not positive, a VALID point has no pixel or covariance,
        or a lens distortion cannot be inverted.
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
    # in parts, because intermediate results take ten times the memory
    parts = [slice(first, first + frames) for first in range(0, shape[0], frames)]

    def fill(part: slice) -> None:
        sigma[part] = _reconstruct_part(result, part, rig, (track0, track1), (gate, gate_sigmas), common)

    if len(parts) == 1:
        fill(parts[0])
    else:
        with ThreadPoolExecutor(min(THREADS, cores(), len(parts))) as pool:
            list(pool.map(fill, parts))
    return result


def narrow_gates(reconstruction: Reconstruction, *, gate: float, gate_sigmas: float) -> None:
    """Narrow the gates of a reconstruction in place. The result is that of `reconstruct` with these gates.

    ``reconstruction``: a result of `reconstruct`. ``gate``, ``gate_sigmas``: as for `reconstruct`, not
    larger.
    """
    if reconstruction.epipolar_sigma is None:
        raise ValueError("the standard deviations of the epipolar distances are not known: reconstruct again")
    beyond = np.abs(reconstruction.epipolar) > np.maximum(gate, gate_sigmas * reconstruction.epipolar_sigma)
    end_points(
        reconstruction, beyond & (reconstruction.outcome == PointOutcome.VALID), PointOutcome.STEREO_MISMATCH
    )


def end_points(reconstruction: Reconstruction, points: BoolArray, outcome: PointOutcome) -> None:
    """Set the outcome of points of a reconstruction in place, without the memory of a copy.

    ``points``: mask of points and frames, shape [n_frames, n_points].
    """
    reconstruction.position[points], reconstruction.covariance[points] = np.nan, np.nan
    reconstruction.outcome[points] = int(outcome)


def _reconstruct_part(
    result: Reconstruction,
    part: slice,
    rig: StereoRig,
    tracks: tuple[Track, Track],
    gates: tuple[float, float],
    common: FloatArray | None,
) -> FloatArray:
    """Fill in some frames of a result; returns the standard deviations of their epipolar distances [px]."""
    valid_by_camera = [track.outcome[part] == PointOutcome.VALID for track in tracks]
    for camera, track in enumerate(tracks):
        result.pixels[camera][part] = _pixels(track, part, valid_by_camera[camera], camera)
    paired = valid_by_camera[0] & valid_by_camera[1]
    pixels = (result.pixels[0][part][paired], result.pixels[1][part][paired])
    noise = (tracks[0].covariance[part][paired], tracks[1].covariance[part][paired])
    if common is None:
        met = triangulate(rig, *pixels, *noise)
    else:
        slopes = (gradient(tracks[0].warp[part][paired]), gradient(tracks[1].warp[part][paired]))
        noise, shared = _apart(noise, slopes, common[part][paired])
        met = triangulate(rig, *pixels, *noise)
        along = _along(rig, met, noise, slopes)
        met = met._replace(covariance=met.covariance + along @ shared @ np.swapaxes(along, -1, -2))
    allowed = np.maximum(gates[0], gates[1] * met.epipolar_sigma)
    fine = np.all(np.isfinite(met.position), axis=-1) & (np.abs(met.epipolar) <= allowed)

    outcome = np.where(valid_by_camera[0], tracks[1].outcome[part], tracks[0].outcome[part]).astype(np.int64)
    outcome[paired] = np.where(fine, int(PointOutcome.VALID), int(PointOutcome.STEREO_MISMATCH))
    result.outcome[part] = outcome
    valid = outcome == PointOutcome.VALID
    result.position[part][valid], result.covariance[part][valid] = met.position[fine], met.covariance[fine]
    result.epipolar[part][paired] = met.epipolar
    sigma = np.full(paired.shape, np.nan)
    sigma[paired] = met.epipolar_sigma
    return sigma


Pair = tuple[FloatArray, FloatArray]


def _apart(noise: Pair, slopes: Pair, common: FloatArray) -> tuple[Pair, FloatArray]:
    """The cameras' noise without the common part [px²], and the common part in the material picture [px²],
    each of shape [n, 2, 2]."""
    inside = [F @ common @ np.swapaxes(F, -1, -2) for F in slopes]
    most = np.zeros(len(common))
    for whole, part in zip(noise, inside, strict=True):
        most = np.maximum(most, largest_eigenvalue(inverse(whole + TINY * np.eye(2)) @ part))
    scale = (MOST_COMMON / np.maximum(most, MOST_COMMON))[:, None, None]
    independent = [whole - scale * part for whole, part in zip(noise, inside, strict=True)]
    return (independent[0], independent[1]), scale * common


def _along(rig: StereoRig, met: Triangulation, noise: Pair, slopes: Pair) -> FloatArray:
    """Derivative of the positions by their coordinates in the material picture [m/px], shape [n, 3, 2]."""
    total = np.zeros((len(met.position), 3, 2))
    for camera, covariance, F in zip(rig.cameras, noise, slopes, strict=True):
        J = projection_slope(camera, met.position)
        total += met.covariance @ np.swapaxes(J, -1, -2) @ (inverse(covariance + TINY * np.eye(2)) @ F)
    return total


def _pixels(track: Track, part: slice, valid: NDArray[np.bool_], camera: int) -> FloatArray:
    """Pixels of a camera's points in some frames [px], NaN where it lost them, shape [n, n_points, 2]."""
    where = apply(np.broadcast_to(track.points, (*valid.shape, 2)), track.warp[part])
    bad = valid & ~np.all(np.isfinite(where), axis=-1)
    if np.any(bad):
        frame, point = np.argwhere(bad)[0]
        raise ValueError(
            f"camera {camera}, frame {part.start + frame}, point {point} is VALID but lies at "
            f"{where[frame, point]} px: give it another outcome"
        )
    return np.asarray(np.where(valid[..., None], where, np.nan))


def perturbed(rig: StereoRig, change: FloatArray) -> StereoRig:
    """The rig with slightly changed parameters. The pose of camera 0 defines the frame and is unchanged.

    ``change``: changes in the order of `StereoRig.parameter_names` [px, -, rad, m], shape [26].
    """
    n = len(PARAMETERS)
    first = _changed(rig.cameras[0], change[:n])
    second = _changed(rig.cameras[1], change[n : 2 * n])
    R, t = rig.relative
    turn = _rotation(change[2 * n : 2 * n + 3])
    R, t = turn @ R, t + change[2 * n + 3 :]
    second = replace(second, rotation=R @ first.rotation, translation=t + R @ first.translation)
    return replace(rig, cameras=(first, second))


def calibration_slopes(rig: StereoRig, points: FloatArray) -> FloatArray:
    """Derivatives of positions with respect to the rig's parameters at fixed pixels, by central differences.

    ``points``: positions in the rig's frame, in front of both cameras [m], shape [..., 3]. Returns: S, in m
    per unit of each of `StereoRig.parameter_names`, shape [..., 3, 26].
    """
    points = np.asarray(points, dtype=np.float64)
    pixels = [camera.project(points) for camera in rig.cameras]
    unit = np.eye(2)
    slopes = np.empty((*points.shape, len(rig.parameter_names)))
    for k, step in enumerate(_steps(rig)):
        change = np.zeros(slopes.shape[-1])
        change[k] = step
        ahead, behind = (
            triangulate(perturbed(rig, way * change), pixels[0], pixels[1], unit, unit).position
            for way in (1.0, -1.0)
        )
        slopes[..., k] = (ahead - behind) / (2.0 * step)
    return slopes


def calibration_sigma(rig: StereoRig, points: FloatArray) -> FloatArray:
    """Standard deviations of positions from the calibration's covariance. The error is common to all points.

    ``rig``: the cameras, with a covariance. ``points``: positions in the rig's frame, in front of both
    cameras [m], shape [..., 3]. The result is smooth over the field and equal in all frames, so some points
    of one frame are sufficient. Returns: by component [m], shape [..., 3]. Raises ValueError if the rig has
    no covariance, or if its size does not match the parameters.
    """
    n = len(rig.parameter_names)
    if rig.covariance is None:
        raise ValueError(
            "the rig has no covariance: calibrate it here, camera files of other programs bring none"
        )
    if rig.covariance.shape != (n, n):
        raise ValueError(f"the rig's covariance has shape {rig.covariance.shape}, must be ({n}, {n})")
    slopes = calibration_slopes(rig, points)
    return np.asarray(np.sqrt(np.einsum("...ij,jk,...ik->...i", slopes, rig.covariance, slopes)))


def _changed(camera: Camera, change: FloatArray) -> Camera:
    """A camera with its `PARAMETERS` changed."""
    fx, fy, cx, cy, skew = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.skew]) + change[:5]
    k1, k2, p1, p2, k3 = np.array(camera.distortion) + change[5:]
    return replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, skew=skew, distortion=(k1, k2, p1, p2, k3))


def _rotation(r: FloatArray) -> FloatArray:
    """Rodrigues' rotation exp([r]) of a rotation vector [rad], shape [3, 3]."""
    angle = float(np.linalg.norm(r))
    cross = np.cross(np.eye(3), r)  # [r], so that [r] v = r × v
    if angle == 0.0:
        return np.eye(3)
    return np.asarray(
        np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross
    )


def _steps(rig: StereoRig) -> FloatArray:
    """Steps of the differences, shape [26]: each shifts a pixel by a few hundredths, far above round-off."""
    baseline = float(np.linalg.norm(rig.relative[1]))
    steps = []
    for camera in rig.cameras:
        steps += [1e-5 * camera.fx, 1e-5 * camera.fy, 0.01, 0.01, 0.1, 1e-3, 1e-2, 1e-4, 1e-4, 1e-1]
    return np.array([*steps, *[1e-5] * 3, *[1e-5 * baseline] * 3])


MOST_POINTS = 200
"""Largest number of points that are compared with each other, evenly spaced over the grid."""
FEWEST_POINTS, FEWEST_FRAMES = 6, 12
"""Smallest number of points and frames for an estimate of the shared error."""
NEAR = 2.0
"""Largest distance of point pairs for the estimate of the memory, in subsets [-]."""
LAGS = 0.4
"""Longest lag over the number of frames [-]."""
STEPS = 25
"""Number of memories and lengths that are tried, on a logarithmic scale."""


@dataclass(frozen=True)
class SharedError:
    """Shared error: the part of the epipolar distance's error that is correlated between neighbouring points
    and successive frames."""

    sigma: float
    """Standard deviation s of the epipolar distance [px]; 0 if none was found."""
    length: float
    """Distance l at which the correlation is 1/e [px]."""
    memory: float
    """Time lag tau at which the correlation is 1/e [frames]."""


NONE = SharedError(0.0, 1.0, 1.0)
"""No shared error."""


def shared_error(epipolar: FloatArray, valid: BoolArray, points: FloatArray, *, subset: float) -> SharedError:
    """Estimate size, correlation length and memory of the shared error of matches.

    ``epipolar``: signed distances of camera 1's points from the epipolar lines of camera 0's [px], shape
    [n_frames, n_points]. ``valid``: mask of the known ones, same shape. ``points``: positions in the material
    picture [px], shape [n_points, 2]. ``subset``: side of the subsets [px]. Points that are closer in both
    directions share noise. Returns: the estimate; `NONE` if too few points were tracked, or if their
    distances are not correlated.
    """
    steady = np.flatnonzero(valid.mean(axis=0) > 0.5)
    steady = steady[:: max(-(-steady.size // MOST_POINTS), 1)]
    if steady.size < FEWEST_POINTS or len(valid) < FEWEST_FRAMES:
        return NONE
    V = valid[:, steady].astype(np.float64)
    D = np.where(V > 0.0, epipolar[:, steady], 0.0)
    D = np.where(V > 0.0, D - D.sum(axis=0) / V.sum(axis=0), 0.0)
    place = points[steady]
    apart, free = cdist(place, place), cdist(place, place, "chebyshev") >= subset
    near = (free & (apart <= NEAR * subset)).astype(np.float64)
    if not near.any():
        return NONE
    memory = _memory(D, V, near)
    length = _length(D, V, apart, free)
    if memory is None or length is None:
        return NONE
    share = float(demeaned(len(D), memory)[0])
    return SharedError(sigma=float(np.sqrt(length[1] / share)), length=length[0], memory=memory)


def demeaned(n: int, memory: float) -> FloatArray:
    """Covariances by lag of n values of a unit process with memory, relative to their mean, shape [n].

    The process has the covariance exp(-|i - j| / memory). The subtraction of the mean of n values removes a
    part of it.
    """
    at = np.arange(n)
    R = np.exp(-np.abs(at[:, None] - at) / memory)
    rows = R.mean(axis=1)
    H = R - rows[:, None] - rows[None, :] + R.mean()
    return np.array([np.diagonal(H, lag).mean() for lag in range(n)])


def _memory(D: FloatArray, V: FloatArray, near: FloatArray) -> float | None:
    """Memory of the error shared by near points [frames]; None if there is none."""
    n = len(D)
    last = max(int(LAGS * n), 2)
    mates, counts = D @ near, V @ near
    correlation = np.array([np.sum(D[: n - k] * mates[k:]) for k in range(last)])
    pairs = np.array([np.sum(V[: n - k] * counts[k:]) for k in range(last)])
    if not (pairs > 0.0).all() or correlation[0] <= 0.0:
        return None
    correlation = correlation / pairs
    best, least = None, np.inf
    for memory in np.geomspace(0.5, float(n), STEPS):
        shape = demeaned(n, memory)[:last]
        size = float(shape @ correlation / (shape @ shape))
        misfit = float(np.sum((correlation - size * shape) ** 2))
        if size > 0.0 and misfit < least:
            best, least = float(memory), misfit
    return best


def _length(D: FloatArray, V: FloatArray, apart: FloatArray, free: BoolArray) -> tuple[float, float] | None:
    """Correlation length of the points' errors [px], and their covariance at zero distance [px²]; None if
    there is no shared error."""
    pairs = V.T @ V
    use = free & (pairs > 0.5 * len(D))
    if not use.any():
        return None
    covariance, distance = (D.T @ D)[use] / pairs[use], apart[use]
    best, least = None, np.inf
    for length in np.geomspace(distance.min(), 3.0 * distance.max(), STEPS):
        shape = np.exp(-((distance / length) ** 2))
        size = float(shape @ covariance / max(float(shape @ shape), 1e-300))
        misfit = float(np.sum((covariance - size * shape) ** 2))
        if size > 0.0 and misfit < least:
            best, least = (float(length), size), misfit
    return best
