"""Point values on mesh nodes: a local quadratic by weighted least squares, with a gate for outliers.

The displacements of image correlation stand at points of a grid; the cost of Sutula and others (2020, Sec. 6)
needs them at the nodes of the mesh. At a node x0 the nine nearest points are fitted by

    p(x) = a0 + a1 x + a2 y + a3 x^2 + a4 x y + a5 y^2,   x, y from x0,
    weights w = e + (1 - e)(1 - r/r_max)^2

and the node's value is a0 (Belytschko and others 1996). A point that its neighbours do not predict is left
out before that.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dic.robust import MAD
from kolsky.base.arrays import FloatArray

NEIGHBOURS = 9
"""Points of a local fit; six are its least."""
LEAST_WEIGHT = 1e-4
"""Weight e of the farthest point."""
CONDITION = 1e-6
"""Least determinant of the normal matrix over the product of its diagonal: below it the points lie on a conic
and the weighted mean stands in."""
GATE_NEIGHBOURS = 20
"""Points that predict one point for the gate."""
GATE = 6.0
"""Largest deviation from the prediction, in robust standard deviations of all points."""
GATE_PASSES = 5
"""Most times that the gate is applied again without what it took out."""


@dataclass(frozen=True)
class Projected:
    """Values at targets."""

    values: FloatArray
    """Shape [n_targets, k], unit of what was projected."""
    mean_only: NDArray[np.bool_]
    """Targets at which the points allow no quadratic: the weighted mean, shape [n_targets]."""
    outside: FloatArray
    """Distance of a target from its nearest point over the points' spacing [-], shape [n_targets]."""


def project(points: FloatArray, values: FloatArray, targets: FloatArray) -> Projected:
    """Project point values on targets by local quadratics.

    Parameters
    ----------
    points
        Where values are known [m], shape [n, 2].
    values
        Shape [n, k]: any number of fields, in any unit.
    targets
        Where they are wanted [m], shape [n_targets, 2].

    Raises
    ------
    ValueError
        If there are fewer than `NEIGHBOURS` points, or a value is not finite.
    """
    if len(points) < NEIGHBOURS:
        raise ValueError(f"a quadratic takes at least {NEIGHBOURS} points, got {len(points)}")
    if not np.isfinite(values).all():
        raise ValueError("values must be finite: leave out the points that image correlation lost")
    tree = cKDTree(points)
    distance, near = tree.query(targets, k=NEIGHBOURS)
    weights, flat = _weights(points[near] - targets[:, None], distance)
    return Projected(np.einsum("nk,nkf->nf", weights, values[near]), flat, distance[:, 0] / spacing(points))


def spacing(points: FloatArray) -> float:
    """Median distance between neighbours [m]."""
    return float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))


def outliers(points: FloatArray, values: FloatArray, *, gate: float = GATE) -> NDArray[np.bool_]:
    """Find the points that their neighbours do not predict.

    Each point is predicted by the quadratic of its `GATE_NEIGHBOURS` nearest others. Its deviation, over the
    noise that the prediction has itself and in standard deviations of all of that field (from their median,
    so that outliers do not widen it), must be at most `gate`. What is found is taken out and the rest judged
    again, for
    an outlier spoils its neighbours.

    Parameters
    ----------
    points, values
        As in `project`; finite.
    gate
        Limit in standard deviations, > 0.

    Returns
    -------
    array of bool, shape [n]
    """
    bad = np.zeros(len(points), dtype=np.bool_)
    for _ in range(GATE_PASSES):
        good = np.flatnonzero(~bad)
        if len(good) <= GATE_NEIGHBOURS + 1:
            break
        own, field = points[good], values[good]
        distance, near = cKDTree(own).query(own, k=GATE_NEIGHBOURS + 1)
        weights, _ = _weights(own[near[:, 1:]] - own[:, None], distance[:, 1:])
        expected = np.einsum("nk,nkf->nf", weights, field[near[:, 1:]])
        # A point at an edge is extrapolated: its prediction has more noise of its own.
        deviation = np.abs(field - expected) / np.sqrt(1.0 + (weights**2).sum(axis=1))[:, None]
        scale = MAD * np.median(deviation, axis=0)
        ratio = np.divide(deviation, scale, out=np.zeros_like(deviation), where=scale > 0.0).max(axis=1)
        if not (ratio > gate).any():
            break
        # Of neighbours that spoil each other the worst goes first.
        worst = (ratio > gate) & (ratio >= ratio[near[:, 1:9]].max(axis=1))
        bad[good[worst]] = True
    return bad


def point_noise(points: FloatArray, values: FloatArray) -> float:
    """Standard deviation of a value from what its neighbours predict, all fields together [unit of values].

    Of what is smooth over `GATE_NEIGHBOURS` points nothing is left; a rough field counts as noise too.
    """
    distance, near = cKDTree(points).query(points, k=GATE_NEIGHBOURS + 1)
    weights, _ = _weights(points[near[:, 1:]] - points[:, None], distance[:, 1:])
    expected = np.einsum("nk,nkf->nf", weights, values[near[:, 1:]])
    deviation = np.abs(values - expected) / np.sqrt(1.0 + (weights**2).sum(axis=1))[:, None]
    return float(MAD * np.median(deviation))


def _weights(offsets: FloatArray, distance: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Weights c of the local fit, whose value at the target is sum c_k f_k, [n, k]; and where it is the
    mean."""
    length = np.maximum(distance.max(axis=1), np.finfo(float).tiny)
    x, y = np.moveaxis(offsets / length[:, None, None], -1, 0)
    weight = LEAST_WEIGHT + (1.0 - LEAST_WEIGHT) * (1.0 - distance / length[:, None]) ** 2
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weighed = basis * weight[..., None]
    normal = np.einsum("nka,nkb->nab", weighed, basis)
    flat = np.linalg.det(normal) <= CONDITION * np.prod(np.einsum("naa->na", normal), axis=1)
    normal[flat] = np.eye(6)
    constant = np.zeros((len(normal), 6, 1))
    constant[:, 0] = 1.0
    found = np.einsum("nka,na->nk", weighed, np.linalg.solve(normal, constant)[..., 0])
    found[flat] = (weight / weight.sum(axis=1, keepdims=True))[flat]
    return np.asarray(found), flat
