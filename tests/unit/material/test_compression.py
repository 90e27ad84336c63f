"""The equilibrium of a compressed cylinder: closed forms, differences, another program's bonded cylinder."""

from pathlib import Path

import numpy as np
import pytest

from explicit.materials import LAWS, bulk_modulus
from kolsky.material.end_friction.compression import compress
from kolsky.material.end_friction.cylinder import (
    UNDEFORMED,
    Body,
    Deformation,
    half_cylinder,
    isochoric_stress,
    isochoric_tangent,
)
from kolsky.material.end_friction.problem import CONTINUATIONS, NodesLaw, NodesModel, measure

REFERENCE = Path(__file__).resolve().parents[2] / "reference"
POISSON = 0.495
SHEAR = 80e3 / (2.0 * (1.0 + POISSON))
BULK = float(bulk_modulus(SHEAR, POISSON))
NEO = LAWS["neo_hookean"].of([SHEAR])
MESH = half_cylinder(4.75e-3, 3.25e-3, 6, 5)
AREA = np.pi * 4.75e-3**2


def test_a_frictionless_cylinder_is_the_closed_form():
    rows = np.loadtxt(
        REFERENCE / "C_frictionless_analytic.csv", delimiter=",", skiprows=1, usecols=range(1, 5)
    )
    nu, strain, force, radius = rows[(rows[:, 0] == POISSON) & (rows[:, 1] < 0.35)].T[:4]
    first = [
        k for k, e in enumerate(strain) if e not in strain[:k]
    ]  # two laws: the neo-Hookean one comes first
    mesh = half_cylinder(4.75e-3, 3.25e-3, 2, 2)
    made = compress([NEO], mesh, strain[first], bulk=BULK, modulus=SHEAR, bonded=False, friction=0.0)
    assert nu.size
    # Homogeneous, so the mesh adds nothing; the platen's overclosure is that of one step.
    np.testing.assert_allclose(made.stress * AREA, force[first], rtol=2e-3)
    np.testing.assert_allclose(made.bulge, radius[first], rtol=1e-4)


def test_a_bonded_cylinder_meets_other_programs():
    strain, force, _, _, radius = np.loadtxt(REFERENCE / "A_force_radius.csv", delimiter=",")[:3].T
    made = compress([NEO], MESH, strain, bulk=BULK, modulus=SHEAR)
    # The static solutions are known to 0.1 to 0.3 %; the side has landed on few nodes of this coarse mesh.
    np.testing.assert_allclose(made.stress * AREA, force, rtol=6e-3)
    np.testing.assert_allclose(made.bulge, radius, rtol=1e-3)


def test_a_side_that_rolls_onto_its_platen_meets_another_program():
    """Mooney-Rivlin, f = 0.3: DOLFINx's two meshes agree within 0.2 %; the side lands between 10 and 20 %."""
    lines = (REFERENCE / "I_force.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines if line.startswith("mooney_rivlin,0.3,")]
    table = np.array([[float(x) for x in row[2:6]] for row in rows])
    strain, force, _, radius = table[table[:, 0] < 0.31].T
    law, bulk = LAWS["mooney_rivlin"](9e3, 5e3, 0.0), float(bulk_modulus(28e3, POISSON))
    mesh = half_cylinder(4.75e-3, 3.25e-3, 8, 7)
    made = compress([law], mesh, strain, bulk=bulk, modulus=28e3, bonded=False, friction=0.3)
    # Half a per cent is the coarse mesh; a side that lands node by node is up to 1.9 % off here.
    np.testing.assert_allclose(made.stress * AREA, force, rtol=6e-3)
    np.testing.assert_allclose(made.bulge, radius, rtol=1e-3)
    assert made.snaps == 0


def test_derivatives_are_those_of_differences():
    law, mesh = LAWS["mooney_rivlin"], half_cylinder(4.75e-3, 3.25e-3, 3, 3)
    strain, steps = np.array([0.05, 0.12]), np.ones(2)

    def run(x, moved=(), f=0.3, more=False):
        laws = [law(*x, 0.0), *(law(*(x + row), 0.0) for row in moved)]
        return compress(laws, mesh, strain, bulk=BULK, modulus=SHEAR, bonded=False, friction=f,
                        steps=steps[: len(moved)], by_friction=more)  # fmt: skip

    x = np.array([9e3, 5e3])
    made = run(x, np.eye(2), more=True)
    for k, row in enumerate(2.0 * np.eye(2)):
        high, low = run(x + row), run(x - row)
        np.testing.assert_allclose(made.stress_by[:, k], (high.stress - low.stress) / 4.0, rtol=1e-6)
        np.testing.assert_allclose(made.bulge_by[:, k], (high.bulge - low.bulge) / 4.0, rtol=1e-4)
    high, low = run(x, f=0.3001), run(x, f=0.2999)
    np.testing.assert_allclose(made.stress_by[:, 2], (high.stress - low.stress) / 2e-4, rtol=1e-4)


def test_the_tangent_is_the_derivative_of_the_stress():
    rng = np.random.default_rng(3)
    F = UNDEFORMED + 0.3 * (rng.random((1, 40, 5)) - 0.5)
    law = LAWS["ogden2"].example()
    state = Deformation.of(F)
    assert state.valid
    A, h = isochoric_tangent(law, state), 1e-6
    for k in range(5):
        row = h * np.eye(5)[k]
        high, low = (isochoric_stress(law, Deformation.of(F + s * row)) for s in (1.0, -1.0))
        np.testing.assert_allclose(
            A[..., k], (high - low) / (2 * h), rtol=1e-5, atol=1e-3 * law.shear_modulus
        )


def test_stiffness_is_the_derivative_of_the_forces():
    mesh = half_cylinder(4e-3, 3e-3, 2, 2)
    body, rng = Body(mesh, BULK), np.random.default_rng(4)
    u = 1e-4 * rng.standard_normal(mesh.points.size)
    way = rng.standard_normal(u.size)
    _, stiffness = body.forces(NEO, body.deformation(u))
    along = np.einsum("eij,ej->ei", stiffness, way[body.dofs])
    h = 1e-9
    high, low = (body.forces(NEO, body.deformation(u + s * h * way))[0] for s in (1.0, -1.0))
    np.testing.assert_allclose(along, (high - low) / (2 * h), rtol=1e-5, atol=1e-5 * np.abs(along).max())


@pytest.mark.parametrize(
    ("continuation", "value"),
    [
        ("tangent", 2.0 + 1.0 * 0.5),
        ("quadratic", 2.0 + 1.0 * (1.5**2 - 1.0) / 2.0),
        ("exponential", 2.0 * np.exp(0.5 * (1.5**2 - 1.0) / 2.0)),
        ("level", 2.0),
    ],
)
def test_a_curve_goes_on_past_its_last_node(continuation, value):
    """2U' = 1 + s^2 ... up to s = 1 where it is 2 with slope 1, by 401 nodes of its logarithm."""
    s = np.linspace(0.0, 1.0, 401)
    law = NodesLaw(s, np.log(2.0) + 0.25 * (s**2 - 1.0), continuation)  # slope 2 * 0.5 = 1 at s = 1
    assert law.two_u_prime(1.5)[0] == pytest.approx(value, rel=1e-6)
    q = [law.two_u_prime(1.5 + h)[0] for h in (1e-6, -1e-6)]
    assert law.two_u_prime(1.5)[1] == pytest.approx((q[0] - q[1]) / 2e-6, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("continuation", CONTINUATIONS)
def test_a_curve_of_nodes_has_its_own_derivatives(continuation):
    law = NodesLaw(
        np.linspace(0.0, 1.2, 6), np.log(1e4) + np.array([0, 0.05, 0.1, 0.3, 0.4, 0.8]), continuation
    )
    lam, h = np.array([[0.5, 1.3, 1.6], [1.1, 1.05, 0.87]]), 1e-6
    for i in range(3):
        row = h * np.eye(3)[i]
        slope = (law.strain_energy(*(lam + row).T) - law.strain_energy(*(lam - row).T)) / (2 * h)
        # Forty Gauss points over a kink at the last node.
        np.testing.assert_allclose(law.principal(*lam.T)[i], slope, rtol=2e-2, atol=20.0)
        up, down = (np.stack(law.principal(*(lam + s * row).T)) for s in (1.0, -1.0))
        np.testing.assert_allclose(law.hessian(*lam.T)[..., i].T, (up - down) / (2 * h), rtol=1e-5, atol=1.0)


def test_a_curve_of_nodes_gives_its_uniaxial_stress():
    model = NodesModel(np.linspace(0.0, float(measure(0.5)), 5))
    stress = model.stress(np.full(5, np.log(3e4)), np.array([0.1, 0.5]))
    np.testing.assert_allclose(stress, 3e4 * np.array([0.9**-2 - 0.9, 0.5**-2 - 0.5]))
    assert model.prior(np.linspace(0.0, 1.0, 5))[0] == pytest.approx(
        np.zeros(3), abs=1e-12
    )  # straight: likely


def test_a_law_that_softens_has_no_equilibrium():
    law = NodesLaw(np.linspace(0.0, 0.3, 4), np.log(1e4) - np.array([0.0, 2.0, 4.0, 8.0]), "level")
    mesh = half_cylinder(4.75e-3, 3.25e-3, 2, 2)
    with pytest.raises(ValueError, match="no equilibrium near the last one at a compression of"):
        compress([law], mesh, np.array([0.9]), bulk=1e6, modulus=1e4)


@pytest.mark.parametrize(
    ("arguments", "message"), [((0.0, 1.0, 2, 2), "must be > 0 m"), ((1.0, 1.0, 1, 2), "2 x 2 elements")]
)
def test_impossible_meshes_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        half_cylinder(*arguments)
