"""Whether residuals ask for a branch that relaxes: a score test against planted elastic data.

At the elastic optimum a weak branch of relaxation time tau_j moves the data by a direction d_j. What the free
parameters can follow is taken out of it; the gain of chi-square by its best strength, which is >= 0, is

    g_j = max(0, d_j . r / |d_j|)^2,    g = max_j g_j,

in whitened data. Under the null the times mean nothing, so g has no textbook distribution (Davies 1977): it
is drawn. Planted elastic data with the same noise give scores that are normal with the directions'
correlation; they are drawn by the thousand, and the share that gains as much is the probability. Residuals
that are correlated in time, which the weights do not know, make scores larger than 1: each is divided by its
block standard deviation where that is above 1, from what the branch itself leaves of the residuals.

A strong branch is out of reach of its direction at the elastic optimum: the parameters have moved to make up
for it. Where the model with it has been searched for, what -2 ln L has fallen by is the gain too, over the
same variance; of weak branches it is g.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.material.relaxation.rate_fit import SIGNIFICANT

DRAWS = 20000
"""Planted elastic data."""
MOST_TAKEN = 0.75
"""Share of a direction's own blocks beyond which a block length says nothing of it [-]."""


@dataclass(frozen=True)
class BranchTest:
    """What a weak branch would improve."""

    gain: float
    """Improvement of chi-square by the best branch, or by the one that was searched for [-]."""
    time: float
    """Its relaxation time [s]."""
    strength: float
    """The strength that a linear model asks for [-]."""
    probability: float
    """Share of planted elastic data that improve as much, at least 1 / (draws + 1) [-]."""

    @property
    def significant(self) -> bool:
        """True if chance does not explain it."""
        return self.probability < SIGNIFICANT


def branch_test(
    residual: FloatArray,
    slopes: FloatArray,
    directions: FloatArray,
    times: Sequence[float] | FloatArray,
    *,
    blocks: Sequence[IntArray] = (),
    draws: int = DRAWS,
    seed: int = 1,
    realised: float = 0.0,
) -> BranchTest:
    """Hold the residuals of an elastic fit against branches of some relaxation times.

    Parameters
    ----------
    residual
        Data less prediction, whitened, shape [k].
    slopes
        Of the prediction by the free parameters, whitened, shape [k, d].
    directions
        Change of the prediction by a unit of strength, whitened, a row a time, shape [n, k].
    times
        The relaxation times [s], shape [n].
    blocks
        Labels of the entries: residuals of one label may be correlated, shape [k] each.
    draws, seed
        Planted elastic data, and the seed of their noise.
    realised
        Fall of -2 ln L by the branch that was searched for, 0 if none was [-].

    Raises
    ------
    ValueError
        If no branch has an effect of its own.
    """
    basis, _ = np.linalg.qr(slopes)
    own = directions - (directions @ basis) @ basis.T
    left = residual - basis @ (basis.T @ residual)
    size = np.linalg.norm(own, axis=1)
    seen = size > 1e-9 * max(float(np.linalg.norm(directions, axis=1).max()), np.finfo(float).tiny)
    if not seen.any():
        raise ValueError("no branch has an effect that the free parameters cannot follow")
    unit, taus, size = own[seen] / size[seen, None], np.asarray(times, dtype=float)[seen], size[seen]
    scale = _block_deviations(unit, left, blocks)
    score = unit @ left / scale
    best = int(np.argmax(score))
    gain = max(max(0.0, float(score[best])) ** 2, realised / float(scale.max()) ** 2)
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(unit @ unit.T)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    planted = np.maximum(rng.standard_normal((draws, len(unit))) @ root.T, 0.0).max(axis=1) ** 2
    as_much = int((planted >= gain).sum())
    strength = max(0.0, float(unit[best] @ left) / float(size[best]))
    return BranchTest(gain, float(taus[best]), strength, (1 + as_much) / (draws + 1))


def _block_deviations(unit: FloatArray, left: FloatArray, blocks: Sequence[IntArray]) -> FloatArray:
    """Standard deviation of each score if residuals of a block are correlated in any way, >= 1, shape [n].

    Block sums of what the direction itself leaves of the residual. A direction whose weight w_b lies in
    1 / sum w_b^2 = n_e blocks has taken a share 1 / n_e of them along, which is given back.
    """
    bare = left - (unit @ left)[:, None] * unit
    scale = np.ones(len(unit))
    for label in blocks:
        n = int(label.max()) + 1
        for k, (row, rest) in enumerate(zip(unit, bare, strict=True)):
            taken = float((np.bincount(label, row**2, minlength=n) ** 2).sum())
            squares = float((np.bincount(label, row * rest, minlength=n) ** 2).sum())
            if taken < MOST_TAKEN:
                scale[k] = max(scale[k], float(np.sqrt(squares)) / (1.0 - taken))
    return scale
