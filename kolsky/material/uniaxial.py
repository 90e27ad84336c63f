"""Quasi-static uniaxial tests: ramps, holds, toe, and the mean of repeats with its band.

The band of a curve separates common uncertainty from noise, because errors are correlated along the curve.

.. math::

   T = \\bar T + \\sum_j z_j\\,\\mathbf m_j + \\boldsymbol\\sigma \\circ \\boldsymbol\\epsilon ,
   \\qquad z_j, \\epsilon_i \\sim N(0, 1)

A *mode* :math:`\\mathbf m_j` moves the whole curve by one standard uncertainty of one cause. Specimens differ
in their overall stiffness: a specimen that is 5 % too stiff is 5 % too stiff at every strain. Drawing points
independently would average this out, in the curve and in every stiffness compared with it.

The *apparent modulus* of a curve follows from Gaussian rubber elasticity,

.. math:: E_a = \\frac{3 T}{\\lambda - \\lambda^{-2}} \\tag{M.9}

with the nominal stress :math:`T = L / \\pi r^2`. For a solid that obeys the theory it is the same at all
strains. A change with strain shows the material's deviation from the theory, a change with time shows
relaxation.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtr, ndtri, stdtrit

from dic.basics import check_interval, check_shape
from kolsky.base.arrays import FloatArray

REVERSAL = 0.05
"""The strain has reversed if it has decreased by this share of the test's range."""


@dataclass(frozen=True)
class UniaxialTest:
    """One test, positive along its branch: shortening in compression, lengthening in tension."""

    name: str
    strain: FloatArray
    """Nominal strain [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    compression: bool
    """True if the branch is compression."""
    time: FloatArray | None = None
    """Time of the samples [s], shape [n]; None if not recorded."""
    bulge: FloatArray | None = None
    """Radius at mid-height [m], shape [n]; None if not measured."""

    def __post_init__(self) -> None:
        columns = [self.strain, self.stress, self.time, self.bulge]
        for column in columns:
            if column is not None and (column.shape != self.strain.shape or not np.isfinite(column).all()):
                raise ValueError(f"{self.name}: every column must be finite and of one length")
        if self.strain.ndim != 1 or self.strain.size < 2:
            raise ValueError(f"{self.name}: a test needs at least 2 samples, got {self.strain.size}")

    def part(self, samples: slice | NDArray[np.bool_]) -> "UniaxialTest":
        """A subset of its samples."""
        columns = {"strain": self.strain, "stress": self.stress, "time": self.time, "bulge": self.bulge}
        kept: dict[str, Any] = {key: x[samples] for key, x in columns.items() if x is not None}
        return replace(self, **kept)

    def without_machine(self, compliance: float, *, area: float, length: float) -> "UniaxialTest":
        """The test without the deformation of the machine: u = u_measured - C F.

        ``compliance``: compliance C of machine, load cell and platens in series [m/N]. ``area``, ``length``:
        undeformed cross-section [m^2] and length [m] of the specimen.
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
    """The stretches of samples with increasing strain, in the order of the test.

    A reversal counts if the strain has decreased by `REVERSAL` of the test's range. Noise therefore causes
    none. The first ramp is the first pull. The last of several ramps belongs to the conditioned material
    (Mullins).
    """
    strain = test.strain
    least = REVERSAL * float(np.ptp(strain))
    ramps: list[slice] = []
    rising, start, extreme = True, 0, 0
    for i, now in enumerate(np.append(strain, -np.inf)):  # whose last value ends the last ramp
        sign = 1.0 if rising else -1.0
        if sign * (now - strain[extreme]) > 0.0:
            extreme = i
        elif sign * (strain[extreme] - now) > least:
            if rising and strain[extreme] - strain[start] > least:
                ramps.append(slice(start, extreme + 1))
            rising, start, extreme = not rising, extreme, i
    if not ramps:
        raise ValueError(f"{test.name}: the strain never rises; is its sign declared correctly?")
    return ramps


def gaussian_strain(strain: FloatArray, *, compression: bool) -> FloatArray:
    """lam - lam^-2 as a magnitude [-]; the stress of a Gaussian network is E_a / 3 times it, Eq. (M.9)."""
    lam = 1.0 - strain if compression else 1.0 + strain
    return np.asarray(np.abs(lam - lam**-2))


FEWEST = 5
"""Smallest number of samples in a range of extrapolation."""


@dataclass(frozen=True)
class Toe:
    """Method for the zero of the strain."""

    kind: Literal["none", "line", "gaussian"] = "none"
    """"none": the recorded strain is used. "line": a straight line is continued to zero stress (toe
    compensation of ASTM D695). "gaussian": the curve of Gaussian rubber elasticity, Eq. (M.9), is continued.
    It has the curvature of soft solids."""
    low: float = 0.02
    """Recorded strain above which the faces are in full contact [-]."""
    high: float = 0.10
    """Upper strain of the range for the extrapolation of the curve [-]."""

    def __post_init__(self) -> None:
        if self.kind not in ("none", "line", "gaussian"):
            raise ValueError(f"a toe is 'none', 'line' or 'gaussian', got {self.kind!r}")
        if not 0.0 <= self.low < self.high < 1.0:
            raise ValueError(
                f"a toe is continued from strains 0 <= low < high < 1, got {self.low} to {self.high}"
            )


@dataclass(frozen=True)
class ZeroedTest:
    """A test with zero strain at the specimen's first full contact, by its toe."""

    test: UniaxialTest
    """The test from the end of its toe on."""
    offset: float
    """Strain that was subtracted [-]."""
    sigma: float
    """Its standard uncertainty from the scatter about the continued curve [-]."""


def correct_toe(test: UniaxialTest, toe: Toe) -> ZeroedTest:
    """Find the zero of the strain and remove the toe."""
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


NEAR = 0.005
"""A strain is held if its distance from the ramp's end is within this share of the ramp's range [-]."""
LONG = 0.05
"""Share of the ramp's duration (of its samples if no time was recorded) [-]. A strain that stays near the end
for longer is held. A steady ramp spends `NEAR` of its duration there."""
LOSS = 0.01
"""Share of the stress that must relax for a hold to be reported [-]."""


@dataclass(frozen=True)
class Hold:
    """A strain that was held after a ramp."""

    strain: float
    """Held strain [-]."""
    duration: float | None
    """Duration of the hold [s]; None if no time was recorded."""
    samples: int
    first: float
    """Nominal stress at its beginning [Pa]."""
    last: float
    """Nominal stress at its end [Pa]."""


def divide_ramp_and_hold(test: UniaxialTest, ramp: slice) -> tuple[slice, Hold | None]:
    """A ramp that ends when its strain is reached, if there is a hold after it; else the unchanged ramp.

    With noise, the largest strain of a record lies somewhere in the hold. The ramp up to it would include
    relaxed stresses.
    """
    strain = test.strain
    begin, stop = int(ramp.start), int(ramp.stop)
    top = float(strain[stop - 1])
    near = NEAR * (top - float(strain[begin:stop].min()))
    reached = begin + int(np.argmax(strain[begin:stop] >= top - near))
    left = np.flatnonzero(np.abs(strain[reached:] - top) > 2.0 * near)
    end = reached + int(left[0]) if left.size else strain.size
    if end - reached < 2:
        return ramp, None
    if test.time is None:
        share, duration = (end - reached) / max(1, reached - begin), None
    else:
        before = float(test.time[reached] - test.time[begin])
        duration = float(test.time[end - 1] - test.time[reached])
        share = duration / before if before > 0.0 else np.inf
    if share <= LONG:
        return ramp, None
    first, last = float(test.stress[reached]), float(test.stress[end - 1])
    return slice(begin, reached + 1), Hold(float(strain[reached]), duration, end - reached, first, last)


def remarks_of(name: str, hold: Hold | None) -> tuple[str, ...]:
    """The remark on a curve without the hold, if the stress relaxes in it."""
    if hold is None or abs(hold.last - hold.first) <= LOSS * abs(hold.first):
        return ()
    long = f"{hold.samples} samples" if hold.duration is None else f"{hold.duration:.4g} s"
    return (
        f"{name}: its strain is held at {hold.strain:.3g} for {long} and the stress goes from"
        f" {1e-3 * hold.first:.4g} to {1e-3 * hold.last:.4g} kPa; this relaxation is not in the curve,"
        " `kolsky material relaxation` reads it",
    )


COVERAGE = 2.0
"""Coverage factor k of an interval. The modes between tests are widened to give Student's 95.45 %."""


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

    def times(self, factor: FloatArray | float) -> "CurveBand":
        """The curve and all its uncertainties multiplied by a factor, shape [n] or a number."""
        stress, noise, modes = self.stress * factor, self.noise * factor, self.modes * factor
        return replace(self, stress=stress, noise=noise, modes=modes)

    def with_mode(self, name: str, mode: FloatArray) -> "CurveBand":
        """The band with one more source: its standard uncertainty along the curve [Pa], shape [n]."""
        return replace(self, modes=np.vstack([self.modes, mode]), names=(*self.names, name))

    def parts(self) -> dict[str, FloatArray]:
        """Standard uncertainty by source, modes of one name in quadrature [Pa], shape [n] each."""
        found = {"noise": self.noise}
        for name in dict.fromkeys(self.names):
            rows = self.modes[[other == name for other in self.names]]
            found[name] = np.sqrt((rows**2).sum(axis=0))
        return found


def student_factor(freedom: int) -> float:
    """Widening of a standard uncertainty with few degrees of freedom: t_p(nu) / k at k's p."""
    if freedom < 1:
        raise ValueError(f"a scatter needs at least 1 degree of freedom, got {freedom}")
    return float(stdtrit(freedom, ndtr(COVERAGE))) / COVERAGE


def mean_of_repeats(strain: FloatArray, values: FloatArray) -> CurveBand:
    """Mean of repeated tests. Their scatter gives modes of the mean, widened for its degrees of freedom.

    The covariance of the mean is that of the tests divided by their number, S / n. Its modes come from the
    singular values of the tests' deviations. The n - 1 modes reproduce it exactly. ``strain``: common axis
    [-], shape [n_points]. ``values``: every test on it [Pa], shape [n_tests, n_points]. Raises ValueError if
    there are fewer than two tests.
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
    """A test's values on an axis, and the standard deviation of one sample about a smooth curve.

    At each position, a straight line is fitted to the samples within half the axis' spacing. With fewer than
    four samples, neighbours are interpolated. The noise is estimated from second differences of neighbouring
    samples, which are small for a smooth curve.

    ``strain``, ``value``: samples in any order [-] and [Pa], shape [n], at least three. ``axis``: ascending
    places inside their range, shape [m], at least two. Raises ValueError if a place is outside this range, or
    if a value is not finite.
    """
    check_shape(strain.shape, strain=strain, value=value)
    check_interval(f"[{strain.min()}, {strain.max()}]", axis=axis)
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
    """Noise from the distance of each sample to the line between its neighbours, whatever the kinks."""
    left, right = x[1:-1] - x[:-2], x[2:] - x[1:-1]
    apart = (left + right) > 0.0
    if not apart.any():
        return 0.0
    share = right[apart] / (left + right)[apart]
    gap = y[1:-1][apart] - share * y[:-2][apart] - (1.0 - share) * y[2:][apart]
    gap = gap / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    return float(np.median(np.abs(gap)) / ndtri(0.75))


def noise_about_curve(strain: FloatArray, value: FloatArray, axis: FloatArray) -> FloatArray:
    """Standard deviation of the few readings of a test about a smooth curve, shape of `axis`.

    A smooth curve bends between few readings by more than their noise, and second differences contain the
    bend. They are therefore taken from the residuals of a polynomial, of the fifth order with twenty readings
    or more. Few readings do not show whether noise grows with the reading. The larger of a constant and a
    proportional noise is therefore taken. ``strain``, ``value``: in any order [-] and [Pa], at least four.
    """
    order = np.argsort(strain, kind="stable")
    x, y = strain[order], value[order]
    smooth = np.polynomial.Polynomial.fit(x, y, min(5, x.size // 4))
    left, curve = y - smooth(x), smooth(axis)
    # Near zero stress a ratio has no meaning. Stresses below a thousandth of the largest are replaced by that
    # thousandth.
    share = _noise(x, left / np.maximum(np.abs(smooth(x)), 1e-3 * np.abs(y).max()))
    return np.asarray(np.maximum(_noise(x, left), share * np.abs(curve)))


@dataclass(frozen=True)
class ApparentModulus:
    """E_a of a curve with its interval."""

    strain: FloatArray
    """Nominal strain, positive along the branch [-], shape [n]."""
    time: FloatArray | None
    """Time since the strain was zero, mean of the tests [s], shape [n]; None if a test has no times."""
    modulus: FloatArray
    """E_a [Pa], shape [n]."""
    sigma: FloatArray
    """Its standard uncertainty [Pa], shape [n]."""
    mean: float
    """Mean over the curve, with equal weight for each strain [Pa]."""
    mean_sigma: float
    """Its standard uncertainty with the correlation of errors common to all points [Pa]."""

    def interval(self, k: float = COVERAGE) -> tuple[FloatArray, FloatArray]:
        """Both ends of the interval at each strain [Pa], shape [n] each."""
        return self.modulus - k * self.sigma, self.modulus + k * self.sigma


def apparent_modulus(
    band: CurveBand, *, compression: bool, time: FloatArray | None = None
) -> ApparentModulus:
    """E_a of a curve, Eq. (M.9). Raises ValueError if a strain is not > 0: there is no quotient.

    ``band``: positive along the branch. ``time``: time of each point since the strain was zero [s].
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
