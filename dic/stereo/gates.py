"""What a stereo match must pass."""

from enum import IntFlag

import numpy as np

from dic.arrays import IntArray
from dic.stereo.evidence import Evidence
from dic.stereo.settings import StereoGates


class Gate(IntFlag):
    """What a match failed; several may be set."""

    CORRELATION = 1
    """No match in the first place: its outcome says why."""
    EPIPOLAR = 2
    """The two lines of sight pass each other too far apart."""
    FACET = 4
    """The subset deforms as no piece of surface seen by these cameras can, or one seen too obliquely."""
    BACK_MATCH = 8
    """Looked for from camera 1, the point is found elsewhere in camera 0, or not at all."""
    NEIGHBOURS = 16
    """The neighbours' warps put the point elsewhere, or there are none."""
    UNIQUENESS = 32
    """Another place on the epipolar line looks nearly as much alike, or more."""
    DISTANCE = 64
    """The point lies outside the declared distances."""
    VIEW = 128
    """A camera's picture holds too little of the subset: its outcome is OUT_OF_VIEW."""


def judge(evidence: Evidence, gates: StereoGates, distances: tuple[float, float] | None = None) -> IntArray:
    """Gates that each match fails, as a sum of `Gate` members, shape [n].

    Parameters
    ----------
    evidence
        The numbers; one that could not be had fails its gate.
    gates
        The limits.
    distances
        Declared nearest and farthest distance along camera 0's lines of sight [m].
    """
    near, far = distances if distances is not None else (0.0, np.inf)
    with np.errstate(invalid="ignore"):  # inf, where there is no evidence, passes no comparison
        noise = np.where(np.isfinite(evidence.sigma), gates.sigmas * evidence.sigma, 0.0)
        passes = (
            (
                Gate.EPIPOLAR,
                np.abs(evidence.epipolar) <= gates.epipolar + gates.sigmas * evidence.epipolar_sigma,
            ),
            (
                Gate.FACET,
                (evidence.facet <= gates.facet + noise) & (evidence.incidence <= np.radians(gates.incidence)),
            ),
            (Gate.BACK_MATCH, evidence.back_match <= gates.back_match + noise),
            (Gate.NEIGHBOURS, evidence.neighbours <= gates.neighbours + noise),
            (Gate.UNIQUENESS, evidence.distinct <= gates.distinct),
            (Gate.DISTANCE, (evidence.distance >= near) & (evidence.distance < far)),
            (Gate.VIEW, evidence.unseen <= gates.unseen),
        )
    return np.asarray(sum(np.where(passed, 0, int(gate)) for gate, passed in passes), dtype=np.int64)
