"""Derivatives of equilibria against differences of whole solutions, and the adjoint against them."""

import numpy as np
import pytest
from tests.unit.implicit.models import MOONEY, PULL, TIGHT, clamped, sliding

from explicit.materials import LAWS
from kolsky.equilibrium.meshes import rectangle
from kolsky.equilibrium.model import Coupled, Fixed, Model, Pressure, RigidPlane
from kolsky.equilibrium.sensitivity import adjoint, direct, second
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import solve

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
        sliding(extra=(RigidPlane("right", (-1.0, 0.0), (1.0, 0.0), "push", tolerance=1e-11),)),
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


@pytest.mark.parametrize("case", ["plane strain, mixed", "two regions", "follower pressure"])
def test_the_adjoint_is_the_direct_one(case):
    model, steps = CASES[case]
    solution = solve(model, steps, newton=TIGHT)
    rng = np.random.default_rng(3)
    by_u, by_f = rng.normal(size=(2, *solution.displacements.shape))
    all_of = direct(solution)
    expected = np.einsum("spnd,snd->p", all_of.displacements, by_u)
    expected += np.einsum("spnd,snd->p", all_of.forces, by_f)
    found = adjoint(solution, by_u, by_f)
    assert found.shape == solution.parameters.shape
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-8)


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
            assert (np.abs(own - by) / scale).max() < 1e-5


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
