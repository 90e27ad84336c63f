"""A peeling bond in a series of residuals: the planted length comes back, and silence where there is none."""

import numpy as np
import pytest

from kolsky.bodies.specimen_fit import LIMIT, debonding

N = 40
X = np.linspace(0.0, 1.0, N)
J = np.stack([X, X**2], -1) * 50.0
SHORT = -20.0 * X
"""Force with bonds shorter by 1 mm, less the force as it is, in standard deviations."""


def test_length_and_deviation_are_those_of_least_squares() -> None:
    opened = np.where(np.arange(N) >= 24, SHORT, 0.0)
    residual = 0.6 * opened + J @ np.array([0.3, -0.1])
    found = debonding(residual, J, SHORT, amount=1e-3, scale=4.0)
    assert found is not None
    assert found.sample == 24
    assert found.length == pytest.approx(0.6e-3)
    # The deviation of one more constant in the fit with J: [(A^T A)^-1] of A = [J, template].
    A = np.column_stack([J, opened])
    assert found.sigma == pytest.approx(1e-3 * np.sqrt(4.0 * np.linalg.inv(A.T @ A)[2, 2]))
    assert found.z == pytest.approx(found.length / found.sigma)
    assert found.searched == round(0.85 * N) - round(0.15 * N)


def test_noise_alone_and_a_bond_that_holds_are_not_suspected() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        found = debonding(rng.standard_normal(N), J, SHORT, amount=1e-3, scale=1.0)
        assert found is not None
        assert not found.suspected
    stiffer = debonding(-np.where(np.arange(N) >= 20, SHORT, 0.0), J, SHORT, amount=1e-3, scale=1.0)
    assert stiffer is not None
    assert not stiffer.suspected  # more force than the model's is no peeling


def test_limit() -> None:
    opened = np.where(np.arange(N) >= 24, SHORT, 0.0)
    unit = debonding(opened, J, SHORT, amount=1e-3, scale=1.0)
    assert unit is not None
    for size, suspected in ((0.95, False), (1.05, True)):
        found = debonding(size * LIMIT / unit.z * opened, J, SHORT, amount=1e-3, scale=1.0)
        assert found is not None
        assert found.suspected is suspected


def test_constants_that_imitate_it_leave_nothing_to_say() -> None:
    assert debonding(np.zeros(N), np.eye(N), SHORT, amount=1e-3, scale=1.0) is None
