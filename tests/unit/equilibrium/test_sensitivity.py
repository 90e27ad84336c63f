"""Derivatives of equilibria against differences of whole solutions."""

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.equilibrium.equations import Equations
from kolsky.equilibrium.meshes import box, rectangle
from kolsky.equilibrium.model import Coupled, Fixed, Gravity, Model, Pressure, RigidSurface
from kolsky.equilibrium.reduction import ReducedModel, Sample, choose, decompose, reduce
from kolsky.equilibrium.sensitivity import direct, second
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import solve
from tests.unit.equilibrium.models import MOONEY, PULL, TIGHT, clamped, sliding

PRESSED = rectangle((1.0, 1.0), (1, 1), kind="quad9")


def by_differences(model, steps, step=1e-4):
    """Derivatives of displacements and forces of all points by every constant."""
    table = model.parameters()
    found = []
    for j in range(table.size):
        values = []
        for sign in (1.0, -1.0):
            moved = table.copy()
            moved.flat[j] *= 1.0 + sign * step
            answer = solve(model, steps, moved, newton=TIGHT)
            values.append(np.stack([answer.displacements, answer.forces]))
        found.append((values[0] - values[1]) / (2.0 * step * table.flat[j]))
    return np.stack(found, axis=2)


CASES = {
    "plane stress": (clamped(), PULL),
    "plane strain, mixed": (clamped(kinematics="plane_strain", volumetric="mixed"), PULL),
    "two regions": (clamped(kind="quad4", regions=np.array([0, 1])), {"pull": [0.3]}),
    "follower pressure": (
        sliding(kinematics="plane_strain", extra=(Pressure("top", "p"),), volumetric="mixed"),
        {"p": [3e3]},
    ),
    "coupled force": (sliding(extra=(Coupled("right", 0, "f"),)), {"f": [5e3, 1e4]}),
}
SLOW_CASES = {
    "3d, mixed": (clamped("hex8", "3d", volumetric="mixed"), PULL),
    "axisymmetric": (clamped("quad8", "axisymmetric"), PULL),
    "ogden": (clamped(solid=Isotropic(LAWS["ogden2"].example(), bulk(2e5))), PULL),
    "arruda_boyce": (clamped(solid=Isotropic(LAWS["arruda_boyce"].example(), bulk(2e5))), PULL),
    "contact": (
        sliding(extra=(RigidSurface("right", (-1.0, 0.0), (1.0, 0.0), "push", tolerance=1e-11),)),
        {"push": [0.2]},
    ),
}


def compared(model, steps):
    solution = solve(model, steps, newton=TIGHT)
    found = direct(solution)
    expected = by_differences(model, steps)
    constants = model.parameters().ravel()[None, :, None, None]
    for name, other in zip(("displacements", "forces"), expected, strict=True):
        own, size = getattr(found, name), np.abs(getattr(solution, name)).max()
        by = np.abs(constants * other).max(axis=(0, 2, 3))[None, :, None, None]
        # h^2 = 1e-8 of curvature, and 1e-12 / h of rounding, beside the effect and the quantity
        assert (np.abs(constants * (own - other)) / (by + 0.1 * size)).max() < 2e-6


@pytest.mark.parametrize("case", CASES)
def test_direct_is_the_difference(case):
    compared(*CASES[case])


@pytest.mark.slow
@pytest.mark.parametrize("case", SLOW_CASES)
def test_direct_is_the_difference_elsewhere(case):
    compared(*SLOW_CASES[case])


def test_derivatives_by_a_force_and_a_displacement():
    model, _ = CASES["coupled force"]
    h = 1.0
    at, above, below = (solve(model, {"f": [8e3 + dh]}, newton=TIGHT) for dh in (0.0, h, -h))
    found = direct(at, histories=("f",)).mean_displacement("right")[0, -1, 0]
    by = (above.mean_displacement("right") - below.mean_displacement("right"))[0, 0] / (2.0 * h)
    assert found == pytest.approx(by, rel=1e-7)
    model, h = clamped(), 1e-5
    at, above, below = (solve(model, {"pull": [0.3 + dh]}, newton=TIGHT) for dh in (0.0, h, -h))
    found = direct(at, histories=("pull",)).reaction("right")[0, -1, 0]
    by = (above.reaction("right") - below.reaction("right"))[0, 0] / (2.0 * h)
    assert found == pytest.approx(by, rel=1e-7)
    with pytest.raises(ValueError, match="histories must be out of"):
        direct(at, histories=("push",))


@pytest.mark.parametrize("case", ["plane stress", "follower pressure"])
def test_second_derivatives_are_differences_of_the_first(case):
    model, steps = CASES[case]
    table = model.parameters()
    solution = solve(model, steps, newton=TIGHT)
    found = second(direct(solution))
    for q in (0, 3):
        h = 1e-4 * table.flat[q]
        firsts = []
        for sign in (1.0, -1.0):
            moved = table.copy()
            moved.flat[q] += sign * h
            firsts.append(direct(solve(model, steps, moved, newton=TIGHT)))
        for name in ("displacements", "forces"):
            by = (getattr(firsts[0], name) - getattr(firsts[1], name)) / (2.0 * h)
            own = getattr(found, name)[:, q]
            scale = np.abs(by).max(axis=(0, 2, 3))[None, :, None, None] + 1e-9 * np.abs(by).max()
            # a two-point difference of the first derivatives: 1.0e-5 where a pressure follows, 5e-7 elsewhere
            assert (np.abs(own - by) / scale).max() < 2e-5


def test_what_second_derivatives_refuse():
    model, steps = CASES["coupled force"]
    with pytest.raises(ValueError, match="without histories"):
        second(direct(solve(model, steps), histories=("f",)))
    model, steps = SLOW_CASES["contact"]
    with pytest.raises(ValueError, match="contact"):
        second(direct(solve(model, steps)))


def test_stiffness_scales_the_force():
    # all stresses are linear in the constants of this law: sum p dF/dp = F between displaced grips
    solution = solve(clamped(), PULL, newton=TIGHT)
    found = direct(solution)
    weighted = np.einsum("spd,p->sd", found.reaction("right"), solution.parameters[0])
    np.testing.assert_allclose(weighted, solution.reaction("right"), rtol=1e-9, atol=1e-9)
    model = Model(PRESSED, MOONEY, (Fixed("left"),), kinematics="plane_strain")
    assert (direct(solve(model)).displacements == 0.0).all()


RUBBER = Isotropic(LAWS["neo_hookean"].of([2e5]), bulk(1.5e6))
REDUCTION_PRESSED = (Fixed("left"), Gravity(1000.0, (0.0, 0.0, -9.81), "weight"), Pressure("top", "p"))


def _beam(cells=(4, 1, 1), kind="hex8") -> Model:
    return Model(box((0.04, 0.01, 0.01), cells, kind=kind), RUBBER, REDUCTION_PRESSED)


def test_basis_leaves_what_the_singular_values_say() -> None:
    rng = np.random.default_rng(2)
    Q, _ = np.linalg.qr(rng.standard_normal((40, 4)))
    W, _ = np.linalg.qr(rng.standard_normal((6, 4)))
    snapshots = (W * np.array([5.0, 2.0, 0.5, 0.1])) @ Q.T
    found = decompose(snapshots, 2)
    assert found.T @ found == pytest.approx(np.eye(2), abs=1e-12)
    left = snapshots - snapshots @ found @ found.T
    assert (left**2).sum() == pytest.approx(0.5**2 + 0.1**2)
    assert decompose(snapshots, 5).shape == (40, 4)


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


def test_a_tolerance_below_round_off_is_not_reached() -> None:
    G = np.abs(np.random.default_rng(6).standard_normal((20, 50)))
    found = choose(G, tolerance=1e-30)
    assert not found.reached
    assert len(found.cells) <= 20
    assert 1e-30 < found.residual < 1e-12


@pytest.mark.parametrize("kind", ["hex8", "tet10"])
def test_reduced_loads_are_those_of_the_whole(kind: str) -> None:
    model = _beam((2, 1, 1), kind)
    rng = np.random.default_rng(8)
    snapshots = 1e-3 * rng.standard_normal((4, model.n_dofs))
    snapshots[:, model.unknowns.index < 0] = 0.0
    V = decompose(snapshots, 3)
    every = Sample(np.arange(len(model.mesh.cells)), np.ones(len(model.mesh.cells)), 0.0, True)
    reduced = ReducedModel(model, V, every, gravity="weight")
    q = np.array([2e-3, -1e-3, 1.5e-3])
    equations = Equations(model, model.parameters())
    state = equations.evaluate(V @ q, {"weight": 1.0, "p": 0.0})
    pressed = equations.evaluate(V @ q, {"weight": 0.0, "p": 1.0})
    assert reduced.loads(q)[0][0] == pytest.approx(V.T @ pressed.carried, rel=1e-9)
    assert reduced.weight == pytest.approx(V.T @ state.carried)
    forces, tangent, inverted = reduced.internal(q)
    assert forces == pytest.approx(V.T @ state.body.forces, rel=1e-9)
    assert not inverted
    h = 1e-8
    differences = [(reduced.internal(q + h * e)[0] - forces) / h for e in np.eye(3)]
    assert tangent == pytest.approx(np.array(differences).T, rel=1e-4)
    by = [(reduced.loads(q + h * e)[0][0] - reduced.loads(q)[0][0]) / h for e in np.eye(3)]
    assert reduced.loads(q)[1][0] == pytest.approx(np.array(by).T, rel=1e-4)


def test_reduced_equilibrium_is_the_whole_one_at_a_snapshot() -> None:
    model = _beam()
    p = np.array([0.0, 200.0, 400.0, 600.0])
    found = solve(model, {"weight": np.ones(4), "p": p})
    reduced = reduce(model, found.displacements, modes=9, tolerance=1e-9, gravity="weight")
    assert reduced.modes <= 4
    at = reduced.equilibrium([400.0])
    assert at.outcome.ok
    assert (reduced.V @ at.q).reshape(-1, 3) == pytest.approx(
        found.displacements[2], abs=1e-5 * np.abs(found.displacements[2]).max()
    )
    step = reduced.equilibrium([401.0], tolerance=1e-12).q - reduced.equilibrium([399.0], tolerance=1e-12).q
    assert at.slopes[:, 0] == pytest.approx(step / 2.0, rel=1e-4, abs=1e-12)
