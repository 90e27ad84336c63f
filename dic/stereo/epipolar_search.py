"""Candidates for a stereo match: a pair of pictures, templates compared along the whole epipolar curve.

At every step of a point's epipolar curve the subset is deformed as a facet there would be seen, and
correlated (ZNCC). The best place is an initial guess; the ratio to the second peak says how unique it is. No
neighbour or earlier match is used. The part of a curve inside the picture follows from linear inequalities of
1/s, s the distance along the ray. A facet at X = C0 + s d with normal n is seen by camera 1 as ::

    A = s P B - s (P d) (qᵀ B),        B = ∂d/∂p,   P = ∂π1/∂X,   q = n / n·d

(Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 13.1, lens distortion included). The slope of
a surface shows only along the epipolar line P d; across it all surfaces look alike, which tests any match.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dic.basics import BoolArray, FloatArray, IntArray, cv2
from dic.camera import Camera, StereoRig
from dic.correlation import correlate
from dic.correlation import subsets as warps
from dic.correlation.kernels.curve import Curves
from dic.correlation.kernels.curve import search as search_kernel
from dic.correlation.subsets import Correlation, Match, PictureStack
from dic.outcome import PointOutcome
from dic.stereo.geometry import (
    directions,
    epipolar_distance,
    epipolar_sigma,
    midpoint,
    pixel_slope,
    projection_slope,
)


@dataclass(frozen=True, kw_only=True)
class StereoSearch:
    """Search for initial guesses."""

    distances: tuple[float, float] | None = None
    """Nearest and farthest distance of the specimen along camera 0's rays [m]; None: wherever the
    epipolar curves lie in camera 1's picture."""
    stretching_turns: tuple[float, ...] = (-50.0, -25.0, 0.0, 25.0, 50.0)
    """Turns of a small facet within the epipolar plane that are tried, from facing both cameras alike [°]."""
    shearing_turns: tuple[float, ...] = (-25.0, 0.0, 25.0)
    """Turns of it out of the epipolar plane [°]."""
    seeds: int = 40
    """Number of points, spread over all, that are looked for along their whole epipolar curve."""
    subset: int | None = None
    """Side of the subset for this search [px]; None: the match's, or 31 px if that is smaller."""
    least_zncc: float = 0.6
    """A seed needs this correlation at its best place."""
    distinct: float = 0.6
    """A seed's ZNSSD must be below this share of that of the second peak."""
    neighbours: int = 8
    """Number of nearest points that may pass on a guess."""
    attempts: int = 3
    """Number of neighbours' guesses that a point tries before it is given up."""

    @property
    def turns(self) -> NDArray[np.float64]:
        """All pairs of turns within and out of the epipolar plane [rad], shape [n, 2]."""
        return np.radians([(a, b) for a in self.stretching_turns for b in self.shearing_turns])

    def __post_init__(self) -> None:
        near, far = self.distances if self.distances is not None else (1.0, 2.0)
        turns = (*self.stretching_turns, *self.shearing_turns)
        enough = bool(self.stretching_turns) and bool(self.shearing_turns)
        subset = 31 if self.subset is None else self.subset
        _check(
            ("distances", self.distances, 0.0 < near < far < np.inf, "two positive lengths [m], near < far"),
            (
                "turns",
                turns,
                enough and all(abs(turn) < 80.0 for turn in turns),
                "at least one of each, below 80°",
            ),
            ("seeds", self.seeds, self.seeds >= 1, "at least 1"),
            ("subset", self.subset, subset % 2 == 1 and 5 <= subset <= 201, "odd, from 5 to 201 px"),
            ("least_zncc", self.least_zncc, 0.0 <= self.least_zncc < 1.0, "from 0 to below 1"),
            ("distinct", self.distinct, 0.0 < self.distinct < 1.0, "between 0 and 1"),
            ("neighbours", self.neighbours, self.neighbours >= 1, "at least 1"),
            ("attempts", self.attempts, self.attempts >= 1, "at least 1"),
        )


@dataclass(frozen=True, kw_only=True)
class StereoGates:
    """Gates that a match must pass; each by itself, none knows another's number.

    Raises ValueError: a value outside its range; the message names it.
    """

    sigmas: float = 4.0
    """Standard deviations of the match that the distances below are widened by."""
    epipolar: float = 0.5
    """Greatest distance from the epipolar line for an exact match: what the calibration leaves [px]."""
    facet: float = 1.0
    """Greatest part of the subset's deformation that no piece of surface can cause, at its rim [px]."""
    back_match: float = 0.5
    """Greatest distance from the point to where its match is found back in camera 0 [px]."""
    neighbours: float = 0.5
    """Greatest distance from where the neighbours' warps put the point, median over them [px]."""
    distinct: float = 0.6
    """Greatest share of the second peak's ZNSSD, in both directions."""
    unseen: float = 0.15
    """Greatest share of the subset that a picture may miss: at a picture's rim the middle of a curved subset
    is extrapolated. What a mask leaves out does not count."""
    incidence: float = 75.0
    """Greatest angle between a ray and the surface's normal, for both cameras [°]."""

    def __post_init__(self) -> None:
        _check(
            ("sigmas", self.sigmas, 0.0 <= self.sigmas < np.inf, "finite, not negative"),
            ("epipolar", self.epipolar, self.epipolar > 0.0, "a positive distance [px]"),
            ("facet", self.facet, self.facet > 0.0, "a positive distance [px]"),
            ("back_match", self.back_match, self.back_match > 0.0, "a positive distance [px]"),
            ("neighbours", self.neighbours, self.neighbours > 0.0, "a positive distance [px]"),
            ("distinct", self.distinct, 0.0 < self.distinct <= 1.0, "above 0, at most 1"),
            ("unseen", self.unseen, 0.0 <= self.unseen < 1.0, "from 0 to below 1"),
            ("incidence", self.incidence, 0.0 < self.incidence <= 90.0, "above 0, at most 90°"),
        )


def _check(*checks: tuple[str, object, bool, str]) -> None:
    for name, value, fine, allowed in checks:
        if not fine:
            raise ValueError(f"{name} must be {allowed}, got {value}")


class FacetGeometry(NamedTuple):
    """Facets' places in space and how both cameras' pixels depend on them; arrays of shape [..., n, n]."""

    X: FloatArray
    """Places in the rig's frame [m], shape [..., 3]."""
    d: FloatArray
    """Unit vectors from camera 0 to them, shape [..., 3]."""
    B: FloatArray
    """Derivative of d by camera 0's pixel, up to multiples of d [1/px], shape [..., 3, 2]."""
    P: FloatArray
    """Derivative of camera 1's pixel by X [px/m], shape [..., 2, 3]."""


def facet_geometry(rig: StereoRig, pixels0: FloatArray, distance: FloatArray) -> FacetGeometry:
    """The geometry of facets seen by camera 0 at `pixels0` [px], `distance` [m] along its ray."""
    first, second = rig.cameras
    ideal = first.undistort(pixels0)
    v = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ first.rotation
    length = np.linalg.norm(v, axis=-1)
    B = first.rotation.T[:, :2] @ np.linalg.inv(pixel_slope(first, ideal)) / length[..., None, None]
    d = v / length[..., None]
    X = first.centre + np.asarray(distance)[..., None] * d
    return FacetGeometry(X, d, np.broadcast_to(B, (*X.shape[:-1], 3, 2)), projection_slope(second, X))


def normals(rig: StereoRig, X: FloatArray, turns: FloatArray) -> FloatArray:
    """Normals turned away from the one that faces both cameras alike.

    ``rig``: the cameras. ``X``: places of the facets in the rig's frame [m], shape [..., 3]. ``turns``:
    angles within the epipolar plane, where they stretch what one camera sees against the other, and out of
    it, where they shear it, shape [m, 2] [rad]. Returns: unit vectors toward the cameras, shape [..., m, 3].
    """
    to = [_unit(camera.centre - X) for camera in rig.cameras]
    middle = _unit(to[0] + to[1])
    axis = _unit(np.cross(to[0], to[1]))
    side = np.cross(axis, middle)
    within, out = np.asarray(turns)[:, :1], np.asarray(turns)[:, 1:]
    parts = ((middle, np.cos(within)), (side, np.sin(within)))
    level = sum(direction[..., None, :] * share for direction, share in parts)
    return np.asarray(level * np.cos(out) + axis[..., None, :] * np.sin(out))


def gradient(facet: FacetGeometry, distance: FloatArray, normal: FloatArray) -> FloatArray:
    """A: how camera 1's pixel of a facet changes with camera 0's [-], shape [..., 2, 2].

    ``facet``: the facets' geometry. ``distance``: along camera 0's rays [m], shape [...]. ``normal``: the
    facets' normals, shape [..., 3]; of any length, not across the ray.
    """
    q = normal / np.sum(normal * facet.d, axis=-1, keepdims=True)
    plane = facet.B - facet.d[..., :, None] * (q[..., None, :] @ facet.B)
    return np.asarray(np.asarray(distance)[..., None, None] * (facet.P @ plane))


class FacetFit(NamedTuple):
    """The facet that a measured gradient speaks of."""

    normal: FloatArray
    """Unit normal toward camera 0, shape [..., 3]."""
    incidence: tuple[FloatArray, FloatArray]
    """Angles between the normal and the rays of the two cameras [rad], each of shape [...]."""
    across: FloatArray
    """Misfit that no facet can explain: the part of the gradient across the epipolar line that is wrong [-],
    shape [...]."""


def fit_facet(rig: StereoRig, pixels0: FloatArray, distance: FloatArray, A: FloatArray) -> FacetFit:
    """The facet with the gradient `A` of camera 1's pixel by camera 0's, and how far it is from being one.

    ``rig``: the cameras. ``pixels0``: where camera 0 sees the facets [px], shape [n, 2]. ``distance``: along
    camera 0's rays [m], shape [n]. ``A``: measured gradients [-], shape [n, 2, 2].
    """
    facet = facet_geometry(rig, pixels0, distance)
    s = np.asarray(distance)[..., None]
    epipole = (facet.P @ facet.d[..., None])[..., 0]  # along the epipolar line [px/m]
    length = np.linalg.norm(epipole, axis=-1, keepdims=True)
    along = epipole / length
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    excess = s[..., None] * (facet.P @ facet.B) - A
    tilt = np.einsum("...i,...ij->...j", along, excess) / (s * length)  # qᵀ B
    wrong = np.linalg.norm(np.einsum("...i,...ij->...j", across, excess), axis=-1)
    # q: its component along d is 1, the others follow from qᵀ B, whose columns span the rest with d
    basis = np.concatenate([facet.B, facet.d[..., None]], axis=-1)
    q = np.linalg.solve(
        np.swapaxes(basis, -1, -2), np.concatenate([tilt, np.ones_like(s)], axis=-1)[..., None]
    )
    normal = -_unit(q[..., 0])
    to1 = _unit(rig.cameras[1].centre - facet.X)
    cosines = -np.sum(normal * facet.d, axis=-1), np.sum(normal * to1, axis=-1)
    angles = tuple(np.arccos(np.clip(cosine, -1.0, 1.0)) for cosine in cosines)
    return FacetFit(normal, (angles[0], angles[1]), wrong)


def distance_along(rig: StereoRig, pixels0: FloatArray, X: FloatArray) -> FloatArray:
    """Distance of points along camera 0's rays [m], shape [...]."""
    return np.asarray(np.sum((X - rig.cameras[0].centre) * directions(rig.cameras[0], pixels0), axis=-1))


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


MARGIN = 0.5
"""Distances found are widened on both sides by this share of their span in the search of second peaks ..."""
LEAST_SUBSETS_ALONG = 2.0
"""... and by at least this many subsets along the curve."""


@dataclass(frozen=True)
class Pair:
    """Inputs of one stereo match; every point has a place in camera 0."""

    rig: StereoRig
    pictures: tuple[NDArray[np.float32], NDArray[np.float32]]
    """Their grey values, each of shape [rows, columns]."""
    stacks: tuple[PictureStack, PictureStack]
    """The same, prepared."""
    points: FloatArray
    """Places in the material picture [px], shape [n, 2]."""
    reference: FloatArray
    """Warps to camera 0's picture, shape [n, 12]."""
    mask: BoolArray | None
    """Pixels of the material picture that belong to the specimen."""
    settings: Correlation
    """Of the match."""
    search: StereoSearch
    gates: StereoGates

    @property
    def places(self) -> FloatArray:
        """Places of the points in camera 0 [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def correlate(self, rows: IntArray, guess: FloatArray, **changed: object) -> Match:
        """Match the points of these rows from these guesses, with some of the settings changed."""
        return correlate(
            *self.stacks,
            self.points[rows],
            guess,
            replace(self.settings, **changed),  # type: ignore[arg-type]
            reference_warp=self.reference[rows],
            mask=self.mask,
        )

    def correlate_back(self, rows: IntArray, warp: FloatArray, guess: FloatArray, tolerance: float) -> Match:
        """Match camera 1's subsets at `warp` in camera 0; found are total warps again."""
        return correlate(
            *self.stacks[::-1],
            self.points[rows],
            guess,
            replace(self.settings, tolerance=max(tolerance, self.settings.tolerance)),
            reference_warp=warp,
            mask=self.mask,
        )

    def epipolar(self, rows: IntArray, match: Match) -> tuple[FloatArray, FloatArray]:
        """Epipolar distance and its sigma [px], shape [rows]; inf where the match is none."""
        distance, sigma = np.full(len(rows), np.inf), np.zeros(len(rows))
        some = match.outcome == PointOutcome.VALID
        pixels = self.places[rows][some], warps.apply(self.points[rows], match.warp)[some]
        distance[some] = epipolar_distance(self.rig, *pixels)
        sigma[some] = epipolar_sigma(self.rig, *pixels, np.zeros((2, 2)), match.covariance[some])
        return distance, sigma

    def distances(self, rows: IntArray, warp: FloatArray) -> FloatArray:
        """Of points matched by `warp`, along camera 0's rays [m], shape [rows]."""
        places0, places1 = self.places[rows], warps.apply(self.points[rows], warp)
        return distance_along(self.rig, places0, midpoint(self.rig, places0, places1))

    def around(self, rows: IntArray, warp: FloatArray) -> tuple[float, float]:
        """Nearest and farthest distance of matched points, with room for second peaks on either side [m]."""
        distance = self.distances(rows, warp)
        near, far = float(distance.min()), float(distance.max())
        facet = facet_geometry(self.rig, self.places[rows], distance)
        pace = np.median(np.linalg.norm(facet.P @ facet.d[..., None], axis=1))  # along the curve [px/m]
        margin = max(MARGIN * (far - near), LEAST_SUBSETS_ALONG * self.settings.subset / float(pace))
        return max(near - margin, near / 2.0), far + margin


Array = NDArray[np.floating[Any]]

SAMPLES = 12
"""A subset is sampled at about this many places each way, the picture smoothed to match."""
ROWS = 4_000
"""Subsets looked at in one go, to stay in the cache; OpenCV takes arrays of up to 32766 rows."""


@dataclass(frozen=True)
class Subsets:
    """Templates, one a row."""

    points: FloatArray
    """Places in the material picture [px], shape [n, 2]."""
    reference: FloatArray
    """Their warps to camera 0's picture, shape [n, 12]."""
    xi: FloatArray
    """Offsets of the samples within the subset [px], shape [m, 2]."""
    template: NDArray[np.float32]
    """Samples less their mean, over their norm; 0 outside mask and picture; shape [n, m]."""
    weight: NDArray[np.float32]
    """1 inside mask and picture, 0 outside, shape [n, m]."""
    stride: int
    """Distance between samples [px]."""

    @property
    def places(self) -> FloatArray:
        """Places of the points in camera 0 [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def take(self, rows: NDArray[np.int64]) -> "Subsets":
        """Some of them."""
        points, reference = self.points[rows], self.reference[rows]
        return Subsets(points, reference, self.xi, self.template[rows], self.weight[rows], self.stride)


def subsets(
    picture: NDArray[np.float32],
    points: FloatArray,
    reference: FloatArray,
    subset: int,
    mask: BoolArray | None,
) -> Subsets:
    """Templates of `subset` [px] about `points`; samples outside the mask of the material picture count 0."""
    stride = max(1, round(subset / SAMPLES))
    steps = np.arange(-(subset // 2), subset // 2 + 1, stride, dtype=np.float64)
    xi = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    everywhere = (len(points), len(xi), 2)
    base = np.broadcast_to(points[:, None], everywhere)
    at = warps.apply(base, reference[:, None], xi)
    grey = sample(smoothed(picture, stride), at[..., 0], at[..., 1])
    weight = inside_picture(at, (picture.shape[0], picture.shape[1])).astype(np.float32)
    if mask is not None:
        weight *= in_mask(base + xi, mask)
    total = np.maximum(weight.sum(axis=1, keepdims=True), 1.0)
    grey = (grey - np.sum(grey * weight, axis=1, keepdims=True) / total) * weight
    norm = np.linalg.norm(grey, axis=1, keepdims=True)
    template = np.divide(grey, norm, out=np.zeros_like(grey), where=norm > 0.0)
    return Subsets(points, reference, xi, template, weight, stride)


def inside_picture(places: FloatArray, shape: tuple[int, int]) -> BoolArray:
    """True where places [px] lie between a picture's outermost pixel centres, shape [...]; NaN does not."""
    return np.asarray(np.all((places >= 0.0) & (places <= (shape[1] - 1.0, shape[0] - 1.0)), axis=-1))


def in_mask(places: FloatArray, mask: BoolArray) -> BoolArray:
    """True where the pixels nearest to places [px] belong to the mask, shape [...]."""
    column, row = np.moveaxis(np.rint(places).astype(np.int64), -1, 0)
    inside = (column >= 0) & (row >= 0) & (column < mask.shape[1]) & (row < mask.shape[0])
    return np.asarray(inside & mask[np.where(inside, row, 0), np.where(inside, column, 0)])


def smoothed(picture: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """The picture less its mean (for single precision), averaged over `stride` pixels each way."""
    centred = np.asarray(picture - picture.mean(dtype=np.float64), dtype=np.float32)
    return centred if stride == 1 else np.asarray(cv2.blur(centred, (stride, stride)), dtype=np.float32)


def sample(picture: NDArray[np.float32], x: Array, y: Array) -> NDArray[np.float32]:
    """Grey values between pixels, bilinear, the edge continued, shape [n, m] as x and y."""
    grey = np.empty(x.shape, dtype=np.float32)
    for a in range(0, len(x), ROWS):
        column, row = (np.ascontiguousarray(k[a : a + ROWS], dtype=np.float32) for k in (x, y))
        grey[a : a + ROWS] = cv2.remap(
            picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return grey


BORDER = 33
"""Places on each side of a picture through which its border is followed."""
BOX_ENLARGEMENT = 0.02
"""What the box of ideal points is enlarged by, as a share of its size: the border bends between places."""


def visible_piece(
    rig: StereoRig, rays: FloatArray, shape1: tuple[int, int], limits: tuple[float, float]
) -> FloatArray:
    """Inverse distances along camera 0's rays between which camera 1's picture can show them [1/m]."""
    first, second = rig.cameras
    v = rays @ second.rotation.T
    e = second.rotation @ first.centre + second.translation
    low = np.full(len(rays), 1.0 / limits[1])
    high = np.full(len(rays), 1.0 / limits[0])
    sides = [(e[2], v[:, 2])]  # a q + b >= 0
    box = ideal_box(second, shape1)
    for axis, bounds in enumerate(() if box is None else box):
        for sign, bound in zip((1.0, -1.0), bounds, strict=True):
            sides.append((sign * (e[axis] - bound * e[2]), sign * (v[:, axis] - bound * v[:, 2])))
    for a, b in sides:
        if a > 0.0:
            low = np.maximum(low, -b / a)
        elif a < 0.0:
            high = np.minimum(high, -b / a)
        else:
            high = np.where(b < 0.0, low, high)
    visible = high > low
    least = np.where(visible, low, 1.0 / limits[1])
    return np.stack([least, np.where(visible, high, least)], axis=1)


def ideal_box(camera: Camera, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray] | None:
    """Least and largest x, and y, of the ideal points that a picture shows [-]."""
    along = np.linspace(0.0, 1.0, BORDER)
    ends = np.zeros(BORDER), np.ones(BORDER)
    border = np.concatenate([np.stack(p, axis=1) for end in ends for p in ((along, end), (end, along))])
    try:
        ideal = camera.undistort(border * (shape[1] - 1.0, shape[0] - 1.0))
    except ValueError:
        return None
    low, high = ideal.min(axis=0), ideal.max(axis=0)
    room = BOX_ENLARGEMENT * (high - low)
    return np.array([low[0] - room[0], high[0] + room[0]]), np.array([low[1] - room[1], high[1] + room[1]])


RANGE = 20.0
"""Nearest and farthest distance that a whole curve is walked through, over that of the crossing axes."""


def fold(camera: Camera) -> float:
    """Squared radius on the plane z = 1 at which a lens model begins to fold back [-]; inf if it does not.

    ``camera``: the camera; the radius is that where r (1 + k1 r² + k2 r⁴ + k3 r⁶) turns.
    """
    k1, k2, _, _, k3 = camera.distortion
    turning = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    real = (root.real for root in turning if abs(root.imag) < 1e-12 and root.real > 0.0)
    return float(min(real, default=np.inf))


class Candidates(NamedTuple):
    """The best place of each point on its epipolar curve, and how it compares with the others."""

    warp: FloatArray
    """Affine total warps to the best place, shape [n, 12]; NaN where the curve misses the picture."""
    zncc: FloatArray
    """Correlation there, shape [n]; -1 where the curve misses the picture."""
    second_peak: FloatArray
    """Largest correlation outside the best place's own peak, shape [n]; -1 if there is no other place."""
    distance: FloatArray
    """Of the best place along camera 0's ray [m], shape [n]."""


def search(
    rig: StereoRig,
    templates: Subsets,
    picture1: NDArray[np.float32],
    *,
    limits: tuple[float, float] | None,
    turns: FloatArray | None = None,
    gradients: FloatArray | None = None,
    device: str = "cpu",
    threads: int | None = None,
) -> Candidates:
    """The best place of each subset on its epipolar curve, and the second peak.

    ``picture1``: camera 1's picture, shape [rows, columns]. ``limits``: nearest and farthest distance along
    camera 0's rays [m]; None: the whole curve. ``turns``: turns of the facet that are tried at every place
    (`facet.normals`) [rad], shape [h, 2]. ``gradients``: instead of `turns`: the gradient of camera 1's pixel
    by camera 0's, one for each point, shape [n, 2, 2], the same all along its curve. ``threads``: CPU
    threads; None: all cores the process may use. A result does not depend on it. Returns: one row a point.
    """
    n, places = len(templates.points), templates.places
    if not n:
        empty = np.zeros(0)
        return Candidates(np.zeros((0, 12)), empty, empty, empty)
    meet = _axes_meet(rig)
    near, far = limits if limits is not None else (meet / RANGE, meet * RANGE)
    facet = facet_geometry(rig, places, np.ones(n))
    reference_gradient = np.eye(2) + templates.reference[:, 2:6].reshape(-1, 2, 2)
    slopes = np.zeros((n, 2, 2)) if gradients is None else np.asarray(gradients)
    piece = visible_piece(rig, facet.d, (picture1.shape[0], picture1.shape[1]), (near, far))
    angle = np.zeros((1, 2)) if turns is None or gradients is not None else np.asarray(turns)
    within, out = angle.T
    curves = Curves(
        camera=_numbers(rig),
        picture=np.ascontiguousarray(smoothed(picture1, templates.stride)),
        given=np.concatenate(
            [part.reshape(n, -1) for part in (facet.d, facet.B, reference_gradient, slopes, piece)], axis=1
        ),
        has_gradient=gradients is not None,
        turns=np.stack([np.cos(within), np.sin(within), np.cos(out), np.sin(out)], axis=1),
        step=float(templates.stride),
        xi=templates.xi,
        template=templates.template,
        weight=templates.weight,
    )
    output = search_kernel(curves, device, threads)
    nowhere = output[:, 6] <= -1.0
    warp = np.zeros((n, 12))
    warp[:, :2] = output[:, :2] - templates.points
    warp[:, 2:6] = output[:, 2:6] - np.eye(2).reshape(-1)
    warp[nowhere] = np.nan
    return Candidates(warp, output[:, 6], output[:, 7], np.where(nowhere, np.nan, output[:, 8]))


def _numbers(rig: StereoRig) -> FloatArray:
    """Camera 1 and camera 0's centre as the kernel reads them, shape [29]."""
    first, second = rig.cameras
    grid = [second.fx, second.fy, second.cx, second.cy, second.skew, *second.distortion, fold(second)]
    return np.concatenate(
        [second.rotation.reshape(-1), second.translation, grid, second.centre, first.centre]
    )


def _axes_meet(rig: StereoRig) -> float:
    """Distance before camera 0 at which the optical axes come nearest to each other [m]."""
    first, second = rig.cameras
    centres = np.array([[camera.cx, camera.cy] for camera in rig.cameras])
    meet = midpoint(rig, centres[0], centres[1])
    s = float(distance_along(rig, centres[0], meet))
    if not (np.isfinite(s) and s > 0.0):
        baseline = float(np.linalg.norm(second.centre - first.centre))
        s = 3.0 * baseline
    return s
