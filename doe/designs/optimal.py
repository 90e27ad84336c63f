"""D-optimal designs: the candidates that determine a polynomial best, by Fedorov's exchange.

The design maximises det(X^T X) of the model matrix X. The confidence ellipsoid of the polynomial's
coefficients then has the smallest volume (V. V. Fedorov, Theory of Optimal Experiments, 1972, chapter 3).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike, NDArray

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Design, Rng, count_of, seed_of

IntArray = NDArray[np.intp]

STARTS = 10
"""Number of random starts."""
GAIN = 1e-9
"""An exchange must increase the determinant by at least this relative gain. Round-off is far smaller."""


def d_optimal(box: Box, n: int, *, rng: Rng, candidates: ArrayLike | None = None, degree: int = 2) -> Design:
    """The n distinct candidates that determine a polynomial best; exchanges may end in a local optimum.

    Each start is a random choice. One point at a time is exchanged for the candidate that increases the
    determinant most, until no exchange increases it. The best result of all starts is returned. ``n``: at
    least the number of
    terms and at most that of the candidates. ``rng``: integer seed or NumPy generator of the starts.
    ``candidates``: points that meet the constraints, in parameter units, shape [c, d]. Default: a grid of
    five levels per parameter. ``degree``: of the polynomial in the unit box's coordinates, all terms up to
    it.
    """
    n, seed = count_of(n), seed_of(rng)
    if degree < 1:
        raise ValueError(f"degree must be at least 1, got {degree}")
    if candidates is None:
        candidates = grid(box)
    points = np.unique(box.require(np.asarray(candidates, dtype=np.float64), what="candidate"), axis=0)
    model = monomials(2.0 * box.unit(points) - 1.0, degree)
    terms = model.shape[1]
    if not terms <= n <= len(points):
        raise ValueError(
            f"n must be in [{terms}, {len(points)}] (terms of the polynomial, distinct candidates), got {n}"
        )
    if np.linalg.matrix_rank(model) < terms:
        raise ValueError(
            f"the candidates do not fix a polynomial of degree {degree}: give more levels or a lower degree"
        )
    generator = np.random.default_rng(seed)
    exchanged = [_exchange(model, _start(model, n, generator)) for _ in range(STARTS)]
    best = max(exchanged, key=lambda rows: float(np.linalg.slogdet(model[rows].T @ model[rows])[1]))
    settings = {"n": n, "candidates": len(points), "degree": degree, "starts": STARTS, "rng": seed}
    return Design(points[np.sort(best)], box, "d_optimal", settings)


def grid(box: Box, levels: int = 5) -> FloatArray:
    """Candidates on a grid of equally spaced levels, in parameter units, shape [levels^d, d]."""
    axes = np.meshgrid(*[np.linspace(0.0, 1.0, levels)] * box.dimension, indexing="ij")
    return box.scale(np.stack([axis.ravel() for axis in axes], axis=1))


def monomials(coded: FloatArray, degree: int) -> FloatArray:
    """All monomials up to a degree at coded points in [-1, 1], shape [n, C(d + degree, d)]."""
    d = coded.shape[1]
    powers = [term for total in range(degree + 1) for term in combinations_with_replacement(range(d), total)]
    return np.stack([np.prod(coded[:, list(term)], axis=1) for term in powers], axis=1)


def _start(model: FloatArray, n: int, generator: np.random.Generator) -> IntArray:
    """Random rows that determine the polynomial: first a basis in random order, then more random rows."""
    order = generator.permutation(len(model))
    rows: list[int] = []
    residual = model[order].copy()
    for _ in range(model.shape[1]):  # Gram-Schmidt: largest independent part first, ties random
        size = np.einsum("ij,ij->i", residual, residual) * generator.uniform(0.5, 1.0, len(residual))
        pick = int(np.argmax(size))
        rows.append(int(order[pick]))
        direction = residual[pick] / np.linalg.norm(residual[pick])
        residual -= np.outer(residual @ direction, direction)
    remaining = [int(row) for row in order if int(row) not in set(rows)]
    return np.array(rows + remaining[: n - len(rows)], dtype=np.intp)


def _exchange(model: FloatArray, rows: IntArray) -> IntArray:
    """Exchange one row at a time for the candidate that increases the determinant most, until none does."""
    rows = rows.copy()
    while True:
        inverse = np.linalg.inv(model[rows].T @ model[rows])
        cross = model @ inverse @ model[rows].T
        variance = np.einsum("ij,jk,ik->i", model, inverse, model)
        # Fedorov's delta: det(new)/det(old) - 1 when row j of the design gives way to candidate i.
        gain = variance[:, None] - variance[rows] - variance[:, None] * variance[rows] + cross**2
        gain[rows] = -np.inf  # a repeated simulation adds no information
        i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if gain[i, j] <= GAIN:
            return rows
        rows[j] = i


def keep(design: Design, *constraints: Callable[[FloatArray], ArrayLike]) -> Design:
    """The points of a design that meet all constraints; ``settings["refused"]`` is the number of the others.
    A constraint is a function of points in parameter units, shape [n, d], that returns True for valid points,
    shape [n]. Raises ValueError if its result has another shape, or no point is valid."""
    mask = np.ones(len(design), dtype=bool)
    for constraint in constraints:
        allowed = np.asarray(constraint(design.points.copy()))
        if allowed.shape != mask.shape or allowed.dtype != bool:
            raise ValueError(f"a constraint must return {len(mask)} truth values, got {allowed!r}")
        mask &= allowed
    if not mask.any():
        raise ValueError(f"no point of the {len(design)} of the {design.kind} meets the constraints")
    settings = {**design.settings, "refused": int((~mask).sum())}
    return Design(design.points[mask], design.box, design.kind, settings)
