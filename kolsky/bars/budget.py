"""Uncertainty budget after the GUM (JCGM 100:2008).

Inputs, contributions, combined uncertainty and degrees of freedom.

`propagate` varies each input by its standard uncertainty in both directions (central differences, GUM 5.1.3).
It therefore works for any model of NumPy arrays. Correlated inputs are declared by `correlation`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components
from scipy.special import stdtrit

from dic.basics import check_interval
from kolsky.bars.records import BudgetTable, Contribution, History, Quantity
from kolsky.base.arrays import FloatArray


def merge_quantities(quantities: Iterable[Quantity]) -> list[Quantity]:
    """Quantities without duplicates.

    A quantity that occurs several times, such as a bar's Poisson's ratio, is listed once.

    If only one of the duplicates has an uncertainty, that one is kept.

    Raises ValueError if two have the same name and different values or uncertainties.
    """
    found: dict[str, Quantity] = {}
    for q in quantities:
        known = found.setdefault(q.name, q)
        if known == q or (q.sigma == 0.0 and (q.value, q.unit) == (known.value, known.unit)):
            continue
        if known.sigma > 0.0 or (q.value, q.unit) != (known.value, known.unit):
            raise ValueError(f"quantity '{q.name}' is stated twice: {known} and {q}")
        found[q.name] = q
    return list(found.values())


def correlation_matrix(
    quantities: Sequence[Quantity], correlations: Mapping[tuple[str, str], float]
) -> FloatArray:
    """Coefficients by pairs of names as a matrix, shape [n, n].

    Raises ValueError if a name is unknown or occurs twice, or if there are no such quantities.
    """
    place = {q.name: i for i, q in enumerate(quantities)}
    if len(place) < len(quantities):
        raise ValueError("a quantity occurs twice; cure: `merge_quantities`")
    R = np.eye(len(place))
    for (one, other), r in correlations.items():
        if one == other or not {one, other} <= set(place):
            raise ValueError(f"correlation of {one!r} and {other!r}: must be two of {', '.join(place)}")
        check_interval("[-1, 1]", **{f"correlation of {one} and {other}": r})
        R[place[one], place[other]] = R[place[other], place[one]] = r
    lowest = float(np.linalg.eigvalsh(R)[0]) if R.size else 0.0
    if lowest < -1e-9:  # round-off
        raise ValueError(
            f"the correlations contradict each other: their matrix has the eigenvalue {lowest:.3g}, all must"
            " be >= 0; if they were rounded, state more digits"
        )
    return R


def _correlated_groups(correlation: FloatArray) -> list[list[int]]:
    """Groups of correlated quantities: for each group the list of their indices."""
    if not correlation.size:
        return []
    n, label = connected_components(correlation != 0.0, directed=False)
    return [np.flatnonzero(label == k).tolist() for k in range(n)]


@dataclass(frozen=True)
class Budget:
    """Outputs of a model, and the contribution of each quantity to the uncertainty of each sample."""

    quantities: tuple[Quantity, ...]
    correlation: FloatArray
    """Their correlation coefficients, shape [n_quantities, n_quantities]."""
    value: Mapping[str, FloatArray]
    """Outputs at the best estimates, shape [...]."""
    contribution: Mapping[str, FloatArray]
    """Contributions c_i u_i with their signs, Eq. (U.11), shape [n_quantities, ...]."""
    noise: Mapping[str, FloatArray]
    """Standard deviations from the signals' noise, independent of all quantities, shape [...]."""
    curvature: Mapping[str, FloatArray]
    """Second differences (y+ + y- - 2 y) / 2 over one standard uncertainty, shape [n_quantities, ...]. They
    are the error of the linearisation, and the bias of the best estimate."""
    interaction: Mapping[str, FloatArray]
    """Contribution of products of quantities, sum of +-u_i u_j d2y/dx_i dx_j over all pairs, shape [...]."""

    def sigma(self, output: str) -> FloatArray:
        """Combined standard uncertainty u_c, Eq. (U.10), shape [...]."""
        Z = self.contribution[output]
        variance = np.einsum("i...,ij,j...->...", Z, self.correlation, Z)
        # By round-off, fully correlated contributions may sum to -1e-16 of their squares.
        return np.sqrt(np.maximum(variance, 0.0) + self.noise[output] ** 2)

    def freedom(self, output: str) -> FloatArray:
        """Effective degrees of freedom by Welch and Satterthwaite, Eq. (U.12), shape [...].

        The formula needs independent parts. Correlated quantities count as one, with the smallest of their
        degrees of freedom. Noise is taken as exactly known.
        """
        Z, u = self.contribution[output], self.sigma(output)
        under = np.zeros(u.shape)
        for group in _correlated_groups(self.correlation):
            nu = min(self.quantities[i].freedom for i in group)
            part = Z[group]
            variance = np.einsum("i...,ij,j...->...", part, self.correlation[np.ix_(group, group)], part)
            under += variance**2 / nu
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(under > 0.0, u**4 / under, np.inf)

    def coverage_factor(self, output: str, probability: float = 0.95) -> FloatArray:
        """Student's t for the effective degrees of freedom, rounded down (GUM G.4.1), shape [...].

        Raises ValueError if the probability is not inside (0, 1).
        """
        check_interval("(0, 1)", probability=probability)
        nu = np.floor(self.freedom(output) * (1.0 + 1e-12))  # 4 may have become 4 - 1e-15
        return np.asarray(stdtrit(nu, 0.5 + 0.5 * probability))

    def history(self, output: str, unit: str) -> History:
        """An output with its combined standard uncertainty."""
        return History(self.value[output], self.sigma(output), unit)

    def nonlinearity(self, output: str) -> float:
        """Largest second-order term, divided by the combined standard uncertainty at the same sample [-].

        This term is the curvature of any one quantity, or the interaction of all. If it is not small, the
        budget is not reliable. Use random draws of the quantities in this case.
        """
        u = self.sigma(output)
        second = np.concatenate([self.curvature[output], self.interaction[output][None]])
        return float(np.max(np.abs(second) / np.where(u > 0.0, u, np.inf), initial=0.0))

    def peak(self, output: str) -> int:
        """Flat index of the sample with the largest magnitude."""
        return int(np.argmax(np.abs(self.value[output])))


def budget_table(budget: Budget, results: Mapping[str, tuple[str, int | None, str]]) -> BudgetTable:
    """The budget of the reported results, e.g. of the peak stress.

    ``results``: by the name of the result: output, flat index of the sample (None: that of the largest
    magnitude), unit. Returns: a row for every quantity, with its sensitivity (output per unit of it) and its
    share of the variance, Eq. (U.13), then one for the noise of every result. Shares add up to 1; that of a
    correlated quantity may be negative.
    """
    numbers: dict[str, tuple[float, float, str]] = {}
    shares: list[dict[str, float]] = [{} for _ in budget.quantities]
    slopes: list[dict[str, float]] = [{} for _ in budget.quantities]
    noises = []
    for name, (output, sample, unit) in results.items():
        at = budget.peak(output) if sample is None else sample
        u, noise = (float(one.reshape(-1)[at]) for one in (budget.sigma(output), budget.noise[output]))
        Z = budget.contribution[output].reshape(len(budget.quantities), -1)[:, at]
        numbers[name] = (float(budget.value[output].reshape(-1)[at]), u, unit)
        parts = Z * (budget.correlation @ Z) / u**2 if u > 0.0 else np.zeros(Z.size)
        for i, q in enumerate(budget.quantities):
            shares[i][name] = float(parts[i])
            if q.sigma > 0.0:
                slopes[i][name] = float(Z[i] / q.sigma)
        of_noise = Quantity(f"noise, {name}", 0.0, noise, unit, "A")
        noises.append(Contribution(of_noise, {name: noise**2 / u**2 if u > 0.0 else 0.0}))
    inputs = [Contribution(*row) for row in zip(budget.quantities, shares, slopes, strict=True)]
    return BudgetTable(results=numbers, contributions=(*inputs, *noises))


Model = Callable[[Mapping[str, float]], Mapping[str, ArrayLike]]
"""Function from the values of the quantities, by name, to named outputs. The outputs are scalars or arrays of
fixed shapes."""


def propagate(
    model: Model,
    quantities: Sequence[Quantity],
    *,
    noise: Mapping[str, ArrayLike] | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
    tolerance: float = 0.05,
) -> Budget:
    """Propagate standard uncertainties through a model, Eq. (U.10).

    Sensitivities are central differences over one standard uncertainty on either side (GUM 5.1.3, note 2). A
    half step of all quantities at once must agree with them. This check detects three faults: a step within
    the model's round-off, a jump (e.g. of a window by one sample) and a strong nonlinearity. The model is run
    2 n + 3 times.

    Raises ValueError if a quantity occurs twice, if the correlations or the noise are impossible, or if the
    steps disagree. The same error is raised if the model fails at a varied value, or if an output is not
    finite or changes its shape.

    ``model``: from values by name to outputs, which must keep their shapes. ``quantities``: inputs with their
    standard uncertainties. Inputs with 0 are listed but not varied. ``noise``: standard deviations of outputs
    due to the noise of signals. The model does not vary this noise. ``correlations``: coefficients of pairs
    of quantities. ``tolerance``: largest difference between the half step and the prediction by the
    contributions [-]. It is divided by the combined standard uncertainty, as root mean square over the
    samples.
    """
    R = correlation_matrix(quantities, correlations or {})
    best = {q.name: q.value for q in quantities}
    value = outputs(model, best, "the best estimates", None)
    if stray := set(noise or {}) - set(value):
        raise ValueError(f"noise of {stray.pop()!r}: no output is called so; there are {', '.join(value)}")
    check_interval("[0, inf)", **{f"noise of {name}": sigma for name, sigma in (noise or {}).items()})
    noises = {
        name: np.array(np.broadcast_to(np.asarray((noise or {}).get(name, 0.0), dtype=float), output.shape))
        for name, output in value.items()
    }
    whole: dict[str, list[FloatArray]] = {name: [] for name in value}
    bend: dict[str, list[FloatArray]] = {name: [] for name in value}
    for q in quantities:
        plus, minus = _varied_outputs(model, value, best, {q: 1.0})
        for name in value:
            whole[name].append(0.5 * (plus[name] - minus[name]))
            bend[name].append(0.5 * (plus[name] + minus[name]) - value[name])
    contribution = {name: _stack(whole[name], value[name]) for name in value}
    curvature = {name: _stack(bend[name], value[name]) for name in value}
    # All are varied at once by half a step. Signs alternate, because equal contributions could otherwise
    # cancel.
    share = {q: 0.5 * (-1) ** k for k, q in enumerate(quantities)}
    plus, minus = _varied_outputs(model, value, best, share)
    steps = np.array(list(share.values()))
    interaction = {}
    for name in value:
        together = 0.5 * (plus[name] - minus[name])
        straight = np.tensordot(steps, contribution[name], 1)
        scale = _size(contribution[name], noises[name])
        if float(np.sqrt(np.mean((together - straight) ** 2))) > tolerance * scale:
            _raise_for_steps(model, value, best, quantities, name, contribution[name], tolerance * scale)
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
    """Combined standard uncertainty without correlations, which may cancel contributions to zero."""
    return float(np.sqrt(np.mean(np.sum(contribution**2, axis=0) + noise**2)))


def _stack(rows: list[FloatArray], like: FloatArray) -> FloatArray:
    return np.stack(rows) if rows else np.zeros((0, *like.shape))


def _varied_outputs(
    model: Model, value: Mapping[str, FloatArray], best: Mapping[str, float], steps: Mapping[Quantity, float]
) -> tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]]:
    """Outputs with quantities changed by plus and minus a share of their standard uncertainties."""
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


def _raise_for_steps(
    model: Model,
    value: Mapping[str, FloatArray],
    best: Mapping[str, float],
    quantities: Sequence[Quantity],
    output: str,
    contribution: FloatArray,
    allowed: float,
) -> None:
    """Find the quantity with another slope at its half step, and raise ValueError."""
    off = []
    for q, one in zip(quantities, contribution, strict=True):
        plus, minus = _varied_outputs(model, value, best, {q: 0.5})
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
    """Outputs of a model as arrays.

    `where` describes the values in the error message, `like` has the correct shapes.

    Raises ValueError if the model fails, if an output is not finite, or if names or shapes differ from those
    of `like`.
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
