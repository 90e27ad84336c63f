"""Rest position of the flyer from its rim. Until the flyer moves, its face touches the specimen's upper end.

Every picture is sampled at the same positions on the flyer's cylinder. The paint then ends at the rim in all
frames of a camera (`dic.bodies.edge_fit`). The translation at rest follows from the rim's position on the
body, the specimen's declared length and its lower end. No picture needs to show the flyer at rest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from dic.basics import BoolArray, FloatArray, IntArray
from dic.bodies.edge_fit import HALF, fit_edge, in_view, sampled, strip_places
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.images import PictureError, Pictures
from dic.stereo.geometry import pixels_per_length
from dic.surfaces.cylinder import SpecimenFrame

MODEL = 0.12
"""Standard deviation of a rim due to effects that the model does not include [px]. Examples are printed dots
that end before the rim, a shadow, a chamfer and aliased rows. Sprayed drops reach the rim; for them it is
half as large."""
MOST_FRAMES = 24
"""Largest number of frames that are compared."""
FEWEST_FRAMES = 6
"""Smallest number of frames that must show the rim."""
SHARE = 0.4
"""Half width of the strip across the axis, over the specimen's radius [-]."""
FEWEST_COLUMNS = 16
"""Smallest number of columns of the strip that must be in view [px]."""
WITHIN, BEYOND = 16, 10
"""The specimen's side is searched in these rows around the region's end, toward the flyer and away from it
[px]."""
CLEAR = 4.0
"""Smallest ratio of the specimen's variation to that of the flyer."""
REACH = 1.0
"""Largest distance of the rim from its prediction [px]. The prediction uses the first varying row and the
band. Half of the band's change is added to the limit."""
VARIES = 5.0, 0.12
"""The variation of the first varying row is this multiple of that of the flyer's rows, and at least this
share of that of the specimen."""
LARGEST_SHARE = 0.0025
"""Largest standard deviation of the upper end over the length [-]. If it is larger, the cameras disagree on
the lower end, or the length was not measured."""


@dataclass(frozen=True)
class Rim:
    """The rim of the flyer's face on the body."""

    y: float
    """Its axial position at translation zero [m]."""
    sigma: float
    """Its standard deviation [m]."""
    cameras: int
    """Number of cameras that show it."""


@dataclass(frozen=True)
class RestGeometry:
    """Geometry of the specimen at rest."""

    length: float
    """Its length, which is the y of the flyer's face at rest [m]."""
    length_sigma: float
    """Standard deviation of the length, including that of the lower end's position [m]."""
    radius: float
    """Its radius [m]."""

    @property
    def length_is_certain(self) -> bool:
        """True if the upper end is known well enough to give the flyer's position at rest."""
        return self.length_sigma <= LARGEST_SHARE * self.length


def find_rim(
    pictures: tuple[Pictures, Pictures],
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    places: FloatArray,
    moves: FloatArray,
    geometry: RestGeometry,
) -> Rim | None:
    """Find the rim of the flyer's face in all frames that show it.

    ``body``: the tracked flyer; the rim is searched beyond the end of its region. ``places``: its points at
    translation zero [m], shape [n_points, 3]; NaN where not known. ``moves``: translations of the frames [m],
    shape [n_frames, 3]; NaN where not known. ``geometry``: the specimen, for the band between it and the rim.
    Returns: None if neither camera shows the rim clearly in `FEWEST_FRAMES` frames.
    """
    finite = np.asarray(np.isfinite(places).all(axis=1))
    if finite.sum() < 3:
        return None
    radius = float(np.median(np.hypot(places[finite, 0], places[finite, 2])))
    start = _end_of_region(body, places, finite)
    frames = np.flatnonzero(np.isfinite(moves).all(axis=1))
    frames = frames[:: max(-(-frames.size // MOST_FRAMES), 1)]
    ends, sigmas = [], []
    for camera, series in zip(rig.cameras, pictures, strict=True):
        one = _rim_of(camera, series, frame, radius, start, frames, moves, geometry)
        if one is not None:
            ends.append(one[0])
            sigmas.append(one[1])
    if not ends:
        return None
    return combine_rims(ends, sigmas)


def combine_rims(ends: list[float], sigmas: list[float]) -> Rim:
    """The rim from one camera or both.

    Both cameras see the same paint at the same rim, so the model error does not average out. If they
    disagree, one of them may show no rim, and it is unknown which one. Half of their difference is therefore
    added to the standard deviation. Each position is then within one standard deviation of the mean. If the
    difference is too large (`RestGeometry.length_is_certain`), the rim is not used as the zero of
    displacements.
    """
    apart = abs(ends[0] - ends[-1])
    return Rim(
        y=float(np.mean(ends)),
        sigma=float(np.hypot(np.sqrt(np.mean(np.square(sigmas))), 0.5 * apart)),
        cameras=len(ends),
    )


def _end_of_region(body: TrackedBody, places: FloatArray, finite: BoolArray) -> float:
    """y on the body at the end of its region toward the specimen [m]. The y of the points is extrapolated to
    this end."""
    along = body.points[finite] - body.points[finite].mean(axis=0)
    slope, *_ = np.linalg.lstsq(np.column_stack([along, np.ones(len(along))]), places[finite, 1], rcond=None)
    axis = int(np.argmax(np.abs(slope[:2])))
    line = Polynomial.fit(body.points[finite, axis], places[finite, 1], 1)
    rows = np.flatnonzero(body.mask.any(axis=axis))  # axis 0 is x, the columns of the mask
    ends = line(np.array([rows[0], rows[-1]], dtype=np.float64))
    return float(ends.min())


def _rim_of(
    camera: Camera,
    pictures: Pictures,
    frame: SpecimenFrame,
    radius: float,
    start: float,
    frames: IntArray,
    moves: FloatArray,
    geometry: RestGeometry,
) -> tuple[float, float] | None:
    """The rim on the body in one camera [m], and its standard deviation [m]."""
    middle = np.array([0.0, start, radius]) + moves[frames[-1]]
    scale = float(np.linalg.norm(pixels_per_length(camera, frame.in_rig(middle), frame.rotation[1])))
    half = SHARE * geometry.radius
    x = np.arange(-half, half, 1.0 / scale)
    u = np.arange(-WITHIN, BEYOND + 1.0)
    strips, usable = _stabilised_strip(camera, pictures, frame, radius, x, start - u / scale, frames, moves)
    if len(strips) < FEWEST_FRAMES:
        return None
    spread = np.sqrt(strips.var(axis=0).mean(axis=1))
    high = float(np.percentile(spread, 75))
    above = np.flatnonzero(spread > 0.5 * high)
    if not above.size or above[0] < 2 or float(np.median(spread[: above[0] - 1])) * CLEAR > high:
        return None
    centre = frame.positions(camera.centre)
    bands = scale * np.array([face_width(centre, start + moves[k, 1], radius, geometry) for k in usable])
    nearest = float(bands[:, 1].min())  # nearest position of the specimen's side
    start -= (u[first_varying(spread, int(above[0]), high)] - nearest) / scale
    u = np.arange(-HALF, HALF + 1.0)
    strips, usable = _stabilised_strip(camera, pictures, frame, radius, x, start - u / scale, frames, moves)
    if len(strips) < FEWEST_FRAMES:
        return None
    bands = scale * np.array([face_width(centre, start + moves[k, 1], radius, geometry) for k in usable])
    reach = REACH + 0.5 * float(bands[:, 0].max() - bands[:, 1].min())
    fit = fit_edge(strips, u, np.stack([bands[:, 1], bands[:, 0] - bands[:, 1]]), reach=reach, sure=True)
    if fit is None:
        return None
    return start - fit.place / scale, float(np.hypot(fit.sigma, MODEL)) / scale


def first_varying(spread: FloatArray, above: int, high: float) -> int:
    """First row that the specimen's side reaches."""
    low = float(np.median(spread[: max(above - 3, 1)]))
    return int(np.argmax(spread > max(VARIES[0] * low, VARIES[1] * high)))


def _stabilised_strip(
    camera: Camera,
    pictures: Pictures,
    frame: SpecimenFrame,
    radius: float,
    x: FloatArray,
    y: FloatArray,
    frames: IntArray,
    moves: FloatArray,
) -> tuple[FloatArray, list[int]]:
    """Grey values at positions on the body, shape [n, y, x], and their frames. Only frames that show all
    positions are used. Positions outside the view in the last frame are left out."""
    places = strip_places(x, y, radius)
    columns = in_view(camera, pictures.shape, frame, places + moves[frames[-1]]).all(axis=0)
    if columns.sum() < FEWEST_COLUMNS:
        return np.empty((0, y.size, 0)), []
    places = places[:, columns]
    strips, usable = [], []
    for k in frames.tolist():
        if not in_view(camera, pictures.shape, frame, places + moves[k]).all():
            continue
        try:
            picture = pictures.frame(k).astype(np.float64)
        except PictureError:
            continue
        strips.append(sampled(camera, picture, frame, places + moves[k]))
        usable.append(k)
    stack = np.array(strips)
    if len(stack):
        level = stack[:, :HALF].mean(axis=(1, 2), keepdims=True)  # the light may flicker
        stack = stack * (level.mean() / np.where(level > 0.0, level, 1.0))
    return stack, usable


def face_width(camera: FloatArray, y: float, radius: float, geometry: RestGeometry) -> tuple[float, float]:
    """Width at which a camera sees the flyer's face between its rim and the specimen [m].

    ``camera``: the camera's centre in the test frame [m], shape [3]. ``y``: the face's position [m]. If the
    face is above the camera, it is visible. If it is below, the rim hides the specimen's end. ``radius``: of
    the flyer [m]. ``geometry``: the specimen. Returns two widths: for the initial radius of the specimen at
    the face, and for its mean radius, which grows at constant volume.
    """
    mean = geometry.radius * float(np.sqrt(geometry.length / max(y, 0.2 * geometry.length)))
    distance = float(np.hypot(camera[0], camera[2])) - radius
    slope = max(y - float(camera[1]), 0.0) / distance
    return max(radius - geometry.radius, 0.0) * slope, max(radius - mean, 0.0) * slope
