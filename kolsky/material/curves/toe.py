"""Toe and contact: where a test's strain begins, declared and extrapolated, never read off by eye.

A face that is not flat or not parallel touches little by little, and the first samples are too soft. The part
after it is continued to zero stress; the strain there is the specimen's zero. The length stays what it was:
the platen travelled that far before it had met all of the specimen.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from kolsky.base.arrays import FloatArray
from kolsky.material.curves.uniaxial import UniaxialTest, gaussian_strain

FEWEST = 5
"""Samples that a range of extrapolation needs."""


@dataclass(frozen=True)
class Toe:
    """How the zero of the strain is found."""

    kind: Literal["none", "line", "gaussian"] = "none"
    """ "none": the strain as it is. "line": a straight line is continued to zero stress (toe compensation of
    ASTM D695). "gaussian": the curve of Gaussian rubber elasticity, Eq. (M.9), bent as soft solids are."""
    low: float = 0.02
    """Strain from which on the faces are in full contact, as recorded [-]."""
    high: float = 0.10
    """Strain up to which the curve is continued from [-]."""

    def __post_init__(self) -> None:
        if self.kind not in ("none", "line", "gaussian"):
            raise ValueError(f"a toe is 'none', 'line' or 'gaussian', got {self.kind!r}")
        if not 0.0 <= self.low < self.high < 1.0:
            raise ValueError(
                f"a toe is continued from strains 0 <= low < high < 1, got {self.low} to {self.high}"
            )


@dataclass(frozen=True)
class Begun:
    """A test whose strain begins where the specimen does."""

    test: UniaxialTest
    """The test, from the end of its toe on."""
    offset: float
    """What was taken off the strain [-]."""
    sigma: float
    """Its standard uncertainty from the scatter about the continued curve [-]."""


def correct_toe(test: UniaxialTest, toe: Toe) -> Begun:
    """Find the zero of the strain and leave out the toe.

    Parameters
    ----------
    test
        One loading ramp.
    toe
        What is declared of it.

    Raises
    ------
    ValueError
        If the range has fewer than `FEWEST` samples, the stress does not rise over it, or the continued curve
        meets zero stress only inside the range itself.
    """
    if toe.kind == "none":
        return Begun(test.part(test.strain > 0.0), 0.0, 0.0)
    inside = (test.strain >= toe.low) & (test.strain <= toe.high)
    if inside.sum() < FEWEST:
        raise ValueError(
            f"{test.name}: {int(inside.sum())} samples have a strain from {toe.low:g} to {toe.high:g}, a"
            f" toe's range needs {FEWEST}; the test spans {test.strain.min():.4g} to {test.strain.max():.4g}"
        )
    e, stress = test.strain[inside], test.stress[inside]
    slope, constant = np.polyfit(e, stress, 1)
    if not slope > 0.0:
        raise ValueError(f"{test.name}: the stress does not rise from strain {toe.low:g} to {toe.high:g}")
    start = np.array([slope, -constant / slope])

    def residual(p: FloatArray) -> FloatArray:
        shifted = e - p[1]
        if toe.kind == "gaussian":
            shifted = gaussian_strain(shifted, compression=test.compression) / 3.0  # slope 1 at rest
            shifted = np.where(e < p[1], -shifted, shifted)
        return np.asarray((p[0] * shifted - stress) / slope)

    fit = least_squares(residual, start, method="lm", x_scale=np.array([slope, 0.01]))
    offset = float(fit.x[1])
    if not fit.success or offset > toe.low:
        raise ValueError(
            f"{test.name}: continued from strains {toe.low:g} to {toe.high:g} the stress is zero at"
            f" {offset:.4g}, inside the range; let it begin later"
        )
    variance = float(fit.fun @ fit.fun) / (e.size - 2)
    covariance = variance * np.linalg.inv(fit.jac.T @ fit.jac)
    kept = test.part(test.strain >= toe.low)
    return Begun(replace(kept, strain=kept.strain - offset), offset, float(np.sqrt(covariance[1, 1])))
