"""Rest position of the flyer from its rim: before contact moves it, its face is the specimen's upper end.

The flyer is held still: every picture of it is sampled at the same places on its cylinder. Above the rim
these grey values are those of its speckles in all frames; below it the specimen passes. The standard
deviation over the frames rises at the rim from that of the noise to that of the specimen's speckles, as the
integral of the blur, which gives the rim to a few hundredths of a pixel from all frames together. Where the
rim stands above a camera, the face is seen at a glance between rim and specimen; that band is as wide as the
geometry says.

With the rim's place on the body, the specimen's declared length and its lower end, the translation at rest
follows without a picture that shows the flyer there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.special import ndtr

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.images import PictureError, Pictures
from dic.stereo.rays import pixels_per_length
from dic.surfaces import SpecimenFrame

MODEL = 0.05
"""Standard deviation of a rim for what the model leaves out: a shadow, a chamfer [px]."""
BAND_SHARE = 0.3
"""Standard deviation of the mean width of the face seen at a glance, as a share of it."""
MOST_FRAMES = 60
"""Frames at most that are compared."""
FEWEST_FRAMES = 8
"""Frames that must show the rim."""
WITHIN, BEYOND = 10, 16
"""Rows of the search about the region's end, toward the flyer and beyond [px]."""
FIT_WITHIN, FIT_BEYOND = 6, 4
"""Rows of the fit about the rim [px]."""
COLUMNS = 65
"""Places across the axis."""
CLEAR = 4.0
"""The specimen varies by so many times what the flyer does."""
LARGEST_SHARE = 0.002
"""Largest standard deviation of the upper end, as a share of the length: beyond it the cameras disagree on
the lower end, or the length was not measured."""
MOST_APART = 4.0
"""Largest disagreement of the cameras, in standard deviations."""
LARGEST_MISFIT = 0.1
"""Largest residual of the fit, as a share of the specimen's variation."""


@dataclass(frozen=True)
class Rim:
    """The rim of the flyer's face on the body."""

    y: float
    """Its place at translation zero, along the axis [m]."""
    sigma: float
    """Its standard deviation [m]."""
    cameras: int
    """Cameras that showed it."""


@dataclass(frozen=True)
class RestGeometry:
    """What is known of the specimen at rest."""

    length: float
    """Its length: the flyer's face stands at this y [m]."""
    length_sigma: float
    """Standard deviation of the length, and of the lower end's place [m]."""
    radius: float
    """Its radius [m]."""

    @property
    def known(self) -> bool:
        """True if the upper end is known well enough to stand for the flyer's place at rest."""
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

    Parameters
    ----------
    pictures
        Both series.
    body
        The flyer, followed; the rim is looked for beyond the end of its region.
    rig, frame
        The cameras and the test frame.
    places
        Its points at translation zero [m], shape [n_points, 3]; NaN where not known.
    moves
        Translations of the frames [m], shape [n_frames, 3]; NaN where not known.
    geometry
        The specimen, for the band between it and the rim.

    Returns
    -------
    Rim or None
        None if neither camera shows the rim clearly in `FEWEST_FRAMES` frames, or they disagree.
    """
    known = np.asarray(np.isfinite(places).all(axis=1))
    if known.sum() < 3:
        return None
    radius = float(np.median(np.hypot(places[known, 0], places[known, 2])))
    start = _end_of_region(body, places, known)
    x0, x1 = np.percentile(places[known, 0], (10.0, 90.0))
    x = np.linspace(x0, x1, COLUMNS)
    frames = np.flatnonzero(np.isfinite(moves).all(axis=1))
    frames = frames[:: max(-(-frames.size // MOST_FRAMES), 1)]
    found, sigmas = [], []
    for camera, series in zip(rig.cameras, pictures, strict=True):
        one = _rim_of(camera, series, frame, radius, x, start, frames, moves, geometry)
        if one is not None:
            found.append(one[0])
            sigmas.append(one[1])
    if not found:
        return None
    return joined(found, sigmas)


def joined(found: list[float], sigmas: list[float]) -> Rim | None:
    """The rim from one camera or both.

    Parameters
    ----------
    found
        Its place in each camera that showed it [m].
    sigmas
        Standard deviations of these [m].

    Returns
    -------
    Rim or None
        None if the cameras disagree by more than `MOST_APART` standard deviations: what one of them shows is
        then no rim, and which is not known.
    """
    apart = abs(found[0] - found[-1])
    if apart > MOST_APART * float(np.hypot(sigmas[0], sigmas[-1])):
        return None
    return Rim(
        y=float(np.mean(found)),
        sigma=float(np.hypot(np.sqrt(np.mean(np.square(sigmas)) / len(sigmas)), 0.5 * apart)),
        cameras=len(found),
    )


def _end_of_region(body: TrackedBody, places: FloatArray, known: BoolArray) -> float:
    """y on the body where its region ends toward the specimen [m]: the points' y continued to that pixel."""
    along = body.points[known] - body.points[known].mean(axis=0)
    slope, *_ = np.linalg.lstsq(np.column_stack([along, np.ones(len(along))]), places[known, 1], rcond=None)
    axis = int(np.argmax(np.abs(slope[:2])))
    line = Polynomial.fit(body.points[known, axis], places[known, 1], 1)
    rows = np.flatnonzero(body.mask.any(axis=axis))  # axis 0 is x: columns of the mask
    ends = line(np.array([rows[0], rows[-1]], dtype=np.float64))
    return float(ends.min())


def _rim_of(
    camera: Camera,
    pictures: Pictures,
    frame: SpecimenFrame,
    radius: float,
    x: FloatArray,
    start: float,
    frames: IntArray,
    moves: FloatArray,
    geometry: RestGeometry,
) -> tuple[float, float] | None:
    """The rim on the body in one camera [m], and its standard deviation [m]."""
    middle = np.array([np.median(x), start, radius]) + moves[frames[-1]]
    scale = float(np.linalg.norm(pixels_per_length(camera, frame.in_rig(middle), frame.rotation[1])))
    u = np.arange(-WITHIN, BEYOND + 1.0)
    for _ in range(2):  # about the region's end, then about what was found
        stack, shown = _held_still(camera, pictures, frame, radius, x, start - u / scale, frames, moves)
        if len(stack) < FEWEST_FRAMES:
            return None
        spread = np.sqrt(stack.var(axis=0).mean(axis=1))
        high = float(np.percentile(spread, 75))
        above = np.flatnonzero(spread > 0.5 * high)
        if above[0] < 2 or spread[: above[0] - 1].max() * CLEAR > high:
            return None
        if u[-1] == FIT_BEYOND:
            break
        start -= u[above[0]] / scale
        u = np.arange(-FIT_WITHIN, FIT_BEYOND + 1.0)
    bands = scale * np.array(
        [glance(frame.positions(camera.centre), start + moves[k, 1], radius, geometry) for k in shown]
    )
    fit = fit_rise(u, spread, bands)
    if fit is None:
        return None
    place, own = fit
    sigma = np.sqrt(own**2 + MODEL**2 + (BAND_SHARE * float(bands.mean())) ** 2)
    return start - place / scale, float(sigma) / scale


def _held_still(
    camera: Camera,
    pictures: Pictures,
    frame: SpecimenFrame,
    radius: float,
    x: FloatArray,
    y: FloatArray,
    frames: IntArray,
    moves: FloatArray,
) -> tuple[FloatArray, list[int]]:
    """Grey values at places of the body in the frames that show all of them, shape [n, y, x], and the
    frames."""
    Y, X = np.meshgrid(y, x, indexing="ij")
    places = np.stack([X, Y, np.sqrt(np.maximum(radius**2 - X**2, 0.0))], axis=-1)
    rows, columns = pictures.shape
    kept, shown = [], []
    for k in frames.tolist():
        at = camera.project(frame.in_rig((places + moves[k]).reshape(-1, 3))).T[::-1]
        if at.min() < 1.0 or at[0].max() > rows - 2.0 or at[1].max() > columns - 2.0:
            continue
        try:
            picture = pictures.frame(k).astype(np.float64)
        except PictureError:
            continue
        kept.append(ndimage.map_coordinates(picture, at, order=3).reshape(Y.shape))
        shown.append(k)
    stack = np.array(kept)
    if len(stack):
        level = stack[:, : WITHIN // 2].mean(axis=(1, 2), keepdims=True)  # light that flickers
        stack = stack * (level.mean() / np.where(level > 0.0, level, 1.0))
    return stack, shown


def glance(camera: FloatArray, y: float, radius: float, geometry: RestGeometry) -> float:
    """Width at which a camera sees the flyer's face between its rim and the specimen [m].

    Parameters
    ----------
    camera
        The camera's centre in the test frame [m], shape [3].
    y
        The face's place [m]. Above the camera's height it is seen; below, the rim hides the specimen's end.
    radius
        Of the flyer [m].
    geometry
        The specimen: its mean radius grows as its volume is kept.
    """
    specimen = geometry.radius * float(np.sqrt(geometry.length / max(y, 0.2 * geometry.length)))
    distance = float(np.hypot(camera[0], camera[2])) - radius
    return max(radius - specimen, 0.0) * max(y - float(camera[1]), 0.0) / distance


def fit_rise(u: FloatArray, spread: FloatArray, bands: FloatArray) -> tuple[float, float] | None:
    """Where a standard deviation over the frames begins to rise, and its own standard deviation [px].

    ``spread² = n² + V² <Φ((u - s - band)/b)²>``, the mean over the frames, V linear beyond the rim.

    Parameters
    ----------
    u
        Places, toward the specimen [px], shape [n].
    spread
        Standard deviations over the frames there [grey], shape [n].
    bands
        Widths of what never varies between rim and specimen [px], shape [n_frames].

    Returns
    -------
    tuple or None
        None if there is no such rise, or the fit does not describe it.
    """
    high, low = float(spread.max()), float(spread.min())

    def residual(p: FloatArray) -> FloatArray:
        place, blur, top, slope, noise = p
        share = np.mean(ndtr((u[:, None] - place - bands) / blur) ** 2, axis=1)
        rise = (top + slope * np.maximum(u - place, 0.0)) ** 2 * share
        return np.asarray((np.sqrt(noise**2 * high**2 + rise * high**2) - spread) / high)

    bound = ([u[1], 0.2, 0.2, -0.2, 0.0], [u[-2], 2.0, 2.0, 0.2, 0.5])
    fit = least_squares(residual, [0.0, 0.6, 0.9, 0.0, float(np.clip(low / high, 1e-3, 0.4))], bounds=bound)
    dof = u.size - 5
    misfit = float(np.sqrt(2.0 * fit.cost / dof))
    if misfit > LARGEST_MISFIT or not u[1] + 0.1 < fit.x[0] < u[-2] - 0.1:
        return None
    variance = misfit**2 * np.linalg.pinv(fit.jac.T @ fit.jac)[0, 0]
    return float(fit.x[0]), float(np.sqrt(variance))
