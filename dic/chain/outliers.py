"""Removal of outliers from the tracked specimen: changed patches, false matches, rough points, ends.

A gate changes the body in place and returns it, because its arrays are the largest of a measurement. A
highlight, lost paint or a shadow causes a residual far above the noise. The largest residual along a point's
references (`dic.tracking.Track.excess`) is compared with that of better points in the same frame. Some points
have rolled onto a platen, or a platen's rim hides them from a camera. They are removed by their position.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy import ndimage

from dic.basics import BoolArray, FloatArray, IntArray
from dic.bodies.axial_displacement import AxialDisplacement
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.chain.inputs import Inputs
from dic.chain.test_frame import RestState
from dic.correlation.subsets import neighbour_warp
from dic.outcome import PointOutcome
from dic.processes import parts, run_parallel
from dic.stereo.reconstruction import GATE, end_points, narrow_gates, reconstruct
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.surface_history import static_mean
from dic.tracking import Track

MARGIN = 0.5
"""Distance that a subset keeps from the ends: about the width of an edge in a picture [px]."""
SMALL = 1e-5
"""Distance of the two points from which a picture's scale is computed [m]."""
AT_ONCE = 50_000
"""Number of points times frames in one call. If there are few points, a call processes many frames."""
SLACK = 0.8
"""Smallest scale of a picture on the specimen, relative to the scale at one point [-]."""


def past_the_ends(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    subset: int,
    direction: tuple[float, float],
    ends: tuple[FloatArray, FloatArray],
    *,
    platen: float | None = None,
) -> BoolArray:
    """Valid points whose subset reaches past an end: a camera cannot see a part of it.

    The masked subset extends a known number of pixels from its point toward either end in the material
    picture. The point's warp deforms this extent. It must then fit between the point and the end in each
    camera's picture. If the platen's rim hides the end, the rim is used instead of the end.
    """
    r = body.reconstruction
    toward = np.asarray(direction) / np.linalg.norm(direction)
    position = frame.positions(r.position)
    valid = r.outcome == PointOutcome.VALID
    past = np.zeros(valid.shape, dtype=bool)
    step = max(1, AT_ONCE // max(len(body.points), 1))
    parts = [slice(first, first + step) for first in range(0, len(valid), step)]
    for side, end in zip((-1.0, 1.0), ends, strict=True):
        reach = _reach(body, side * toward, subset // 2)
        for camera, track, pixels in zip(rig.cameras, body.tracks, r.pixels, strict=True):
            along, scale = axis_in_picture(camera, frame, position[valid])
            hidden = 0.0 if platen is None else platen * _steepest(camera, frame, side, end)
            for part in parts:
                defined = valid[part] & np.isfinite(end[part, None])
                with np.errstate(invalid="ignore"):  # no point
                    before = side * (end[part, None] - position[part, :, 1])
                    near = defined & (before < 2.0 * subset / (SLACK * scale) + hidden)
                k, rows = np.nonzero(near)
                k += part.start
                room = visible_room(
                    camera, frame, position[k, rows], pixels[k, rows], end[k], side * along, platen
                )
                extent = _extent(track, k, rows, side * reach[rows, None] * toward)
                past[k, rows] |= extent @ (side * along) > room - MARGIN
    return past


def visible_room(
    camera: Camera,
    frame: SpecimenFrame,
    places: FloatArray,
    pixels: FloatArray,
    end: FloatArray | float,
    outward: FloatArray,
    platen: float | None,
) -> FloatArray:
    """Distance in a picture from points to the visible end of the specimen [px], shape [n].

    The end is taken at the point's distance from the axis. The rim lies in the plane of the end. Its point is
    on the camera's side, in the plane through the point, the camera and the direction of the axis. The rim
    does not hide points at the same or a larger distance from the axis.
    """
    y = np.full(len(places), end)
    at_end = np.column_stack([places[:, 0], y, places[:, 2]])
    room = (camera.project(frame.in_rig(at_end)) - pixels) @ outward
    if platen is None:
        return np.asarray(room)
    eye = frame.positions(camera.centre)
    start, way = eye[[0, 2]], places[:, [0, 2]] - eye[[0, 2]]
    a, b, c = (way**2).sum(axis=1), way @ start, start @ start - platen**2
    share = (-b - np.sqrt(np.maximum(b**2 - a * c, 0.0))) / a
    before = (b**2 > a * c) & (share < 1.0)
    rim = start + share[:, None] * way
    on_rim = np.column_stack([rim[:, 0], y, rim[:, 1]])[before]
    room[before] = np.minimum(room[before], (camera.project(frame.in_rig(on_rim)) - pixels[before]) @ outward)
    return np.asarray(room)


def axis_in_picture(camera: Camera, frame: SpecimenFrame, places: FloatArray) -> tuple[FloatArray, float]:
    """Direction of the axis toward the flyer in a picture, a unit vector [2], and scale along it [px/m]."""
    if not len(places):
        return np.array([0.0, -1.0]), 1.0
    step = np.array([0.0, SMALL, 0.0])
    middle = places.mean(axis=0)
    pixels = camera.project(frame.in_rig(np.array([middle - step, middle + step])))
    way = pixels[1] - pixels[0]
    size = float(np.linalg.norm(way))
    return np.asarray(way / size), size / (2.0 * SMALL)


def _steepest(camera: Camera, frame: SpecimenFrame, side: float, end: FloatArray) -> float:
    """Largest slope of the rays relative to the plane of an end, away from the specimen; at least 0."""
    x, y, z = frame.positions(camera.centre)
    return float(np.max(np.nan_to_num(side * (y - end)), initial=0.0) / np.hypot(x, z))


def _extent(track: Track, k: IntArray, rows: IntArray, step: FloatArray) -> FloatArray:
    """Steps in the material picture from the points `rows`, mapped to pictures `k` [px], shape [n, 2]."""
    warp = track.warp[k, rows]
    return np.asarray(step + neighbour_warp(warp, step)[:, :2] - warp[:, :2])


def _reach(body: TrackedBody, step: FloatArray, half: int) -> FloatArray:
    """Distance that each subset's mask reaches from its point along `step` [px], shape [n_points]."""
    rows, columns = body.mask.shape
    reach = np.full(len(body.points), 0.5)
    inside = np.ones(len(body.points), dtype=bool)
    for k in range(1, half + 1):
        x, y = np.round(body.points + k * step).astype(int).T
        in_picture = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        inside &= in_picture
        inside[inside] = body.mask[y[inside], x[inside]]
        reach[inside] = k + 0.5
    return reach


REACH = 2
"""Neighbours are points up to this many cells away."""
SIGMAS = 5.0
"""Allowed distance from the surface through the neighbours due to noise, in standard deviations [-]."""
BENDING = 0.035
"""Further allowance for the curvature of the surface between the points, over their spacing [-]."""
FEWEST_CONFIRMING = 2
"""Smallest number of neighbours of a valid point. A point with fewer neighbours is removed."""
FEWEST = 4
"""Smallest number of neighbours for a check of a point against a plane."""
BENT = 10
"""Smallest number of neighbours for a check of a point against a quadratic surface."""
ROUNDS = 12


def spacing(position: FloatArray, cell: IntArray) -> float:
    """Median distance of adjacent points of the grid [m]; NaN if no two adjacent points are known.

    ``position``: positions [m], shape [n_points, 3]; NaN where not known. ``cell``: column and row of each
    point in the grid, shape [n_points, 2].
    """
    near, offset = _neighbours(cell)
    adjacent = (near >= 0) & (np.abs(offset).sum(axis=-1) == 1.0)
    apart = np.linalg.norm(position[near] - position[:, None], axis=-1)[adjacent]
    apart = apart[np.isfinite(apart)]
    return float(np.median(apart)) if apart.size else float("nan")


def off_surface(
    position: FloatArray, sigma: FloatArray, valid: BoolArray, cell: IntArray, *, distance: float
) -> BoolArray:
    """Valid points that lie off the smooth surface through their neighbours.

    In every frame a polynomial in the grid's columns and rows is fitted to the positions of a point's
    neighbours, without the point itself. The worst point of a neighbourhood is removed first, and all points
    are checked again without it. One false match therefore does not reject the points around it. A point with
    fewer than two neighbours is removed too. A point with two or three neighbours is not checked.
    """
    if not distance > 0.0:
        raise ValueError(f"distance must be a positive length [m], got {distance}")
    near, offset = _neighbours(cell)
    terms = _terms(offset)
    bending = BENDING * distance

    def of(frames: range) -> BoolArray:
        off = np.zeros((len(frames), len(cell)), dtype=bool)
        for k, frame in enumerate(frames):
            remaining = valid[frame].copy()
            for _ in range(ROUNDS):
                score = _scores(position[frame], sigma[frame], remaining, near, terms, bending)
                around = np.where(near >= 0, score[near], 0.0).max(axis=1, initial=0.0)
                worst = remaining & (score > 1.0) & (score >= around)
                if not worst.any():
                    break
                remaining &= ~worst
            off[k] = valid[frame] & ~remaining
        return off

    processes, off = parts(), np.zeros(valid.shape, dtype=bool)
    works = [partial(of, range(part, len(position), processes)) for part in range(processes)]
    for part, outliers in enumerate(run_parallel(works, processes=processes)):
        off[part::processes] = outliers
    return off


def _neighbours(cell: IntArray) -> tuple[IntArray, FloatArray]:
    """Points around each point (-1: none) and their offsets [cells], shapes [n, m] and [n, m, 2]."""
    low = cell.min(axis=0) - REACH
    table = np.full(tuple(cell.max(axis=0) - low + REACH + 1), -1, dtype=np.int64)
    table[tuple((cell - low).T)] = np.arange(len(cell))
    steps = [(i, j) for i in range(-REACH, REACH + 1) for j in range(-REACH, REACH + 1) if (i, j) != (0, 0)]
    at = (cell - low)[:, None] + np.array(steps)
    near = table[at[..., 0], at[..., 1]]
    return near, np.broadcast_to(np.array(steps, dtype=np.float64), (*near.shape, 2))


def _terms(offset: FloatArray) -> FloatArray:
    """Constant, linear and quadratic terms of offsets, shape [..., 6]."""
    i, j = offset[..., 0], offset[..., 1]
    return np.stack([np.ones_like(i), i, j, i * i, i * j, j * j], axis=-1)


def _scores(
    position: FloatArray,
    sigma: FloatArray,
    remaining: BoolArray,
    near: IntArray,
    terms: FloatArray,
    bending: float,
) -> FloatArray:
    """Distance from the surface through the neighbours over the allowed distance [-], shape [n_points]."""
    used = (near >= 0) & remaining[near] & remaining[:, None]
    count = used.sum(axis=1)
    score = np.zeros(len(position))
    score[remaining & (count < FEWEST_CONFIRMING)] = 2.0
    for order, chosen in (
        (6, np.flatnonzero(count >= BENT)),
        (3, np.flatnonzero((count >= FEWEST) & (count < BENT))),
    ):
        if not chosen.size:
            continue
        A = np.where(used[chosen, :, None], terms[chosen, :, :order], 0.0)
        around = near[chosen]
        x = np.where(used[chosen, :, None], position[around], 0.0)
        noise = np.where(used[chosen, :, None], sigma[around], 0.0)
        ridge = 1e-9 * np.eye(order)  # neighbours on one line determine no plane: its variance is then large
        # the surface's height at the point itself: the constant term of the fit
        constant = np.eye(order)[:, :1]
        weights = (A @ np.linalg.solve(np.swapaxes(A, 1, 2) @ A + ridge, constant))[..., 0]
        spread = np.sqrt(np.einsum("nm,nmk->nk", weights**2, noise**2))
        expected = np.einsum("nm,nmk->nk", weights, x)
        # An extrapolation also magnifies the curvature between the points.
        bent = bending * np.maximum(1.0, np.sum(np.abs(weights), axis=1))[:, None]
        allowed = bent + SIGMAS * np.hypot(spread, sigma[chosen])
        score[chosen] = np.max(np.abs(position[chosen] - expected) / allowed, axis=1)
    return score


SEED = 10.0
"""Smallest residual of a false match, relative to that of the frame's better points [-]."""
TOUCHED = 1.5
"""Smallest residual of other points of the same patch, relative to that of the frame's better points [-]."""
BETTER = 25.0
"""Percentile of the frame's residuals that represents the better points [%]."""
TOUCH_REACH = 2
"""Points of a patch lie within this many cells of each other."""


def unlike_points(excess: FloatArray, valid: BoolArray, cell: IntArray) -> BoolArray:
    """Valid points of patches whose residual is larger than noise can cause.

    A patch contains a point with `SEED` times the residual of the frame's better points, and all adjoining
    points with `TOUCHED` times that residual. The limits were chosen on one random population and tested on
    another (verification page of the tracking).
    """
    low = cell.min(axis=0)
    shape = tuple((cell.max(axis=0) - low + 1).tolist())
    at = tuple((cell - low).T)
    around = np.ones((2 * TOUCH_REACH + 1, 2 * TOUCH_REACH + 1), dtype=bool)
    unlike = np.zeros(valid.shape, dtype=bool)
    for frame in range(len(valid)):
        judged = valid[frame] & np.isfinite(excess[frame])
        if not judged.any():
            continue
        residual = np.where(judged, 1.0 + excess[frame], 0.0)
        level = residual / np.percentile(residual[judged], BETTER)
        if not (level > SEED).any():
            continue
        seeds, touched = np.zeros((2, *shape), dtype=bool)
        seeds[at], touched[at] = level > SEED, level > TOUCHED
        patch = ndimage.binary_propagation(seeds, structure=around, mask=touched)
        unlike[frame] = patch[at] & judged
    return unlike


LEAST_GATE = 0.1
"""Smallest gate for epipolar distances [px]."""
GATE_SIGMAS = 6.0
"""The gate, in standard deviations of the epipolar distances in the static frames."""
OWN_SIGMAS = 4.0
"""The gate, in standard deviations of the point's epipolar distance."""


def gate_residual(body: TrackedBody) -> TrackedBody:
    """Remove patches of points that no longer resemble their reference, in either camera.

    Points that another gate has removed are not used and begin no patch. A subset that reaches past an end
    also has a large residual, but its neighbours may be correct.
    """
    valid = np.asarray(body.reconstruction.outcome == PointOutcome.VALID)
    unlike = np.zeros(valid.shape, dtype=bool)
    for track in body.tracks:
        if track.excess is not None:
            unlike |= unlike_points(track.excess, valid, body.cell)
    return _without(body, unlike, PointOutcome.LOW_CORRELATION)


def gate_epipolar(inputs: Inputs, body: TrackedBody, rest_state: RestState) -> TrackedBody:
    """Apply the epipolar gate derived from the specimen's static frames."""
    r, rest_frames = body.reconstruction, rest_state.frames
    at_rest = r.epipolar[rest_frames][r.outcome[rest_frames] == PointOutcome.VALID]
    gate = max(LEAST_GATE, GATE_SIGMAS * float(np.median(np.abs(at_rest))) / 0.6745)
    if gate <= GATE:  # the remaining points have passed that gate
        narrow_gates(r, gate=gate, gate_sigmas=OWN_SIGMAS)
        return body
    reconstruction = reconstruct(
        inputs.rig, *body.tracks, gate=gate, gate_sigmas=OWN_SIGMAS, common=body.common
    )
    return replace(body, reconstruction=reconstruction)


def gate_ends(
    inputs: Inputs, body: TrackedBody, rest_state: RestState, axial: AxialDisplacement | None
) -> TrackedBody:
    """Remove points whose subset, in either camera, reaches past an end or behind a platen's rim.

    The upper end follows from the declared length and the flyer's displacement. If one of them is missing,
    only the lower end is checked.
    """
    settings, t = inputs.settings, inputs.t
    upper = np.full(t.size, np.nan)
    if settings.length is not None and axial is not None and axial.t.size:
        upper = settings.length - np.interp(t, axial.t, axial.displacement)
    past = past_the_ends(
        body,
        inputs.rig,
        rest_state.placement.frame,
        settings.subset,
        settings.direction,
        (np.zeros(t.size), upper),
        platen=rest_state.platen,
    )
    return _without(body, past, PointOutcome.AT_END)


def gate_surface(body: TrackedBody, rest_state: RestState) -> TrackedBody:
    """Remove points that lie off the smooth surface through their neighbours."""
    r, placement = body.reconstruction, rest_state.placement
    variance = placement.frame.variances(r.covariance)
    # Relative to the cylinder, because a surface through a few neighbours does not follow its curvature.
    at_rest = placement.frame.positions(static_mean(r, rest_state.frames)[0])
    depth = np.sqrt(np.maximum(placement.radius**2 - at_rest[:, 0] ** 2, 0.0))
    cylinder = np.stack([at_rest[:, 0], at_rest[:, 1], depth], axis=1)
    distance = spacing(at_rest, body.cell)
    if not distance > 0.0:
        return body  # no adjacent points at rest: points cannot be checked
    off = off_surface(
        placement.frame.positions(r.position) - cylinder,
        np.sqrt(variance),
        np.asarray(r.outcome == PointOutcome.VALID) & np.isfinite(cylinder).all(axis=1),
        body.cell,
        distance=distance,
    )
    return _without(body, off, PointOutcome.OFF_SURFACE)


def _without(body: TrackedBody, points: BoolArray, outcome: PointOutcome) -> TrackedBody:
    """The body with an outcome set at some points and frames; its reconstruction is changed in place."""
    end_points(body.reconstruction, points, outcome)
    return body
