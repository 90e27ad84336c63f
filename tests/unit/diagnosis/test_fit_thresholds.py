"""Thresholds from a population: the tolerance limit of a normal logarithm, the largest value, the margin."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from synthetic import synthetic

from kolsky.inverse.result import CauseFinding
from populations import fit_thresholds
from populations.fit_thresholds import MARGIN, figures, limit, threshold, tolerance_factor
from populations.threshold_choice import STRONGEST, RightShot, chosen, strongest, table


def test_tolerance_factor_is_howes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert tolerance_factor(10**6) == pytest.approx(norm.ppf(0.9875), rel=5e-3)
    # ISO 16269-6, one-sided limits: confidence 95 %, share 99 %, n = 40.
    monkeypatch.setattr(fit_thresholds, "FALSE_ALARMS", 0.01)
    assert tolerance_factor(40) == pytest.approx(2.941, abs=2e-3)


def test_threshold_of_a_lognormal_figure() -> None:
    logs = 0.2 * norm.ppf((np.arange(40) + 0.5) / 40)
    values = np.exp(logs)
    expected = MARGIN * np.exp(logs.mean() + tolerance_factor(40) * logs.std(ddof=1))
    assert threshold(values) == pytest.approx(expected, rel=1e-12)
    assert threshold([*np.ones(39), 9.0]) == pytest.approx(MARGIN * 9.0, rel=1e-9)  # the largest seen counts
    with pytest.raises(ValueError, match="at least 10"):
        threshold(np.ones(9))


def test_figures_of_a_result() -> None:
    found = dict(figures(synthetic(nodes=False)))
    assert found["force: residual over expected"] == pytest.approx(1.0, rel=1e-12)
    assert found["force: slow residual over expected"] == pytest.approx(0.75, rel=1e-12)
    assert found["leading lag in sigmas"] == pytest.approx(0.4, rel=1e-12)


def right(number: int, *, excess: float = 1.0, evidence: float = 0.0, m: float = 1.12) -> RightShot:
    """A made-up result: force residual `excess` times the expected, a cause of some evidence, the truth m."""
    result = synthetic(nodes=False)
    force = replace(result.fit[0], residual=excess * result.fit[0].expected)
    cause = CauseFinding("x", "", "1", 0.0, 5.0, 1.0, 0.5, evidence, 1.0, {}, {}, named=False)
    known = replace(cause, key="y", evidence=999.0, declared_sigma=3.0)  # 5 is within k = 2 of 0 +- 3
    result = replace(result, fit=(force, *result.fit[1:]), causes=(cause, known))
    return RightShot(f"shot-{number}", result, {"stiffness_factor": m})


def test_limits_are_chosen_on_one_population_and_judged_on_the_other() -> None:
    sigma = right(0).result.estimates["stiffness_factor"].sigma
    value = right(0).result.estimates["stiffness_factor"].value
    near, far = value + 5.9 * sigma, value + 6.1 * sigma
    one = [right(n, excess=1.0 + 0.01 * n, evidence=4.0 * n, m=near) for n in range(12)]
    one.append(right(12, excess=50.0, evidence=900.0, m=far))  # its search ended elsewhere
    two = [right(n, excess=1.0, m=value) for n in range(19)] + [right(19, excess=3.0, evidence=56.0, m=value)]
    assert strongest(one[3].result) == 12.0
    said = chosen(one, two, limit)
    rows = said["limits"]
    force, evidence = rows["force: residual over expected"], rows[STRONGEST]
    assert force["chosen"] == pytest.approx(threshold(1.0 + 0.01 * np.arange(12)), rel=1e-12)
    assert evidence["chosen"] == pytest.approx(MARGIN * 44.0, rel=1e-12)
    assert (force["of two above chosen"]["count"], evidence["of two above chosen"]["count"]) == (1, 1)
    assert evidence["of two above in use"]["count"] == 0
    # Clopper and Pearson of 1 in 20: 0.13 to 24.9 %.
    band = force["of two above chosen"]
    assert (band["low"], band["high"]) == pytest.approx((0.00127, 0.2487), abs=1e-4)
    assert said["population one"]["search ended elsewhere"] == ["shot-12"]
    text = table(said)
    assert (
        "| strongest evidence of a cause | 100 | 55 | 44 | 56 | 0 of 20 (0.0 to 16.8 %) | 1 of 20 (0.1"
        in text
    )
    assert "population one: 13 shots; the search of 1 ended elsewhere (shot-12)" in text
