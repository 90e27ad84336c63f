"""A model run beside its best estimates: differences over standard uncertainties, and what is refused."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray

Model = Callable[[Mapping[str, float]], Mapping[str, ArrayLike]]
"""From values of the quantities, by name, to named outputs: scalars or arrays of fixed shapes."""


def moved(
    model: Model, value: Mapping[str, FloatArray], best: Mapping[str, float], steps: Mapping[Quantity, float]
) -> tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]]:
    """Outputs with quantities moved by shares of their standard uncertainties, and by the same back."""
    sizes = {q: step * q.sigma for q, step in steps.items() if q.sigma > 0.0}
    if not sizes:
        return value, value
    found = []
    for sign in (1.0, -1.0):
        at = {q.name: q.value + sign * step for q, step in sizes.items()}
        where = f"{len(at)} quantities moved together"
        if len(sizes) == 1:
            ((q, step),) = sizes.items()
            where = f"{q.name} = {q.value + sign * step:.6g} {q.unit}"
        found.append(outputs(model, dict(best) | at, where, value))
    return found[0], found[1]


def refuse_steps(
    model: Model,
    value: Mapping[str, FloatArray],
    best: Mapping[str, float],
    quantities: Sequence[Quantity],
    output: str,
    contribution: FloatArray,
    allowed: float,
) -> None:
    """Find the quantity whose half step tells another slope, and refuse.

    Raises
    ------
    ValueError
        Always.
    """
    off = []
    for q, one in zip(quantities, contribution, strict=True):
        plus, minus = moved(model, value, best, {q: 0.5})
        off.append(float(np.sqrt(np.mean((one - (plus[output] - minus[output])) ** 2))))
    q = quantities[int(np.argmax(off))]
    raise ValueError(
        f"{output}: differences over one and over half a standard uncertainty disagree by more than the"
        f" {allowed:.3g} allowed, most with {q.name}, {q.sigma:.3g} {q.unit}, by {max(off):.3g}: the model"
        " jumps or bends there; fix its windows, or use Monte Carlo"
    )


def outputs(
    model: Model, values: Mapping[str, float], where: str, like: Mapping[str, FloatArray] | None
) -> dict[str, FloatArray]:
    """Outputs of a model as arrays; `where` is said of the values if it fails, `like` has the right shapes.

    Raises
    ------
    ValueError
        If the model fails, an output is not finite, or names or shapes differ from those of `like`.
    """
    try:
        found = {name: np.asarray(value, dtype=float) for name, value in model(values).items()}
    except ValueError as error:
        raise ValueError(f"the model fails at {where}: {error}") from error
    for name, value in found.items():
        if not np.isfinite(value).all():
            at = int(np.argmin(np.isfinite(value)))
            raise ValueError(
                f"output {name} is not finite at sample {at} with {where}; leave such samples out"
            )
    if like is not None and {n: v.shape for n, v in found.items()} != {n: v.shape for n, v in like.items()}:
        raise ValueError(
            f"outputs change their names or shapes with {where}; fix grid and windows in the model"
        )
    return found
