"""An input at one value that was tried as the cause of a misfit."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.candidate_input import CandidateInput
from kolsky.diagnosis.cause_fit import LinearFit


@dataclass(frozen=True)
class Trial:
    """An input at a value, with the free parameters that suit it."""

    candidate: CandidateInput
    """The input."""
    x: FloatArray
    """Free parameters in SI, shape [d]."""
    u: float
    """Coordinate of the input."""
    misfits: FloatArray
    """`ExpectedResidual.misfits` there, shape [2]."""
    residual: FloatArray
    """Prediction minus data there, shape [k]."""
    fit: LinearFit | None = None
    """The last linear fit about it."""
    step: float = 0.0
    """What that fit would still change the coordinate by."""
    lost: str = ""
    """Why it could not be tried; empty if it was."""

    @property
    def value(self) -> float:
        """What the data prefer, in the input's unit."""
        return self.candidate.value(self.u)

    @property
    def sigma(self) -> float:
        """Standard uncertainty of the value, NaN if it is not known."""
        if self.fit is None or self.lost:
            return float("nan")
        low, high = self.candidate.lowest, self.candidate.highest
        one = float(np.sqrt(self.fit.covariance[-1, -1]))
        if not np.isfinite(one):
            return float("inf")
        reach = max(min(one, self.u - low, high - self.u), 1e-3 * one, 1e-15)
        up, down = min(self.u + reach, high), max(self.u - reach, low)
        slope = abs(self.candidate.value(up) - self.candidate.value(down)) / (up - down)
        return slope * one
