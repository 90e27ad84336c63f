"""Levels and powers for residuals that are correlated in a way the likelihood does not know."""

import numpy as np
import pytest

from doe import Box
from doe.uncertainty import Channel, Likelihood, profile_likelihoods, sample_posterior, verdicts


@pytest.fixture
def linear() -> tuple[Likelihood, np.ndarray]:
    """Two parameters seen linearly by forty data, and the covariance of their optimum."""
    rng = np.random.default_rng(3)
    design = rng.standard_normal((40, 2)) * [30.0, 12.0]
    truth = np.array([0.4, 0.6])
    box = Box.of({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    likelihood = Likelihood(box, lambda x: x @ design.T, design @ truth, [Channel("all", np.ones(40))])
    return likelihood, np.linalg.inv(design.T @ design)


def test_interval_is_longer_by_the_root_of_the_factor(linear: tuple[Likelihood, np.ndarray]) -> None:
    likelihood, covariance = linear
    found = profile_likelihoods(likelihood, [0.5, 0.5], correlation=[4.0, 1.0])
    for profile, factor, variance in zip(found.profiles, (4.0, 1.0), np.diag(covariance), strict=True):
        low, high = profile.interval
        assert low is not None
        assert high is not None
        # Closed form for a linear model; the ends are roots good to 1e-9 of the box.
        assert high - low == pytest.approx(2.0 * np.sqrt(3.841459 * factor * variance), rel=1e-5)
        assert profile.level == pytest.approx(3.841459 * factor, rel=1e-6)
    assert [verdict.kind.value for verdict in verdicts(likelihood, found)] == ["identified"] * 2


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, [1.0, 0.0]])
def test_a_factor_that_is_no_factor_is_refused(
    linear: tuple[Likelihood, np.ndarray], wrong: float | list[float]
) -> None:
    with pytest.raises(ValueError, match="correlation must be > 0"):
        profile_likelihoods(linear[0], [0.5, 0.5], correlation=wrong)


def test_power_of_the_likelihood_widens_the_posterior(linear: tuple[Likelihood, np.ndarray]) -> None:
    pytest.importorskip("emcee")
    likelihood, covariance = linear
    chains = sample_posterior(likelihood, [0.4, 0.6], rng=1, power=0.25)
    # About 40 x 32 independent samples: their standard deviation is known to 2 %.
    np.testing.assert_allclose(chains.samples.std(axis=0), 2.0 * np.sqrt(np.diag(covariance)), rtol=0.08)
    with pytest.raises(ValueError, match="power must be > 0"):
        sample_posterior(likelihood, [0.4, 0.6], rng=1, power=0.0)
