"""Paule and Mandel's scatter between values beside statsmodels'."""

import numpy as np
import pytest

from kolsky.studies.rates.scatter import mixed_fit

CASES = {
    # values and standard uncertainties of Hartung and others' kind: agreeing, scattered, uneven
    "agreeing": ([1.0, 1.1, 0.9, 1.05], [0.2, 0.3, 0.25, 0.2]),
    "scattered": ([1.12, 1.31, 0.98, 1.22, 1.4], [0.02, 0.05, 0.03, 0.02, 0.04]),
    "uneven": ([3.0, 3.4, 2.1], [0.01, 0.5, 0.2]),
}


@pytest.mark.parametrize("name", CASES)
def test_the_scatter_between_values_is_that_of_statsmodels(name: str) -> None:
    analysis = pytest.importorskip("statsmodels.stats.meta_analysis", reason="needs statsmodels")
    values, sigma = (np.array(row) for row in CASES[name])
    oracle = analysis.combine_effects(values, sigma**2, method_re="iterated", atol=1e-12)
    found = mixed_fit(values, sigma, np.ones((values.size, 1)))
    np.testing.assert_allclose(found.between**2, oracle.tau2, rtol=1e-4, atol=1e-9)  # its root's tolerance
    np.testing.assert_allclose(found.coefficients[0], oracle.mean_effect_re, rtol=1e-6)
