"""What a measured displacement or force does to the fitted constants (Sutula and others 2020, Sec. 4).

At the minimum of the cost J(m, v) over the constants m a changed measurement v moves them by

    dm/dv = -[d2J/dm2]^-1 d2J/dm dv                                                         (K.18, K.19)

which gives variances (K.20-25), sensitivity fields on the mesh (K.26, K.27), and before any test has been
made a map of where a displacement would tell most (K.28-36).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from kolsky.base.arrays import FloatArray

SMALLEST_EIGENVALUE = 1e-9
"""Least eigenvalue over the largest, of the curvature by relative constants, that counts as not zero."""


def parameter_change(hessian: FloatArray, mixed: FloatArray) -> FloatArray:
    """Change of the fitted constants by a measurement, Eq. (K.19).

    Parameters
    ----------
    hessian
        d2J/dm2 at the minimum, positive definite, shape [p, p].
    mixed
        d2J/dm dv, shape [p, n].

    Returns
    -------
    array, shape [p, n]

    Raises
    ------
    ValueError
        If the cost has no minimum there: some direction of the constants is not seen by the data.
    """
    size = np.sqrt(np.abs(np.diag(hessian)))
    if not (size > 0.0).all():
        raise ValueError("the cost does not depend on one of the constants: hold it, or measure more")
    try:
        factor = cho_factor(hessian / np.outer(size, size))
    except np.linalg.LinAlgError:
        raise ValueError(
            "the cost has no minimum here: its second derivatives are not positive definite"
        ) from None
    return np.asarray(-cho_solve(factor, mixed / size[:, None]) / size[:, None])


def variance(change: FloatArray, sigma: FloatArray | float) -> FloatArray:
    """Variance of each constant from uncorrelated noise, Eqs. (K.20-23).

    Parameters
    ----------
    change
        dm/dv, shape [p, n].
    sigma
        Standard deviation of each measurement, one number or shape [n].

    Returns
    -------
    array, shape [p]
    """
    return np.asarray(((change * np.asarray(sigma)) ** 2).sum(axis=1))


def relative_deviation(change: FloatArray, sigma: FloatArray | float, constants: FloatArray) -> FloatArray:
    """Standard deviation of each constant over its size [-], Eqs. (K.24, K.25), shape [p].

    Raises
    ------
    ValueError
        If a constant is zero.
    """
    if not (constants != 0.0).all():
        raise ValueError("a constant is zero: a deviation relative to it has no meaning")
    return np.asarray(np.sqrt(variance(change, sigma)) / np.abs(constants))


def smoothed(mass: csr_matrix, change: FloatArray) -> FloatArray:
    """Sensitivity as a field, so that its integral with a disturbance is the change, Eqs. (K.26, K.27).

    Parameters
    ----------
    mass
        Mass matrix of the region with measurements, sparse, [n, n]; rows without mass belong to nodes outside
        it.
    change
        dm/dv of the nodal values, shape [p, n].

    Returns
    -------
    array, shape [p, n]; zero outside the region.
    """
    inside = np.flatnonzero(mass.diagonal() > 0.0)
    field = np.zeros_like(change)
    solver = splu(csc_matrix(mass[inside][:, inside]))
    field[:, inside] = solver.solve(np.ascontiguousarray(change[:, inside].T)).T
    return field


@dataclass(frozen=True)
class BeforeTest:
    """What displacements of the whole domain would tell, before any has been measured."""

    directions: FloatArray
    """Combinations of relative constants that displacements see, one a row, shape [k, p]. The identity where
    they see every constant apart."""
    eigenvalues: FloatArray
    """Of the curvature by relative constants, descending [m^4], shape [p]."""
    change: FloatArray
    """Change of each by a nodal displacement, Eq. (K.32) or (K.35) [1/m], shape [k, n]."""
    field: FloatArray
    """The same as a field, Eq. (K.36) [1/m^3], shape [k, n]."""
    singular: bool
    """Whether some combination of constants moves no displacement, so that eigenvectors stand in."""


def before_test(slopes: FloatArray, mass: csr_matrix, constants: FloatArray) -> BeforeTest:
    """Map where a displacement would tell most of the constants, Eqs. (K.28-36).

    The model is taken as right, u = u_msr, so that the curvature is that of Eq. (K.30). The constants are
    taken relative to their values: with Pa and pure numbers beside each other an eigenvector has no meaning.

    Parameters
    ----------
    slopes
        du/dm of every nodal displacement, shape [p, n].
    mass
        Mass matrix of the whole domain, sparse, [n, n].
    constants
        The constants, none of them zero, shape [p].

    Raises
    ------
    ValueError
        If a constant is zero or no constant moves a displacement.
    """
    if not (constants != 0.0).all():
        raise ValueError("a constant is zero: choose the value for which the test is planned")
    relative = slopes * np.abs(constants)[:, None]
    loaded = np.asarray((mass @ relative.T).T)
    curvature = relative @ loaded.T  # Eq. (K.30)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    values, vectors = values[::-1], vectors[:, ::-1].T
    if not values[0] > 0.0:
        raise ValueError("no constant moves a displacement: a force has to be measured")
    seen = values > SMALLEST_EIGENVALUE * values[0]
    if seen.all():
        directions = np.eye(len(values))
        inverse = np.linalg.inv(curvature)  # Eq. (K.32)
        return BeforeTest(directions, values, inverse @ loaded, inverse @ relative, False)
    vectors = vectors[seen]
    vectors *= np.sign(vectors[np.arange(len(vectors)), np.abs(vectors).argmax(axis=1)])[:, None]
    weights = vectors / values[seen][:, None]  # Eqs. (K.34, K.35)
    return BeforeTest(vectors, values, weights @ loaded, weights @ relative, True)
