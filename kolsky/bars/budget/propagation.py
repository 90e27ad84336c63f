"""Propagation of standard uncertainties through any model by central differences (GUM 5.1.3)."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.budget.budget import Budget
from kolsky.bars.budget.quantities import check_quantities, correlation_matrix
from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray

Model = Callable[[Mapping[str, float]], Mapping[str, ArrayLike]]
"""From values of the quantities, by name, to named outputs: scalars or arrays of fixed shapes."""


def propagate(
    model: Model,
    quantities: Sequence[Quantity],
    *,
    noise: Mapping[str, ArrayLike] | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
    tolerance: float = 0.05,
) -> Budget:
    """Propagate standard uncertainties through a model, Eq. (U.10).

    Sensitivities are central differences over one standard uncertainty to either side (GUM 5.1.3, note 2).
    Half a step of all quantities at once must agree with them, which excludes a step in the round-off of the
    model, a jump (of a window by a sample, say) and a strong nonlinearity. The model is run 2 n + 3 times.

    Parameters
    ----------
    model
        From values by name to outputs, which must keep their shapes.
    quantities
        Inputs with their standard uncertainties; those with 0 are listed and not varied.
    noise
        Standard deviations of outputs from the noise of signals, which the model does not vary.
    correlations
        Coefficients of pairs of quantities.
    tolerance
        Largest difference of the half step from what the contributions say, over the combined standard
        uncertainty, in the root mean square over the samples [-].

    Raises
    ------
    ValueError
        If a quantity is impossible or occurs twice, the model fails at a varied value, an output is not
        finite or changes its shape, the correlations are none, or the steps disagree.
    """
    check_quantities(quantities)
    R = correlation_matrix(quantities, correlations or {})
    best = {q.name: q.value for q in quantities}
    value = outputs(model, best, "the best estimates", None)
    noises = _noises(noise or {}, value)
    whole: dict[str, list[FloatArray]] = {name: [] for name in value}
    bend: dict[str, list[FloatArray]] = {name: [] for name in value}
    for q in quantities:
        plus, minus = outputs_beside(model, value, best, {q: 1.0})
        for name in value:
            whole[name].append(0.5 * (plus[name] - minus[name]))
            bend[name].append(0.5 * (plus[name] + minus[name]) - value[name])
    contribution = {name: _stack(whole[name], value[name]) for name in value}
    curvature = {name: _stack(bend[name], value[name]) for name in value}
    # All at once over half a step, with alternating signs so that equal contributions do not hide.
    share = {q: 0.5 * (-1) ** k for k, q in enumerate(quantities)}
    plus, minus = outputs_beside(model, value, best, share)
    steps = np.array(list(share.values()))
    interaction = {}
    for name in value:
        together = 0.5 * (plus[name] - minus[name])
        straight = np.tensordot(steps, contribution[name], 1)
        scale = _size(contribution[name], noises[name])
        if float(np.sqrt(np.mean((together - straight) ** 2))) > tolerance * scale:
            raise_for_steps(model, value, best, quantities, name, contribution[name], tolerance * scale)
        mean = 0.5 * (plus[name] + minus[name]) - value[name]
        interaction[name] = 4.0 * (mean - np.tensordot(steps**2, curvature[name], 1))
    return Budget(
        quantities=tuple(quantities),
        correlation=R,
        value=value,
        contribution=contribution,
        noise=noises,
        curvature=curvature,
        interaction=interaction,
    )


def _size(contribution: FloatArray, noise: FloatArray) -> float:
    """Combined standard uncertainty without correlations, by which the whole may cancel to nothing."""
    return float(np.sqrt(np.mean(np.sum(contribution**2, axis=0) + noise**2)))


def _noises(noise: Mapping[str, ArrayLike], value: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    for name in noise:
        if name not in value:
            raise ValueError(f"noise of {name!r}: no output is called so; there are {', '.join(value)}")
    found = {}
    for name, output in value.items():
        sigma = np.asarray(noise.get(name, 0.0), dtype=float)
        if not (np.isfinite(sigma).all() and (sigma >= 0.0).all()):
            raise ValueError(f"noise of {name} must be finite and >= 0")
        found[name] = np.array(np.broadcast_to(sigma, output.shape))
    return found


def _stack(rows: list[FloatArray], like: FloatArray) -> FloatArray:
    return np.stack(rows) if rows else np.zeros((0, *like.shape))


def outputs_beside(
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


def raise_for_steps(
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
        plus, minus = outputs_beside(model, value, best, {q: 0.5})
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
