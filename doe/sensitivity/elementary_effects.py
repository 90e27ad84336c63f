"""Morris' screening: elementary effects along random walks through a grid, for few and expensive runs.

A trajectory visits d + 1 points. From one to the next a single parameter moves by p / 2 (p - 1) of its edge,
p the number of levels; an effect is the change of the output over that move (Morris 1991). The mean of its
size tells how much a parameter matters, its scatter whether the effect depends on where (Campolongo et al.
2007).
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import index

import numpy as np
from numpy.typing import NDArray

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Design, Rng, seed_of


@dataclass(frozen=True)
class ElementaryEffects:
    """Effects of each parameter on each output, per edge of the box."""

    names: tuple[str, ...]
    """Parameters, length d."""
    effects: FloatArray
    """Every effect, in the outputs' units, shape [r, d, s]."""

    @property
    def mean(self) -> FloatArray:
        """Mean effect mu, in the outputs' units, shape [s, d]."""
        return self.effects.mean(axis=0).T

    @property
    def size(self) -> FloatArray:
        """Mean size mu* of the effect, in the outputs' units, shape [s, d]."""
        return np.abs(self.effects).mean(axis=0).T

    @property
    def size_sigma(self) -> FloatArray:
        """Standard uncertainty of `size` from the scatter of the trajectories, shape [s, d]."""
        scatter = np.abs(self.effects).std(axis=0, ddof=1).T
        return np.asarray(scatter / np.sqrt(len(self.effects)))

    @property
    def scatter(self) -> FloatArray:
        """Standard deviation sigma of the effect: curvature or interaction, shape [s, d]."""
        return self.effects.std(axis=0, ddof=1).T


@dataclass(frozen=True)
class Trajectories:
    """The runs of a screening, to be made in any order."""

    design: Design
    """The points, trajectory after trajectory, shape [r (d + 1), d]."""
    moved: NDArray[np.int64]
    """Which parameter each step moves, shape [r, d]."""

    def effects(self, outputs: FloatArray) -> ElementaryEffects:
        """The effects of the runs' outputs.

        Parameters
        ----------
        outputs
            One row a point of `design`, shape [r (d + 1), s].

        Raises
        ------
        ValueError
            If the shape is wrong, or an output is not finite: an effect is then not known, and a trajectory
            that is left out would be missed where the model is at its limits.
        """
        r, d = self.moved.shape
        y = np.asarray(outputs, dtype=np.float64)
        if y.ndim != 2 or len(y) != r * (d + 1):
            raise ValueError(f"outputs must have shape [{r * (d + 1)}, s], got {list(y.shape)}")
        bad = np.flatnonzero(~np.isfinite(y).all(axis=1))
        if len(bad):
            at = self.design.box.as_dict(self.design.points[bad[0]])
            raise ValueError(
                f"{len(bad)} of {len(y)} runs have no finite output, the first at {at}: take a smaller box"
            )
        step = np.diff(self.design.unit_points.reshape(r, d + 1, d), axis=1)
        change = np.diff(y.reshape(r, d + 1, -1), axis=1)
        row, place = np.arange(r)[:, None], np.arange(d)[None, :]
        slope = change / step[row, place, self.moved][..., None]
        effects = np.empty_like(slope)
        effects[row, self.moved] = slope
        return ElementaryEffects(self.design.box.names, effects)


def morris(box: Box, trajectories: int, *, levels: int = 4, rng: Rng) -> Trajectories:
    """Random trajectories through the grid of a box.

    Parameters
    ----------
    box
        Where.
    trajectories
        How many, r, at least 2; they cost r (d + 1) runs.
    levels
        Levels of each parameter, p, even, at least 2: an even number visits all of them equally often.
    rng
        Integer seed or generator.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """
    r, p, d, seed = index(trajectories), index(levels), box.dimension, seed_of(rng)
    if r < 2:
        raise ValueError(f"trajectories must be at least 2, got {r}: one has no scatter")
    if p < 2 or p % 2:
        raise ValueError(f"levels must be even and at least 2, got {p}")
    draw = np.random.default_rng(seed)
    delta = p / (2.0 * (p - 1.0))
    low = draw.integers(0, p // 2, size=(r, d)) / (p - 1.0)
    down = draw.random((r, d)) < 0.5
    order = np.argsort(draw.random((r, d)), axis=1)
    turn = np.argsort(order, axis=1)  # in which step a parameter moves
    after = np.arange(d + 1)[None, :, None] > turn[:, None, :]
    unit_points = (low[:, None, :] + delta * (after ^ down[:, None, :])).reshape(-1, d)
    settings = {"trajectories": r, "levels": p, "rng": seed}
    return Trajectories(Design(box.scale(unit_points), box, "morris", settings), order)
