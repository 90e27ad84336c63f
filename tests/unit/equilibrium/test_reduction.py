"""Reduced models: the best basis, weights with a planted answer, loads that are exact."""

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.equilibrium.equations import Equations
from kolsky.equilibrium.meshes import box
from kolsky.equilibrium.model import Fixed, Gravity, Model, Pressure
from kolsky.equilibrium.reduction import ReducedModel, Sample, choose, decompose, independent, reduce
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import solve

RUBBER = Isotropic(LAWS["neo_hookean"].of([2e5]), bulk(1.5e6))
PRESSED = (Fixed("left"), Gravity(1000.0, (0.0, 0.0, -9.81), "weight"), Pressure("top", "p"))


def _beam(cells=(4, 1, 1), kind="hex8") -> Model:
    return Model(box((0.04, 0.01, 0.01), cells, kind=kind), RUBBER, PRESSED)


def test_basis_leaves_what_the_singular_values_say() -> None:
    rng = np.random.default_rng(2)
    Q, _ = np.linalg.qr(rng.standard_normal((40, 4)))
    W, _ = np.linalg.qr(rng.standard_normal((6, 4)))
    snapshots = (W * np.array([5.0, 2.0, 0.5, 0.1])) @ Q.T
    found = decompose(snapshots, 2)
    assert found.values[:4] == pytest.approx([5.0, 2.0, 0.5, 0.1])
    assert found.modes.T @ found.modes == pytest.approx(np.eye(2), abs=1e-12)
    left = snapshots - snapshots @ found.modes @ found.modes.T
    assert (left**2).sum() == pytest.approx(0.5**2 + 0.1**2)
    assert found.lost == pytest.approx(np.sqrt(0.26 / 29.26))
    assert independent(snapshots) == 4
    with pytest.raises(ValueError, match=r"\[1, 4\]"):
        decompose(snapshots, 5)


def test_planted_weights_are_found() -> None:
    rng = np.random.default_rng(4)
    G = rng.standard_normal((30, 200))
    # the sum of all columns is made 3 times the second and 7 times the ninth
    G[:, 199] += 3.0 * G[:, 1] + 7.0 * G[:, 8] - G.sum(axis=1)
    found = choose(G, tolerance=1e-9)
    assert found.reached
    assert np.linalg.norm(G[:, found.cells] @ found.weights - G.sum(axis=1)) < 1e-8 * np.linalg.norm(
        G.sum(axis=1)
    )
    assert (found.weights > 0.0).all()
    assert len(found.cells) <= 30


def test_too_few_elements_are_said() -> None:
    G = np.abs(np.random.default_rng(6).standard_normal((20, 50)))
    found = choose(G, tolerance=1e-6, most=3)
    assert not found.reached
    assert len(found.cells) <= 3
    assert found.residual > 1e-6


@pytest.mark.parametrize("kind", ["hex8", "tet10"])
def test_reduced_loads_are_those_of_the_whole(kind: str) -> None:
    model = _beam((2, 1, 1), kind)
    rng = np.random.default_rng(8)
    snapshots = 1e-3 * rng.standard_normal((4, model.n_dofs))
    snapshots[:, model.unknowns.index < 0] = 0.0
    basis = decompose(snapshots, 3)
    every = Sample(np.arange(len(model.mesh.cells)), np.ones(len(model.mesh.cells)), 0.0, True)
    reduced = ReducedModel(model, basis, every, gravity="weight")
    q = np.array([2e-3, -1e-3, 1.5e-3])
    equations = Equations(model, model.parameters())
    state = equations.evaluate(basis.modes @ q, {"weight": 1.0, "p": 0.0})
    pressed = equations.evaluate(basis.modes @ q, {"weight": 0.0, "p": 1.0})
    V = basis.modes
    assert reduced.loads(q)[0][0] == pytest.approx(V.T @ pressed.carried, rel=1e-9)
    assert reduced.weight == pytest.approx(V.T @ state.carried)
    forces, tangent, inverted = reduced.internal(q, reduced.constants())
    assert forces == pytest.approx(V.T @ state.body.forces, rel=1e-9)
    assert not inverted
    h = 1e-8
    differences = [(reduced.internal(q + h * e, reduced.constants())[0] - forces) / h for e in np.eye(3)]
    assert tangent == pytest.approx(np.array(differences).T, rel=1e-4)
    by = [(reduced.loads(q + h * e)[0][0] - reduced.loads(q)[0][0]) / h for e in np.eye(3)]
    assert reduced.loads(q)[1][0] == pytest.approx(np.array(by).T, rel=1e-4)


def test_reduced_equilibrium_is_the_whole_one_at_a_snapshot() -> None:
    model = _beam()
    p = np.array([0.0, 200.0, 400.0, 600.0])
    found = solve(model, {"weight": np.ones(4), "p": p})
    reduced = reduce([found], modes=9, tolerance=1e-9, gravity="weight")
    assert reduced.modes <= 4
    at = reduced.equilibrium([400.0])
    assert at.outcome.ok
    assert reduced.expanded(at.q) == pytest.approx(
        found.displacements[2], abs=1e-5 * np.abs(found.displacements[2]).max()
    )
    step = reduced.equilibrium([401.0], tolerance=1e-12).q - reduced.equilibrium([399.0], tolerance=1e-12).q
    assert at.slopes[:, 0] == pytest.approx(step / 2.0, rel=1e-4, abs=1e-12)
