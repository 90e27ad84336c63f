"""Difference formulas of second order for one parameter, central or one-sided where a bound is near."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import inf

import numpy as np

from explicit.arrays import FloatArray
from explicit.materials.volumetric import POISSON_LIMIT
from explicit.model import Samples

BOUNDS: dict[str, tuple[float, float]] = {
    "stiffness_factor": (0.0, inf),
    "poisson": (0.0, POISSON_LIMIT),
    "damping": (0.0, inf),
    "friction": (0.0, inf),
    "mass_damping": (0.0, inf),
}
"""The parameters that can be varied, with the range of their values."""

LEAST_SCALE = {"damping": 1e-5, "friction": 0.1, "mass_damping": 10.0}
"""Scale of a parameter whose value may be zero [s, 1, 1/s]: what makes a difference in a test."""


@dataclass(frozen=True)
class Stencil:
    """Points where a response is evaluated, and its slope: sum_j weights[j] f(value + offsets[j] h) / h."""

    offsets: FloatArray
    """Distances from the value in steps, the first one 0 [-], shape [3]."""
    weights: FloatArray
    """Weights of the responses [-], shape [3]."""


CENTRAL = Stencil(np.array([0.0, 1.0, -1.0]), np.array([0.0, 0.5, -0.5]))
"""(f(p + h) - f(p - h)) / 2 h."""
FORWARD = Stencil(np.array([0.0, 1.0, 2.0]), np.array([-1.5, 2.0, -0.5]))
"""(-3 f(p) + 4 f(p + h) - f(p + 2 h)) / 2 h."""
BACKWARD = Stencil(-FORWARD.offsets, -FORWARD.weights)
"""The same to the other side."""


def scale_of(name: str, value: float) -> float:
    """Scale that a relative step of a parameter refers to.

    The stiffness factor, damping, friction and drag refer to their own value, the latter three not below
    `LEAST_SCALE`; Poisson's ratio to its distance from 1/2, by which the bulk modulus scales.
    """
    if name == "poisson":
        return 0.5 - value
    return max(value, LEAST_SCALE.get(name, 0.0))


def stencil_for(name: str, value: float, widest: float) -> Stencil:
    """The central formula, or a one-sided one where a step would leave the parameter's range.

    Parameters
    ----------
    name : str
        The parameter.
    value, widest : float
        Its value and the widest step, in its unit.

    Raises
    ------
    ValueError
        If neither side has room for the widest step.
    """
    low, high = BOUNDS[name]
    for stencil in (CENTRAL, FORWARD, BACKWARD):
        reached = value + stencil.offsets * widest
        above = reached.min() > low if name == "stiffness_factor" else reached.min() >= low
        if above and reached.max() <= high:
            return stencil
    raise ValueError(
        f"{name} = {value:.6g} has no room for a step of {widest:.3g} inside [{low:g}, {high:g}];"
        " use smaller relative steps"
    )


def perturbed(samples: Samples, values: Mapping[str, FloatArray], n: int) -> Samples:
    """A batch of `n` copies of one sample, with new values of some parameters, shape [n]."""
    columns = {f.name: np.repeat(getattr(samples, f.name), n) for f in fields(Samples)}
    return Samples(**{**columns, **values})
