"""Measured histories with the standard deviation of every value (SI, float64)."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dic.basics import check_interval, check_shape
from kolsky.base.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    import explicit.materials


@dataclass(frozen=True)
class Recording:
    """One recorded channel of an instrument, on the instrument's clock."""

    time: FloatArray
    """Sample times on the instrument's clock [s], shape [n]."""
    value: FloatArray
    """Samples in `unit`, shape [n]."""
    channel: str
    """The column or channel name in the file."""
    unit: str
    """Unit of `value` as the instrument gives it, e.g. "V"."""
    path: Path
    """The file of the record."""
    sha256: str
    """SHA-256 of that file, hex."""
    file_unit: str | None = None
    """Unit of the samples as written in the file. None if the file gives no unit."""
    note: str = ""
    """Change of the samples to uniform times, in words. Empty if they were not changed."""
    first_line: int | None = None
    """For a text file with one sample per line: line of the first sample, from 1; otherwise None."""


@dataclass(frozen=True)
class ForceHistory:
    """A force on the shot's clock, compression-positive.

    Raises ValueError if shapes differ, a value is not finite, or a sigma is negative.
    """

    time: FloatArray
    """Sample times on the shot's clock [s], shape [n]."""
    force: FloatArray
    """Force, compression-positive [N], shape [n]."""
    sigma: FloatArray
    """Standard deviation of each sample's noise [N], shape [n]."""

    def __post_init__(self) -> None:
        check_shape((self.time.size,), time=self.time, force=self.force, **{"sigma of the force": self.sigma})
        check_interval("[0, inf) N", **{"sigma of the force": self.sigma})


@dataclass(frozen=True)
class FlyerMotion:
    """The flyer's measured displacement toward the specimen. A failed frame has no row.

    Raises ValueError if shapes differ, a value is not finite, or a sigma is not positive.
    """

    time: FloatArray
    """Frame times on the shot's clock [s], shape [n]."""
    displacement: FloatArray
    """Displacement toward the specimen [m], shape [n]."""
    sigma: FloatArray
    """Standard deviation of each displacement [m], shape [n]."""
    zero_sigma: float = 0.0
    """Standard deviation of the position at rest, the zero of all displacements [m]. This error is common to
    all of them."""
    shared_sigma: FloatArray | None = None
    """Standard deviation of an error that successive displacements have in common, e.g. by warm air [m],
    shape [n]. None if unknown. `sigma` does not include it."""
    shared_memory: float = 0.0
    """Correlation time, in which the correlation of that error falls to 1/e [s]."""
    notes: tuple[str, ...] = ()
    """Warnings about its record, one sentence each."""

    def __post_init__(self) -> None:
        shape = (self.time.size,)
        check_shape(
            shape, time=self.time, displacement=self.displacement, **{"sigma of the flyer": self.sigma}
        )
        check_interval("(0, inf) m", **{"sigma of the flyer": self.sigma})
        check_interval("[0, inf) m", zero_sigma=self.zero_sigma)
        if self.shared_sigma is not None and np.any(self.shared_sigma):
            check_shape(shape, shared_sigma=self.shared_sigma)
            check_interval("[0, inf) m", shared_sigma=self.shared_sigma)
            check_interval("(0, inf) s", shared_memory=self.shared_memory)


@dataclass(frozen=True)
class FrontVelocity:
    """The velocity of the incident bar's face toward the specimen, from the waves in the bar."""

    time: FloatArray
    """Sample times on the shot's clock [s], shape [n]. They are uniform and begin at the wave's arrival at
    the face."""
    velocity: FloatArray
    """Velocity toward the specimen [m/s], shape [n]."""
    noise: float
    """Standard deviation of one sample's noise [m/s]. For slow noise, it is that of white noise with the same
    level at low frequencies."""
    sigma_gain: float = 0.0
    """Standard uncertainty of the scale, common to all samples [-]."""


@dataclass(frozen=True)
class CentreLine:
    """The specimen's outline on the camera side.

    Measured radius Z as a function of height y, frame by frame. One row is one point of one frame. The number
    of points may differ between frames.
    """

    time: FloatArray
    """Time of the point's frame on the shot's clock [s], shape [n]."""
    frame: IntArray
    """Frame number of the point, shape [n]."""
    y: FloatArray
    """Height above the transmission platen's initial plane, toward the flyer [m], shape [n]."""
    Z: FloatArray
    """Out-of-plane position from the specimen's axis: the model's r [m], shape [n]."""
    sigma: FloatArray
    """Standard deviation of Z, independent from point to point [m], shape [n]."""
    modes: FloatArray | None = None
    """Errors of Z that points and frames have in common, one standard deviation each [m], shape [n_modes, n].
    None if unknown."""

    def select(self, points: IntArray | BoolArray) -> "CentreLine":
        """A subset of the points, by number or as a mask."""
        columns = (self.time[points], self.frame[points], self.y[points], self.Z[points], self.sigma[points])
        return CentreLine(*columns, modes=None if self.modes is None else self.modes[:, points])


@dataclass(frozen=True)
class MaterialCurve:
    """A quasi-static uniaxial curve, tension-positive, from one branch (tension or compression)."""

    stretch: FloatArray
    """Stretch along the load, 1 at rest [-], shape [n]."""
    stress: FloatArray
    """Nominal stress, tension-positive [Pa], shape [n]."""
    sigma: FloatArray
    """Standard deviation of each stress, independent from point to point [Pa], shape [n]."""
    modes: FloatArray | None = None
    """Standard uncertainties common to all points, one row per source [Pa], shape [n_modes, n]. None if
    unknown."""
    conditioned: "MaterialCurve | None" = None
    """The same material's curve after earlier loading (Mullins), if known."""
    law: "explicit.materials.AnyLaw | None" = None
    """The closed-form law of this curve. None for a measured curve."""

    @property
    def total_sigma(self) -> FloatArray:
        """Standard uncertainty of each stress from all sources [Pa], shape [n]."""
        if self.modes is None:
            return self.sigma
        return np.asarray(np.sqrt(self.sigma**2 + (self.modes**2).sum(axis=0)))
