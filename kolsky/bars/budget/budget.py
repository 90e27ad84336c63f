"""Uncertainty budget after the GUM (JCGM 100:2008): contributions, combined uncertainty, freedom."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from kolsky.bars.budget.quantities import correlated_groups
from kolsky.bars.records import History, Quantity
from kolsky.bars.result import BudgetTable, Contribution
from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Budget:
    """Outputs of a model, and what each quantity contributes to the uncertainty of each sample."""

    quantities: tuple[Quantity, ...]
    """Inputs."""
    correlation: FloatArray
    """Their correlation coefficients, shape [n_quantities, n_quantities]."""
    value: Mapping[str, FloatArray]
    """Outputs at the best estimates, shape [...]."""
    contribution: Mapping[str, FloatArray]
    """Contributions c_i u_i with their signs, Eq. (U.11), shape [n_quantities, ...]."""
    noise: Mapping[str, FloatArray]
    """Standard deviations from the signals' noise, independent of all quantities, shape [...]."""
    curvature: Mapping[str, FloatArray]
    """Second differences (y+ + y- - 2 y) / 2 over one standard uncertainty, shape [n_quantities, ...]: what a
    straight line misses, and the bias of the best estimate."""
    interaction: Mapping[str, FloatArray]
    """Contribution of products of quantities, sum of +-u_i u_j d2y/dx_i dx_j over all pairs, shape [...]."""

    def sigma(self, output: str) -> FloatArray:
        """Combined standard uncertainty u_c, Eq. (U.10), shape [...]."""
        Z = self.contribution[self._known(output)]
        variance = np.einsum("i...,ij,j...->...", Z, self.correlation, Z)
        # Fully correlated contributions may cancel to -1e-16 of their squares.
        return np.sqrt(np.maximum(variance, 0.0) + self.noise[output] ** 2)

    def freedom(self, output: str) -> FloatArray:
        """Effective degrees of freedom by Welch and Satterthwaite, Eq. (U.12), shape [...].

        The formula needs independent parts: quantities that are correlated count as one, with the smallest
        of their degrees of freedom. Noise counts as known.
        """
        Z, u = self.contribution[self._known(output)], self.sigma(output)
        under = np.zeros(u.shape)
        for group in correlated_groups(self.correlation):
            nu = min(self.quantities[i].freedom for i in group)
            part = Z[group]
            variance = np.einsum("i...,ij,j...->...", part, self.correlation[np.ix_(group, group)], part)
            under += variance**2 / nu
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(under > 0.0, u**4 / under, np.inf)

    def coverage_factor(self, output: str, probability: float = 0.95) -> FloatArray:
        """Student's t for the effective degrees of freedom, rounded down (GUM G.4.1), shape [...].

        Raises
        ------
        ValueError
            If the probability is not inside (0, 1).
        """
        if not 0.0 < probability < 1.0:
            raise ValueError(f"a coverage probability must be inside (0, 1), got {probability}")
        nu = np.floor(self.freedom(output) * (1.0 + 1e-12))  # 4 may have become 4 - 1e-15
        return np.asarray(student.ppf(0.5 + 0.5 * probability, nu))

    def expanded(self, output: str, *, k: float = 2.0) -> FloatArray:
        """Expanded uncertainty U = k u_c, shape [...]."""
        return k * self.sigma(output)

    def history(self, output: str, unit: str) -> History:
        """An output with its combined standard uncertainty."""
        return History(self.value[self._known(output)], self.sigma(output), unit)

    def covariance(self, one: str, other: str) -> FloatArray:
        """Covariance of two outputs sample by sample, from the quantities only (GUM F.1.2.3), shape [...].

        Raises
        ------
        ValueError
            If their shapes differ.
        """
        a, b = self.contribution[self._known(one)], self.contribution[self._known(other)]
        if a.shape != b.shape:
            raise ValueError(
                f"{one} and {other} have the shapes {a.shape[1:]} and {b.shape[1:]}; they must be one"
            )
        return np.asarray(np.einsum("i...,ij,j...->...", a, self.correlation, b))

    def nonlinearity(self, output: str) -> float:
        """Largest term of second order over the combined standard uncertainty at the same sample [-].

        That is the curvature of any one quantity, or the interaction of all. Where it is not small the budget
        is not to be trusted, and `kolsky.bars.budget.monte_carlo` is.
        """
        u = self.sigma(output)
        second = np.concatenate([self.curvature[output], self.interaction[output][None]])
        return float(np.max(np.abs(second) / np.where(u > 0.0, u, np.inf), initial=0.0))

    def peak(self, output: str) -> int:
        """Flat index of the sample with the largest magnitude."""
        return int(np.argmax(np.abs(self.value[self._known(output)])))

    def table(self, output: str, sample: int | None = None) -> list[dict[str, Any]]:
        """Contributions at one sample, the largest share first; the last row is the whole.

        Parameters
        ----------
        output
            Name of the output.
        sample
            Flat index of the sample; that of the largest magnitude by default.

        Returns
        -------
        list of dict
            "quantity", "value", "unit", "sigma", "kind", "freedom", "sensitivity" (output per unit of the
            quantity), "contribution" and "share" of the variance, Eq. (U.13). Shares add up to 1; that of a
            correlated quantity may be negative.
        """
        at = self.peak(output) if sample is None else sample
        Z = self.contribution[output].reshape(len(self.quantities), -1)[:, at]
        u = float(self.sigma(output).reshape(-1)[at])
        share = Z * (self.correlation @ Z) / u**2 if u > 0.0 else np.zeros(Z.size)
        rows: list[dict[str, Any]] = [
            {
                "quantity": q.name,
                "value": q.value,
                "unit": q.unit,
                "sigma": q.sigma,
                "kind": q.kind,
                "freedom": q.freedom,
                "sensitivity": float(z / q.sigma) if q.sigma > 0.0 else 0.0,
                "contribution": float(z),
                "share": float(part),
            }
            for q, z, part in zip(self.quantities, Z, share, strict=True)
        ]
        noise = float(self.noise[output].reshape(-1)[at])
        free = {"value": 0.0, "unit": "", "sensitivity": 1.0, "freedom": float("inf")}
        part = noise**2 / u**2 if u > 0.0 else 0.0
        rows.append(
            {"quantity": "noise", **free, "sigma": noise, "kind": "A", "contribution": noise, "share": part}
        )
        rows.sort(key=lambda row: -abs(float(row["share"])))
        whole = {
            "quantity": f"combined, {output}",
            "value": float(self.value[output].reshape(-1)[at]),
            "unit": "",
            "sigma": u,
            "kind": "",
            "freedom": float(self.freedom(output).reshape(-1)[at]),
            "sensitivity": 1.0,
            "contribution": u,
            "share": 1.0,
        }
        return [*rows, whole]

    def _known(self, output: str) -> str:
        if output not in self.value:
            raise ValueError(f"no output is called {output!r}; there are {', '.join(self.value)}")
        return output


def budget_table(budget: Budget, results: Mapping[str, tuple[str, int | None, str]]) -> BudgetTable:
    """The budget at the numbers that are quoted, e.g. at the peak stress.

    Parameters
    ----------
    budget
        As `propagate` made it.
    results
        By the name of the quoted number: output, flat index of the sample (None: that of the largest
        magnitude), unit.

    Returns
    -------
    BudgetTable
        A row for every quantity, then one for the noise of every quoted number.
    """
    numbers: dict[str, tuple[float, float, str]] = {}
    shares: list[dict[str, float]] = [{} for _ in budget.quantities]
    slopes: list[dict[str, float]] = [{} for _ in budget.quantities]
    noises = []
    for name, (output, sample, unit) in results.items():
        rows = {row["quantity"]: row for row in budget.table(output, sample)}
        whole, noise = rows[f"combined, {output}"], rows["noise"]
        numbers[name] = (whole["value"], whole["sigma"], unit)
        for share, slope, q in zip(shares, slopes, budget.quantities, strict=True):
            share[name] = rows[q.name]["share"]
            if q.sigma > 0.0:
                slope[name] = rows[q.name]["sensitivity"]
        of_noise = Quantity(f"noise, {name}", 0.0, noise["sigma"], unit, "A")
        noises.append(Contribution(of_noise, {name: noise["share"]}))
    inputs = [Contribution(*row) for row in zip(budget.quantities, shares, slopes, strict=True)]
    return BudgetTable(results=numbers, contributions=(*inputs, *noises))
