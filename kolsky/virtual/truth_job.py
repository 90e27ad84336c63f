"""One shot's simulation as it is asked for: its motion and the times of its frames."""

from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.base.arrays import FloatArray
from kolsky.virtual.motion import Path1D, path_of
from kolsky.virtual.schema import Specification

MARGIN = 15e-6
"""Time that is simulated beyond the record, and of the record beyond the last frame [s]."""


@dataclass(frozen=True)
class Job:
    """One shot's simulation, timed from the flyer's start."""

    quantities: Specification
    """The specification."""
    path: Path1D
    """The flyer's motion."""
    end: float
    """Time from start to end of the record [s]."""
    frames: FloatArray
    """True times of the frames from the start on, static ones below or at 0 [s], shape [n_frames]."""

    @property
    def last(self) -> float:
        """Time from the start that is simulated [s]."""
        late = abs(self.quantities.imperfections.trigger) + abs(self.quantities.transmitted.delay)
        return self.end + MARGIN + late

    @classmethod
    def of(cls, quantities: Specification, folder: Path = Path()) -> "Job":
        """The simulation that a specification asks for; files that it names are in `folder`.

        Raises
        ------
        ValueError
            If its motion cannot be.
        """
        path, end = path_of(quantities, folder)
        frames = quantities.frames
        first = -(frames.static - 1 + frames.phase) / frames.rate
        count = int(np.floor((end - first) * frames.rate * (1.0 + 1e-12))) + 1
        return cls(quantities, path, end, first + np.arange(count) / frames.rate)

    @property
    def contact(self) -> tuple[str, str]:
        """True contact laws of faces and side."""
        slips = self.quantities.imperfections.slip_friction > 0.0
        declared = self.quantities.interface
        return (SLIDING_LAW, SLIDING_LAW) if slips else (declared.faces, declared.side)

    @property
    def group(self) -> Hashable:
        """Shots of one group share a model of the solver."""
        q = self.quantities
        kind = "prony" if q.relaxation is None else q.relaxation.kind
        relaxing = kind, sum(len(one) for one in q.relaxing)
        support = q.transmission.model_dump_json()
        return (q.specimen, q.truth, q.material.law, relaxing, self.contact, support)
