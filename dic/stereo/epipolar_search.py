"""Candidates for a stereo match: templates of a pair of pictures, compared along whole epipolar curves.

At every step of a point's epipolar curve the subset is deformed like a facet at that distance, and correlated
(ZNCC). The best position is an initial guess. The ratio to the second peak measures its uniqueness. No
neighbour or earlier match is used. The part of a curve inside the picture follows from linear inequalities of
1/s; s is the distance along the ray. Camera 1 sees a facet at X = C0 + s d with normal n as ::

    A = s P B - s (P d) (qᵀ B),        B = ∂d/∂p,   P = ∂π1/∂X,   q = n / n·d

(Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 13.1, including lens distortion). The slope
of a surface affects A only along the epipolar line P d. Across this line A is the same for all surfaces. This
is a test of every match.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dic.basics import BoolArray, FloatArray, IntArray, check_fields, cv2
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
    """Nearest and farthest distance of the specimen along camera 0's rays [m]. None: the whole part of the
    epipolar curves in camera 1's picture."""
    stretching_turns: tuple[float, ...] = (-50.0, -25.0, 0.0, 25.0, 50.0)
    """Tried rotations of a facet within the epipolar plane [°]. They are relative to a facet that faces both
    cameras equally."""
    shearing_turns: tuple[float, ...] = (-25.0, 0.0, 25.0)
    """Tried rotations of the facet out of the epipolar plane [°]."""
    seeds: int = 40
    """Number of points that are searched along their whole epipolar curve. They are spread over all
    points."""
    subset: int | None = None
    """Side of the subset for this search [px]. None: that of the match, but at least 31 px."""
    least_zncc: float = 0.6
    """Smallest correlation of a seed at its best position."""
    distinct: float = 0.6
    """Largest ratio of a seed's ZNSSD to that of the second peak."""
    neighbours: int = 8
    """Number of nearest points that may give a guess to a point."""
    attempts: int = 3
    """Largest number of neighbours' guesses that a point tries."""

    @property
    def turns(self) -> NDArray[np.float64]:
        """All pairs of rotations within and out of the epipolar plane [rad], shape [n, 2]."""
        return np.radians([(a, b) for a in self.stretching_turns for b in self.shearing_turns])

    def __post_init__(self) -> None:
        near, far = self.distances if self.distances is not None else (1.0, 2.0)
        stretching, shearing = (
            (bool(turns) and all(abs(turn) < 80.0 for turn in turns), "at least one, below 80°")
            for turns in (self.stretching_turns, self.shearing_turns)
        )
        subset = 31 if self.subset is None else self.subset
        check_fields(
            self,
            distances=(0.0 < near < far < np.inf, "two positive lengths [m], near < far"),
            stretching_turns=stretching,
            shearing_turns=shearing,
            seeds=(self.seeds >= 1, "at least 1"),
            subset=(subset % 2 == 1 and 5 <= subset <= 201, "odd, from 5 to 201 px"),
            least_zncc=(0.0 <= self.least_zncc < 1.0, "from 0 to below 1"),
            distinct=(0.0 < self.distinct < 1.0, "between 0 and 1"),
            neighbours=(self.neighbours >= 1, "at least 1"),
            attempts=(self.attempts >= 1, "at least 1"),
        )


@dataclass(frozen=True, kw_only=True)
class StereoGates:
    """Gates that a match must pass; they are independent of each other.

    Raises ValueError if a value is outside its range; the message names it.
    """

    sigmas: float = 4.0
    """The distances below are increased by this number of standard deviations of the match."""
    epipolar: float = 0.5
    """Largest distance from the epipolar line for an exact match, due to calibration errors [px]."""
    facet: float = 1.0
    """Largest part of the subset's deformation that no surface can cause [px]. It is measured at the subset's
    border."""
    back_match: float = 0.5
    """Largest distance of the point from its back match in camera 0 [px]."""
    neighbours: float = 0.5
    """Largest distance from the position predicted by the neighbours' warps, median over them [px]."""
    distinct: float = 0.6
    """Largest ratio of the ZNSSD to that of the second peak, in both directions."""
    unseen: float = 0.15
    """Largest share of the subset outside a picture. At a picture's border the centre of a curved subset is
    extrapolated. Pixels outside the mask are not counted."""
    incidence: float = 75.0
    """Largest angle between a ray and the surface's normal, for both cameras [°]."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            sigmas=(0.0 <= self.sigmas < np.inf, "finite, not negative"),
            epipolar=(self.epipolar > 0.0, "a positive distance [px]"),
            facet=(self.facet > 0.0, "a positive distance [px]"),
            back_match=(self.back_match > 0.0, "a positive distance [px]"),
            neighbours=(self.neighbours > 0.0, "a positive distance [px]"),
            distinct=(0.0 < self.distinct <= 1.0, "above 0, at most 1"),
            unseen=(0.0 <= self.unseen < 1.0, "from 0 to below 1"),
            incidence=(0.0 < self.incidence <= 90.0, "above 0, at most 90°"),
        )


class FacetGeometry(NamedTuple):
    """Positions of facets in space and the derivatives of both cameras' pixels; arrays of shape [..., n,
    n]."""

    X: FloatArray
    """Positions in the rig's frame [m], shape [..., 3]."""
    d: FloatArray
    """Unit vectors from camera 0 to them, shape [..., 3]."""
    B: FloatArray
    """Derivative of d with respect to camera 0's pixel [1/px], shape [..., 3, 2]. Multiples of d are
    arbitrary."""
    P: FloatArray
    """Derivative of camera 1's pixel with respect to X [px/m], shape [..., 2, 3]."""


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
    """Normals rotated from the one that faces both cameras equally.

    ``X``: positions of the facets in the rig's frame [m], shape [..., 3]. ``turns``: angles within the
    epipolar plane and out of it [rad], shape [m, 2]. The first stretch one camera's view relative to the
    other; the second shear it. Returns: unit vectors toward the cameras, shape [..., m, 3].
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
    """A: derivative of camera 1's pixel of a facet by camera 0's [-], shape [..., 2, 2].

    ``facet``: the facets' geometry. ``distance``: along camera 0's rays [m], shape [...]. ``normal``: the
    facets' normals, shape [..., 3]. They may have any length and must not be perpendicular to the ray.
    """
    q = normal / np.sum(normal * facet.d, axis=-1, keepdims=True)
    plane = facet.B - facet.d[..., :, None] * (q[..., None, :] @ facet.B)
    return np.asarray(np.asarray(distance)[..., None, None] * (facet.P @ plane))


class FacetFit(NamedTuple):
    """The facet that fits a measured gradient."""

    normal: FloatArray
    """Unit normal toward camera 0, shape [..., 3]."""
    incidence: tuple[FloatArray, FloatArray]
    """Angles between the normal and the rays of the two cameras [rad], each of shape [...]."""
    across: FloatArray
    """Misfit that no facet can explain: the error of the gradient across the epipolar line [-], shape
    [...]."""


def fit_facet(rig: StereoRig, pixels0: FloatArray, distance: FloatArray, A: FloatArray) -> FacetFit:
    """The facet that fits the gradient `A` of camera 1's pixel by camera 0's, and its misfit.

    ``pixels0``: pixels of the facets in camera 0 [px], shape [n, 2]. ``distance``: along camera 0's rays [m],
    shape [n]. ``A``: measured gradients [-], shape [n, 2, 2].
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
    # q: its component along d is 1; qᵀ B gives the other two components
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
"""For the search of second peaks, the range of distances is extended on both sides by this share of its span
..."""
LEAST_SUBSETS_ALONG = 2.0
"""... and by at least this many subsets along the curve."""


@dataclass(frozen=True)
class Pair:
    """Inputs of one stereo match. Every point has a position in camera 0."""

    rig: StereoRig
    pictures: tuple[NDArray[np.float32], NDArray[np.float32]]
    """Grey values of the pictures, each of shape [rows, columns]."""
    stacks: tuple[PictureStack, PictureStack]
    """The prepared pictures."""
    points: FloatArray
    """Positions in the material picture [px], shape [n, 2]."""
    reference: FloatArray
    """Warps to camera 0's picture, shape [n, 12]."""
    mask: BoolArray | None
    """Pixels of the material picture that belong to the specimen."""
    settings: Correlation
    """Settings of the match."""
    search: StereoSearch
    gates: StereoGates

    @property
    def places(self) -> FloatArray:
        """Positions of the points in camera 0 [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def correlate(self, rows: IntArray, guess: FloatArray, **changed: object) -> Match:
        """Match the points of these rows from these guesses; ``changed``: settings to change."""
        return correlate(
            *self.stacks,
            self.points[rows],
            guess,
            replace(self.settings, **changed),  # type: ignore[arg-type]
            reference_warp=self.reference[rows],
            mask=self.mask,
        )

    def correlate_back(self, rows: IntArray, warp: FloatArray, guess: FloatArray, tolerance: float) -> Match:
        """Match camera 1's subsets at `warp` in camera 0; the results are total warps."""
        return correlate(
            *self.stacks[::-1],
            self.points[rows],
            guess,
            replace(self.settings, tolerance=max(tolerance, self.settings.tolerance)),
            reference_warp=warp,
            mask=self.mask,
        )

    def epipolar(self, rows: IntArray, match: Match) -> tuple[FloatArray, FloatArray]:
        """Epipolar distance and its sigma [px], shape [rows]; inf without a valid match."""
        distance, sigma = np.full(len(rows), np.inf), np.zeros(len(rows))
        some = match.outcome == PointOutcome.VALID
        pixels = self.places[rows][some], warps.apply(self.points[rows], match.warp)[some]
        distance[some] = epipolar_distance(self.rig, *pixels)
        sigma[some] = epipolar_sigma(self.rig, *pixels, np.zeros((2, 2)), match.covariance[some])
        return distance, sigma

    def distances(self, rows: IntArray, warp: FloatArray) -> FloatArray:
        """Distances along camera 0's rays of points matched by `warp` [m], shape [rows]."""
        places0, places1 = self.places[rows], warps.apply(self.points[rows], warp)
        return distance_along(self.rig, places0, midpoint(self.rig, places0, places1))

    def around(self, rows: IntArray, warp: FloatArray) -> tuple[float, float]:
        """Smallest and largest distance of matched points, with a margin for second peaks on both sides
        [m]."""
        distance = self.distances(rows, warp)
        near, far = float(distance.min()), float(distance.max())
        facet = facet_geometry(self.rig, self.places[rows], distance)
        pace = np.median(np.linalg.norm(facet.P @ facet.d[..., None], axis=1))  # along the curve [px/m]
        margin = max(MARGIN * (far - near), LEAST_SUBSETS_ALONG * self.settings.subset / float(pace))
        return max(near - margin, near / 2.0), far + margin


Array = NDArray[np.floating[Any]]

SAMPLES = 12
"""Approximate number of samples of a subset in each direction. The picture is smoothed accordingly."""
ROWS = 4_000
"""Number of subsets that are processed at once. They fit into the cache. OpenCV accepts arrays of up to 32766
rows."""


@dataclass(frozen=True)
class Subsets:
    """Templates, one per row."""

    points: FloatArray
    """Positions in the material picture [px], shape [n, 2]."""
    reference: FloatArray
    """Their warps to camera 0's picture, shape [n, 12]."""
    xi: FloatArray
    """Offsets of the samples within the subset [px], shape [m, 2]."""
    template: NDArray[np.float32]
    """Samples minus their mean, divided by their norm; 0 outside mask and picture; shape [n, m]."""
    weight: NDArray[np.float32]
    """1 inside mask and picture, 0 outside, shape [n, m]."""
    stride: int
    """Distance between samples [px]."""

    @property
    def places(self) -> FloatArray:
        """Positions of the points in camera 0 [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def take(self, rows: NDArray[np.int64]) -> "Subsets":
        """The subsets of some rows."""
        points, reference = self.points[rows], self.reference[rows]
        return Subsets(points, reference, self.xi, self.template[rows], self.weight[rows], self.stride)


def subsets(
    picture: NDArray[np.float32],
    points: FloatArray,
    reference: FloatArray,
    subset: int,
    mask: BoolArray | None,
) -> Subsets:
    """Templates of side `subset` [px] around `points`; samples outside the mask of the material picture have
    weight 0."""
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
    """True where positions [px] lie between the outermost pixel centres of a picture, shape [...]. False for
    NaN."""
    return np.asarray(np.all((places >= 0.0) & (places <= (shape[1] - 1.0, shape[0] - 1.0)), axis=-1))


def in_mask(places: FloatArray, mask: BoolArray) -> BoolArray:
    """True where the pixels nearest to positions [px] belong to the mask, shape [...]."""
    column, row = np.moveaxis(np.rint(places).astype(np.int64), -1, 0)
    inside = (column >= 0) & (row >= 0) & (column < mask.shape[1]) & (row < mask.shape[0])
    return np.asarray(inside & mask[np.where(inside, row, 0), np.where(inside, column, 0)])


def smoothed(picture: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """The picture minus its mean (for single precision), averaged over `stride` pixels in each direction."""
    centred = np.asarray(picture - picture.mean(dtype=np.float64), dtype=np.float32)
    return centred if stride == 1 else np.asarray(cv2.blur(centred, (stride, stride)), dtype=np.float32)


def sample(picture: NDArray[np.float32], x: Array, y: Array) -> NDArray[np.float32]:
    """Bilinear interpolation of grey values, constant beyond the border, shape [n, m] like x and y."""
    grey = np.empty(x.shape, dtype=np.float32)
    for a in range(0, len(x), ROWS):
        column, row = (np.ascontiguousarray(k[a : a + ROWS], dtype=np.float32) for k in (x, y))
        grey[a : a + ROWS] = cv2.remap(
            picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return grey


BORDER = 33
"""Number of points on each side of a picture that represent its border."""
BOX_ENLARGEMENT = 0.02
"""Relative enlargement of the box of ideal points, because the border is curved between its points."""


def visible_piece(
    rig: StereoRig, rays: FloatArray, shape1: tuple[int, int], limits: tuple[float, float]
) -> FloatArray:
    """Range of inverse distances along camera 0's rays that camera 1's picture can show [1/m]."""
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
    """Smallest and largest x and y of the ideal points that a picture shows [-]."""
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
"""Limit of the searched distances of a whole curve, relative to the distance where the optical axes cross."""


def fold(camera: Camera) -> float:
    """Squared radius on the plane z = 1 up to which a lens model is unique [-]; inf without a limit.

    ``camera``: the camera. Beyond this radius r (1 + k1 r² + k2 r⁴ + k3 r⁶) decreases.
    """
    k1, k2, _, _, k3 = camera.distortion
    turning = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    real = (root.real for root in turning if abs(root.imag) < 1e-12 and root.real > 0.0)
    return float(min(real, default=np.inf))


class Candidates(NamedTuple):
    """The best position of each point on its epipolar curve, and its second peak."""

    warp: FloatArray
    """Affine total warps to the best position, shape [n, 12]; NaN where the curve misses the picture."""
    zncc: FloatArray
    """Correlation there, shape [n]; -1 where the curve misses the picture."""
    second_peak: FloatArray
    """Largest correlation outside the peak of the best position, shape [n]; -1 if there is no other peak."""
    distance: FloatArray
    """Distance of the best position along camera 0's ray [m], shape [n]."""


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
    """Find the best position of each subset on its epipolar curve, and the second peak.

    ``picture1``: camera 1's picture, shape [rows, columns]. ``limits``: smallest and largest distance along
    camera 0's rays [m]; None: the whole curve. ``turns``: rotations of the facet that are tried at every
    position (`normals`) [rad], shape [h, 2]. ``gradients``: used instead of `turns`. It is the gradient of
    camera 1's pixel by camera 0's for each point, shape [n, 2, 2], constant along the curve. ``threads``: CPU
    threads; None: all cores that the process may use. The result does not depend on it. Returns: one row per
    point.
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
    """Parameters of camera 1 and camera 0's centre for the kernel, shape [29]."""
    first, second = rig.cameras
    grid = [second.fx, second.fy, second.cx, second.cy, second.skew, *second.distortion, fold(second)]
    return np.concatenate(
        [second.rotation.reshape(-1), second.translation, grid, second.centre, first.centre]
    )


def _axes_meet(rig: StereoRig) -> float:
    """Distance in front of camera 0 at which the optical axes are closest to each other [m]."""
    first, second = rig.cameras
    centres = np.array([[camera.cx, camera.cy] for camera in rig.cameras])
    meet = midpoint(rig, centres[0], centres[1])
    s = float(distance_along(rig, centres[0], meet))
    if not (np.isfinite(s) and s > 0.0):
        baseline = float(np.linalg.norm(second.centre - first.centre))
        s = 3.0 * baseline
    return s
