"""Designs: points of a box with the options that reproduce them. Also the registry's entry for a kind of
design."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import index
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box

Rng = int | np.random.Generator


@dataclass(frozen=True)
class Design:
    """Points of a box and how they were chosen.

    Raises
    ------
    ValueError
        If the points are not of shape [n, d] with n >= 1, not finite, or outside the box.
    """

    points: FloatArray
    """Parameter values, shape [n, d]."""
    box: Box
    """The box they were drawn in."""
    kind: str
    """Name of the design's function."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """The options that reproduce it; "rng" is an integer seed also if a generator was given."""

    def __post_init__(self) -> None:
        points = np.array(self.box.require(self.points, what=f"{self.kind} point"))
        if len(points) == 0:
            raise ValueError(f"a design needs at least one point, got none ({self.kind})")
        points.flags.writeable = False
        object.__setattr__(self, "points", points)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def unit_points(self) -> FloatArray:
        """The points in the unit box [-], shape [n, d]."""
        return self.box.unit(self.points)


def count_of(n: int) -> int:
    """A number of points. Raises ValueError if it is below 2."""
    count = index(n)
    if count < 2:
        raise ValueError(f"a design needs n >= 2 points, got {count}")
    return count


def seed_of(rng: Rng) -> int:
    """The integer that reproduces the draw.

    If `rng` is a generator, the integer is drawn from it. SciPy's samplers use a child of a generator, and
    the recorded state of the generator would not reproduce this child.

    Raises TypeError if `rng` is neither an integer nor a generator.
    """
    if isinstance(rng, np.random.Generator):
        return int(rng.integers(2**63))
    try:
        return index(rng)
    except TypeError:
        raise TypeError(f"rng must be an integer seed or a numpy Generator, got {rng!r}") from None


Need = Literal["levels", "runs", "rng", "generators", "candidates", "points"]


@dataclass(frozen=True)
class DesignKind:
    """A kind of design."""

    function: Callable[..., Design]
    """Function of the box and of the options listed in `needs`, with their names in `DesignKind.make`. "runs"
    is its n."""
    needs: tuple[Need, ...]
    """Options of `make` that the function takes."""

    def make(
        self,
        box: Box,
        *,
        levels: int | Sequence[int] = 5,
        runs: int = 64,
        rng: Rng = 1,
        generators: str = "",
        candidates: ArrayLike | None = None,
        points: ArrayLike | None = None,
    ) -> Design:
        """The design made with options common to all kinds. Options that a kind does not need are ignored.

        ``levels``: one number for all parameters, or one for each. ``runs``: number of points.
        ``candidates``: points to choose from, in parameter units, shape [c, d]; if None, the kind's default.
        ``points``: given points, in parameter units, shape [n, d]. Raises ValueError if an option does not
        fit the box or the kind.
        """
        arguments = {
            "levels": levels,
            "runs": runs,
            "rng": rng,
            "generators": generators,
            "candidates": candidates,
            "points": points,
        }
        return self.function(box, **{"n" if name == "runs" else name: arguments[name] for name in self.needs})
