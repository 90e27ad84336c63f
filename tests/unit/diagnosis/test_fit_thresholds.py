"""Thresholds from a population: the tolerance limit of a normal logarithm, the largest value, the margin."""

import numpy as np
import pytest
from scipy.stats import norm
from synthetic import synthetic

from benchmarks import fit_thresholds
from benchmarks.fit_thresholds import MARGIN, figures, threshold, tolerance_factor


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
