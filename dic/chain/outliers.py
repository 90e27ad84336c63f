"""Removal of outliers from the tracked specimen: patches that changed their looks, false matches, subsets
past an end, points off the surface.

A gate changes the body that it is given, whose arrays are the largest of a measurement, and returns it.
"""

from dataclasses import replace

import numpy as np

from dic.arrays import BoolArray
from dic.bodies.follow import TrackedBody
from dic.bodies.past_ends import past_the_ends
from dic.chain.inspect_images import Inputs
from dic.chain.test_frame import RestState
from dic.outcome import PointOutcome
from dic.rigid_body.axial_displacement import AxialDisplacement
from dic.stereo import reconstruct
from dic.stereo.reconstruction import GATE, end_points, narrow_gates
from dic.surfaces import static_mean
from dic.surfaces.residual_map import unlike_points
from dic.surfaces.smoothness import off_surface, spacing

LEAST_GATE = 0.1
"""Smallest gate for epipolar distances [px]."""
GATE_SIGMAS = 6.0
"""The gate in standard deviations of the epipolar distances at rest."""
OWN_SIGMAS = 4.0
"""And in standard deviations of the point's own."""


def gate_residual(body: TrackedBody) -> TrackedBody:
    """Remove points of patches that do not look like what was followed, in either camera.

    Points that another gate has removed neither judge nor begin a patch: a subset that hangs over an end has
    a large residual too, and says nothing of its neighbours.
    """
    valid = np.asarray(body.reconstruction.outcome == PointOutcome.VALID)
    unlike = np.zeros(valid.shape, dtype=bool)
    for track in body.tracks:
        if track.excess is not None:
            unlike |= unlike_points(track.excess, valid, body.cell)
    return _without(body, unlike, PointOutcome.LOW_CORRELATION)


def gate_epipolar(inputs: Inputs, body: TrackedBody, rest_state: RestState) -> TrackedBody:
    """Apply the epipolar gate that the specimen's static frames give."""
    r, rest = body.reconstruction, rest_state.rest
    at_rest = r.epipolar[rest][r.outcome[rest] == PointOutcome.VALID]
    gate = max(LEAST_GATE, GATE_SIGMAS * float(np.median(np.abs(at_rest))) / 0.6745)
    if gate <= GATE:  # what is left was let through by that one
        narrow_gates(r, gate=gate, gate_sigmas=OWN_SIGMAS)
        return body
    found = reconstruct(inputs.rig, *body.tracks, gate=gate, gate_sigmas=OWN_SIGMAS, common=body.common)
    return replace(body, reconstruction=found)


def gate_ends(
    inputs: Inputs, body: TrackedBody, rest_state: RestState, axial: AxialDisplacement | None
) -> TrackedBody:
    """Remove points whose subset reaches past an end in either camera, or behind a platen's rim.

    The upper end follows from the declared length and the flyer's displacement; without either it is not
    known, and only the lower one judges.
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
    # Against the cylinder: its own curvature is none of the surface through a few neighbours.
    at_rest = placement.frame.positions(static_mean(r, rest_state.rest)[0])
    depth = np.sqrt(np.maximum(placement.radius**2 - at_rest[:, 0] ** 2, 0.0))
    cylinder = np.stack([at_rest[:, 0], at_rest[:, 1], depth], axis=1)
    distance = spacing(at_rest, body.cell)
    if not distance > 0.0:
        return body  # no two neighbours at rest: nothing that could confirm or deny a point
    off = off_surface(
        placement.frame.positions(r.position) - cylinder,
        np.sqrt(variance),
        np.asarray(r.outcome == PointOutcome.VALID) & np.isfinite(cylinder).all(axis=1),
        body.cell,
        distance=distance,
    )
    return _without(body, off, PointOutcome.OFF_SURFACE)


def _without(body: TrackedBody, points: BoolArray, outcome: PointOutcome) -> TrackedBody:
    """The body after some points of some frames were ended, which changes its own reconstruction."""
    end_points(body.reconstruction, points, outcome)
    return body
