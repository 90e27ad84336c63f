"""Model selection for the rate dependence: elastic, Prony series or Bergstrom-Boyce network.

Each model is fitted to the same values. The models are compared by two criteria. With the weighted sum of
squares Q, k parameters and n values,

    AICc = Q + 2 k + 2 k (k + 1) / (n - k - 1),    BIC = Q + k ln n,                                   (V.6)

The weight of a model is exp(-dBIC / 2) over the sum of all. It is the probability of the model if all were
equally likely a priori (Kass and Raftery 1995). A model is chosen if it has the lowest BIC, all others differ
by more than `STRONG`, and none has a lower AICc. Otherwise no model is chosen.

If a law does not fit the strain dependence, a branch can also reduce the misfit. Tests at one rate cannot
distinguish the two. The models of histories therefore include a curve: the stress is any smooth function of
the stretch alone. If the curve is the best model, no rate dependence is chosen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from explicit.materials import MaterialLaw
from kolsky.base.apparatus import NETWORK_DEFAULTS, NETWORK_FREE, Relaxation
from kolsky.base.arrays import FloatArray
from kolsky.inverse.joint_result import Slow
from kolsky.inverse.slow_tests import slow_measured, slow_predicted
from kolsky.material.relaxation.rate_fit import FACTORS, REFUSED, STRENGTHS, HistoryTest, RateFit

STRONG = 6.0
"""Smallest distance in BIC from the chosen model to every other [-]. It means odds of 20 to 1, the "strong"
evidence of Kass and Raftery (1995)."""
POOR_FIT = 2.0
"""If chi-square over degrees of freedom exceeds this, the fit is reported but no model is chosen."""
NETWORK = "bergstrom_boyce"
"""Name of the network among the models, as in a shot file."""
ELASTIC, CURVE = "elastic", "elastic curve"
"""Names of the models without rate dependence: the declared law, and any curve of the stretch."""
MOST_PIECES = 6
"""Maximum number of cubic pieces of a curve [-]. Its 9 constants are as flexible as any law of
`explicit.materials`."""
CREEP_STRENGTHS = (0.1, 1.0)
"""Initial ratios of the networks in the search [-]."""
CREEP_RESISTANCES = (0.1, 1.0, 10.0)
"""Initial resistances in the search, divided by the largest stress of the tests [-]."""
RESISTANCES = (1e-4, 1e4)
"""Allowed resistances divided by that stress [-]. Outside this range, the network flows immediately or
never."""
AT_END = 1e-3
"""A constant is not determined if the distance of its logarithm from the end of its range is below this
[-]."""


@dataclass(frozen=True)
class Candidate:
    """A model fitted to all values."""

    name: str
    """"elastic", "elastic curve", "prony", "prony:2", "prony:3" or "bergstrom_boyce"."""
    parameters: int
    deviance: float
    """Q of Eq. (V.6), up to a common constant [-]."""
    values: Mapping[str, float]
    doubt: str = ""
    """Reason why it cannot be chosen; empty if it can be chosen."""

    def aicc(self, n: int) -> float:
        """Akaike's criterion for small samples of n values. It is infinite unless n exceeds k + 1 [-]."""
        k = self.parameters
        if n <= k + 1:
            return float("inf")
        return self.deviance + 2.0 * k + 2.0 * k * (k + 1) / (n - k - 1)

    def bic(self, n: int) -> float:
        """The Bayesian criterion [-]."""
        return self.deviance + self.parameters * float(np.log(n))


@dataclass(frozen=True)
class ModelComparison:
    """Models of one material, fitted to the same values."""

    candidates: tuple[Candidate, ...]
    """The models, the fewest parameters first."""
    n_data: int
    scatter: float
    """Smallest sum of squares divided by its degrees of freedom, 1 or more [-]. The deviances are already
    divided by it."""
    left_out: Mapping[str, str]
    """Models that were not fitted, and why."""

    @property
    def weights(self) -> tuple[float, ...]:
        """Weight of each model by BIC [-]."""
        bic = np.array([one.bic(self.n_data) for one in self.candidates])
        relative = np.exp(-0.5 * (bic - bic.min()))
        return tuple((relative / relative.sum()).tolist())

    @property
    def best(self) -> Candidate:
        """The model of least BIC among those that can be chosen."""
        sound = [one for one in self.candidates if not one.doubt]
        return min(sound or self.candidates, key=lambda one: one.bic(self.n_data))

    @property
    def rivals(self) -> tuple[Candidate, ...]:
        """Models that prevent the choice of the best one. A model that cannot be chosen is a rival only if
        its BIC is lower than that of the best. The law and a curve are both elastic and therefore no rivals
        of each other."""
        best, n = self.best, self.n_data
        return tuple(
            one
            for one in self.candidates
            if one is not best
            and {one.name, best.name} != {ELASTIC, CURVE}
            and (
                one.bic(n) < best.bic(n) + (0.0 if one.doubt else STRONG)
                or (not one.doubt and one.aicc(n) < best.aicc(n))
            )
        )

    @property
    def chosen(self) -> Candidate | None:
        """The chosen model; None if the data do not determine one."""
        return None if self.rivals or self.best.doubt or self.scatter > POOR_FIT else self.best

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        best = self.best
        if self.scatter > POOR_FIT:
            return (
                f"no model can be chosen: none describes the data (chi-square per degree of freedom"
                f" {self.scatter:.3g} or more); declare the material's [law], or correct the sigmas"
            )
        if best.doubt:
            return f"no model can be chosen: {best.name}: {best.doubt}"
        if self.rivals:
            near = "; ".join(
                f"{one.name} (BIC {one.bic(self.n_data) - best.bic(self.n_data):+.1f}"
                f"{', ' + one.doubt if one.doubt else ''})"
                for one in self.rivals
            )
            return f"the data do not distinguish {best.name} and {near}"
        if best.name == CURVE:
            return (
                "the data do not require rate dependence: a curve of the strain alone explains them, the "
                "law does not; correct the material's [law], or test at a second rate"
            )
        others = [one.bic(self.n_data) for one in self.candidates if one is not best]
        gap = "no other"
        if others:
            gap = f"the next model's BIC is {min(others) - best.bic(self.n_data):.1f} higher"
        return f"the data choose {best.name} ({gap})"


def compare_slow(law: MaterialLaw, slow: Slow, fits: Sequence[RateFit]) -> ModelComparison:
    """Compare the Prony series of `required_branches` with the creeping network on slow tests. `law` is the
    long-term law at factor 1."""
    found = [
        Candidate(
            series_name(len(fit.model.series)),
            len(fit.values),
            fit.chi_square,
            dict(zip(fit.names, fit.values.tolist(), strict=True)),
            _ends(fit.at_bound),
        )
        for fit in fits
    ]
    left_out = {}
    others = [one.label for one in slow if not isinstance(one, HistoryTest)]
    if others:
        left_out[NETWORK] = (
            f"{', '.join(others)}: the flow of the network depends on the amplitude, which storage and loss "
            "modulus do not give"
        )
    else:
        found += [fit_curve(slow), fit_network(law, slow)]
    n = fits[0].n_data
    scatter = max(1.0, min(one.deviance / max(n - one.parameters, 1) for one in found))
    scaled = (replace(one, deviance=one.deviance / scatter) for one in found)
    return ModelComparison(tuple(sorted(scaled, key=lambda one: one.parameters)), n, scatter, left_out)


def series_name(branches: int) -> str:
    """Name of a series as in `--relaxation`. It is "elastic" without branches."""
    return (ELASTIC, "prony")[branches] if branches < 2 else f"prony:{branches}"


def _ends(names: Sequence[str]) -> str:
    return f"at the end of its range: {', '.join(names)}" if names else ""


def fit_curve(slow: Slow) -> Candidate:
    """Fit histories by a cubic spline of the stretch. Its number of pieces has the least BIC."""
    values, sigma = slow_measured(slow)
    histories = [one for one in slow if isinstance(one, HistoryTest)]
    stretch = np.concatenate([one.stretch[np.isfinite(one.sigma)] for one in histories])
    found = []
    for pieces in range(1, MOST_PIECES + 1):
        knots = np.unique(np.quantile(stretch, np.linspace(0.0, 1.0, pieces + 1)))
        if len(knots) < 2:
            continue  # only one stretch: a constant is fitted below
        knots = np.concatenate([np.repeat(knots[0], 3), knots, np.repeat(knots[-1], 3)])
        rows = BSpline.design_matrix(stretch, knots, 3).toarray()
        found.append(_least_squares(rows / sigma[:, None], values / sigma))
    if not found:
        found = [_least_squares(1.0 / sigma[:, None], values / sigma)]
    return min(found, key=lambda one: one.bic(len(values)))


def _least_squares(rows: FloatArray, values: FloatArray) -> Candidate:
    """Fit a curve that is linear in its constants. Unconstrained constants do not count."""
    solved, _, rank, _ = np.linalg.lstsq(rows, values)
    return Candidate(CURVE, int(rank), float(np.square(rows @ solved - values).sum()), {})


def fit_network(law: MaterialLaw, slow: Slow) -> Candidate:
    """Fit factor, ratio and resistance of the network. Its exponents are the defaults of a shot file."""
    values, sigma = slow_measured(slow)
    stress = float(np.abs(values).max())
    names = ("factor", "creep_ratio", "creep_resistance")

    def constants(x: FloatArray) -> dict[str, float]:
        factor, ratio, resistance = np.exp(x)
        return {"factor": factor, "creep_ratio": ratio, "creep_resistance": resistance}

    def residuals(x: FloatArray) -> FloatArray:
        found = constants(x)
        network = Relaxation(
            "bergstrom_boyce", {**{name: found[name] for name in NETWORK_FREE}, **NETWORK_DEFAULTS}
        )
        try:
            predicted = slow_predicted(slow, law, network, {"stiffness_factor": found["factor"]})
        except ValueError:  # this flow cannot be integrated: the search must reject the step
            return np.full(len(values), REFUSED)
        return (predicted - values) / sigma

    ranges = (FACTORS, STRENGTHS, (stress * RESISTANCES[0], stress * RESISTANCES[1]))
    lower, upper = np.log(np.array(ranges)).T
    elastic = slow_predicted(slow, law, None, {})
    weight = elastic / sigma**2
    scale = max(float(weight @ values / (weight @ elastic)), 2.0 * FACTORS[0])
    # both networks together carry the mean stress; the share of the second is not known in advance
    starts = [
        np.log([scale / np.sqrt(1.0 + ratio), ratio, stress * size])
        for ratio, size in product(CREEP_STRENGTHS, CREEP_RESISTANCES)
    ]
    begin = min(starts, key=lambda x: float(np.square(residuals(x)).sum()))
    best = least_squares(residuals, begin, bounds=(lower, upper), diff_step=1e-3, xtol=1e-5, max_nfev=40)
    ends = (best.x - lower < AT_END) | (upper - best.x < AT_END)
    doubt = _ends([name for name, end in zip(names, ends, strict=True) if end])
    return Candidate(NETWORK, len(names), 2.0 * float(best.cost), constants(best.x), doubt)


def comparison_table(found: ModelComparison) -> dict[str, list[Any]]:
    """One row per model."""
    n, models = found.n_data, found.candidates
    least, best = min(one.aicc(n) for one in models), min(one.bic(n) for one in models)
    return {
        "model": [one.name for one in models],
        "parameters": [one.parameters for one in models],
        "deviance (1)": [one.deviance for one in models],
        "AICc over the least (1)": [one.aicc(n) - least for one in models],
        "BIC over the least (1)": [one.bic(n) - best for one in models],
        "weight (1)": list(found.weights),
        "doubt": [one.doubt for one in models],
    }


def comparison_summary(found: ModelComparison) -> dict[str, Any]:
    """The comparison for JSON, SI."""
    return {
        "verdict": found.sentence,
        "chosen": None if found.chosen is None else found.chosen.name,
        "values": found.n_data,
        "scatter": found.scatter,
        "models": comparison_table(found),
        "constants": {one.name: dict(one.values) for one in found.candidates},
        "left_out": dict(found.left_out),
    }
