"""Runs of several models at once, each with the same bits as alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from numpy.typing import ArrayLike

import explicit
from kolsky.inverse.forward import Forward, Numerics, in_surroundings


@dataclass(frozen=True)
class Launch:
    """Runs of one model, to be made at the same time as those of others, see `run_side_by_side`."""

    forward: Forward
    """The shot."""
    points: Mapping[str, ArrayLike]
    """As of `Forward.run`."""
    numerics: Numerics
    """As of `Forward.run`."""
    motion: ArrayLike = 0
    """As of `Forward.run`."""
    material: ArrayLike = 0
    """As of `Forward.run`."""


def run_side_by_side(launches: Sequence[Launch]) -> list[explicit.Response]:
    """Run several models at once, each with the same bits as `Forward.run` alone.

    What is corrected for Poisson's ratio runs one after the other: it is three meshes already.

    Raises
    ------
    ValueError
        As `Forward.run`.
    """
    if len(launches) < 2 or any(one.numerics.compressible is not None for one in launches):
        return [
            one.forward.run(one.points, one.numerics, motion=one.motion, material=one.material)
            for one in launches
        ]
    problems = [
        one.forward.problem(one.points, one.numerics, motion=one.motion, material=one.material)
        for one in launches
    ]
    numerics = launches[0].numerics
    return in_surroundings(
        [one.forward.shot for one in launches],
        problems,
        partial(explicit.run_side_by_side, device=numerics.device, threads=numerics.threads),
    )
