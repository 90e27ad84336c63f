r"""A curve with its band: what is uncertain together along the curve is kept together.

.. math:: T = \bar T + \sum_j z_j\,\mathbf m_j + \boldsymbol\sigma \circ \boldsymbol\epsilon , \qquad
          z_j, \epsilon_i \sim N(0, 1)

A *mode* :math:`\mathbf m_j` moves the whole curve by one standard uncertainty of one cause. Specimens differ
as wholes: one that is 5 % too stiff is so at every strain, and drawing points one by one would average that
away, in the curve and in every stiffness that is compared with it.

The *apparent modulus* of a curve follows from Gaussian rubber elasticity,

.. math:: E_a = \frac{3 T}{\lambda - \lambda^{-2}} \tag{M.9}

with the nominal stress :math:`T = L / \pi r^2`. For a solid that obeys the theory it is one number at all
strains; what changes with the strain is the material, what changes with the time is relaxation.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from kolsky.base.arrays import FloatArray
from kolsky.material.curves.uniaxial import gaussian_strain

COVERAGE = 2.0
"""Coverage factor k of an interval; the modes between tests are widened so that it is Student's 95.45 %."""


@dataclass(frozen=True)
class CurveBand:
    """Nominal stress over nominal strain, both positive along the branch, with its uncertainty."""

    strain: FloatArray
    """Nominal strain, ascending [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    noise: FloatArray
    """Standard uncertainty that is independent from point to point [Pa], shape [n]."""
    modes: FloatArray
    """Standard uncertainties that are common to all points [Pa], shape [n_modes, n]."""
    names: tuple[str, ...]
    """Cause of each mode, length n_modes."""

    def __post_init__(self) -> None:
        n = self.strain.size
        if self.stress.shape != (n,) or self.noise.shape != (n,) or self.modes.shape != (len(self.names), n):
            raise ValueError("stress, noise and modes need one value for each strain, and modes their names")

    @property
    def sigma(self) -> FloatArray:
        """Combined standard uncertainty [Pa], shape [n]."""
        return np.asarray(np.sqrt(self.noise**2 + (self.modes**2).sum(axis=0)))

    def interval(self, k: float = COVERAGE) -> tuple[FloatArray, FloatArray]:
        """Both ends of the band at each strain [Pa], shape [n] each."""
        return self.stress - k * self.sigma, self.stress + k * self.sigma

    def draws(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Curves drawn from the band [Pa], shape [n, n_points]."""
        return np.asarray(
            self.stress
            + rng.standard_normal((n, len(self.names))) @ self.modes
            + self.noise * rng.standard_normal((n, self.stress.size))
        )

    def times(self, factor: FloatArray | float) -> "CurveBand":
        """The curve and all its uncertainties multiplied by a factor, shape [n] or a number."""
        return replace(
            self, stress=self.stress * factor, noise=self.noise * factor, modes=self.modes * factor
        )

    def with_mode(self, name: str, mode: FloatArray) -> "CurveBand":
        """With one more cause: its standard uncertainty along the curve [Pa], shape [n]."""
        return replace(self, modes=np.vstack([self.modes, mode]), names=(*self.names, name))

    def parts(self) -> dict[str, FloatArray]:
        """Standard uncertainty by cause, modes of one name in quadrature [Pa], shape [n] each."""
        found = {"noise": self.noise}
        for name in dict.fromkeys(self.names):
            rows = self.modes[[other == name for other in self.names]]
            found[name] = np.sqrt((rows**2).sum(axis=0))
        return found


def student_factor(freedom: int) -> float:
    """Widening of a standard uncertainty with few degrees of freedom: t_p(nu) / k at k's p.

    Raises
    ------
    ValueError
        If there is no degree of freedom.
    """
    if freedom < 1:
        raise ValueError(f"a scatter needs at least 1 degree of freedom, got {freedom}")
    return float(student.ppf(norm.cdf(COVERAGE), freedom)) / COVERAGE


def mean_of_repeats(strain: FloatArray, values: FloatArray) -> CurveBand:
    """Mean of repeated tests; their scatter as modes of the mean, widened for its degrees of freedom.

    The covariance of the mean is that of the tests over their number, S / n. Its square root is taken from
    the tests' deviations themselves (singular values), n - 1 modes that reproduce it exactly.

    Parameters
    ----------
    strain
        Common axis [-], shape [n_points].
    values
        Every test on it [Pa], shape [n_tests, n_points], at least two tests.

    Raises
    ------
    ValueError
        If there are fewer than two tests.
    """
    count = len(values)
    if count < 2:
        raise ValueError(f"a scatter needs at least 2 tests, got {count}")
    mean = values.mean(axis=0)
    _, size, shape = np.linalg.svd((values - mean) / np.sqrt(count * (count - 1.0)), full_matrices=False)
    used = min(count - 1, strain.size)  # the deviations sum to zero
    modes = student_factor(count - 1) * size[:used, None] * shape[:used]
    return CurveBand(strain, mean, np.zeros_like(mean), modes, ("between tests",) * used)


def resample(strain: FloatArray, value: FloatArray, axis: FloatArray) -> tuple[FloatArray, float]:
    """A test's values on an axis, and the standard deviation of one of its samples about a smooth curve.

    At each place a straight line is fitted to the samples within half the axis' spacing; with fewer than four
    of them the neighbours are joined. The noise is that of second differences over neighbouring samples,
    which a smooth curve hardly has.

    Parameters
    ----------
    strain, value
        Samples in any order [-] and [Pa], shape [n], at least three.
    axis
        Ascending places inside their range, shape [m], at least two.
    """
    order = np.argsort(strain, kind="stable")
    x, y = strain[order], value[order]
    half = 0.5 * np.median(np.diff(axis))
    first, last = np.searchsorted(x, axis - half), np.searchsorted(x, axis + half, side="right")
    found = np.interp(axis, x, y)
    for i in np.flatnonzero(last - first >= 4):
        near = slice(first[i], last[i])
        if x[near][-1] > x[near][0]:
            height = np.polyfit(x[near] - axis[i], y[near], 1)[1]
            inside = x[near][0] <= axis[i] <= x[near][-1]
            found[i] = height if inside else found[i]
    return found, _noise(x, y)


def _noise(x: FloatArray, y: FloatArray) -> float:
    """From each sample's distance to the line between its neighbours, robust against a kink."""
    left, right = x[1:-1] - x[:-2], x[2:] - x[1:-1]
    apart = (left + right) > 0.0
    if not apart.any():
        return 0.0
    share = right[apart] / (left + right)[apart]
    gap = y[1:-1][apart] - share * y[:-2][apart] - (1.0 - share) * y[2:][apart]
    gap = gap / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    return float(np.median(np.abs(gap)) / norm.ppf(0.75))


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
        True if the branch is compression.
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
