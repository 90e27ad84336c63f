"""Smoothness gate: points that lie off the surface through their neighbours."""

from functools import partial

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.forks import parts, side_by_side

REACH = 2
"""Neighbours are points up to so many cells away."""
SIGMAS = 5.0
"""Distance from the surface through the neighbours that noise is allowed, in standard deviations [-]."""
BENDING = 0.035
"""And what its own bending between the points is allowed, over their distance [-]."""
FEWEST_CONFIRMING = 2
"""A point with fewer neighbours is confirmed by nobody."""
FEWEST = 4
"""Neighbours from which on a plane through them judges a point."""
BENT = 10
"""Neighbours from which on the surface through them is quadratic."""
ROUNDS = 12


def spacing(position: FloatArray, cell: IntArray) -> float:
    """Median distance of points that are next to each other in the grid [m]; NaN if no two of them are known.

    Parameters
    ----------
    position
        Places [m], shape [n_points, 3]; NaN where not known.
    cell
        Column and row of each point in the grid, shape [n_points, 2].
    """
    near, offset = _neighbours(cell)
    beside = (near >= 0) & (np.abs(offset).sum(axis=-1) == 1.0)
    apart = np.linalg.norm(position[near] - position[:, None], axis=-1)[beside]
    apart = apart[np.isfinite(apart)]
    return float(np.median(apart)) if apart.size else float("nan")


def off_surface(
    position: FloatArray, sigma: FloatArray, valid: BoolArray, cell: IntArray, *, distance: float
) -> BoolArray:
    """Valid points that lie off the smooth surface through their neighbours.

    In every frame a polynomial of the grid's columns and rows is fitted to the places of a point's
    neighbours, the point itself left out. The worst point among its neighbours goes first, and all are
    judged anew without it: one false match does not condemn those around it. A point with fewer than two
    neighbours is confirmed by nobody and goes too; with two or three it is not judged.

    Parameters
    ----------
    position
        Places in space [m], shape [n_frames, n_points, 3].
    sigma
        Their standard deviations by component [m], likewise.
    valid
        Which are to be judged, shape [n_frames, n_points].
    cell
        Column and row of each point in the grid, shape [n_points, 2].
    distance
        Of the points at rest (`spacing`) [m]: `BENDING` of it is what a surface may bend between them.

    Returns
    -------
    array of bool
        Shape [n_frames, n_points].

    Raises
    ------
    ValueError
        If `distance` is not a positive length.
    """
    if not distance > 0.0:
        raise ValueError(f"distance must be a positive length [m], got {distance}")
    near, offset = _neighbours(cell)
    terms = _terms(offset)
    bending = BENDING * distance

    def of(frames: range) -> BoolArray:
        off = np.zeros((len(frames), len(cell)), dtype=bool)
        for k, frame in enumerate(frames):
            kept = valid[frame].copy()
            for _ in range(ROUNDS):
                score = _scores(position[frame], sigma[frame], kept, near, terms, bending)
                around = np.where(near >= 0, score[near], 0.0).max(axis=1, initial=0.0)
                worst = kept & (score > 1.0) & (score >= around)
                if not worst.any():
                    break
                kept &= ~worst
            off[k] = valid[frame] & ~kept
        return off

    processes, off = parts(), np.zeros(valid.shape, dtype=bool)
    works = [partial(of, range(part, len(position), processes)) for part in range(processes)]
    for part, found in enumerate(side_by_side(works, processes=processes)):
        off[part::processes] = found
    return off


def _neighbours(cell: IntArray) -> tuple[IntArray, FloatArray]:
    """Points around each point, -1 where there is none, and their offsets [cells]: [n, m] and [n, m, 2]."""
    low = cell.min(axis=0) - REACH
    table = np.full(tuple(cell.max(axis=0) - low + REACH + 1), -1, dtype=np.int64)
    table[tuple((cell - low).T)] = np.arange(len(cell))
    steps = [(i, j) for i in range(-REACH, REACH + 1) for j in range(-REACH, REACH + 1) if (i, j) != (0, 0)]
    at = (cell - low)[:, None] + np.array(steps)
    near = table[at[..., 0], at[..., 1]]
    return near, np.broadcast_to(np.array(steps, dtype=np.float64), (*near.shape, 2))


def _terms(offset: FloatArray) -> FloatArray:
    """Constant, linear and quadratic terms of offsets, shape [..., 6]."""
    i, j = offset[..., 0], offset[..., 1]
    return np.stack([np.ones_like(i), i, j, i * i, i * j, j * j], axis=-1)


def _scores(
    position: FloatArray,
    sigma: FloatArray,
    kept: BoolArray,
    near: IntArray,
    terms: FloatArray,
    bending: float,
) -> FloatArray:
    """Distance from the surface through the neighbours over what is allowed, shape [n_points]."""
    used = (near >= 0) & kept[near] & kept[:, None]
    count = used.sum(axis=1)
    score = np.zeros(len(position))
    score[kept & (count < FEWEST_CONFIRMING)] = 2.0
    for order, chosen in (
        (6, np.flatnonzero(count >= BENT)),
        (3, np.flatnonzero((count >= FEWEST) & (count < BENT))),
    ):
        if not chosen.size:
            continue
        A = np.where(used[chosen, :, None], terms[chosen, :, :order], 0.0)
        around = near[chosen]
        x = np.where(used[chosen, :, None], position[around], 0.0)
        noise = np.where(used[chosen, :, None], sigma[around], 0.0)
        ridge = 1e-9 * np.eye(order)  # neighbours on one line fix no plane: its variance then is large
        # the surface's height at the point itself: the constant term of the fit
        constant = np.eye(order)[:, :1]
        weights = (A @ np.linalg.solve(np.swapaxes(A, 1, 2) @ A + ridge, constant))[..., 0]
        spread = np.sqrt(np.einsum("nm,nmk->nk", weights**2, noise**2))
        expected = np.einsum("nm,nmk->nk", weights, x)
        # Weights that extrapolate magnify what the surface does between its points, too.
        bent = bending * np.maximum(1.0, np.sum(np.abs(weights), axis=1))[:, None]
        allowed = bent + SIGMAS * np.hypot(spread, sigma[chosen])
        score[chosen] = np.max(np.abs(position[chosen] - expected) / allowed, axis=1)
    return score
