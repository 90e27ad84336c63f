"""Axial displacement of the flyer: one translation a frame, from all points that either camera sees."""

from dataclasses import dataclass, replace

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.follow import TrackedBody
from dic.camera import StereoRig
from dic.images import Pictures
from dic.rigid_body.axial_translations import OWN_SHARE, Translations, rim_of, translations
from dic.rigid_body.rest_from_rim import RestGeometry, Rim, glance
from dic.surfaces import SpecimenFrame

MODEL = 0.008
"""Standard deviation of the mean place at rest for what the static frames share: warm air, interpolation
[px]."""
FACE_SHARE, NARROW_FACE = 0.001, 1.0
"""And this share of the flyer's face beside its rim, where a camera sees more than so much of it [px]: it
moves with the flyer, but what it hides of the specimen does not."""
FEWEST_AT_REST = 3
"""With fewer static frames that show the body, the others are given its place at rest too."""
MOST_APART = 4.0
"""Largest disagreement of two places at rest that are joined, in standard deviations."""


@dataclass(frozen=True)
class AxialDisplacement:
    """Displacement of the flyer toward the specimen; a frame in which it was not found has no row."""

    t: FloatArray
    """Times [s], shape [n]."""
    frame: IntArray
    """Frames, shape [n]."""
    displacement: FloatArray
    """Toward the specimen, from its mean place at rest [m], shape [n]."""
    sigma: FloatArray
    """Standard deviation from frame to frame [m], shape [n]."""
    n_points: IntArray
    """Points it is from, shape [n]."""
    rest_sigma: float
    """Standard deviation of the mean place at rest, common to all displacements after it [m]."""
    from_rim: bool = False
    """True if no static frame shows the body: the place at rest is then that of the specimen's upper end,
    where the rim of the body's face was, and the displacement in the static frames is the declared rest."""
    rim_disagreement: tuple[float, float] | None = None
    """Height of the rim of the body's face above the specimen's upper end at rest by its length, and the
    standard deviation of that [m]; None where the body is not seen at rest, or its rim is not."""


def axial_displacement(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    t: FloatArray,
    static: BoolArray,
    *,
    subset: int,
    pictures: tuple[Pictures, Pictures] | None = None,
    geometry: RestGeometry | None = None,
) -> AxialDisplacement | None:
    """Axial displacement of a rigid body, toward the specimen.

    The places of the points on the body come from the frames in which both cameras see them. In every frame
    the translation is then the one that fits all pixels of both cameras best, in their covariances; where one
    camera alone sees the body, its place across the axis is held to that of the nearest frame that both saw.

    Parameters
    ----------
    body
        The flyer, followed.
    rig
        The cameras.
    frame
        The test frame.
    t
        Frame times [s], shape [n_frames].
    static
        Frames in which the flyer rests, shape [n_frames].
    subset
        Side of the subsets [px]: those that overlap share their noise.
    pictures
        Both series, to look for the edge strip of the body (`dic.rigid_body.edge_registration`) in the
        frames before its first point came into view, where that is after the static ones; None: do not.
    geometry
        The specimen at rest: where the body is in view in no static frame, its rim then gives the place at
        rest (`dic.rigid_body.rest_from_rim`); None: it is not known.

    Returns
    -------
    AxialDisplacement or None
        None if no point was ever seen by both cameras, or the place at rest, which displacements count from,
        is not known: the body is seen in no static frame, and its rim in too few.
    """
    seen = translations(body, rig, frame, t, static, subset=subset, pictures=pictures)
    rim = None if pictures is None or geometry is None else rim_of(body, rig, frame, pictures, geometry)
    return from_rest(seen, rim, rig, frame, t, static, geometry)


def from_rest(
    seen: Translations | None,
    rim: Rim | None,
    rig: StereoRig,
    frame: SpecimenFrame,
    t: FloatArray,
    static: BoolArray,
    geometry: RestGeometry | None,
) -> AxialDisplacement | None:
    """Displacement from the place at rest, of what `translations` and `rim_of` gave; the other arguments and
    the result as of `axial_displacement`."""
    if seen is None:
        return None
    index, y, sigma, counts = seen.frame, seen.y, seen.sigma, seen.n_points
    at_rest = static[index]
    from_rim = not at_rest.any()
    disagreement = None
    if at_rest.any():
        rest = float(np.mean(y[at_rest]))
        face = 0.0 if geometry is None else _widest_face(rig, frame, seen.places, geometry) / seen.pixel
        rest_sigma = float(
            np.hypot(np.hypot(_of_mean(np.array(sigma)[at_rest]), seen.common), shared(face) * seen.pixel)
        )
        if rim is not None and geometry is not None:
            by_end = geometry.length - rim.y
            sigma_by_end = float(np.hypot(rim.sigma, geometry.length_sigma))
            disagreement = (rest - by_end, float(np.hypot(sigma_by_end, rest_sigma)))
            rest, rest_sigma = joined_rest((rest, rest_sigma), (by_end, sigma_by_end))
        if int(at_rest.sum()) < FEWEST_AT_REST:
            index, y, sigma, counts = with_rest(np.flatnonzero(static), rest, index, y, sigma, counts)
    else:
        if rim is None or geometry is None or not geometry.known:
            return None
        # Before contact moves it, the face is the specimen's upper end: no displacement in the static frames.
        rest = geometry.length - rim.y
        rest_sigma = float(np.hypot(rim.sigma, geometry.length_sigma))
        if not replace(geometry, length_sigma=rest_sigma).known:
            return None
        index, y, sigma, counts = with_rest(np.flatnonzero(static), rest, index, y, sigma, counts)
    return AxialDisplacement(
        t=t[index],
        frame=index,
        displacement=rest - y,
        sigma=np.array(sigma) * OWN_SHARE**0.5,
        n_points=np.array(counts, dtype=np.int64),
        rest_sigma=rest_sigma,
        from_rim=from_rim,
        rim_disagreement=disagreement,
    )


def with_rest(
    static: IntArray, rest: float, index: IntArray, y: FloatArray, sigma: list[float], counts: list[int]
) -> tuple[IntArray, FloatArray, list[float], list[int]]:
    """The displacements with the static frames that do not show the body: there it rests.

    Parameters
    ----------
    static
        Frames in which it rests.
    rest
        Its place there [m].
    index, y, sigma, counts
        Frames that show it, ascending, with place, standard deviation [m] and points.
    """
    still = np.setdiff1d(static, index)
    order = np.argsort(np.concatenate([still, index]), kind="stable")
    spread = np.concatenate([np.full(still.size, float(np.median(sigma))), sigma])[order]
    n = np.concatenate([np.zeros(still.size, dtype=np.int64), counts])[order]
    return (
        np.concatenate([still, index])[order],
        np.concatenate([np.full(still.size, rest), y])[order],
        spread.tolist(),
        n.tolist(),
    )


def shared(face: float) -> float:
    """Standard deviation of the mean place at rest that no number of static frames lowers [px], where the
    widest strip of the flyer's face that a camera sees is `face` [px]."""
    return float(np.hypot(MODEL, FACE_SHARE * max(face - NARROW_FACE, 0.0)))


def _widest_face(rig: StereoRig, frame: SpecimenFrame, places: FloatArray, geometry: RestGeometry) -> float:
    """Widest strip of the flyer's face that either camera sees at rest [m]."""
    radius = float(np.median(np.hypot(places[:, 0], places[:, 2])))
    return max(
        glance(frame.positions(camera.centre), geometry.length, radius, geometry)[0] for camera in rig.cameras
    )


def joined_rest(seen: tuple[float, float], by_end: tuple[float, float]) -> tuple[float, float]:
    """Place at rest and its standard deviation, from what was seen of the body and from the specimen's end.

    By least squares; two that disagree by more than `MOST_APART` standard deviations are not joined, and
    what was seen counts.

    Parameters
    ----------
    seen, by_end
        Place and standard deviation [m].
    """
    apart = seen[0] - by_end[0]
    if abs(apart) > MOST_APART * float(np.hypot(seen[1], by_end[1])):
        return seen
    w = np.array([seen[1], by_end[1]]) ** -2.0
    return float((w[0] * seen[0] + w[1] * by_end[0]) / w.sum()), float(w.sum() ** -0.5)


def _of_mean(sigma: FloatArray) -> float:
    """Sigma of the mean of static frames, in which the reference's part does not average out."""
    return float(np.sqrt(np.mean(sigma**2) * (1.0 - OWN_SHARE + OWN_SHARE / sigma.size)))
