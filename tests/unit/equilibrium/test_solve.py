"""Histories, outcomes and refusals of a solution."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.implicit.models import MOONEY, PULL, TIGHT, clamped, sliding

from kolsky.equilibrium.meshes import rectangle
from kolsky.equilibrium.model import Coupled, Fixed, Model, Prescribed, Pressure, RigidPlane
from kolsky.equilibrium.solid import CompressibleNeoHookean
from kolsky.equilibrium.solution import Outcome
from kolsky.equilibrium.solve import Newton, solve


def test_the_way_does_not_matter():
    once = solve(clamped(), {"pull": [0.5]}, newton=TIGHT)
    often = solve(clamped(), {"pull": np.linspace(0.05, 0.5, 10)}, newton=TIGHT)
    back = solve(clamped(), {"pull": [0.9, 0.2, 0.5]}, newton=TIGHT)
    np.testing.assert_allclose(often.forces[-1], once.forces[-1], atol=1e-6)
    np.testing.assert_allclose(back.forces[-1], once.forces[-1], atol=1e-6)
    assert often.factorisations <= 2 * 10


def test_a_guess_saves_iterations_and_changes_nothing():
    model = clamped()
    found = solve(model, PULL, newton=TIGHT)
    near = model.parameters() * 1.01
    plain, guessed = solve(model, PULL, near), solve(model, PULL, near, guess=found.displacements)
    assert guessed.iterations < plain.iterations
    np.testing.assert_allclose(guessed.reaction("right"), plain.reaction("right"), rtol=1e-6, atol=1e-6)
    useless = solve(model, PULL, guess=found.displacements * -5.0)
    np.testing.assert_allclose(useless.reaction("right"), found.reaction("right"), rtol=1e-6, atol=1e-6)
    with pytest.raises(ValueError, match="guess must have shape"):
        solve(model, PULL, guess=found.displacements[:1])


def test_every_linear_solver_gives_one_answer():
    found = [
        solve(clamped(), PULL, newton=Newton(1e-12, linear=name)) for name in ("multifrontal", "superlu")
    ]
    np.testing.assert_allclose(found[0].forces, found[1].forces, atol=1e-7)


def test_a_crushed_body_says_where_it_stopped():
    found = solve(clamped(), {"pull": [-0.5, -2.5]}, newton=Newton(halvings=2))
    assert found.outcome in (Outcome.INVERTED, Outcome.NOT_CONVERGED)
    assert found.reached == 1
    assert np.isfinite(found.displacements[0]).all()
    assert np.isnan(found.displacements[1]).all()
    assert found.outcome.cause
    assert found.outcome.cure


def test_a_body_that_is_not_held_is_singular():
    model = sliding(extra=())
    loose = replace(model, conditions=(Fixed("left", (0,)), Coupled("right", 0, "f")))
    assert solve(loose, {"f": [1e3]}).outcome is Outcome.SINGULAR


def test_every_outcome_has_a_cause_and_a_cure():
    assert [o for o in Outcome if o.ok] == [Outcome.COMPLETED]
    assert all(len(o.cause) > 10 and len(o.cure) > 5 for o in Outcome)


def test_regions_have_their_own_constants():
    model = clamped("quad4", regions=np.array([0, 1]))
    assert model.parameter_names[:2] == ("C10[0]", "C01[0]")
    one = solve(clamped("quad4"), PULL, newton=TIGHT)
    two = solve(model, PULL, newton=TIGHT)
    np.testing.assert_allclose(two.forces, one.forces, atol=1e-8)
    stiff = model.parameters() * np.array([[1.0], [3.0]])
    assert (solve(model, PULL, stiff).reaction("right")[:, 0] > 1.2 * one.reaction("right")[:, 0]).all()


MESH = rectangle((1.0, 1.0), (1, 1), kind="quad4")


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Model(MESH, MOONEY), "needs a mesh of 3"),
        (lambda: Model(MESH, MOONEY, kinematics="flat"), "kinematics must be"),
        (lambda: Model(MESH, MOONEY, kinematics="plane_stress", volumetric="mixed"), "no volumetric locking"),
        (lambda: Model(MESH, MOONEY, kinematics="plane_strain", volumetric="fbar"), "volumetric must be"),
        (lambda: Model(MESH, MOONEY, kinematics="plane_stress", thickness=0.0), "thickness must be"),
        (
            lambda: Model(
                rectangle((1, 1), (1, 1), kind="tri3"), MOONEY, kinematics="plane_strain", volumetric="mixed"
            ),
            "no stable pressure",
        ),
        (
            lambda: Model(
                MESH, CompressibleNeoHookean(1.0, 1.0), kinematics="plane_strain", volumetric="mixed"
            ),
            "no separate volumetric",
        ),
        (
            lambda: Model(MESH, MOONEY, kinematics="plane_stress", regions=np.array([0, 1])),
            "one number >= 0",
        ),
        (lambda: Model(MESH, MOONEY, (Fixed("roof"),), kinematics="plane_stress"), "has no set 'roof'"),
        (lambda: clamped().parameters([1.0, 2.0]), "got 2 values"),
        (lambda: clamped().parameters([9e3, -1e5, 0.0, 2e5]), "shear modulus must be"),
        (lambda: solve(clamped()), "must have the histories"),
        (lambda: solve(clamped(), {"pull": [0.1], "push": [0.1]}), "must have the histories"),
        (lambda: solve(clamped(), {"pull": [np.nan]}), "finite"),
        (
            lambda: solve(
                sliding(extra=(Coupled("right", 0, "f"), Pressure("top", "p"))), {"f": [1], "p": [1, 2]}
            ),
            "one number of steps",
        ),
        (lambda: sliding(extra=(Fixed("right", (7,)),)).unknowns, "axis of"),
        (lambda: sliding(extra=(Prescribed("left", 0, "pull"),)).unknowns, "both claim axis 0"),
        (lambda: Newton(tolerance=1.0), "tolerance must be"),
        (lambda: Newton(iterations=0), "must be >= 1"),
        (
            lambda: solve(sliding(extra=(RigidPlane("right", (0.0, 0.0), (1.0, 0.0)),))),
            "must not be zero",
        ),
        (
            lambda: solve(sliding(extra=(RigidPlane("right", (1.0,), (1.0, 0.0)),))),
            "must have 2 components",
        ),
        (lambda: solve(sliding(extra=(Pressure("corner", "p"),))), "has no set"),
    ],
)
def test_what_is_refused(make, text):
    with pytest.raises(ValueError, match=text):
        make()


def test_a_pressure_needs_faces():
    mesh = MESH.with_set("corner", np.array([0]))
    model = Model(mesh, MOONEY, (Fixed("left"), Pressure("corner", "p")), kinematics="plane_strain")
    with pytest.raises(ValueError, match="no face"):
        solve(model, {"p": [1.0]})
