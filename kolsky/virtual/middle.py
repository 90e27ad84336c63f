"""A truth between the two elements of the solver, whose outlines come from opposite sides to their limit."""

from collections.abc import Sequence

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.virtual.records import SurfaceHistory, Truth, TruthError
from kolsky.virtual.schema import Specification

MIDDLE = ("fbar", "one_point")
"""Elements whose mean `element = "middle"` asks for."""


def elements_of(quantities: Specification) -> list[Specification]:
    """A specification for each element that its truth is simulated with."""
    truth = quantities.truth
    if truth.element != "middle":
        return [quantities]
    return [
        quantities.model_copy(update={"truth": truth.model_copy(update={"element": element})})
        for element in MIDDLE
    ]


def middle(truths: Sequence[Truth | TruthError]) -> Truth | TruthError:
    """The mean of the truths of one shot; the first of those that did not reach their end, if any did not.

    Parameters
    ----------
    truths
        One an element, at the same times.
    """
    found = []
    for truth in truths:
        if isinstance(truth, TruthError):
            return truth
        found.append(truth)
    first, surfaces = found[0], [truth.surface for truth in found]

    def mean(each: list[FloatArray]) -> FloatArray:
        return np.asarray(np.mean(each, axis=0))

    return Truth(
        surface=SurfaceHistory(
            time=first.surface.time,
            r=mean([surface.r for surface in surfaces]),
            y=mean([surface.y for surface in surfaces]),
            displacement=first.surface.displacement,
            tilt=mean([surface.tilt for surface in surfaces]),
        ),
        force_time=first.force_time,
        transmitted=mean([truth.transmitted for truth in found]),
        incident=mean([truth.incident for truth in found]),
        flyer_acceleration=first.flyer_acceleration,
        support_acceleration=mean([truth.support_acceleration for truth in found]),
        flyer_radius=first.flyer_radius,
    )
