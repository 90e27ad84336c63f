r"""The fit with errors in both by a bounded quasi-Newton method, as Schumacher and others (2020) do it.

Constants and moving displacements are the unknowns together; chi-square and its gradient,

    dchi^2/dp = 2 sum_i S_i^T (f_i - F_i) / sigma_f^2,
    dchi^2/dx_i = 2 (x_i - d_i) / sigma_d^2 + 2 k_i^T (f_i - F_i) / sigma_f^2,

go to L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995; SciPy). It needs tens of simulations where
`kolsky.specimen.errors_in_variables.search` needs about six, and ends at the same constants.
"""

import numpy as np
from scipy.optimize import minimize

from kolsky.base.arrays import FloatArray
from kolsky.specimen.errors_in_variables import Found, Linearised, Respond, Samples, chi_square, found_at

MOST = 400
"""Most simulations of a search."""
FLATTEST = 1e-3
"""Largest slope of chi-square at the end, by standard deviations of constants and displacements [-]."""


class _FailedError(Exception):
    """A simulation failed."""


def search_by_quasi_newton(
    respond: Respond,
    samples: tuple[Samples, ...],
    start: FloatArray,
    *,
    bounds: tuple[FloatArray, FloatArray],
    scales: FloatArray,
) -> Found:
    """Minimise chi-square over the constants and the displacements of all samples.

    Parameters and errors are those of `kolsky.specimen.errors_in_variables.search`. A simulation that fails
    on the way ends the search, which has not converged then.
    """
    p = np.clip(start, *bounds)
    x = tuple(own.displacement for own in samples)
    there = respond(p, x)
    if isinstance(there, str):
        raise ValueError(f"the simulation at the start failed: {there}")
    free = [own.sigma_displacement > 0.0 for own in samples]
    slopes = np.concatenate(
        [
            one.by_constants.reshape(-1, len(p)) / own.sigma_force
            for one, own in zip(there, samples, strict=True)
        ]
    )
    unit = 1.0 / np.maximum(np.linalg.norm(slopes, axis=0), 1e-12 / np.maximum(scales, np.abs(p)))
    best: tuple[FloatArray, tuple[FloatArray, ...], tuple[Linearised, ...]] = (p, x, there)
    lowest, runs = _chi2(samples, x, there), 0

    def objective(z: FloatArray) -> tuple[float, FloatArray]:
        nonlocal runs, best, lowest
        at = np.clip(z[: len(p)] * unit, *bounds)
        moved, parts, used = [], [], len(p)
        for own, moves in zip(samples, free, strict=True):
            size = own.displacement.size if moves else 0
            by = z[used : used + size].reshape(own.displacement.shape) if moves else 0.0
            moved.append(own.displacement + own.sigma_displacement * by)
            used += size
        runs += 1
        found = respond(at, tuple(moved))
        if isinstance(found, str):
            raise _FailedError(found)
        gradient = np.zeros(len(p))
        for own, moves, one, xs in zip(samples, free, found, moved, strict=True):
            weighed = (one.force - own.force) / own.sigma_force**2
            gradient += 2.0 * np.einsum("nip,ni->p", one.by_constants, weighed)
            if moves:
                pulled = np.einsum("nij,ni->nj", one.by_displacement, weighed)
                by_x = 2.0 * (xs - own.displacement) / own.sigma_displacement**2 + 2.0 * pulled
                parts.append((own.sigma_displacement * by_x).ravel())
        value = _chi2(samples, tuple(moved), found)
        if value < lowest:
            best, lowest = (at, tuple(moved), found), value
        return value, np.concatenate([gradient * unit, *parts])

    n_moved = sum(own.displacement.size for own, moves in zip(samples, free, strict=True) if moves)
    limits = [*zip(bounds[0] / unit, bounds[1] / unit, strict=True), *[(-np.inf, np.inf)] * n_moved]
    converged = False
    try:
        result = minimize(
            objective,
            np.concatenate([p / unit, np.zeros(n_moved)]),
            jac=True,
            method="L-BFGS-B",
            bounds=limits,
            options={"maxfun": MOST, "maxiter": MOST, "ftol": 1e-15, "gtol": FLATTEST, "maxcor": 20},
        )
        converged, ended = bool(result.success), f"L-BFGS-B: {result.message}"
    except _FailedError as failed:
        ended = f"a simulation failed: {failed}"
    return found_at(samples, *best, bounds, scales, converged=converged, ended=ended, runs=runs + 1)


def _chi2(samples: tuple[Samples, ...], x: tuple[FloatArray, ...], there: tuple[Linearised, ...]) -> float:
    return sum(chi_square(own, at, one.force) for own, at, one in zip(samples, x, there, strict=True))
