"""Eqs. (K.18-36) against a problem whose minimum is known in closed form."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from kolsky.bodies.sheet_fit import before_test, parameter_change, relative_deviation, smoothed, variance

A = np.array([[2.0, 1.0], [0.5, -1.0], [1.0, 3.0], [0.0, 0.7]])
"""A model linear in its constants, u = A m: least squares has m = (A^T W A)^-1 A^T W v."""
W = np.diag([1.0, 2.0, 0.5, 3.0])


def test_change_is_that_of_least_squares() -> None:
    # J = 1/2 (A m - v)^T W (A m - v): d2J/dm2 = A^T W A, d2J/dm dv = -A^T W.
    found = parameter_change(A.T @ W @ A, -A.T @ W)
    assert found == pytest.approx(np.linalg.inv(A.T @ W @ A) @ A.T @ W)


def test_variance_adds_squares() -> None:
    change = np.array([[3.0, 4.0], [1.0, -2.0]])
    assert variance(change, 0.1) == pytest.approx([0.25, 0.05])
    assert variance(change, np.array([1.0, 2.0])) == pytest.approx([73.0, 17.0])
    assert relative_deviation(change, 0.1, np.array([-5.0, 1.0])) == pytest.approx([0.1, np.sqrt(0.05)])


def test_a_direction_that_is_not_seen_is_refused() -> None:
    with pytest.raises(ValueError, match="not positive definite"):
        parameter_change(np.array([[1.0, 1.0], [1.0, 1.0 - 1e-6]]), np.ones((2, 3)))
    with pytest.raises(ValueError, match="does not depend"):
        parameter_change(np.diag([1.0, 0.0]), np.ones((2, 3)))
    with pytest.raises(ValueError, match="zero"):
        relative_deviation(np.ones((1, 2)), 1.0, np.array([0.0]))


def test_smoothed_field_integrates_to_the_change() -> None:
    # Linear elements on a line of three nodes, the last node outside the region: M from two half-elements.
    mass = csr_matrix(np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.0]]) / 6.0)
    change = np.array([[0.5, -1.0, 0.0]])
    field = smoothed(mass, change)
    # M^-1 of [[2, 1], [1, 2]] / 6 is [[4, -2], [-2, 4]].
    assert field == pytest.approx(np.array([[4.0, -5.0, 0.0]]))
    disturbance = np.array([0.3, 0.2, 0.9])
    assert disturbance @ (mass @ field[0]) == pytest.approx(disturbance @ change[0])


def test_before_a_test_every_constant_that_displacements_see() -> None:
    mass = diags([1.0, 2.0, 0.5, 3.0]).tocsr()
    constants = np.array([10.0, 0.2])
    found = before_test(A.T, mass, constants)
    relative = A * constants  # du / d(relative constant)
    inverse = np.linalg.inv(relative.T @ W @ relative)
    assert not found.singular
    assert found.change == pytest.approx(inverse @ relative.T @ W)  # Eq. (K.32)
    assert found.field == pytest.approx(inverse @ relative.T)  # Eq. (K.36): M^-1 of the change


def test_eigenvectors_where_a_constant_moves_nothing() -> None:
    # Young's modulus moves no displacement under prescribed displacements; the other one is left.
    slopes = np.stack([np.zeros(4), A[:, 1]])
    found = before_test(slopes, diags([1.0, 2.0, 0.5, 3.0]).tocsr(), np.array([2.8e4, 0.2]))
    own = 0.2 * A[:, 1]
    assert found.singular
    assert found.directions == pytest.approx(np.array([[0.0, 1.0]]))
    assert found.eigenvalues == pytest.approx([own @ W @ own, 0.0], abs=1e-12)
    assert found.change[0] == pytest.approx(W @ own / (own @ W @ own))  # Eq. (K.35)
    assert found.field[0] == pytest.approx(own / (own @ W @ own))


def test_nothing_moves() -> None:
    with pytest.raises(ValueError, match="force has to be measured"):
        before_test(np.zeros((2, 4)), diags([1.0] * 4).tocsr(), np.ones(2))
