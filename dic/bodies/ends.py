"""Ends of a specimen: the edge of the speckled side in a picture, its place at rest, and subsets that reach
past an end as the side rolls."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtr

from dic.arrays import FloatArray
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.outcome import PointOutcome
from dic.surfaces import Cylinder, SpecimenFrame

FARTHEST = 2.0
"""Half width of the search for an edge about the declared place [px]."""
MODEL = 0.1
"""Standard deviation of an edge for speckle that is no quadratic and a band that hides it [px]."""
ROWS, COLUMNS = 5, 22
"""Half height and half width of the window [px]."""
WIDEST_BAND = 1.5
"""Widest strip between the side and what lies behind it, as a platen's face seen at a glance [px]."""


@dataclass(frozen=True)
class Edge:
    """An edge that was found."""

    offset: float
    """From the declared place toward the inside of the body [px]."""
    sigma: float
    """Its standard deviation: residual of the fit, and `MODEL` for what the model leaves out [px]."""


def find_edge(picture: FloatArray, place: tuple[float, float], inward: tuple[int, int]) -> Edge | None:
    """Refine the place of an edge between a speckled side and something even.

    Columns of pixels across the edge are fitted together: each has its own grey values inside, a quadratic of
    the distance from the edge; outside all share one, and so does a narrow band between. Edge and band are
    blurred alike, and the edge may be tilted. What a column shows inside differs from column to column, which
    tells the edge from the band.

    Parameters
    ----------
    picture
        Grey values, best the mean of static pictures, shape [rows, columns].
    place
        Where the edge is to a pixel or two (x, y) [px].
    inward
        Direction from it into the body, along a row or a column of the picture: (0, -1) is up.

    Returns
    -------
    Edge or None
        None if there is no such edge within two pixels, or the picture ends there.
    """
    window, ahead, across = _window(picture, place, inward)
    if window is None:
        return None

    def residual(p: FloatArray) -> FloatArray:
        edge, tilt, band, blur = p
        u = ahead[:, None] - (edge + tilt * across)[None]
        inside, rest = ndtr(-u / blur), ndtr((u - band) / blur)
        return _left_over(window, u, inside, 1.0 - inside - rest, rest)

    low, high = [-FARTHEST, -0.1, 0.0, 0.3], [FARTHEST, 0.1, WIDEST_BAND, 1.5]
    starts = [(edge, 0.0, band, 0.6) for edge in (-0.5, 0.5) for band in (0.3, 0.8)]
    fits = [
        least_squares(residual, start, bounds=(low, high), x_scale=(0.1, 0.01, 0.1, 0.1)) for start in starts
    ]
    best = min(fits, key=lambda fit: fit.cost)
    freedom = window.size - 3 * window.shape[1] - 6
    variance = 2.0 * best.cost / freedom * np.linalg.pinv(best.jac.T @ best.jac)[0, 0]
    contrast = float(np.std(window[: ROWS - 1] - np.median(window[-2:])))
    if abs(best.x[0]) > FARTHEST - 0.05 or np.sqrt(2.0 * best.cost / window.size) > 0.3 * contrast:
        return None
    # Rows count outward; inward is the other way.
    return Edge(offset=-float(best.x[0]), sigma=float(np.hypot(np.sqrt(variance), MODEL)))


def _left_over(
    window: FloatArray, u: FloatArray, inside: FloatArray, band: FloatArray, rest: FloatArray
) -> FloatArray:
    """Residual of the least-squares grey values: the columns' own first, then the two that all share."""
    depth = np.clip(u, -8.0, 0.0)
    own = np.stack([inside, inside * depth, inside * depth**2], axis=-1).swapaxes(0, 1)  # column, row, term
    shared = np.stack([band, rest], axis=-1).swapaxes(0, 1)
    grey = window.T[..., None]
    q, _ = np.linalg.qr(own)
    out = np.concatenate([shared, grey], axis=-1)
    out = out - q @ (q.swapaxes(1, 2) @ out)
    terms, left = out[..., :2].reshape(-1, 2), out[..., 2].reshape(-1)
    return np.asarray(left - terms @ np.linalg.lstsq(terms, left, rcond=None)[0])


def _window(
    picture: FloatArray, place: tuple[float, float], inward: tuple[int, int]
) -> tuple[FloatArray | None, FloatArray, FloatArray]:
    """Grey values with the body above, and their distances outward and across from the place [px]."""
    x, y = place
    turned = np.asarray(picture, dtype=np.float64)
    if inward[0]:
        turned, (x, y) = turned.T, (y, x)
    if inward[0] + inward[1] > 0:
        turned, y = turned[::-1], turned.shape[0] - 1 - y
    row, column = round(y), round(x)
    rows = np.arange(row - ROWS, min(row + ROWS + 1, turned.shape[0]))
    columns = np.arange(max(column - COLUMNS, 0), min(column + COLUMNS + 1, turned.shape[1]))
    if rows.size < 2 * ROWS or rows[0] < 0 or columns.size < COLUMNS:
        return None, np.empty(0), np.empty(0)
    return turned[np.ix_(rows, columns)], rows - y, columns - x


MARGIN = 0.5
"""Distance that a subset keeps from the ends: about the width of an edge in a picture [px]."""


DECLARED = 0.5
"""Standard deviation of a place that was read off a picture [px]."""


def refined_end(
    pictures: tuple[FloatArray, FloatArray],
    rig: StereoRig,
    cylinder: Cylinder,
    declared: FloatArray,
    direction: tuple[float, float],
) -> tuple[FloatArray, float, int]:
    """The end of a specimen at rest, from its edge in both cameras' pictures.

    Parameters
    ----------
    pictures
        Mean static pictures of both cameras.
    rig
        The cameras.
    cylinder
        The specimen at rest.
    declared
        Where its end is thought to be, a point on its surface in the rig's frame [m], shape [3].
    direction
        From there into the specimen in the pictures (right, down).

    Returns
    -------
    point : array
        The declared point moved along the axis [m], shape [3].
    sigma : float
        Its standard deviation along the axis [m].
    found : int
        Cameras in which the edge was found. If in none, the point is the declared one.
    """
    inward = (round(direction[0]), round(direction[1]))
    small = 1e-5 * cylinder.axis
    moves, sigmas, slopes = [], [], []
    for camera, picture in zip(rig.cameras, pictures, strict=True):
        place = camera.project(declared)
        slope = float((camera.project(declared + small) - place) @ np.asarray(direction)) / 1e-5  # px per m
        slopes.append(abs(slope))
        edge = find_edge(picture, (float(place[0]), float(place[1])), inward)
        if edge is not None:
            moves.append(edge.offset / slope)
            sigmas.append(edge.sigma / abs(slope))
    if not moves:
        return declared, DECLARED / slopes[0], 0
    apart = 0.5 * abs(moves[0] - moves[-1])
    sigma = float(np.hypot(np.mean(sigmas) / np.sqrt(len(sigmas)), apart))
    return declared + float(np.mean(moves)) * cylinder.axis, sigma, len(moves)


def past_the_ends(
    body: TrackedBody,
    camera: Camera,
    frame: SpecimenFrame,
    subset: int,
    direction: tuple[float, float],
    ends: tuple[FloatArray, FloatArray],
) -> NDArray[np.bool_]:
    """Valid points whose subset reaches past an end, so that part of it is no longer seen.

    The part of a subset that its mask holds reaches so many pixels from the point toward either end in the
    material picture. Deformed with the point's own warp it must fit between the point and that end; where
    side surface has rolled onto the platen, it does not. What such a subset matches is partly the platen,
    and it is pulled along.

    Parameters
    ----------
    body
        The specimen, followed.
    camera
        Camera 0.
    frame
        The test frame.
    subset
        Side of the subsets [px].
    direction
        From the transmission platen toward the flyer in camera 0's picture (right, down).
    ends
        y of the lower and the upper end in every frame [m], each of shape [n_frames]; NaN where not known.

    Returns
    -------
    array of bool
        Shape [n_frames, n_points].
    """
    r = body.reconstruction
    toward = np.asarray(direction) / np.linalg.norm(direction)
    warp = body.tracks[0].warp
    gradient = np.eye(2) + warp[..., 2:6].reshape(*warp.shape[:2], 2, 2)
    stretch = np.einsum("i,fpij,j->fp", toward, gradient, toward)
    position = frame.positions(r.position)
    valid = r.outcome == PointOutcome.VALID
    scale = _pixels_per_metre(camera, frame, position, toward)
    past = np.zeros(valid.shape, dtype=bool)
    for side, end in zip((-1.0, 1.0), ends, strict=True):
        reach = _reach(body, side * toward, subset // 2)
        room = side * (end[:, None] - position[..., 1]) * scale
        with np.errstate(invalid="ignore"):  # no end, or no point: nothing is past it
            past |= valid & (stretch * reach > room - MARGIN)
    return past


def _reach(body: TrackedBody, step: FloatArray, half: int) -> FloatArray:
    """Distance that each subset's mask reaches from its point along `step` [px], shape [n_points]."""
    rows, columns = body.mask.shape
    reach = np.full(len(body.points), 0.5)
    inside = np.ones(len(body.points), dtype=bool)
    for k in range(1, half + 1):
        x, y = np.round(body.points + k * step).astype(int).T
        here = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        inside &= here
        inside[inside] = body.mask[y[inside], x[inside]]
        reach[inside] = k + 0.5
    return reach


def _pixels_per_metre(
    camera: Camera, frame: SpecimenFrame, position: FloatArray, toward: FloatArray
) -> FloatArray:
    """Pixels along `toward` of a metre along y, at every point, shape [n_frames, n_points]."""
    small = 1e-5
    ahead = camera.project(frame.in_rig(position + np.array([0.0, small, 0.0])))
    return np.asarray((ahead - camera.project(frame.in_rig(position))) @ toward / small)
