"""Declared uncertainties beside what the residuals tell: how parts add, and what correlation does."""

from dataclasses import replace

import numpy as np
import pytest

from doe import Box
from kolsky.base.records import ForceHistory
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import observe
from kolsky.inverse.result import Declaration
from kolsky.uncertainty.analyse import UncertaintyAnalysis
from kolsky.uncertainty.profiles import LinearisedOptimum


def test_declared_parts_add_in_quadrature() -> None:
    def part(key: str, shift: float) -> Declaration:
        return Declaration(key, 0.1, "1", {"stiffness_factor": shift}, "varied")

    silent = Declaration("y_offset", float("nan"), "m", {}, "not declared, counted as exact")
    analysis = UncertaintyAnalysis(
        systematic=(part("poisson", 0.03), part("damping", -0.04), part("sensitivity", 0.12), silent),
        profiles=(),
        ridge=None,
        posterior=None,
        found=None,
        warnings=(),
        runs=0,
    )
    assert analysis.sigma_systematic("stiffness_factor") == pytest.approx(0.13, rel=1e-12)
    assert analysis.sigma_systematic("friction") == 0.0


def test_correlation_is_the_sandwich_over_the_independent_variance_never_below_one() -> None:
    n = 40
    pairs = np.tile([1.0, 1.0, -1.0, -1.0], 10)
    edges = 2.0**-17 * np.arange(n + 1)
    for residual, expected in ((3.0 * pairs, 20 * 0.0225 * 20.0 / 19.0), (0.0 * pairs, None)):
        history = ForceHistory(np.linspace(0.0, edges[-1], 401), np.zeros(401), np.full(401, 0.3))
        seen = observe(history, None, window=(0.0, float(edges[-1])), bin_width=2.0**-17)
        bins = replace(seen.bins, edges=edges, mean=residual, sigma=np.full(n, 0.3))
        one = Objective(replace(seen, bins=bins), np.zeros(0, dtype=bool))
        slope = np.ones((n, 1))
        found = LinearisedOptimum(
            np.ones(1), Box.of({"m": (0.0, 2.0)}), one, np.zeros(n), slope, np.zeros((n, 1))
        )
        ratio = 1.0 if expected is None else expected / (0.09 / n)
        np.testing.assert_allclose(found.correlation, [ratio], rtol=1e-9)
