"""Solvers of the tangent against SciPy's dense one."""

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import coo_array
from scipy.sparse.linalg import LinearOperator

from kolsky.equilibrium.linear.base import Pattern, SingularError
from kolsky.equilibrium.linear.solvers import AGED, Hierarchy, MultifrontalSolver, SparseSolver, linear_solver
from kolsky.equilibrium.meshes import box

MESH = box((3.0, 2.0, 1.0), (6, 4, 2), kind="hex8")
DOFS = (MESH.cells[..., None] * 3 + np.arange(3)).reshape(len(MESH.cells), -1)


def pattern(coupled: bool = False) -> Pattern:
    """Unknowns of a box held at one end; `coupled`: its other end is one unknown along x."""
    index = np.arange(MESH.points.size)
    if coupled:
        right = 3 * MESH.nodes("right")
        index[right] = right[0]
    index[(3 * MESH.nodes("left")[:, None] + np.arange(3)).ravel()] = -1
    kept = np.unique(index[index >= 0])
    index[index >= 0] = np.searchsorted(kept, index[index >= 0])
    return Pattern(DOFS, index, len(kept))


def elements(kind: str):
    rng = np.random.default_rng(5)
    A = rng.normal(size=(len(DOFS), 24, 24))
    if kind == "definite":
        return A @ np.swapaxes(A, 1, 2) + np.eye(24)
    if kind == "indefinite":
        return A + np.swapaxes(A, 1, 2)
    return A + 8.0 * np.eye(24)


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("kind", ["definite", "indefinite", "not symmetric"])
@pytest.mark.parametrize("name", ["multifrontal", "superlu"])
def test_against_a_dense_solver(name, kind, coupled, monkeypatch):
    monkeypatch.setattr(
        "kolsky.equilibrium.linear.multifrontal.LEAF_COMPONENTS", 60
    )  # several levels of fronts
    places, K = pattern(coupled), elements(kind)
    dense = np.zeros((places.count, places.count))
    for local, block in zip(places.index[DOFS], K, strict=True):
        free = local >= 0
        np.add.at(dense, np.ix_(local[free], local[free]), block[np.ix_(free, free)])
    np.testing.assert_allclose(places.matrix(K).toarray(), dense, atol=1e-12)
    solver = linear_solver(name, places, MESH.points, MESH.cells)
    factors = solver.factors(K, symmetric=kind != "not symmetric")
    right = np.random.default_rng(1).normal(size=(places.count, 3))
    expected = scipy.linalg.solve(dense, right)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(factors.solve(right), expected, atol=1e-8 * scale)
    np.testing.assert_allclose(factors.solve(right[:, 0]), expected[:, 0], atol=1e-8 * scale)
    transposed = scipy.linalg.solve(dense.T, right)
    np.testing.assert_allclose(
        factors.solve_transposed(right), transposed, atol=1e-8 * np.abs(transposed).max()
    )


def test_every_unknown_is_eliminated_once():
    places = pattern()
    solver = linear_solver("multifrontal", places, MESH.points, MESH.cells)
    own = np.concatenate([front.unknowns[: front.eliminated] for front in solver.fronts])
    np.testing.assert_array_equal(np.sort(own), np.arange(places.count))
    assert sum(len(front.cells) for front in solver.fronts) == len(MESH.cells)
    for front in solver.fronts:  # a boundary is eliminated later, in an ancestor
        assert len(np.unique(front.unknowns)) == len(front.unknowns)


def test_a_body_that_can_move_is_singular():
    places = pattern()
    A = elements("definite") * 0.0
    A[:, :6, :6] = np.eye(6)
    solver = linear_solver("multifrontal", places, MESH.points, MESH.cells)
    with pytest.raises(SingularError):
        solver.factors(A, symmetric=True)
    A[0, 0, 0] = np.nan
    with pytest.raises(SingularError, match="not finite"):
        solver.factors(A, symmetric=True)
    with pytest.raises(ValueError, match="linear must be one of"):
        linear_solver("gauss", places, MESH.points, MESH.cells)


def test_multigrid_solves_what_factors_solve():
    pytest.importorskip("pyamg")
    places, K = pattern(), elements("definite")
    right = np.random.default_rng(1).normal(size=places.count)
    found = [
        linear_solver(name, places, MESH.points, MESH.cells).factors(K, symmetric=True).solve(right)
        for name in ("amg", "multifrontal")
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-8 * np.abs(found[1]).max())


def test_multigrid_is_taken_where_factors_are_too_large(monkeypatch):
    pytest.importorskip("pyamg")
    places = pattern()
    solver = linear_solver("auto", places, MESH.points, MESH.cells)
    assert isinstance(solver, MultifrontalSolver)
    # by hand: every unknown keeps a row of its front
    rows = np.concatenate([np.full(f.eliminated, len(f.unknowns)) for f in solver.fronts])
    assert solver.bytes == 8 * rows.sum()
    monkeypatch.setattr("kolsky.equilibrium.linear.solvers.MANY", 10)
    assert isinstance(linear_solver("auto", places, MESH.points, MESH.cells), MultifrontalSolver)
    monkeypatch.setattr("kolsky.equilibrium.linear.solvers.LARGEST", 8 * rows.sum() - 1)
    assert isinstance(linear_solver("auto", places, MESH.points, MESH.cells), SparseSolver)


def test_what_only_guides_is_solved_loosely():
    places, K = pattern(), elements("definite")
    right = np.random.default_rng(1).normal(size=places.count)
    for name, allowed in (("multifrontal", 1e-3), ("amg", 1e-2)):
        if name == "amg":
            pytest.importorskip("pyamg")
        solver = linear_solver(name, places, MESH.points, MESH.cells)
        exact = solver.factors(K, symmetric=True).solve(right)
        rough = solver.factors(K.astype(np.float32), symmetric=True).solve(right)
        apart = np.abs(rough - exact).max() / np.abs(exact).max()
        assert 0.0 < apart < allowed


def test_a_hierarchy_serves_later_matrices_until_it_has_aged():
    """By hand: dropped beyond AGED times the iterations of its first solution to the same tolerance."""
    pytest.importorskip("pyamg")
    hierarchy = Hierarchy(np.ones((4, 1)))
    hierarchy._levels = object()
    for tolerance, first in ((1e-3, 7), (1e-10, 20)):
        hierarchy.served(first, tolerance)
        hierarchy.served(int(AGED * first), tolerance)
        assert hierarchy.made
    hierarchy.served(int(AGED * 7) + 1, 1e-10)
    assert hierarchy.made
    hierarchy.served(int(AGED * 7) + 1, 1e-3)
    assert not hierarchy.made

    places, K = pattern(), elements("definite")
    solver = linear_solver("amg", places, MESH.points, MESH.cells)
    right = np.random.default_rng(1).normal(size=places.count)
    first = solver.factors(K, symmetric=True)
    first.solve(right)
    stiffer = solver.factors(3.0 * K, symmetric=True)
    assert stiffer._hierarchy is first._hierarchy
    assert stiffer._hierarchy.made
    np.testing.assert_allclose(3.0 * stiffer.solve(right), first.solve(right), rtol=1e-6, atol=1e-12)


def test_a_hierarchy_that_misleads_is_made_again(monkeypatch):
    """A preconditioner of another body does not converge; a new one of the matrix does."""
    pytest.importorskip("pyamg")
    places, K = pattern(), elements("definite")
    right = np.random.default_rng(1).normal(size=places.count)
    solver = linear_solver("amg", places, MESH.points, MESH.cells)
    factors = solver.factors(K, symmetric=True)
    expected = factors.solve(right)

    class Misleading:
        def aspreconditioner(self):
            sign = np.where(np.arange(places.count) % 2, 1.0, -1.0)
            return LinearOperator((places.count, places.count), matvec=lambda x: sign * x.ravel())

    factors._hierarchy._levels = Misleading()
    monkeypatch.setattr("kolsky.equilibrium.linear.solvers.ITERATIONS", 60)
    np.testing.assert_allclose(factors.solve(right), expected, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("entries", [20_000_000, 500])
def test_a_matrix_in_groups_of_cells_is_the_sum_of_all(monkeypatch, entries):
    """SciPy's sum of the same triples; two components may share an unknown."""
    monkeypatch.setattr("kolsky.equilibrium.linear.base.ENTRIES", entries)
    draw = np.random.default_rng(2)
    index = np.concatenate([np.arange(50), [3, 4, 4], np.full(17, -1)])
    dofs = draw.integers(0, len(index), size=(40, 12))
    K = draw.normal(size=(40, 12, 12))
    local = index[dofs]
    rows, columns = np.repeat(local, 12, axis=1).ravel(), np.tile(local, (1, 12)).ravel()
    kept = (rows >= 0) & (columns >= 0)
    expected = coo_array((K.ravel()[kept], (rows[kept], columns[kept])), shape=(50, 50)).toarray()
    found = Pattern(dofs, index, 50).matrix(K)
    assert found.has_sorted_indices
    np.testing.assert_allclose(found.toarray(), expected, rtol=0, atol=1e-13)
