"""Residuals of a law against homogeneous tests, and the search for their least sum of squares.

Many starts are refined one by one. The number of starts that agree on the minimum is reported.

A stress is linear in the moduli of every law in this package. Only the other constants (exponents, locking
stretches) are therefore drawn, over decades. For each draw, the best moduli are one linear least-squares
problem (variable projection, Golub and Pereyra 1973). The best draws are then refined in all constants by a
trust-region method within the bounds (Branch, Coleman and Li 1999; `scipy.optimize.least_squares`). This
method makes no assumption on the law.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear
from scipy.stats import qmc

from explicit.materials import AnyLaw, bulk_modulus
from explicit.materials.law import ParameterSpec
from explicit.materials.volumetric import VolumetricLaw
from kolsky.base.arrays import FloatArray
from kolsky.material.fits.homogeneous import compressible_stress, free_stretch, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest

_FREE_POISSON = ParameterSpec(
    "poisson", "1", 0.0, 0.4999, 0.45, "Poisson's ratio at rest, of the bulk modulus", strict=True
)
"""The unknown in addition to a law's constants if the compressibility is free."""
_LATERAL_SCALE = 0.01
"""Error of lateral stretch that has the same weight as the largest stress in a fit [-]. It is the error of a
good strain measurement."""
REFUSED = 1e8
"""Residual, in units of the largest stress, for constants without a valid law or stress."""


class Weighting(Enum):
    """Divisor of the residuals."""

    ABSOLUTE = "absolute"
    """One stress for all points: the sum of squares in Pa^2 is minimised."""
    RELATIVE = "relative"
    """The measured stress of the point. Small strains then have the same weight as large ones."""
    SIGMA = "sigma"
    """The standard uncertainty of the point."""


@dataclass(frozen=True)
class Residuals:
    """Weighted residuals of a law as a function of its free constants.

    Its unknowns are the free constants, with moduli in units of the largest measured stress. All unknowns are
    then of one size. Raises ValueError if the tests and the law do not fit together.
    """

    law: type[AnyLaw]
    tests: tuple[HomogeneousTest, ...]
    weighting: Weighting = Weighting.ABSOLUTE
    held: Mapping[str, float] = field(default_factory=dict)
    """Constants that are not free, in SI."""
    poisson: float | None = None
    """Poisson's ratio at rest for the compressible solution; None for the incompressible one."""
    free_poisson: bool = False
    """True if this ratio is the last unknown. The tests' lateral stretches are then fitted too."""

    def __post_init__(self) -> None:
        law = self.law
        if not self.tests:
            raise ValueError("a fit needs at least one test")
        names = [spec.name for spec in law.PARAMETERS]
        for name in self.held:
            if name not in names:
                raise ValueError(f"{law.NAME} has no constant {name!r}; it has {', '.join(names)}")
        if self.free_poisson and all(test.lateral is None for test in self.tests):
            raise ValueError("Poisson's ratio is free only where a test has lateral stretches")
        if not self.free:
            raise ValueError(f"{law.NAME}: all constants are held, nothing is left to fit")
        for test in self.tests:
            if self.weighting is Weighting.SIGMA and test.sigma is None:
                raise ValueError(f"{test.name} has no sigma to be weighted by: weight absolute or relative")
            zero = (test.stress == 0.0) & (test.strain != 0.0)
            if self.weighting is Weighting.RELATIVE and zero.any():
                raise ValueError(
                    f"{test.name}: the stress is 0 at strain {test.strain[zero][0]:.6g}, so no relative "
                    "residual exists: leave the point out, or weight absolute"
                )
        if self.n <= len(self.free):
            raise ValueError(
                f"{law.NAME} has {len(self.free)} free constants, the tests only {self.n} points"
            )

    @cached_property
    def free(self) -> tuple[ParameterSpec, ...]:
        """The free constants, in the order of the law, and Poisson's ratio if it is free."""
        constants = tuple(spec for spec in self.law.PARAMETERS if spec.name not in self.held)
        return (*constants, _FREE_POISSON) if self.free_poisson else constants

    @property
    def linear(self) -> bool:
        """True if all unknowns are moduli. Least squares then have one minimum, and one start finds it."""
        return all(spec.unit == "Pa" for spec in self.free)

    @cached_property
    def stress_scale(self) -> float:
        """Largest measured stress [Pa]."""
        return max(float(np.abs(test.stress).max()) for test in self.tests)

    @cached_property
    def units(self) -> FloatArray:
        """SI per unit of the unknowns, shape [n_free]."""
        return np.array([self.stress_scale if spec.unit == "Pa" else 1.0 for spec in self.free])

    @cached_property
    def counted(self) -> tuple[FloatArray, ...]:
        """Factor of every residual [1/Pa], shape [n] for each test.

        It is 0 for a point at rest under relative weighting. There, law and measurement are both zero and
        give no information.
        """
        factors = []
        for test in self.tests:
            if self.weighting is Weighting.SIGMA:
                assert test.sigma is not None
                divisor = test.sigma
            elif self.weighting is Weighting.RELATIVE:
                divisor = np.where(test.strain == 0.0, np.inf, np.abs(test.stress))
            else:
                divisor = np.full(len(test.stress), self.stress_scale)
            factors.append(1.0 / divisor)
        return tuple(factors)

    @cached_property
    def n(self) -> int:
        """Number of residuals with a nonzero weight."""
        lateral = sum(t.lateral.size for t in self.tests if t.lateral is not None) if self.free_poisson else 0
        return lateral + sum(int(np.count_nonzero(factor)) for factor in self.counted)

    def build(self, unknowns: FloatArray) -> AnyLaw:
        """The law for given unknowns. Raises ValueError if they give no valid law."""
        values = dict(self.held)
        values.update({spec.name: float(x) for spec, x in zip(self.free, unknowns * self.units, strict=True)})
        values.pop(_FREE_POISSON.name, None)
        return self.law.of([values[spec.name] for spec in self.law.PARAMETERS])

    def ratio(self, unknowns: FloatArray) -> float | None:
        """Poisson's ratio of the unknowns, or the held one."""
        return float(unknowns[-1]) if self.free_poisson else self.poisson

    def stress(self, law: AnyLaw, poisson: float | None) -> tuple[FloatArray, ...]:
        """Nominal stress of a law at the points of each test [Pa]; incompressible without a ratio.

        Raises ValueError if the compressible solution does not exist at some point.
        """
        if poisson is None:
            return tuple(incompressible_stress(law, test.mode, test.deformation) for test in self.tests)
        volume = VolumetricLaw(float(bulk_modulus(law.shear_modulus, poisson)))
        return tuple(compressible_stress(law, volume, test.mode, test.deformation) for test in self.tests)

    def lateral(self, law: AnyLaw, poisson: float | None) -> list[FloatArray]:
        """Simulated minus measured lateral stretch over `LATERAL_SCALE`, if it is fitted [-]."""
        if not self.free_poisson or poisson is None:
            return []
        volume = VolumetricLaw(float(bulk_modulus(law.shear_modulus, poisson)))
        return [
            (free_stretch(law, volume, test.mode, test.deformation) - test.lateral) / _LATERAL_SCALE
            for test in self.tests
            if test.lateral is not None
        ]

    @cached_property
    def _rows(self) -> int:
        lateral = [t.lateral for t in self.tests if t.lateral is not None] if self.free_poisson else []
        return sum(len(test.stress) for test in self.tests) + sum(len(row) for row in lateral)

    def __call__(self, unknowns: FloatArray) -> FloatArray:
        """Weighted residuals of all tests, one after the other [-], shape [n_points]."""
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                law, ratio = self.build(unknowns), self.ratio(unknowns)
                predicted, across = self.stress(law, ratio), self.lateral(law, ratio)
            except ValueError:
                return np.full(self._rows, REFUSED)
            rows = [
                (T - test.stress) * factor
                for T, test, factor in zip(predicted, self.tests, self.counted, strict=True)
            ]
            whole = np.concatenate([*rows, *across])
            return np.where(np.abs(whole) < REFUSED, whole, REFUSED)


DECADES = 2.0
"""Number of decades on each side of the example. A constant without two finite bounds is drawn over this
range."""
_LEAST_SIZE = 0.3
"""Smallest drawn size of a constant that may have both signs, such as an exponent of Ogden's law."""
ROUGH, FINE = 60, 500
"""Largest number of evaluations of the Jacobian: first for every start, then for the best starts."""
BEST = 3
"""Number of starts that are refined to convergence."""
TIGHT = 1e-14
"""Relative change of sum, constants or gradient at which a search ends. It is that of the last digits."""
EQUAL_MINIMA = 1e-6
"""Relative difference of sums of squares. Below it, two searches have found the same minimum."""
EXACT = 1e-12
"""Sum of squares, in units of the largest stress, below which a law fits the data to round-off. Searches that
end below it are equal."""
_NO_MODULUS = 1e-6
"""Initial shear modulus divided by the largest stress. Below it, a search has reached the limit of valid
laws."""
_NO_LAW = (
    "{}: least squares lead to constants that are not a law (the initial shear modulus would not be > 0, or "
    "there is no stress at a point); keep the bounds of a positive energy, or take a law with fewer constants"
)
_NEAR_BOUND = 1e-7
"""A constant lies at a bound if its distance, relative to the constant's size, is below this."""


@dataclass(frozen=True)
class SearchResult:
    """The least sum of squares of the search."""

    unknowns: FloatArray
    """Free constants in the units of `Residuals`, shape [n_free]."""
    chi2: float
    """Sum of squared residuals [-]."""
    jacobian: FloatArray
    """Derivative of the residuals by the unknowns, shape [n_points, n_free]."""
    at_bound: tuple[bool, ...]
    """True for unknowns at a bound."""
    ends: tuple[float, ...]
    """Sum of squares of each refined start, least first."""
    agreeing: int = 1
    """Starts that reached the least one."""
    unbounded: float = np.nan
    """Smallest sum of squares without the bounds of a positive energy, from the bounded optimum on [-]. NaN
    if no unknown lies at a bound."""


ROUNDS = 3
"""Largest number of rounds of drawn starts until two agree."""


def search(residuals: Residuals, *, bounded: bool, starts: int, seed: int) -> SearchResult:
    """Minimise the sum of squares, with more starts until two of them agree.

    A search without bounds also begins at the bounded optimum, and is therefore never worse.

    ``bounded``: True to keep within the bounds in which the energy is positive; otherwise within those in
    which the law exists. ``starts``: number of starts that are refined. Raises ValueError if the least
    squares lie outside the valid laws: the initial shear modulus would not be > 0, or a point has no stress.
    """
    lower, upper = bounds_of(residuals, bounded=bounded)
    known = []
    if not bounded and not residuals.linear:
        try:
            known = [search(residuals, bounded=True, starts=starts, seed=seed).unknowns]
        except ValueError:
            known = []  # no law with a positive energy fits the data: only the free search is used
    ends: list[tuple[float, FloatArray]] = []
    for number in range(ROUNDS):
        begun = known + _starts(residuals, lower, upper, starts, seed + number)
        known = []
        ends += [_refined(residuals, start, lower, upper, ROUGH, "2-point") for start in begun]
        ends = sorted((end for end in ends if end[0] < REFUSED), key=lambda end: end[0])
        if not ends:
            raise ValueError(_NO_LAW.format(residuals.law.NAME))
        ends[:BEST] = [_refined(residuals, x, lower, upper, FINE, "3-point") for _, x in ends[:BEST]]
        ends.sort(key=lambda end: end[0])
        agreeing = sum(chi2 <= ends[0][0] * (1.0 + EQUAL_MINIMA) + EXACT for chi2, _ in ends)
        if agreeing > 1 or residuals.linear:
            break
    chi2, x = ends[0]
    if residuals.build(x).shear_modulus < _NO_MODULUS * residuals.stress_scale:
        raise ValueError(_NO_LAW.format(residuals.law.NAME))
    chi2, x, at = _snapped_to_bounds(residuals, chi2, x, lower, upper)
    jacobian = least_squares(residuals, x, jac="3-point", max_nfev=1, x_scale="jac").jac
    unbounded = np.nan
    if bounded and at.any():
        wide = bounds_of(residuals, bounded=False)
        unbounded = min(chi2, _refined(residuals, x, *wide, FINE, "3-point")[0])
    sums = tuple(end[0] for end in ends)
    return SearchResult(x, chi2, np.asarray(jacobian), tuple(map(bool, at)), sums, agreeing, unbounded)


def bounds_of(residuals: Residuals, *, bounded: bool) -> tuple[FloatArray, FloatArray]:
    """Bounds of the unknowns, shape [n_free] each.

    ``bounded``: True for those in which the energy is positive; otherwise those in which the law exists.
    """
    lower, upper = [], []
    for spec, unit in zip(residuals.free, residuals.units, strict=True):
        kept = bounded or spec.strict
        lower.append(spec.lower / unit if kept else -np.inf)
        upper.append(spec.upper / unit if kept else np.inf)
    return np.array(lower), np.array(upper)


def _starts(
    residuals: Residuals, lower: FloatArray, upper: FloatArray, count: int, seed: int
) -> list[FloatArray]:
    """Starts inside the bounds, most promising first."""
    linear = np.array([spec.unit == "Pa" for spec in residuals.free])
    shapes = [spec for spec in residuals.free if spec.unit != "Pa"]
    examples = np.array([spec.example for spec in residuals.free]) / residuals.units
    if shapes:
        cube = qmc.LatinHypercube(len(shapes), rng=np.random.default_rng(seed)).random(16 * count)
        drawn = np.column_stack([_drawn(spec, u) for spec, u in zip(shapes, cube.T, strict=True)])
    else:
        drawn, count = np.empty((1, 0)), 1
    ranked = []
    for shape in drawn:
        x = examples.copy()
        x[~linear] = shape
        x = _with_best_moduli(residuals, x, linear, lower, upper)
        chi2 = float(np.sum(residuals(x) ** 2))
        if chi2 < REFUSED:
            ranked.append((chi2, x))
    ranked.sort(key=lambda pair: pair[0])
    chosen: list[FloatArray] = []
    for _, x in ranked:
        # Starts with nearly the same exponents would reach the same minimum.
        if all(np.max(np.abs(x - y) / (np.abs(x) + np.abs(y) + 1e-12)) > 0.05 for y in chosen):
            chosen.append(x)
        if len(chosen) == count:
            break
    return chosen


def _drawn(spec: ParameterSpec, u: FloatArray) -> FloatArray:
    """Values of a pure number inside the bounds of a positive energy, log-uniform in size."""
    if spec.lower < 0.0 < spec.upper:
        sign, share = np.where(u < 0.5, -1.0, 1.0), np.where(u < 0.5, 2.0 * u, 2.0 * u - 1.0)
        return np.asarray(sign * _LEAST_SIZE * (min(-spec.lower, spec.upper) / _LEAST_SIZE) ** share)
    low = max(spec.lower, spec.example * 10.0**-DECADES)
    return np.asarray(low * (min(spec.upper, spec.example * 10.0**DECADES) / low) ** u)


def _with_best_moduli(
    residuals: Residuals, x: FloatArray, linear: NDArray[np.bool_], lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """The same pure numbers with the moduli of least squares. The stress is taken as linear in them."""
    if not linear.any():
        return x
    columns = []
    for k in np.flatnonzero(linear):
        higher = x.copy()
        higher[k] += abs(x[k])
        columns.append((residuals(higher) - residuals(x)) / abs(x[k]))
    A = np.column_stack(columns)
    if not np.isfinite(A).all() or np.abs(A).max() >= REFUSED:
        return x
    with np.errstate(invalid="ignore"):  # SciPy multiplies by the infinite way to a bound that is not there
        solved = lsq_linear(A, A @ x[linear] - residuals(x), (lower[linear], upper[linear]), tol=1e-13)
    best = x.copy()
    best[linear] = solved.x
    return best


def _refined(
    residuals: Residuals, x: FloatArray, lower: FloatArray, upper: FloatArray, most: int, jac: str
) -> tuple[float, FloatArray]:
    """Sum of squares and unknowns at the end of a search from x."""
    size = np.maximum(np.abs(x), 1e-6)
    inside = np.clip(x, np.where(np.isfinite(lower), lower + 1e-9 * size, lower), upper - 1e-9 * size)
    with np.errstate(over="ignore", invalid="ignore"):
        end = least_squares(
            residuals, inside, jac=jac, bounds=(lower, upper), x_scale="jac",
            ftol=TIGHT, xtol=TIGHT, gtol=TIGHT, max_nfev=most,
        )  # fmt: skip
    return float(2.0 * end.cost), np.asarray(end.x)


def _snapped_to_bounds(
    residuals: Residuals, chi2: float, x: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[float, FloatArray, NDArray[np.bool_]]:
    """The minimum with unknowns near a bound moved onto it, because a trust region never reaches a bound."""
    size = np.maximum(np.abs(x), 1.0)
    low, high = x - lower < _NEAR_BOUND * size, upper - x < _NEAR_BOUND * size
    placed = np.where(low, lower, np.where(high, upper, x))
    there = float(np.sum(residuals(placed) ** 2))
    if there <= chi2 * (1.0 + EQUAL_MINIMA):
        return there, placed, low | high
    return chi2, x, np.zeros(len(x), dtype=bool)
