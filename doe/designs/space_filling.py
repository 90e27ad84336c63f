"""Designs that fill a box: factorial, Latin hypercube, low-discrepancy sequences, given points."""

from __future__ import annotations

from collections.abc import Sequence
from operator import index

import numpy as np
import scipy  # submodules load on first use: the statistics take half a second
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Design, Rng, count_of, seed_of

TRIES = 200
"""Number of Latin hypercubes of which `maximin` takes the best."""


def full_factorial(box: Box, levels: int | Sequence[int]) -> Design:
    """Every combination of equally spaced levels, bounds included; the last parameter varies fastest.

    Parameters
    ----------
    box
        Where; a logarithmic parameter's levels have equal ratios.
    levels
        Number of levels: one number for all parameters, or one for each.

    Raises
    ------
    ValueError
        If a number of levels is below 2, or there is not one for each parameter.

    Examples
    --------
    >>> from doe import Box, full_factorial
    >>> len(full_factorial(Box.of({"a": (0.0, 1.0), "b": (0.0, 1.0)}), (2, 3)))
    6
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
        Reduce the centred discrepancy by swapping coordinates (each slice still holds one point).

    Raises
    ------
    ValueError
        If n is below 2.
    TypeError
        If `rng` is neither an integer nor a generator.

    Examples
    --------
    >>> from doe import Box, latin_hypercube
    >>> points = latin_hypercube(Box.of({"a": (0.0, 1.0)}), 4, rng=1).points
    >>> sorted((4 * points[:, 0]).astype(int).tolist())  # one point in each quarter
    [0, 1, 2, 3]
    """
    n = count_of(n)
    seed = seed_of(rng)
    if optimise:
        sampler = scipy.stats.qmc.LatinHypercube(box.dimension, optimization="random-cd", rng=seed)
        unit_points = sampler.random(n)
    else:
        unit_points = _in_slices(box, n, np.random.default_rng(seed))
    settings = {"n": n, "optimise": optimise, "rng": seed}
    return Design(box.scale(unit_points), box, "latin_hypercube", settings)


def _in_slices(box: Box, n: int, generator: np.random.Generator) -> FloatArray:
    """Random points of the unit box, in every parameter one in each of n equal slices, shape [n, d]."""
    slices = generator.permuted(np.tile(np.arange(n), (box.dimension, 1)), axis=1).T
    return np.asarray((slices + generator.random(slices.shape)) / n)


def sobol(box: Box, n: int, *, rng: Rng, scramble: bool = True) -> Design:
    """The first n points of a Sobol' sequence. n is a power of two; only then the sequence is balanced.

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

    Examples
    --------
    >>> from doe import Box, sobol
    >>> sobol(Box.of({"a": (0.0, 1.0), "b": (0.0, 1.0)}), 8, rng=1).points.shape
    (8, 2)
    """
    n = count_of(n)
    exponent = (n - 1).bit_length()
    if n != 2**exponent:
        raise ValueError(
            f"a Sobol' design needs a power of two, got n = {n}: "
            f"take {2**exponent} (or {2 ** (exponent - 1)})"
        )
    seed = seed_of(rng)
    sampler = scipy.stats.qmc.Sobol(box.dimension, scramble=scramble, rng=seed)
    settings = {"n": n, "scramble": scramble, "rng": seed}
    return Design(box.scale(sampler.random_base2(exponent)), box, "sobol", settings)


def from_points(box: Box, points: ArrayLike) -> Design:
    """A design from given points.

    Parameters
    ----------
    box
        The box of the points.
    points
        In parameter units, shape [n, d].

    Raises
    ------
    ValueError
        If the shape is wrong or a point is not finite or outside the box; the message names it.
    """
    return Design(np.asarray(points, dtype=np.float64), box, "from_points")


def halton(box: Box, n: int, *, rng: Rng, scramble: bool = True) -> Design:
    """The first n >= 2 points of a Halton sequence. A larger n adds points to these. Options as in `sobol`.
    Unscrambled it is the radical inverse in the first d primes."""
    n, seed = count_of(n), seed_of(rng)
    sampler = scipy.stats.qmc.Halton(box.dimension, scramble=scramble, rng=seed)
    settings = {"n": n, "scramble": scramble, "rng": seed}
    return Design(box.scale(sampler.random(n)), box, "halton", settings)


def maximin(box: Box, n: int, *, rng: Rng) -> Design:
    """A Latin hypercube of n >= 2 points, the best of `TRIES` random ones: its minimum distance of two
    points in the unit box is the largest.
    """
    n, seed = count_of(n), seed_of(rng)
    generator = np.random.default_rng(seed)
    best = max((_in_slices(box, n, generator) for _ in range(TRIES)), key=_nearest)
    return Design(box.scale(best), box, "maximin", {"n": n, "tries": TRIES, "rng": seed})


def _nearest(unit_points: FloatArray) -> float:
    """Distance of the two nearest points."""
    return float(KDTree(unit_points).query(unit_points, k=2)[0][:, 1].min())
