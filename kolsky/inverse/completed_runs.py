"""Runs of one stage that completed, and the words for those that did not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe import Design
from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import Prediction


@dataclass(frozen=True)
class CompletedRuns:
    """Completed runs of one stage."""

    points: FloatArray
    """Parameters, shape [n, d]."""
    rows: NDArray[np.intp]
    """Their rows in the design, shape [n]."""
    prediction: Prediction
    """What the instruments would have seen."""
    response: Response
    """The solver's full answer."""
    lost: str
    """What became of the runs that did not complete, the first of them in full; empty if there are none."""


@dataclass(frozen=True)
class Replicates:
    """Runs at one point under other motions of the flyer and other curves, drawn from their noise."""

    prediction: Prediction
    """Row 0 is the reference, with the fitted motion and curve."""
    flyer: NDArray[np.bool_]
    """Which rows have another motion."""
    lesson: NDArray[np.bool_]
    """Which rows have still other motions: the weights learn from these, so that `flyer` judges them."""
    curve: NDArray[np.bool_]
    """Which rows have another curve."""
    scale: NDArray[np.bool_]
    """Which row has a motion larger by one standard uncertainty of its scale; at most one."""
    lost: int
    """How many did not complete."""


def lost_in_words(design: Design, response: Response) -> str:
    """The runs that did not complete, in words: their number and the first one's ending; empty if none."""
    lost = len(design) - int(response.completed.sum())
    told = f"{lost} of {len(design)} runs did not complete"
    return f"{told}; {first_lost(design, response)}" if lost else ""


def first_lost(design: Design, response: Response) -> str:
    """The first run that did not complete in words: its parameters and its ending."""
    first = int(np.argmin(response.completed))
    values = design.box.as_dict(design.points[first])
    point = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
    return f"the one at {point} ended {response.describe(first)}"
