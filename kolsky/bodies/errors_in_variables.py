"""Fit constants to forces and displacements that both have errors (Schumacher and others 2020, Eqs. 1-2).

In their objective, the force of every sample, f_i, is an unknown. The simulation under this force gives the
displacement:

    g = sum_i 1/2 (d(p, f_i) - d_i)^2 + w_f 1/2 (f_i - F_i)^2,                                  (S.1)

with measured d_i and F_i. In equilibrium, each force has one displacement. The displacement can therefore be
the unknown instead, and every simulation prescribes displacements. With the noise sigma_d and sigma_f of
each, and w_f = (sigma_d / sigma_f)^2,

    chi^2 = sum_i |(x_i - d_i) / sigma_d|^2 + |(f(p, x_i) - F_i) / sigma_f|^2.

Linearised about x_i, with k = df/dx and S = df/dp from one factorisation, the best x_i depends linearly on
the step dp. Its elimination gives a least-squares problem in p alone,

    r_i = f(p, x_i) - F_i - k (x_i - d_i),   V_i = sigma_f^2 I + k sigma_d^2 k^T,
    minimise sum_i (r_i + S_i dp)^T V_i^-1 (r_i + S_i dp),    x_i - d_i = -sigma_d^2 k^T V_i^-1 (r_i + S_i
    dp),

This is solved within the bounds of Table I by Levenberg and Marquardt's steps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from doe.least_squares import bounded_step
from kolsky.base.arrays import FloatArray

T = TypeVar("T")
DAMPING, MOST_DAMPING = 1e-3, 1e8
"""First damping, and the damping above which the search ends if no step reduces chi-square."""
STEP_TOLERANCE = 1e-3
"""The search ends if the next undamped step is shorter than this, in standard deviations of the residuals."""
CHI_SQUARE_TOLERANCE = 1e-9
"""It also ends if the relative change of chi-square is below this, for data without noise."""
MOST_STEPS = 60
"""Maximum number of simulations in a search."""
LONGEST = 2.0
"""Longest step of a constant divided by its size. The size is its scale, or its value if that is larger."""


@dataclass(frozen=True)
class Samples:
    """Measured displacements and forces of the moving ends of one specimen."""

    displacement: FloatArray
    """[m], shape [n, ends]."""
    force: FloatArray
    """[N], shape [n, ends]."""
    sigma_displacement: float
    """Standard deviation of a displacement [m]. 0 means exact displacements."""
    sigma_force: float
    """Standard deviation of a force [N], > 0."""


@dataclass(frozen=True)
class Linearised:
    """Forces of a specimen and their derivatives at given constants and displacements."""

    force: FloatArray
    """[N], shape [n, ends]."""
    by_constants: FloatArray
    """df/dp, shape [n, ends, p]."""
    by_displacement: FloatArray
    """df/dx [N/m], shape [n, ends, ends]."""


Respond = Callable[[FloatArray, tuple[FloatArray, ...]], tuple[Linearised, ...]]
"""Function of the constants and each specimen's displacements. It returns their forces. It raises ValueError
with the reason of a failure."""


@dataclass(frozen=True)
class Reduced:
    """The least-squares problem of the constants, for all specimens together."""

    residual: FloatArray
    """L^-1 r with V = L L^T, shape [m]."""
    jacobian: FloatArray
    """L^-1 S, shape [m, p]."""


@dataclass(frozen=True)
class SearchOptimum:
    """The end point of a search."""

    constants: FloatArray
    """Shape [p]."""
    displacements: tuple[FloatArray, ...]
    """Displacements x_i of each specimen [m]."""
    linearised: tuple[Linearised, ...]
    """Forces and slopes at these displacements."""
    reduced: Reduced
    """The problem of the constants at these displacements."""
    chi2: float
    """Eq. (S.1) over sigma_d^2 / 2 [-]."""
    at_bound: tuple[bool, ...]
    """Constants at a bound, shape [p]."""
    converged: bool
    ended: str
    simulations: int
    """Number of trial points, rejected ones included."""


def chi_square(samples: Samples, x: FloatArray, there: Linearised) -> float:
    """The objective (S.1) in standard deviations [-]."""
    moved = x - samples.displacement
    chi2 = float((((there.force - samples.force) / samples.sigma_force) ** 2).sum())
    if samples.sigma_displacement > 0.0:
        chi2 += float(((moved / samples.sigma_displacement) ** 2).sum())
    return chi2


def reduce(samples: Samples, x: FloatArray, there: Linearised) -> Reduced:
    """Eliminate the displacements, see the start of this module.

    ``x``: displacements of the simulation of the specimen [m], shape [n, ends].
    """
    moved = x - samples.displacement
    r = there.force - samples.force - np.einsum("nij,nj->ni", there.by_displacement, moved)
    factor = np.linalg.cholesky(_covariance(samples, there))
    residual = np.linalg.solve(factor, r[..., None])[..., 0]
    jacobian = np.linalg.solve(factor, there.by_constants)
    return Reduced(residual.ravel(), jacobian.reshape(-1, jacobian.shape[-1]))


def best_displacement(samples: Samples, x: FloatArray, there: Linearised, step: FloatArray) -> FloatArray:
    """Best displacements for a step of the constants, shape [n, ends] [m]."""
    moved = x - samples.displacement
    r = there.force - samples.force - np.einsum("nij,nj->ni", there.by_displacement, moved)
    r = r + there.by_constants @ step
    weighed = np.linalg.solve(_covariance(samples, there), r[..., None])[..., 0]
    gain = samples.sigma_displacement**2 * np.einsum("nji,nj->ni", there.by_displacement, weighed)
    return np.asarray(samples.displacement - gain)


def search(
    respond: Respond,
    samples: tuple[Samples, ...],
    start: FloatArray,
    *,
    bounds: tuple[FloatArray, FloatArray],
    scales: FloatArray,
) -> SearchOptimum:
    """Minimise chi-square over the constants and the displacements of all samples.

    ``respond``: the simulations. ``samples``: data of each specimen. All have the same constants. ``start``,
    ``scales``: initial constants and their sizes, shape [p]. ``bounds``: lower and upper bounds, each of
    shape [p]. Raises ValueError with the reason if the simulation at the start fails.
    """
    p = np.clip(start, *bounds)
    x = tuple(own.displacement for own in samples)
    try:
        there = respond(p, x)
    except ValueError as error:
        raise ValueError(f"the simulation at the start failed: {error}") from None

    def each(compute: Callable[..., T], *more: FloatArray) -> tuple[T, ...]:
        """A value of every specimen at its displacements."""
        return tuple(compute(own, at, f, *more) for own, at, f in zip(samples, x, there, strict=True))

    chi2 = sum(each(chi_square))
    damping, runs, ended, converged, why = DAMPING, 1, "the steps were used up", False, ""
    while runs < MOST_STEPS:
        problem = _joined(each(reduce))
        size = np.maximum(scales, np.abs(p))
        free = _step(problem, p, bounds, size, 0.0)
        moves = each(best_displacement, free)
        expected = float(np.linalg.norm(problem.jacobian @ free))
        apart = max(
            float(np.abs(move - at).max()) / own.sigma_displacement if own.sigma_displacement > 0.0 else 0.0
            for own, at, move in zip(samples, x, moves, strict=True)
        )
        if expected <= STEP_TOLERANCE and apart <= STEP_TOLERANCE:
            converged, ended = True, f"the next step is within {STEP_TOLERANCE:g} standard deviations"
            break
        step = _step(problem, p, bounds, size, damping)
        trial = np.clip(p + step, *bounds)
        moved = each(best_displacement, trial - p)
        runs, lower = runs + 1, np.inf
        try:
            found = respond(trial, moved)
            lower = sum(chi_square(own, at, f) for own, at, f in zip(samples, moved, found, strict=True))
        except ValueError as error:
            why = str(error)
        if lower < chi2:
            settled = chi2 - lower <= CHI_SQUARE_TOLERANCE * chi2
            p, x, there, chi2, damping = trial, moved, found, lower, max(0.1 * damping, 1e-12)
            if settled:
                converged, ended = True, "chi-square no longer falls"
                break
            continue
        damping *= 10.0
        if damping > MOST_DAMPING:
            converged = lower <= chi2 * (1.0 + CHI_SQUARE_TOLERANCE)
            ended = "chi-square no longer falls" if converged else f"no step lowers chi-square {why}".strip()
            break
    problem = _joined(each(reduce))
    near = 1e-6 * np.maximum(scales, np.abs(p))
    bound = tuple(map(bool, (p - bounds[0] <= near) | (bounds[1] - p <= near)))
    return SearchOptimum(p, x, there, problem, chi2, bound, converged, ended, runs)


def _covariance(samples: Samples, there: Linearised) -> FloatArray:
    """V = sigma_f^2 I + k sigma_d^2 k^T [N^2], shape [n, ends, ends]."""
    k = there.by_displacement
    own = samples.sigma_force**2 * np.eye(k.shape[-1])
    return np.asarray(own + samples.sigma_displacement**2 * k @ np.swapaxes(k, -1, -2))


def _joined(parts: Sequence[Reduced]) -> Reduced:
    return Reduced(
        np.concatenate([part.residual for part in parts]), np.concatenate([part.jacobian for part in parts])
    )


def _step(
    problem: Reduced, p: FloatArray, bounds: tuple[FloatArray, FloatArray], size: FloatArray, damping: float
) -> FloatArray:
    """Bounded step of the linear problem, no longer than `LONGEST` sizes, shape [p]."""
    low = np.maximum((bounds[0] - p) / size, -LONGEST)
    high = np.minimum((bounds[1] - p) / size, LONGEST)
    return size * bounded_step(problem.jacobian * size, problem.residual, low, high, damping=damping)
