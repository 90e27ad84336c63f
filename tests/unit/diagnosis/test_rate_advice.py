"""Advice to try a material with relaxation: its conditions, and the starts of the search."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.diagnosis.causes import LEAST_SHARE
from kolsky.diagnosis.judgement import branch_advice
from kolsky.diagnosis.relaxation import (
    SCANNED_TIMES,
    STRENGTHS,
    BranchFit,
    BranchTest,
    branch_figures,
    explained_share,
    rate_advice,
    scan_points,
)
from kolsky.results.display import QUALITY

FIT = BranchFit(strength=0.3, time=2e-4, aic=-50.0, share=0.6, inside=True)
WEAK = BranchTest(gain=30.0, time=1e-4, strength=0.05, probability=0.001)
CHANCE = BranchTest(gain=2.0, time=1e-4, strength=0.05, probability=0.09)


def test_it_is_given_for_what_chance_does_not_explain() -> None:
    (text,) = rate_advice(WEAK)
    assert "about 1e+02 us" in text
    assert "0.1 % of planted elastic data" in text
    assert "--relaxation prony" in text
    assert rate_advice(None) == rate_advice(CHANCE) == ()


def test_it_is_given_for_a_branch_that_explains_half_of_what_is_left() -> None:
    (text,) = rate_advice(CHANCE, FIT)
    assert "strength 0.3 that relaxes in about 2e+02 us" in text
    assert "60 % of the misfit of this elastic material (AIC -50)" in text
    assert "--relaxation prony" in text
    assert rate_advice(WEAK, FIT) == rate_advice(WEAK)  # the first question was answered


def test_beside_a_likely_input_it_must_explain_more_than_that() -> None:
    (text,) = rate_advice(None, FIT, least=0.59)
    assert "A second shot at a third of the speed distinguishes the two" in text
    assert rate_advice(None, FIT, least=0.6) == ()


def test_a_weak_branch_counts_if_likely_inputs_explain_little() -> None:
    """Below a quarter of the misfit the linear test decides; from there on a branch that explains more."""

    def searched() -> BranchFit:
        raise AssertionError("a fit is made")

    assert branch_advice(WEAK, 0.99 * LEAST_SHARE, searched) == (rate_advice(WEAK), None)
    assert branch_advice(WEAK, LEAST_SHARE, lambda: FIT) == (rate_advice(None, FIT, least=LEAST_SHARE), FIT)
    assert branch_advice(WEAK, 0.6, lambda: FIT) == ((), FIT)
    assert branch_advice(CHANCE, 0.0, lambda: FIT) == (rate_advice(None, FIT), FIT)


@pytest.mark.parametrize("but", [{"aic": 0.1}, {"share": 0.49}, {"inside": False}])
def test_a_branch_that_does_not_is_not_advised(but: dict[str, Any]) -> None:
    assert rate_advice(None, BranchFit(**{**vars(FIT), **but})) == ()
    assert rate_advice(None, FIT) != ()


def test_what_it_is_given_by_is_kept() -> None:
    assert branch_figures(None, None) == {}
    assert branch_figures(WEAK, None) == {"branch_probability": 0.001}
    kept = branch_figures(CHANCE, FIT)
    assert kept == {"branch_probability": 0.09, "branch_strength": 0.3, "branch_time": 2e-4,
                    "branch_share": 0.6, "branch_aic": -50.0}  # fmt: skip
    assert set(kept) <= set(QUALITY)  # the page has words for each


def box(*names: str) -> Box:
    own = {"stiffness_factor": (0.5, 2.0), "poisson": (0.45, 0.4999), "damping": (0.0, 1e-4)}
    ends = {"prony_strength_1": (0.0, 2.0), "prony_time_1": (2e-5, 2e-3)}
    return Box.of({**{name: own[name] for name in names}, **ends})


def test_the_scan_keeps_the_mean_stiffness_and_the_bulk_modulus() -> None:
    points = scan_points(box("stiffness_factor", "poisson", "damping"), np.array([1.4, 0.4985, 3e-5]))
    assert points.shape == (len(STRENGTHS) * SCANNED_TIMES, 5)
    m, poisson, damping, strength, time = points.T
    np.testing.assert_allclose(m * np.sqrt(1.0 + strength), 1.4)
    # K goes with the instantaneous stiffness m (1 + c) over 1 - 2 nu.
    np.testing.assert_allclose(m * (1.0 + strength) / (1.0 - 2.0 * poisson), 1.4 / 0.003)
    np.testing.assert_array_equal(damping, 3e-5)
    assert (np.diff(time[:SCANNED_TIMES]) > 0.0).all()
    assert time.min() > 2e-5
    assert time.max() < 2e-3


def test_a_held_stiffness_leaves_the_bulk_modulus_to_poissons_ratio() -> None:
    points = scan_points(box("poisson"), np.array([0.4985]))
    poisson, strength, _ = points.T
    np.testing.assert_allclose((1.0 + strength) / (1.0 - 2.0 * poisson), 1.0 / 0.003)
    np.testing.assert_array_equal(scan_points(box("damping"), np.array([3e-5]))[:, 0], 3e-5)


class Made:
    """Two forces and two outline points; what is left of a vector is a tenth of it in the force alone."""

    def __init__(self) -> None:
        self.data, self.noise, self.n_force = np.zeros(4), np.array([0.1, 0.2, 1.0, 1.0]), 2

    def with_discrepancy(self, vector: np.ndarray) -> Any:
        return SimpleNamespace(
            data=self.data, noise=self.noise, n_force=2,
            force_discrepancy=float(vector[0]), shape_discrepancy=float(vector[2]),
        )  # fmt: skip


def test_the_share_is_of_squares_over_the_noise() -> None:
    before, after = np.array([1.0, 1.0, 2.0, 2.0]), np.array([0.5, 0.5, 1.0, 1.0])
    # 1/0.1^2 + 1/0.2^2 + 2 (2/1)^2 = 133; a quarter of it is left.
    assert explained_share(Made(), before, after) == pytest.approx(0.75)  # type: ignore[arg-type]
    outline = np.array([1.0, 1.0, 0.0, 0.0])
    assert explained_share(Made(), before, outline) == pytest.approx(8.0 / 133.0)  # type: ignore[arg-type]
    assert explained_share(Made(), np.zeros(4), after) == 0.0  # type: ignore[arg-type]
