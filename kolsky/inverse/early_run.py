"""The longest of the runs that tell the mesh's error, begun before the answer is confirmed.

A run on the refined mesh is alone, and so is the one on the finest graded mesh behind it, which takes twice
as long. Where the last step was so small that the next run will probably be the answer's, both are made at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Forward
from kolsky.inverse.graded_mesh import graded
from kolsky.inverse.idle_core import begun_in_thread, leaves_a_core
from kolsky.inverse.settings import Settings

LIKELY = 1.0
"""Step in standard deviations behind which the next run is probably confirmed [-]: a step with the slopes of
the coarser mesh leaves about a tenth, and a fifth is confirmed."""


@dataclass(frozen=True)
class EarlyRun:
    """A run on the finest graded mesh that is at work."""

    x: FloatArray
    """Where, shape [d]."""
    forward: Forward
    """Of what: under another path of the front face it is another run."""
    response: Callable[[], Response]
    """Waits for it."""

    @classmethod
    def begun(
        cls, forward: Forward, settings: Settings, names: Sequence[str], x: FloatArray
    ) -> EarlyRun | None:
        """Begin the run of a point on one thread; None where no core is idle beside a run.

        Parameters
        ----------
        forward, settings
            The shot under the path as it is now, and what is held.
        names, x
            The free parameters, and the point in SI, shape [d].
        """
        numerics = settings.numerics
        if numerics.compressible is not None or not leaves_a_core(numerics.device, numerics.threads):
            return None
        values = {**settings.held, **dict(zip(names, x.tolist(), strict=True))}
        alone = replace(graded(numerics, settings.refined_mesh), threads=1)
        return cls(x, forward, begun_in_thread(lambda: forward.run(values, alone)))

    def is_of(self, forward: Forward, x: FloatArray) -> bool:
        """True if it is the run of a point under that very path."""
        return self.forward is forward and np.array_equal(self.x, x)
