"""The search along epipolar curves in NumPy and OpenCV, the reference for its kernel."""

import numpy as np
from numpy.typing import NDArray

from dic.basics import BoolArray, FloatArray, IntArray
from dic.camera import Camera, StereoRig
from dic.stereo import epipolar_search
from dic.stereo.geometry import directions, midpoint

KNOTS = 65  # number of positions on a curve before its division into equal steps
NARROWINGS = 3
"""Number of refinements of the part of a curve inside the picture. Each is a few dozen times finer."""


def curve_distances(
    rig: StereoRig,
    pixels0: FloatArray,
    shape1: tuple[int, int],
    limits: tuple[float, float] | None,
    step: float,
) -> FloatArray:
    """Distances along camera 0's rays for equal steps along the epipolar curves of camera 1.

    ``rig``: the cameras. ``pixels0``: positions in camera 0's picture [px], shape [n, 2]. ``shape1``: rows
    and columns of camera 1's picture. ``limits``: nearest and farthest distance [m]; None: the part of the
    curves in camera 1's picture. ``step``: step along the curve [px]. Returns: increasing distances [m],
    shape [n, k]. Rows end in NaN.
    """
    n = len(pixels0)
    near, far = limits if limits is not None else (_axes_meet(rig) / 20.0, _axes_meet(rig) * 20.0)
    # equal steps of 1/s are about equal steps along the curve: the disparity goes with 1/s
    piece = epipolar_search.visible_piece(rig, directions(rig.cameras[0], pixels0), shape1, (near, far))
    inverse = piece[:, :1] + (piece[:, 1:] - piece[:, :1]) * np.linspace(0.0, 1.0, KNOTS)
    for _ in range(NARROWINGS):  # limit to the part of the curve in camera 1's picture
        seen = shows(rig.cameras[1], points_along(rig, pixels0, 1.0 / inverse), shape1)
        first = np.maximum(np.argmax(seen, axis=1) - 1, 0)
        last = np.minimum(KNOTS - np.argmax(seen[:, ::-1], axis=1), KNOTS - 1)
        ends = [np.take_along_axis(inverse, k[:, None], axis=1) for k in (first, last)]
        ends[1] = np.where(seen.any(axis=1, keepdims=True), ends[1], ends[0])
        inverse = ends[0] + (ends[1] - ends[0]) * np.linspace(0.0, 1.0, KNOTS)
    curve = rig.cameras[1].project(points_along(rig, pixels0, 1.0 / inverse))
    pace = np.nan_to_num(np.linalg.norm(np.diff(curve, axis=1), axis=2))
    length = np.concatenate([np.zeros((n, 1)), np.cumsum(pace, axis=1)], axis=1)
    most = int(np.max(length[:, -1], initial=0.0) / step) + 1
    distances = np.full((n, most), np.nan)
    for row in range(n):
        s = np.arange(0.0, length[row, -1] + 1e-9, step)[::-1]
        distances[row, : len(s)] = 1.0 / np.interp(s, length[row], inverse[row])
    return distances


def points_along(rig: StereoRig, pixels0: FloatArray, distances: FloatArray) -> FloatArray:
    """Points on camera 0's rays at given distances [m], shape [n, k, 3]."""
    first = rig.cameras[0]
    return np.asarray(first.centre + directions(first, pixels0)[:, None] * distances[..., None])


def shows(camera: Camera, X: FloatArray, shape: tuple[int, int]) -> BoolArray:
    """True where a picture shows these positions, shape [...]. False where the lens model is not unique."""
    rows, columns = shape
    k1, k2, _, _, k3 = camera.distortion
    turning = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])  # squared radii where r (1 + k1 r² + ...) turns
    folds = min((root.real for root in turning if abs(root.imag) < 1e-12 and root.real > 0.0), default=np.inf)
    inside = camera.in_camera(X)
    before = inside[..., 2] > 0.0
    ideal = inside[..., :2] / np.where(before, inside[..., 2], 1.0)[..., None]
    at = camera.to_pixels(camera.distort(np.where(before[..., None], ideal, 0.0)))
    seen = np.all((at >= 0.0) & (at <= (columns - 1.0, rows - 1.0)), axis=-1)
    return np.asarray(before & seen & (np.sum(ideal * ideal, axis=-1) < folds))


def _axes_meet(rig: StereoRig) -> float:
    """Distance in front of camera 0 at which the optical axes are closest to each other [m]."""
    first, second = rig.cameras
    centres = np.array([[camera.cx, camera.cy] for camera in rig.cameras])
    meet = midpoint(rig, centres[0], centres[1])
    s = float(epipolar_search.distance_along(rig, centres[0], meet))
    if not (np.isfinite(s) and s > 0.0):
        baseline = float(np.linalg.norm(second.centre - first.centre))
        s = 3.0 * baseline
    return s


def search(
    rig: StereoRig,
    wanted: epipolar_search.Subsets,
    picture1: NDArray[np.float32],
    *,
    limits: tuple[float, float] | None,
    turns: FloatArray | None = None,
    gradients: FloatArray | None = None,
) -> epipolar_search.Candidates:
    """The best position of each subset on its epipolar curve, and the second peak.

    ``rig``: the cameras. ``wanted``: the templates. ``picture1``: camera 1's picture, shape [rows,
    columns]. ``limits``: nearest and farthest distance along camera 0's rays [m]; None: the whole curve.
    ``turns``: tried rotations of the facet at every position (`facet.normals`) [rad], shape [h, 2].
    ``gradients``: used instead of `turns`. One gradient of camera 1's pixel by camera 0's for each point,
    shape [n, 2, 2], constant along its curve. Returns: one row per point.
    """
    n, shape1 = len(wanted.points), (picture1.shape[0], picture1.shape[1])
    found = epipolar_search.Candidates(
        np.full((n, 12), np.nan), np.full(n, -1.0), np.full(n, -1.0), np.full(n, np.nan)
    )
    places = wanted.places
    distances = curve_distances(rig, places, shape1, limits, float(wanted.stride))
    smooth = epipolar_search.smoothed(picture1, wanted.stride)
    per_point = distances.shape[1] * (len(turns) if turns is not None else 1)
    batch = max(1, epipolar_search.ROWS // max(per_point, 1))
    for start in range(0, n, batch):
        rows = np.arange(start, min(start + batch, n))
        s = distances[rows]
        step = _gradients(rig, places[rows], s, turns, None if gradients is None else gradients[rows])
        A = step @ (np.eye(2) + wanted.reference[rows, 2:6].reshape(-1, 1, 1, 2, 2))
        X = points_along(rig, places[rows], s)
        centre = rig.cameras[1].project(X)
        some = wanted.take(rows)
        zncc = _correlate(some, smooth, centre, A)
        zncc[~shows(rig.cameras[1], X, shape1)] = -1.0
        _keep_best(found, rows, some.points, s, centre, A, zncc)
    return found


def _gradients(
    rig: StereoRig, pixels0: FloatArray, s: FloatArray, turns: FloatArray | None, given: FloatArray | None
) -> FloatArray:
    """Gradient of camera 1's pixel by camera 0's for every position and rotation, shape [n, k, h, 2, 2]."""
    if given is not None:
        return np.broadcast_to(given[:, None, None], (*s.shape, 1, 2, 2))
    seen = epipolar_search.facet_geometry(rig, np.repeat(pixels0[:, None], s.shape[1], axis=1), s)
    n = epipolar_search.normals(rig, seen.X, np.zeros((1, 2)) if turns is None else turns)
    wide = epipolar_search.FacetGeometry(*(np.expand_dims(part, 2) for part in seen))
    return epipolar_search.gradient(wide, s[..., None], n)


def _correlate(
    wanted: epipolar_search.Subsets, picture: NDArray[np.float32], centre: FloatArray, A: FloatArray
) -> FloatArray:
    """ZNCC of every subset at all its positions with all gradients, shape [n, k, h]; -1 where there is
    none."""
    n, k, h = A.shape[:3]
    nowhere = ~np.all(np.isfinite(centre), axis=-1)
    middle = np.where(nowhere[..., None], 0.0, centre).astype(np.float32)[:, :, None]
    # One product per point. A product for all points would be divided between threads, which then wait
    # actively.
    slope = np.nan_to_num(A).astype(np.float32).reshape(n, k * h, 2, 2)
    x, y = ((slope[:, :, c] @ wanted.xi.T.astype(np.float32)).reshape(n * k * h, -1) for c in (0, 1))
    origin = np.repeat(middle, h, axis=2).reshape(-1, 2)
    x += origin[:, 0, None]
    y += origin[:, 1, None]
    grey = epipolar_search.sample(picture, x, y).reshape(n, k * h, -1)
    template, weight = wanted.template[:, None], wanted.weight[:, None]
    zncc = correlation(grey, template, weight)
    # pixels outside the picture do not count; less than half a subset has no correlation
    right, bottom = picture.shape[1] - 1.0, picture.shape[0] - 1.0
    crossing = (x.min(axis=1) < 0.0) | (y.min(axis=1) < 0.0)
    crossing |= (x.max(axis=1) > right) | (y.max(axis=1) > bottom)
    i, j = np.nonzero(crossing.reshape(n, k * h))
    if len(i):
        x, y = x[crossing], y[crossing]
        seen = wanted.weight[i] * ~((x < 0.0) | (y < 0.0) | (x > right) | (y > bottom))
        part = correlation(grey[i, j], wanted.template[i], seen)
        zncc[i, j] = np.where(2.0 * seen.sum(axis=1) < wanted.weight[i].sum(axis=1), -1.0, part)
    zncc = zncc.reshape(n, k, h)
    zncc[nowhere] = -1.0
    return zncc


def _keep_best(
    found: epipolar_search.Candidates,
    rows: IntArray,
    points: FloatArray,
    s: FloatArray,
    centre: FloatArray,
    A: FloatArray,
    zncc: FloatArray,
) -> None:
    """Write the best position of each point and the second peak into `found`."""
    along = zncc.max(axis=2)
    for i, row in enumerate(rows):
        k = int(np.argmax(along[i]))
        if along[i, k] <= -1.0:
            continue
        h = int(np.argmax(zncc[i, k]))
        found.distance[row] = s[i, k]
        found.warp[row] = 0.0
        found.warp[row, :2] = centre[i, k] - points[i]
        found.warp[row, 2:6] = (A[i, k, h] - np.eye(2)).reshape(-1)
        left, right = _peak(along[i], k)
        crests = _refined_maxima(along[i])
        found.zncc[row] = crests[k]
        found.second_peak[row] = max(crests[:left].max(initial=-1.0), crests[right:].max(initial=-1.0))


def _refined_maxima(profile: FloatArray) -> FloatArray:
    """The profile. Its local maxima are replaced by the maximum of the parabola through them and their
    neighbours."""
    crests = profile.copy()
    before, here, after = profile[:-2], profile[1:-1], profile[2:]
    bend = 2.0 * here - before - after
    top = (here >= before) & (here >= after) & (bend > 0.0) & (np.minimum(before, after) > -1.0)
    rise = np.divide((after - before) ** 2, 8.0 * bend, out=np.zeros_like(here), where=top)
    crests[1:-1] = np.minimum(here + rise, 1.0)
    return crests


def _peak(profile: FloatArray, k: int) -> tuple[int, int]:
    """The slice of the profile that decreases from its peak at k on both sides."""
    left, right = k, k + 1
    while left > 0 and profile[left - 1] < profile[left]:
        left -= 1
    while right < len(profile) and profile[right] < profile[right - 1]:
        right += 1
    return left, right


def correlation(g: NDArray[np.float32], t: NDArray[np.float32], weight: NDArray[np.float32]) -> FloatArray:
    """Zero-normalised cross-correlation of g and t over the samples of weight 1, shape [...]; -1 if flat."""
    count = np.maximum(np.einsum("...m->...", weight), 1.0)

    def total(a: NDArray[np.float32], b: NDArray[np.float32]) -> FloatArray:
        return np.asarray(np.einsum("...m,...m->...", a, b), dtype=np.float64)

    tw = t * weight
    gw = g * weight
    sg, st = total(g, weight), total(t, weight)
    gg, tt = total(g, gw), total(t, tw)
    vg, vt = gg - sg * sg / count, tt - st * st / count
    flat = (vg <= 1e-6 * gg) | (vt <= 1e-6 * tt)
    norm = np.sqrt(np.where(flat, 1.0, vg * vt))
    return np.asarray(np.where(flat, -1.0, (total(g, tw) - sg * st / count) / norm))
