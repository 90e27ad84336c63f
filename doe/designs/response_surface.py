"""The classical designs for a quadratic response surface, from pyDOE, in parameter units."""

from __future__ import annotations

import re
from operator import index
from typing import Any

import numpy as np

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Design

GENERATOR = re.compile(r"[+-]?[a-z]+")


def fractional_factorial(box: Box, generators: str) -> Design:
    """A two-level fractional factorial, 2^(d-p) of the box's corners.

    ``generators``: one word for each parameter. A single letter is an independent factor, several letters are
    the product of those factors, and a leading minus swaps the levels. "a b ab" is half of 2^3 corners.
    """
    words = generators.split()
    if len(words) != box.dimension:
        raise ValueError(f"generators must be one word a parameter ({box.dimension}), got {generators!r}")
    for word in words:
        if not GENERATOR.fullmatch(word):
            raise ValueError(f"a generator is letters a to z with or without a sign, got {word!r}")
    bare = [word.lstrip("+-") for word in words]
    factors = [word for word in bare if len(word) == 1]
    for word in bare:
        missing = sorted(set(word) - set(factors))
        if missing:
            raise ValueError(f"generator {word!r} multiplies {missing}, which are letters of no parameter")
    if len(set(factors)) != len(factors):
        raise ValueError(f"a single letter names one parameter, got {generators!r}")
    from pydoe import fracfact

    return _scaled(box, fracfact(" ".join(words)), "fractional_factorial", {"generators": generators})


def central_composite(box: Box) -> Design:
    """Corners, middles of the faces and one centre. A simulation has no scatter, so one centre is enough."""
    if box.dimension < 2:
        raise ValueError("a central composite design needs two parameters or more, got 1")
    from pydoe import ccdesign

    coded = ccdesign(box.dimension, center=(0, 1), alpha="rotatable", face="ccf")
    return _scaled(box, coded, "central_composite", {})


def box_behnken(box: Box) -> Design:
    """Middles of the box's edges and one centre: a quadratic design without the corners."""
    if index(box.dimension) < 3:
        raise ValueError(f"a Box-Behnken design needs three parameters or more, got {box.dimension}")
    from pydoe import bbdesign

    return _scaled(box, bbdesign(box.dimension, center=1), "box_behnken", {})


def _scaled(box: Box, coded: Any, kind: str, settings: dict[str, Any]) -> Design:
    """Coded levels in [-1, 1] in parameter units."""
    unit: FloatArray = 0.5 * (np.asarray(coded, dtype=np.float64) + 1.0)
    return Design(box.scale(unit), box, kind, settings)
