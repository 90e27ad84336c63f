"""A quasi-static uniaxial test: nominal stress over strain, its ramps, the machine's compliance, its toe.

A face that is not flat or not parallel touches gradually, and the first samples are too soft (the toe).
The curve after it is continued to zero stress; the strain there is the zero of the specimen's strain. The
length stays as measured: the platen travelled that far before it had met all of the specimen.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from kolsky.base.arrays import FloatArray

REVERSAL = 0.05
"""The strain has turned when it has gone back by this share of the test's range."""


@dataclass(frozen=True)
class UniaxialTest:
    """One test, positive along its own branch: shortening in compression, lengthening in tension."""

    name: str
    """Name of the test, for messages."""
    strain: FloatArray
    """Nominal strain [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    compression: bool
    """True if the branch is compression."""
    time: FloatArray | None = None
    """Time of the samples [s], shape [n]; None if it was not recorded."""
    bulge: FloatArray | None = None
    """Radius at mid-height [m], shape [n]; None if it was not measured."""

    def __post_init__(self) -> None:
        columns = [self.strain, self.stress, self.time, self.bulge]
        for column in columns:
            if column is not None and (column.shape != self.strain.shape or not np.isfinite(column).all()):
                raise ValueError(f"{self.name}: every column must be finite and of one length")
        if self.strain.ndim != 1 or self.strain.size < 2:
            raise ValueError(f"{self.name}: a test needs at least 2 samples, got {self.strain.size}")

    def part(self, samples: slice | NDArray[np.bool_]) -> "UniaxialTest":
        """Some of its samples."""
        return replace(
            self,
            strain=self.strain[samples],
            stress=self.stress[samples],
            time=None if self.time is None else self.time[samples],
            bulge=None if self.bulge is None else self.bulge[samples],
        )

    def without_machine(self, compliance: float, *, area: float, length: float) -> "UniaxialTest":
        """The test without the deformation of the machine: u = u_measured - C F.

        Parameters
        ----------
        compliance
            Compliance C of machine, load cell and platens in series [m/N].
        area, length
            Undeformed cross-section [m^2] and length [m] of the specimen.

        Raises
        ------
        ValueError
            If the compliance is negative, or so large that the specimen itself would get longer under load.
        """
        if not compliance >= 0.0:
            raise ValueError(f"a compliance must be >= 0 m/N, got {compliance}")
        strain = self.strain - compliance * area * self.stress / length
        most = int(np.argmax(self.stress))
        if strain[most] <= 0.0 < self.stress[most]:
            raise ValueError(
                f"{self.name}: a compliance of {compliance:.4g} m/N would explain the whole displacement at "
                f"{self.stress[most]:.4g} Pa; it must be below "
                f"{self.strain[most] * length / (area * self.stress[most]):.4g} m/N"
            )
        return replace(self, strain=strain)


def loading_ramps(test: UniaxialTest) -> list[slice]:
    """The stretches of samples in which the strain rises, in the order in which they were run.

    A turn counts when the strain has gone back by `REVERSAL` of the test's range, so noise makes none. The
    first ramp is the first pull; the last of several belongs to the conditioned material (Mullins).

    Raises
    ------
    ValueError
        If the strain never rises.
    """
    strain = test.strain
    least = REVERSAL * float(np.ptp(strain))
    ramps: list[slice] = []
    rising, start, extreme = True, 0, 0
    for i in range(1, strain.size):
        sign = 1.0 if rising else -1.0
        if sign * (strain[i] - strain[extreme]) > 0.0:
            extreme = i
        elif sign * (strain[extreme] - strain[i]) > least:
            if rising and strain[extreme] - strain[start] > least:
                ramps.append(slice(start, extreme + 1))
            rising, start, extreme = not rising, extreme, i
    if rising and strain[extreme] - strain[start] > least:
        ramps.append(slice(start, extreme + 1))
    if not ramps:
        raise ValueError(f"{test.name}: the strain never rises; is its sign declared as it is?")
    return ramps


def stretch_of(strain: FloatArray, *, compression: bool) -> FloatArray:
    """Stretch along the load [-] of a strain that is positive along its branch."""
    return 1.0 - strain if compression else 1.0 + strain


def gaussian_strain(strain: FloatArray, *, compression: bool) -> FloatArray:
    """|lam - lam^-2| [-]: by Gaussian rubber elasticity the stress is E_a / 3 times it, Eq. (M.9)."""
    lam = stretch_of(strain, compression=compression)
    return np.asarray(np.abs(lam - lam**-2))


FEWEST = 5
"""Samples that a range of extrapolation needs."""


@dataclass(frozen=True)
class Toe:
    """Method by which the zero of the strain is found."""

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
class ZeroedTest:
    """A test whose strain is zero at the specimen's first full contact, by its toe."""

    test: UniaxialTest
    """The test, from the end of its toe on."""
    offset: float
    """Strain that was subtracted [-]."""
    sigma: float
    """Its standard uncertainty from the scatter about the continued curve [-]."""


def correct_toe(test: UniaxialTest, toe: Toe) -> ZeroedTest:
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
        return ZeroedTest(test.part(test.strain > 0.0), 0.0, 0.0)
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
    return ZeroedTest(replace(kept, strain=kept.strain - offset), offset, float(np.sqrt(covariance[1, 1])))
