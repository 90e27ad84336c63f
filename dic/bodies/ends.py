"""The place of a specimen's lower end at rest, from its edge in both cameras' pictures."""

from dataclasses import replace
from functools import partial

import numpy as np

from dic.arrays import FloatArray
from dic.bodies.edge_fit import HALF, fit_edge, in_view, sampled, strip_places
from dic.camera import Camera, StereoRig
from dic.forks import side_by_side
from dic.stereo.rays import pixels_per_length
from dic.surfaces import Cylinder, SpecimenFrame, on_cylinder, test_frame

MODEL = 0.06
"""Standard deviation of an edge for what the model leaves out [px]."""
PHASES = (0.0, 0.5)
"""Places of the strip that are tried [px]: what a fit is off by as its rows lie between those of the picture
has the period of a pixel."""
LEAST_GAP = 0.5
"""A gap in the paint before the edge that says nothing [px]."""
SHARE = 0.4
"""Half width of the strip across the axis in which an end is looked for, as a share of the radius."""
FEWEST_COLUMNS = 16
"""Columns of a strip that must be in view [px]."""
LEAST_BEYOND = 2.0
"""Rows beyond the end that must be in view [px]."""
REACH = 3.5
"""Largest distance of the end from the declared place [px]."""
RIM_SIGMA = 0.02
"""Standard deviation of the platen's radius, as a share of it, where the flyer's stands for it."""
OPEN_RIM = 0.25
"""Width of the platen's face beside the specimen as a share of the radius, and its standard deviation, where
no radius of a platen is known."""

DECLARED = 0.5
"""Standard deviation of a place that was read off a picture [px]."""


def refined_end(
    pictures: tuple[FloatArray, FloatArray],
    rig: StereoRig,
    cylinder: Cylinder,
    declared: tuple[float, float],
    direction: tuple[float, float],
    *,
    platen: float | None = None,
) -> tuple[FloatArray, float, int]:
    """The lower end of a specimen at rest, from its edge in both cameras' pictures.

    A camera above the plane of the end sees the specimen's own edge, and the platen's face beyond it at a
    glance. From below that plane the platen's rim stands before the end and hides it: what is seen is the
    rim, at the platen's radius in the same plane.

    Parameters
    ----------
    pictures
        Mean static pictures of both cameras.
    rig
        The cameras.
    cylinder
        The specimen at rest.
    declared
        Where the specimen is seen to end in camera 0's picture (x, y) [px].
    direction
        From there into the specimen in the pictures (right, down).
    platen
        Radius of the platen it stands on [m]; None: not known.

    Returns
    -------
    point : array
        A point of the end's plane on the specimen's side [m], shape [3].
    sigma : float
        Its standard deviation along the axis [m].
    found : int
        Cameras in which the edge was found. If in none, the point is the declared one.

    Raises
    ------
    ValueError
        As `on_cylinder` and `test_frame`.
    """
    rim = (1.0 + OPEN_RIM) * cylinder.radius if platen is None else max(platen, cylinder.radius)
    rim_sigma = OPEN_RIM * cylinder.radius if platen is None else RIM_SIGMA * rim
    zero = on_cylinder(rig.cameras[0], declared, cylinder)
    frame = test_frame(cylinder, rig, toward_flyer=direction, zero=zero)
    if not _sees_end(rig.cameras[0], frame, 0.0):
        zero = on_cylinder(rig.cameras[0], declared, replace(cylinder, radius=rim))
        frame = test_frame(cylinder, rig, toward_flyer=direction, zero=zero)
    y, sigma, found = 0.0, np.inf, 0
    for _ in range(2):  # about the declared place, then about what was found
        looked = side_by_side(
            [
                partial(end_in_camera, camera, picture, frame, y, cylinder.radius, rim, rim_sigma)
                for camera, picture in zip(rig.cameras, pictures, strict=True)
            ]
        )
        seen = [one for one in looked if one is not None]
        found = len(seen)
        if not found:
            break
        y, sigma = weighted_mean(*np.array([one[:2] for one in seen]).T)
    if not found:
        scale = _scale(rig.cameras[0], frame, 0.0, cylinder.radius)
        y, sigma = 0.0, float(np.hypot(DECLARED / scale, abs(_slope(rig.cameras[0], frame, 0.0)) * rim_sigma))
    return frame.in_rig(np.array([[0.0, y, cylinder.radius]]))[0], sigma, found


def weighted_mean(values: FloatArray, sigmas: FloatArray) -> tuple[float, float]:
    """Mean weighted with the inverse variances, and its standard deviation: larger by the root of chi-squared
    over the degrees of freedom where the values disagree."""
    w = 1.0 / sigmas**2
    mean = float(np.sum(w * values) / np.sum(w))
    chi2 = float(np.sum(w * (values - mean) ** 2)) / max(values.size - 1, 1)
    return mean, float(np.sqrt(max(1.0, chi2) / np.sum(w)))


def _slope(camera: Camera, frame: SpecimenFrame, y: float) -> float:
    """Rise of the rays to a plane across the axis: a camera above it has a positive one."""
    x, height, z = frame.positions(camera.centre)
    return float((height - y) / np.hypot(x, z))


def _scale(camera: Camera, frame: SpecimenFrame, y: float, radius: float) -> float:
    """Pixels of a length along the axis on the cameras' side [px/m]."""
    place = frame.in_rig(np.array([0.0, y, radius]))
    return float(np.linalg.norm(pixels_per_length(camera, place, frame.rotation[1])))


def _sees_end(camera: Camera, frame: SpecimenFrame, y: float) -> bool:
    """True if a camera stands above the plane of the lower end."""
    return _slope(camera, frame, y) >= 0.0


def end_in_camera(
    camera: Camera,
    picture: FloatArray,
    frame: SpecimenFrame,
    y: float,
    specimen: float,
    rim: float,
    rim_sigma: float,
) -> tuple[float, float] | None:
    """Height of the lower end in one camera, and its standard deviation [m]; None if it is not seen there.

    Parameters
    ----------
    camera, picture, frame
        The camera, its mean static picture and the test frame.
    y
        About where the end is [m].
    specimen, rim, rim_sigma
        Radii of specimen and platen, and the standard deviation of the latter [m].
    """
    slope = _slope(camera, frame, y)
    radius = specimen if slope >= 0.0 else rim
    scale = _scale(camera, frame, y, radius)
    half = SHARE * specimen
    x = np.arange(-half, half, 1.0 / scale)
    u = np.arange(-HALF, HALF + 1.0)
    widest = 1.3 * scale * max(slope, 0.0) * (rim - specimen) + 0.3
    found = []
    for phase in PHASES:
        at = y + phase / scale
        places = strip_places(x, at - u / scale, radius)
        seen = in_view(camera, picture.shape, frame, places)
        rows, columns = seen.any(axis=1), seen[seen.any(axis=1)].all(axis=0)
        if u[rows].max(initial=-HALF) < LEAST_BEYOND or u[rows].min(initial=HALF) > -HALF:
            continue
        if columns.sum() < FEWEST_COLUMNS:
            continue
        strip = sampled(camera, picture, frame, places[np.ix_(rows, columns)])
        fit = fit_edge(strip[None], u[rows], np.array([[0.0], [widest]]), reach=REACH)
        if fit is not None:
            found.append((phase - fit.place, fit.sigma, fit.gap))
    if not found:
        return None
    place, off = of_phases(np.array(found))
    return y + place / scale, float(np.hypot(off / scale, min(slope, 0.0) * rim_sigma))


def of_phases(found: FloatArray) -> tuple[float, float]:
    """Place of an edge and its standard deviation [px], from fits to strips that differ in where their rows
    lie between those of the picture.

    To the fits' own standard deviation comes what the model leaves out: `MODEL`, half of what the fits differ
    by, and a gap in the paint before the edge, anywhere in which the body may end (a uniform distribution).

    Parameters
    ----------
    found
        Place, standard deviation and gap of each fit [px], shape [n, 3].
    """
    place, sigma, gap = found.mean(axis=0)
    apart = 0.5 * float(np.ptp(found[:, 0]))
    open_gap = max(float(gap) - LEAST_GAP, 0.0) / 12.0**0.5
    return float(place), float(np.sqrt(sigma**2 + MODEL**2 + apart**2 + open_gap**2))
