"""Covariance of a least-squares optimum from its curvature, with corrections for correlated residuals."""

from __future__ import annotations

import numpy as np

from doe.arrays import FloatArray

SMALLEST_SHARE = 1e-12
"""Smallest over largest eigenvalue of the information in unit-box parameters: with derivatives good to
1e-8, a smaller one is not told from zero."""


class SingularInformationError(ValueError):
    """Some direction of the parameters does not move the data; a covariance does not exist."""


def inverse_information(jacobian: FloatArray) -> FloatArray:
    """(J^T J)^-1 of a whitened Jacobian, shape [k, d] -> [d, d].

    Raises SingularInformationError if a direction of the parameters is not seen; the message names it.
    """
    _, singular, right = np.linalg.svd(jacobian, full_matrices=False)
    values = singular**2
    if values[-1] <= SMALLEST_SHARE * values[0]:
        raise SingularInformationError(
            f"the data do not move along {np.round(right[-1], 3).tolist()} (unit-box coordinates): hold one "
            "of these parameters, or read the profile likelihood, which needs no inverse"
        )
    return np.asarray((right.T / values) @ right)


def gauss_newton(jacobian: FloatArray, residual: FloatArray, *, scaled: bool = True) -> FloatArray:
    """Covariance s^2 (J^T C^-1 J)^-1 of the optimum for independent whitened residuals.

    Parameters
    ----------
    jacobian
        Whitened, C^(-1/2) dR/dx, shape [k, d]; the result has the units of x squared.
    residual
        Whitened residual at the optimum [-], shape [k].
    scaled
        Take s^2 = r^T r / (k - d) from the residual; False believes the declared noise, s^2 = 1.

    Returns
    -------
    covariance
        Shape [d, d].

    Raises
    ------
    SingularInformationError
        If a direction is not seen.
    ValueError
        If there are not more data than parameters.
    """
    k, d = _sizes(jacobian, residual)
    s2 = float(residual @ residual) / (k - d) if scaled else 1.0
    return s2 * inverse_information(jacobian)


def sandwich(jacobian: FloatArray, residual: FloatArray, *, block: int) -> FloatArray:
    """Covariance of the optimum if residuals within a block may be correlated in any way.

    A (sum_b g_b g_b^T) A with A = (J^T J)^-1 and g_b the block's share of J^T r, times B / (B - d) for B
    blocks (Liang and Zeger 1986). With blocks of one it is White's estimate.

    Parameters
    ----------
    jacobian, residual
        Whitened, shapes [k, d] and [k], neighbours in time beside each other.
    block
        Entries in a block, at least 1; there must be more than 4 d blocks.

    Raises
    ------
    ValueError
        If there are too few blocks.
    SingularInformationError
        If a direction is not seen.
    """
    k, d = _sizes(jacobian, residual)
    n_blocks = _blocks(k, d, block)
    gain = inverse_information(jacobian)
    scores = jacobian * residual[:, None]
    sums = np.add.reduceat(scores, np.arange(0, k, block), axis=0) @ gain
    return np.asarray(sums.T @ sums * n_blocks / (n_blocks - d))


def block_bootstrap(
    jacobian: FloatArray,
    residual: FloatArray,
    *,
    block: int,
    rng: int | np.random.Generator,
    n_draws: int = 2000,
) -> FloatArray:
    """Covariance of the linearised optimum over residuals put together from moving blocks.

    Each draw joins stretches of `block` neighbouring residuals, from random places and wrapped at the
    end, to a new residual vector r*, and moves the optimum by (J^T J)^-1 J^T r* (Politis and Romano's
    circular bootstrap). Unlike the sandwich it takes the noise to be the same along the vector.

    Parameters
    ----------
    jacobian, residual
        Whitened, shapes [k, d] and [k], neighbours in time beside each other.
    block
        Entries in a block, at least 1; there must be more than 4 d blocks.
    rng
        Seed or generator.
    n_draws
        Draws, at least 100: the standard deviations are good to 1 / sqrt(2 n_draws).

    Raises
    ------
    ValueError
        If there are too few blocks or draws.
    SingularInformationError
        If a direction is not seen.
    """
    k, d = _sizes(jacobian, residual)
    n_blocks = _blocks(k, d, block)
    if n_draws < 100:
        raise ValueError(f"n_draws must be at least 100, got {n_draws}")
    generator = np.random.default_rng(rng)
    gain = inverse_information(jacobian) @ jacobian.T
    # Least squares with d parameters leaves residuals smaller than the noise by (k - d) / k.
    pool = (residual - residual.mean()) * np.sqrt(k / (k - d))
    moves = np.empty((n_draws, d))
    for draw in range(n_draws):  # one at a time: all together would not fit in memory for a long record
        starts = generator.integers(0, k, size=n_blocks)
        places = (starts[:, None] + np.arange(block)).ravel()[:k] % k
        moves[draw] = gain @ pool[places]
    return np.atleast_2d(np.cov(moves, rowvar=False))


def _sizes(jacobian: FloatArray, residual: FloatArray) -> tuple[int, int]:
    if jacobian.ndim != 2 or residual.shape != (len(jacobian),):
        raise ValueError(f"shapes [k, d] and [k] are needed, got {jacobian.shape} and {residual.shape}")
    k, d = jacobian.shape
    if k <= d:
        raise ValueError(f"{k} data do not tell the uncertainty of {d} parameters: more data are needed")
    return k, d


def _blocks(k: int, d: int, block: int) -> int:
    n_blocks = -(-k // block) if block >= 1 else 0
    if n_blocks <= 4 * d:
        raise ValueError(
            f"blocks of {block} entries divide {k} data into {n_blocks}, but more than {4 * d} are needed "
            f"for {d} parameter(s): take shorter blocks, at least 1"
        )
    return n_blocks
