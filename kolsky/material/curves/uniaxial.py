"""A quasi-static uniaxial test: nominal stress over strain, its ramps, and the machine's compliance."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray

REVERSAL = 0.05
"""The strain has turned when it has gone back by this share of the test's range."""


@dataclass(frozen=True)
class UniaxialTest:
    """One test, positive along its own branch: shortening in compression, lengthening in tension."""

    name: str
    """Which test, for messages."""
    strain: FloatArray
    """Nominal strain [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    compression: bool
    """Whether the branch is compression."""
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
