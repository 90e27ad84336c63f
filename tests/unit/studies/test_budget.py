"""The error budget: its rule, its design, its shares, and the plan of a campaign."""

import numpy as np
import pytest
from scipy.stats import t as student

from doe.ledger import Run
from kolsky.studies.budget.budget import NODES, WEIGHTS, analysed, design
from kolsky.studies.budget.campaign import plan_campaign, shot_sigma, slope_half_width
from kolsky.studies.budget.factors import NOISE, factors_of, shifted
from kolsky.virtual.schema import Specification

FACTORS = factors_of(
    {"imperfections.length": "0.5 %", "imperfections.sensitivity": "2 %", "material.damping": "4 us"}
)
LINEAR, CURVED = np.array([0.0, 3.0, -0.5, 0.0]), np.array([0.0, 0.0, 0.2, 0.0])
"""A made-up answer: 1 + sum_i (a_i z_i + b_i z_i^2) + noise of 0.1; the noise is factor 0, z in sigmas."""


def made_up(points: np.ndarray, *, lost: int | None = None) -> list[Run]:
    rng = np.random.default_rng(4)
    noises = {number: 0.1 * rng.standard_normal() for number in range(1, 2000)} | {0: 0.0}
    runs = []
    for number, point in enumerate(points):
        z = point.copy()
        z[0] = 0.0
        value = 1.0 + LINEAR @ z + CURVED @ z**2 + noises[int(point[0])]
        failed = number == lost
        runs.append(Run(not failed, "x", np.array([np.nan if failed else value]), "why" if failed else ""))
    return runs


def test_sizes_are_read_with_their_units() -> None:
    assert [(factor.key, factor.sigma) for factor in FACTORS] == [
        (NOISE, 1.0),
        ("imperfections.length", 0.005),
        ("imperfections.sensitivity", 0.02),
        ("material.damping", pytest.approx(4e-6)),
    ]
    assert [factor.shared for factor in FACTORS] == [False, False, True, False]
    for key, size in {
        "imperfections.length": "5 mm",
        "imperfections.tall": 1.0,
        "scope.format": "csv",
    }.items():
        with pytest.raises(ValueError, match=key):
            factors_of({key: size})


def test_errors_are_added_to_the_specification() -> None:
    q = shifted(Specification(), {"material.damping": -5e-6, "imperfections.length": 0.01})
    assert q.material.damping == pytest.approx(20e-6)
    assert q.imperfections.length == 0.01
    assert q.material.poisson == Specification().material.poisson


def test_rule_has_the_moments_of_a_normal_variable() -> None:
    """E 1, z, z^2, z^3, z^4 = 1, 0, 1, 0, 3."""
    assert [float(WEIGHTS @ NODES**k) for k in range(5)] == pytest.approx([1, 0, 1, 0, 3], abs=1e-14)


def test_each_source_alone() -> None:
    """Of a z + b z^2 the mean is b, the variance a^2 + 2 b^2, the slope a / sigma; noise is its scatter."""
    points = design(FACTORS, draws=400, together=2000 - 401, seed=1)
    found = analysed("made up", "m", 1.0, FACTORS, made_up(points), 0, 400)
    noise, length, sensitivity, damping = found.sources
    assert length.u == pytest.approx(3.0, rel=1e-12)
    assert length.slope == pytest.approx(3.0 / 0.005, rel=1e-12)
    assert sensitivity.bias == pytest.approx(0.2, rel=1e-12)
    assert sensitivity.u == pytest.approx(np.sqrt(0.5**2 + 2 * 0.2**2), rel=1e-12)
    assert damping.u == pytest.approx(0.0, abs=1e-12)
    assert noise.u == pytest.approx(0.1, rel=0.15)  # of 400 draws: 3.5 %, four of these
    total = np.sqrt(3.0**2 + 0.5**2 + 2 * 0.2**2 + 0.1**2)
    assert found.u_sum == pytest.approx(total, rel=1e-3)
    assert found.u_together == pytest.approx(total, rel=0.07)  # of 1599 draws: 1.8 %
    assert found.share(length) == pytest.approx(9.0 / total**2, rel=1e-3)
    low, high = found.u_together_interval
    assert high / low == pytest.approx(1.0 + 2 * 1.96 / np.sqrt(2 * 1598), rel=0.01)
    assert found.adds_up


def test_all_at_once_that_does_not_add_up_is_said() -> None:
    points = design(FACTORS, draws=8, together=40, seed=1)
    runs = made_up(points)
    for run in runs[-40:]:
        run.results[:] *= 3.0
    assert analysed("made up", "m", 1.0, FACTORS, runs, 0, 8).adds_up is False
    none = analysed("made up", "m", 1.0, FACTORS, runs[:-40], 0, 8)
    assert none.adds_up is None


def test_a_test_that_gave_no_answer_leaves_its_source_unknown() -> None:
    points = design(FACTORS, draws=8, together=0, seed=1)
    found = analysed("made up", "m", 1.0, FACTORS, made_up(points, lost=3), 0, 8)
    assert np.isnan(found.sources[2].u)
    assert found.sources[2].refused == ("why",)
    assert found.sources[1].u == pytest.approx(3.0)
    assert shot_sigma(found, 0.0) > 3.0  # the sensitivity is common to all shots


def test_design_keeps_sources_apart() -> None:
    points = design(FACTORS, draws=5, together=6, seed=1)
    assert points.shape == (1 + 2 * 3 + 5 + 6, 4)
    assert not points[0].any()
    alone = points[1:7]
    assert (np.count_nonzero(alone, axis=1) == 1).all()
    assert points[7:12, 0].tolist() == [1, 2, 3, 4, 5]
    assert not points[7:12, 1:].any()
    assert points[12:, 0].tolist() == [6, 7, 8, 9, 10, 11]
    # A Latin hypercube has one value in each sixth of the probability.
    from scipy.stats import norm

    sixths = np.sort(np.floor(6 * norm.cdf(points[12:, 1:])), axis=0)
    assert (sixths == np.arange(6)[:, None]).all()


def test_slope_of_a_campaign_by_the_covariance_of_least_squares() -> None:
    """The variance of a fitted slope is the corner of s^2 (A^T A)^-1."""
    rates = np.array([100.0, 150.0, 400.0, 900.0, 1000.0])
    A = np.column_stack([np.ones(5), np.log10(rates)])
    covariance = 0.03**2 * np.linalg.inv(A.T @ A)
    expected = student.ppf(0.975, 3) * np.sqrt(covariance[1, 1])
    assert slope_half_width(rates, 0.03) == pytest.approx(expected, rel=1e-12)
    assert slope_half_width(rates[:2], 0.03) == np.inf
    assert slope_half_width(np.full(5, 100.0), 0.03) == np.inf


def test_campaign_is_the_smallest_that_serves() -> None:
    """n shots at two ends D decades apart: u = 2 s / (D sqrt n) for even n."""
    found = plan_campaign(100.0, 1000.0, 0.05, 0.04)
    n = found.shots
    assert found.half_width <= 0.05
    fewer = np.concatenate([np.full((n - 1) // 2, 100.0), np.full(n - 1 - (n - 1) // 2, 1000.0)])
    assert slope_half_width(fewer, 0.04) > 0.05
    if n % 2 == 0:
        assert found.half_width == pytest.approx(student.ppf(0.975, n - 2) * 2 * 0.04 / np.sqrt(n), rel=1e-12)
    assert plan_campaign(100.0, 1000.0, 0.05, 0.04, layout="even").shots > n
    with pytest.raises(ValueError, match="do not reach"):
        plan_campaign(100.0, 110.0, 1e-4, 0.04)
