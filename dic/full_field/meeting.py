"""Points where the rays of two cameras meet: gates, places at rest, cylinders through them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.bodies.follow import TrackedBody
from dic.camera import StereoRig
from dic.chain.outliers import GATE_SIGMAS, LEAST_GATE, OWN_SIGMAS
from dic.full_field.curvature import match_bias, without_bias
from dic.full_field.result import FittedCylinder
from dic.full_field.settings import FullFieldSettings
from dic.outcome import PointOutcome
from dic.stereo import Reconstruction, reconstruct
from dic.surfaces import Cylinder, fit_cylinder, overlap_factor, referenced, static_mean
from dic.surfaces.frame import SpecimenFrame

CORRECTIONS = 2
"""Times that the curvature's bias is taken off: the second starts from a cylinder that is nearly right."""


def gated(rig: StereoRig, body: TrackedBody, rest: Sequence[int]) -> TrackedBody:
    """The body with the epipolar gate that its reference frames give."""
    epipolar = body.reconstruction.epipolar[list(rest)]
    found = epipolar[np.isfinite(epipolar)]
    if not found.size:
        raise ValueError(
            "no point was matched between the cameras: check which camera is which, the calibration, the "
            "crop offsets and the region"
        )
    gate = max(LEAST_GATE, GATE_SIGMAS * float(np.median(np.abs(found))) / 0.6745)
    again = reconstruct(rig, *body.tracks, gate=gate, gate_sigmas=OWN_SIGMAS, common=body.common)
    return replace(body, reconstruction=again)


def at_rest_of(r: Reconstruction, rest: Sequence[int]) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Mean places of the points at the reference, their covariances, and which points they are."""
    known = referenced(r, rest)
    X, C = static_mean(r, rest)
    return X[known], C[known], known


def cylinder_of(
    r: Reconstruction,
    rest: Sequence[int],
    settings: FullFieldSettings,
    points: FloatArray,
    radius: float | None = None,
) -> Cylinder:
    """The cylinder at the reference."""
    X, C, known = at_rest_of(r, rest)
    return fit_cylinder(X, C, radius=radius, overlap=overlap_factor(points[known], settings.subset))


def corrected(
    rig: StereoRig, body: TrackedBody, rest: Sequence[int], settings: FullFieldSettings, radius: float | None
) -> tuple[TrackedBody, float, float]:
    """The body without the bias of its subsets' curvature, the bias's median size in camera 1 [px], and the
    radius before [m]."""
    first, track = body, body.tracks[1]
    plain, size = cylinder_of(first.reconstruction, rest, settings, body.points).radius, 0.0
    for _ in range(CORRECTIONS):
        cylinder = cylinder_of(body.reconstruction, rest, settings, body.points, radius)
        bias = match_bias(rig, cylinder, body.points, body.mask, settings.subset, settings.stereo_shape)
        known = np.isfinite(bias).all(axis=1)
        size = float(np.median(np.linalg.norm(bias[known], axis=1))) if known.any() else 0.0
        tracks = (body.tracks[0], without_bias(track, bias, body.material))
        body = gated(rig, replace(first, tracks=tracks, reconstruction=meeting(rig, first, tracks)), rest)
    return body, size, plain


def meeting(rig: StereoRig, body: TrackedBody, tracks: tuple[Any, Any]) -> Reconstruction:
    return reconstruct(rig, *tracks, common=body.common)


def cylinders(
    r: Reconstruction,
    frame: SpecimenFrame,
    points: FloatArray,
    settings: FullFieldSettings,
    correction: float,
    plain: float,
) -> FittedCylinder:
    """A cylinder with a free radius through the points of each frame."""
    n = len(r.outcome)
    radius, sigma, rms, count = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, int)
    for k in range(n):
        valid = r.outcome[k] == PointOutcome.VALID
        try:
            found = fit_cylinder(
                frame.positions(r.position[k, valid]),
                frame.covariances(r.covariance[k, valid]),
                overlap=overlap_factor(points[valid], settings.subset),
            )
        except ValueError:
            continue  # too few points, or none of a cylinder: NaN and no points
        radius[k], sigma[k], rms[k] = found.radius, found.sigma[4], found.rms
        count[k] = int(found.used.sum())
    return FittedCylinder(radius, sigma, rms, count, correction, plain)
