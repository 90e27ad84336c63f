r"""The apparent modulus by Gaussian rubber elasticity, against strain and time.

.. math:: E_a = \frac{3 T}{\lambda - \lambda^{-2}} \tag{M.9}

with the nominal stress :math:`T = L / \pi r^2`. For a solid that obeys the theory it is one number at all
strains; what changes with the strain is the material, what changes with the time is relaxation.
"""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import COVERAGE, CurveBand
from kolsky.material.curves.uniaxial import gaussian_strain


@dataclass(frozen=True)
class ApparentModulus:
    """E_a of a curve with its interval."""

    strain: FloatArray
    """Nominal strain, positive along the branch [-], shape [n]."""
    time: FloatArray | None
    """Time since the strain was zero, mean of the tests [s], shape [n]; None if one has no times."""
    modulus: FloatArray
    """Apparent modulus [Pa], shape [n]."""
    sigma: FloatArray
    """Its standard uncertainty [Pa], shape [n]."""
    mean: float
    """Mean over the curve, each strain alike [Pa]."""
    mean_sigma: float
    """Its standard uncertainty, with what is common to all points kept together [Pa]."""

    def interval(self, k: float = COVERAGE) -> tuple[FloatArray, FloatArray]:
        """Both ends of the interval at each strain [Pa], shape [n] each."""
        return self.modulus - k * self.sigma, self.modulus + k * self.sigma


def apparent_modulus(
    band: CurveBand, *, compression: bool, time: FloatArray | None = None
) -> ApparentModulus:
    """E_a of a curve, Eq. (M.9).

    Parameters
    ----------
    band
        Nominal stress over nominal strain, both positive along the branch, no point at rest.
    compression
        Whether the branch is compression.
    time
        Time of each point since the strain was zero [s], shape [n].

    Raises
    ------
    ValueError
        If a strain is not > 0, where the quotient has no value.
    """
    if (band.strain <= 0.0).any():
        raise ValueError(f"E_a needs strains > 0, got {band.strain.min():.6g}: leave out the point at rest")
    factor = 3.0 / gaussian_strain(band.strain, compression=compression)
    scaled = band.times(factor)
    common = scaled.modes.mean(axis=1)  # a mode moves all points together
    alone = scaled.noise / band.strain.size
    return ApparentModulus(
        strain=band.strain,
        time=time,
        modulus=scaled.stress,
        sigma=scaled.sigma,
        mean=float(scaled.stress.mean()),
        mean_sigma=float(np.sqrt((common**2).sum() + (alone**2).sum())),
    )
