"""The score test of a branch: closed forms for one direction, synthetic elastic data, known branches."""

import numpy as np
import pytest
from scipy.stats import norm

from kolsky.diagnosis.relaxation import branch_test

K = 400


def decays(times: np.ndarray) -> np.ndarray:
    """Directions of branches: what is left at a time, over one second."""
    return np.exp(-np.linspace(0.0, 1.0, K) / times[:, None])


TIMES = np.geomspace(0.02, 1.0, 6)
SLOPES = np.stack([np.ones(K), np.linspace(0.0, 1.0, K)], axis=1)


def test_one_direction_has_the_tail_of_half_a_normal() -> None:
    unit = np.zeros(K)
    unit[7] = 4.0
    residual = np.zeros(K)
    residual[7] = 1.5
    elsewhere = np.eye(K)[:, 100:101]
    found = branch_test(residual, elsewhere, unit[None], [0.1])
    assert found.gain == pytest.approx(2.25)
    assert found.strength == pytest.approx(1.5 / 4.0)  # residual over direction
    assert found.probability == pytest.approx(norm.sf(1.5), rel=0.05)  # 20000 draws: 2 % (k = 1)
    assert branch_test(-residual, elsewhere, unit[None], [0.1]).gain == 0.0  # a strength is >= 0


def test_a_strong_branch_counts_by_what_its_search_has_gained() -> None:
    unit, elsewhere = 4.0 * np.eye(K)[:1], np.eye(K)[:, 100:101]
    residual = np.zeros(K)
    residual[0] = 1.5
    # 4 is above the score's 2.25, 1 below.
    found = branch_test(residual, elsewhere, unit, [0.1], realised=4.0)
    assert found.gain == pytest.approx(4.0)
    assert found.probability == pytest.approx(norm.sf(2.0), rel=0.15)  # 20000 draws: 5 % (k = 1)
    assert branch_test(residual, elsewhere, unit, [0.1], realised=1.0).gain == pytest.approx(2.25)
    # Residuals that are one value in blocks of 20: the gain is over the variance of a sum of them, about 20.
    rng = np.random.default_rng(9)
    label = np.arange(K) // 20
    blocked = rng.standard_normal(K // 20)[label]
    direction = decays(TIMES)[-1:]
    plain, known = (
        branch_test(blocked, SLOPES[:, :1], direction, [1.0], realised=900.0, blocks=blocks).gain
        for blocks in ((), [label])
    )
    assert plain == pytest.approx(900.0)
    assert 900.0 / 60.0 < known < 900.0 / 5.0


def test_what_the_parameters_follow_is_no_evidence() -> None:
    found = branch_test(3.0 * SLOPES[:, 1] - 5.0, SLOPES, decays(TIMES), TIMES)
    assert found.gain == pytest.approx(0.0, abs=1e-18)
    with pytest.raises(ValueError, match="no branch has an effect"):
        branch_test(np.zeros(K), SLOPES, SLOPES.T[:1], [0.1])


def test_planted_elastic_data_are_seldom_called_relaxing() -> None:
    rng = np.random.default_rng(4)
    p = [
        branch_test(rng.standard_normal(K), SLOPES, decays(TIMES), TIMES, draws=400).probability
        for _ in range(400)
    ]
    assert np.mean(np.array(p) < 0.2) == pytest.approx(0.2, abs=0.06)  # three standard deviations


def test_correlated_residuals_are_no_more_evidence_than_their_blocks() -> None:
    rng = np.random.default_rng(6)
    labels = [np.arange(K) // length for length in (2, 4, 8, 20)]
    calls = [0, 0]  # residuals in blocks of one value: a mean has 20 times the variance
    for _ in range(100):
        residual = rng.standard_normal(K // 20)[labels[-1]]
        for k, blocks in enumerate(([], labels)):
            calls[k] += branch_test(
                residual, SLOPES, decays(TIMES), TIMES, blocks=blocks, draws=400
            ).significant
    assert calls[0] > 15  # as if every entry were independent
    assert calls[1] <= 5


def test_a_planted_branch_is_found_with_its_time() -> None:
    rng = np.random.default_rng(5)
    residual = 6.0 * decays(TIMES)[2] + rng.standard_normal(K)
    found = branch_test(residual, SLOPES, decays(TIMES), TIMES)
    assert found.significant
    assert found.time == TIMES[2]
    assert found.strength == pytest.approx(6.0, rel=0.2)  # its sigma is 0.4 beside what the slopes follow
