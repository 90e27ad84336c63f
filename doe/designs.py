"""Designs of experiments: where in the box to run. Each is one function and one line in `DESIGNS`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc

from doe.box import Box

FloatArray = NDArray[np.float64]
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
    """The design's name in `DESIGNS`."""
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

    def as_dicts(self) -> list[dict[str, float]]:
        """The points as values by parameter name, length n."""
        return [self.box.as_dict(point) for point in self.points]


def full_factorial(box: Box, levels: int | Sequence[int]) -> Design:
    """Every combination of equally spaced levels, bounds included; the last parameter varies fastest.

    Parameters
    ----------
    box
        Where; a logarithmic parameter's levels have equal ratios.
    levels
        Number of levels, one for all parameters or one each.

    Raises
    ------
    ValueError
        If a number of levels is below 2 or their count is not that of the parameters.
    """
    counts = (
        tuple(index(n) for n in levels) if isinstance(levels, Sequence) else (index(levels),) * box.dimension
    )
    if len(counts) != box.dimension:
        raise ValueError(
            f"levels must be one number or one for each of {list(box.names)}, got {list(counts)}"
        )
    for name, count in zip(box.names, counts, strict=True):
        if count < 2:
            raise ValueError(f"levels of {name!r} must be at least 2 (both bounds), got {count}")
    axes = np.meshgrid(*(np.linspace(0.0, 1.0, count) for count in counts), indexing="ij")
    unit_points = np.stack([axis.ravel() for axis in axes], axis=1)
    return Design(box.scale(unit_points), box, "full_factorial", {"levels": counts})


def latin_hypercube(box: Box, n: int, *, rng: Rng, optimise: bool = False) -> Design:
    """A Latin hypercube: in every parameter, one point in each of n equal slices.

    Parameters
    ----------
    box
        Where.
    n
        Number of points, at least 2.
    rng
        Integer seed or NumPy generator.
    optimise
        Lower the centred discrepancy by swapping coordinates (the slices keep one point each).

    Raises
    ------
    ValueError
        If n is below 2.
    TypeError
        If `rng` is neither an integer nor a generator.
    """
    n = _count(n)
    seed = _seed(rng)
    sampler = qmc.LatinHypercube(box.dimension, optimization="random-cd" if optimise else None, rng=seed)
    settings = {"n": n, "optimise": optimise, "rng": seed}
    return Design(box.scale(sampler.random(n)), box, "latin_hypercube", settings)


def sobol(box: Box, n: int, *, rng: Rng, scramble: bool = True) -> Design:
    """The first n points of a Sobol' sequence, n a power of two (its balance holds for no other n).

    Parameters
    ----------
    box
        Where.
    n
        Number of points: 2, 4, 8, ...
    rng
        Integer seed or NumPy generator of the scrambling.
    scramble
        Owen scrambling. Without it the sequence is deterministic and starts at the lower corner.

    Raises
    ------
    ValueError
        If n is below 2 or not a power of two; the message names the next one.
    TypeError
        If `rng` is neither an integer nor a generator.
    """
    n = _count(n)
    exponent = (n - 1).bit_length()
    if n != 2**exponent:
        raise ValueError(
            f"a Sobol' design needs a power of two, got n = {n}: "
            f"take {2**exponent} (or {2 ** (exponent - 1)})"
        )
    seed = _seed(rng)
    sampler = qmc.Sobol(box.dimension, scramble=scramble, rng=seed)
    settings = {"n": n, "scramble": scramble, "rng": seed}
    return Design(box.scale(sampler.random_base2(exponent)), box, "sobol", settings)


def from_points(box: Box, points: ArrayLike) -> Design:
    """A design somebody else chose.

    Parameters
    ----------
    box
        Where the points lie.
    points
        In parameter units, shape [n, d].

    Raises
    ------
    ValueError
        If the shape is wrong or a point is not finite or outside the box; the message names it.
    """
    return Design(np.asarray(points, dtype=np.float64), box, "from_points")


DESIGNS: dict[str, Callable[..., Design]] = {
    "full_factorial": full_factorial,
    "latin_hypercube": latin_hypercube,
    "sobol": sobol,
    "from_points": from_points,
}
"""Designs by name. Each takes the box first; a new design is one function and one line here."""


def _count(n: int) -> int:
    count = index(n)
    if count < 2:
        raise ValueError(f"a design needs n >= 2 points, got {count}")
    return count


def _seed(rng: Rng) -> int:
    """The integer that reproduces the draw.

    From a generator one is drawn: SciPy's samplers spawn a child of a generator, which its recorded
    state would not reproduce.
    """
    if isinstance(rng, np.random.Generator):
        return int(rng.integers(2**63))
    try:
        return index(rng)
    except TypeError:
        raise TypeError(f"rng must be an integer seed or a numpy Generator, got {rng!r}") from None
