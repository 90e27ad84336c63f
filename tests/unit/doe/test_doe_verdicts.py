"""Thresholds of verdicts and corrections of covariances from both sides, in closed form."""

import numpy as np
import pytest
from numpy.typing import NDArray

from doe import Box
from doe.uncertainty import (
    Channel,
    Likelihood,
    VerdictKind,
    profile_likelihoods,
    verdicts,
)
from doe.uncertainty.profile import LEVEL

FloatArray = NDArray[np.float64]


def of_inflation(inflation: float) -> Likelihood:
    """Two parameters whose interval is so many times longer than alone: 1 over the sine of their angle."""
    angle = np.arcsin(1.0 / inflation)
    A = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)]])

    def model(p: FloatArray) -> FloatArray:
        return p @ A.T

    box = Box(("x", "y"), (-2.0, -2.0), (2.0, 2.0))
    return Likelihood(box, model, np.zeros(2), [Channel("all", np.full(2, 0.1))])


@pytest.mark.parametrize(("inflation", "leans"), [(2.9, False), (3.1, True)])
def test_an_interval_three_times_longer_than_alone_rests_on_the_others(inflation: float, leans: bool) -> None:
    likelihood = of_inflation(inflation)
    x, _ = verdicts(likelihood, profile_likelihoods(likelihood, (0.1, 0.1)))
    assert x.kind is VerdictKind.IDENTIFIED
    assert x.inflation == pytest.approx(inflation, rel=1e-4)  # the ends' tolerance
    assert ("times longer" in x.text) is leans
    assert [p.name for p in x.partners] == (["y"] if leans else [])


def test_level_is_the_square_of_the_normal_quantile() -> None:
    assert pytest.approx(1.959963984540054**2, rel=1e-12) == LEVEL  # tables


@pytest.mark.parametrize("correlation", [1.0, 4.0])
def test_correlation_widens_an_interval_by_its_root(correlation: float) -> None:
    likelihood = of_inflation(2.0)
    found = profile_likelihoods(likelihood, (0.1, 0.1), correlation=correlation)
    low, high = found["x"].interval
    assert low is not None
    assert high is not None
    # sigma = 0.1 x inflation
    assert high - low == pytest.approx(2.0 * 1.959963984540054 * np.sqrt(correlation) * 0.2, rel=1e-5)
