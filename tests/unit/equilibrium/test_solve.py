"""Histories, outcomes and error messages of a solution."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import coo_array

from benchmarks.equilibrium import SIZE, felupe, strip
from explicit.materials import LAWS
from kolsky.equilibrium.linear.base import Pattern, SingularError
from kolsky.equilibrium.linear.solvers import MultifrontalSolver, MultigridSolver, linear_solver
from kolsky.equilibrium.meshes import box, rectangle
from kolsky.equilibrium.model import Coupled, Fixed, Model, Prescribed, Pressure, RigidSurface
from kolsky.equilibrium.solid import CompressibleNeoHookean, Isotropic, bulk
from kolsky.equilibrium.solution import Outcome
from kolsky.equilibrium.solve import PAIRS, Newton, QuasiNewtonTangent, continued, solve
from tests.unit.equilibrium.models import MOONEY, PULL, TIGHT, clamped, sliding


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
        (lambda: Model(rectangle((1, 1), (1, 1), kind="tri3"), MOONEY, kinematics="plane_strain",
         volumetric="mixed"), "no stable pressure"),
        (lambda: Model(MESH, CompressibleNeoHookean(1.0, 1.0), kinematics="plane_strain", volumetric="mixed"),
         "no separate volumetric"),
        (lambda: Model(MESH, MOONEY, kinematics="plane_stress", regions=np.array([0, 1])), "one number >= 0"),
        (lambda: Model(MESH, MOONEY, (Fixed("roof"),), kinematics="plane_stress"), "has no set 'roof'"),
        (lambda: clamped().parameters([1.0, 2.0]), "got 2 values"),
        (lambda: clamped().parameters([9e3, -1e5, 0.0, 2e5]), "shear modulus must be"),
        (lambda: solve(clamped()), "must have the histories"),
        (lambda: solve(clamped(), {"pull": [0.1], "push": [0.1]}), "must have the histories"),
        (lambda: solve(clamped(), {"pull": [np.nan]}), "finite"),
        (lambda: solve(sliding(extra=(Coupled("right", 0, "f"), Pressure("top", "p"))),
         {"f": [1], "p": [1, 2]}), "one number of steps"),
        (lambda: sliding(extra=(Fixed("right", (7,)),)).unknowns, "axis of"),
        (lambda: sliding(extra=(Prescribed("left", 0, "pull"),)).unknowns, "both claim axis 0"),
        (lambda: Newton(tolerance=1.0), "tolerance must be"),
        (lambda: Newton(halvings=-1), "must be >= 0"),
        (lambda: solve(sliding(extra=(RigidSurface("right", (0.0, 0.0), (1.0, 0.0)),))), "must not be zero"),
        (lambda: solve(sliding(extra=(RigidSurface("right", (1.0,), (1.0, 0.0)),))),
         "must have 2 components"),
        (lambda: solve(sliding(extra=(Pressure("corner", "p"),))), "has no set"),
    ],
)  # fmt: skip
def test_what_is_refused(make, text):
    with pytest.raises(ValueError, match=text):
        make()


def test_a_pressure_needs_faces():
    mesh = MESH.with_set("corner", np.array([0]))
    model = Model(mesh, MOONEY, (Fixed("left"), Pressure("corner", "p")), kinematics="plane_strain")
    with pytest.raises(ValueError, match="no face"):
        solve(model, {"p": [1.0]})


PAGE = Path(__file__).resolve().parents[3] / "docs" / "theory" / "solver.md"


@pytest.mark.slow
def test_the_example_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    names: dict[str, object] = {}
    exec(block, names)
    assert capsys.readouterr().out.startswith("COMPLETED")
    slopes = names["direct"](names["found"]).reaction("right")[-1, :, 0]  # type: ignore[operator]
    constants = names["rubber"].parameters()  # type: ignore[attr-defined]
    # the law is linear in its constants: their products with the slopes add up to the force
    assert np.isclose(slopes @ constants, names["found"].reaction("right")[-1, 0], rtol=1e-6)  # type: ignore[attr-defined]


FILE = Path(__file__).resolve().parents[2] / "reference" / "J_strip.csv"
TABLE = np.array([line.split(",") for line in FILE.read_text(encoding="utf-8").splitlines()[1:]])
"""Cells, order, nominal strain, force: `tests/reference/J_dolfinx.py`."""


@pytest.mark.parametrize(("cells", "kind", "order"), [((20, 5, 2), "hex8", "1"), ((20, 5, 1), "hex27", "2")])
def test_force(cells, kind, order):
    rows = TABLE[(TABLE[:, 0] == "x".join(map(str, cells))) & (TABLE[:, 1] == order)]
    assert len(rows) == 10
    strains, expected = rows[:, 2].astype(float), rows[:, 3].astype(float)
    found = solve(strip(cells, kind), {"pull": SIZE[0] * strains})
    assert found.outcome.ok
    # both stop at a residual of 1e-8; 0.1 % was asked for
    np.testing.assert_allclose(found.reaction("right")[:, 0], expected, rtol=1e-6)


def test_force_of_felupe():
    pytest.importorskip("felupe")
    model, pulls = strip((8, 2, 1), "hex8"), SIZE[0] * np.array([0.4, 0.8, 1.25])
    found = solve(model, {"pull": pulls})
    np.testing.assert_allclose(found.reaction("right")[:, 0], felupe(model.mesh, pulls)["forces"], rtol=1e-6)


class Doubled:
    """Factors of 2 I."""

    def solve(self, right):
        return 0.5 * right


def test_the_formula_is_that_of_bfgs() -> None:
    # H+ = (I - s y^T / y.s) H (I - y s^T / y.s) + s s^T / y.s  (Nocedal and Wright 2006, Eq. 6.17)
    rng = np.random.default_rng(3)
    A = rng.normal(size=(5, 5))
    A = A @ A.T + np.eye(5)
    H, kept = 0.5 * np.eye(5), QuasiNewtonTangent(Doubled(), learns=True)
    for step in rng.normal(size=(3, 5)):
        change = A @ step
        kept.learn(step, change)
        left = np.eye(5) - np.outer(step, change) / (change @ step)
        H = left @ H @ left.T + np.outer(step, step) / (change @ step)
    found = np.array([kept.direction(column) for column in np.eye(5)])
    np.testing.assert_allclose(found, -H, rtol=1e-12, atol=1e-12 * np.abs(H).max())
    assert kept.uses == 3


def test_what_would_spoil_the_formula_is_not_learnt() -> None:
    step, residual = np.array([1.0, 0.0]), np.array([1.0, 2.0])
    falling, still = QuasiNewtonTangent(Doubled(), learns=True), QuasiNewtonTangent(Doubled(), learns=False)
    falling.learn(step, -step)
    still.learn(step, 3.0 * step)
    for kept in (falling, still):
        np.testing.assert_allclose(kept.direction(residual), [-0.5, -1.0])
        assert kept.uses == 1


def test_only_the_last_pairs_are_remembered() -> None:
    kept = QuasiNewtonTangent(Doubled(), learns=True)
    axes = np.eye(PAIRS + 1)
    for axis in axes:
        kept.learn(axis, 4.0 * axis)
    np.testing.assert_allclose([-kept.direction(axis) @ axis for axis in axes], [0.5] + [0.25] * PAIRS)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_a_polynomial_is_continued(degree: int) -> None:
    places = [0.0, -1.0, -1.5, -3.0, -4.0, -5.0]
    rng = np.random.default_rng(degree)
    of = rng.normal(size=(3, degree + 1))
    states = [np.array([np.polyval(row, x) for row in of]) for x in places]
    wanted = [np.polyval(row, 1.0) for row in of]
    np.testing.assert_allclose(continued(places, states), wanted, rtol=1e-9)


def test_beyond_a_kink_few_states_are_taken() -> None:
    # at rest until the last step but one, then straight on: 0, 0, 0, 0, 1, 2 goes on to 3
    states = [np.array([value]) for value in (2.0, 1.0, 0.0, 0.0, 0.0, 0.0)]
    np.testing.assert_allclose(continued([0.0, -1.0, -2.0, -3.0, -4.0, -5.0], states), [3.0])


def test_a_smooth_history_takes_fewer_factorisations_than_steps() -> None:
    rubber = Isotropic(LAWS["neo_hookean"].of([25e3]), bulk(2e5))
    grips = (Fixed("left"), Fixed("right", axes=(1, 2)), Prescribed("right", 0, "pull"))
    strip = Model(box((0.1, 0.025, 0.005), (8, 2, 1), kind="hex8"), rubber, grips)
    pulls = np.linspace(0.01, 0.1, 10)
    found = solve(strip, {"pull": pulls})
    assert found.outcome.ok
    assert found.factorisations < 10
    # what they converge to is an equilibrium of its own tangent
    tight = solve(strip, {"pull": pulls}, newton=Newton(tolerance=1e-11, single=False))
    np.testing.assert_allclose(found.reaction("right"), tight.reaction("right"), rtol=1e-8, atol=1e-9)


LINEAR_MESH = box((3.0, 2.0, 1.0), (6, 4, 2), kind="hex8")
DOFS = (LINEAR_MESH.cells[..., None] * 3 + np.arange(3)).reshape(len(LINEAR_MESH.cells), -1)


def pattern(coupled: bool = False) -> Pattern:
    """Unknowns of a box held at one end; `coupled`: its other end is one unknown along x."""
    index = np.arange(LINEAR_MESH.points.size)
    if coupled:
        right = 3 * LINEAR_MESH.nodes("right")
        index[right] = right[0]
    index[(3 * LINEAR_MESH.nodes("left")[:, None] + np.arange(3)).ravel()] = -1
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
def test_against_a_dense_solver(kind, coupled, monkeypatch):
    monkeypatch.setattr(
        "kolsky.equilibrium.linear.multifrontal.LEAF_COMPONENTS", 60
    )  # several levels of fronts
    places, K = pattern(coupled), elements(kind)
    dense = np.zeros((places.count, places.count))
    for local, block in zip(places.index[DOFS], K, strict=True):
        free = local >= 0
        np.add.at(dense, np.ix_(local[free], local[free]), block[np.ix_(free, free)])
    np.testing.assert_allclose(places.matrix(K).toarray(), dense, atol=1e-12)
    solver = linear_solver("multifrontal", places, LINEAR_MESH.points, LINEAR_MESH.cells)
    factors = solver.factors(K, symmetric=kind != "not symmetric")
    right = np.random.default_rng(1).normal(size=(places.count, 3))
    expected = scipy.linalg.solve(dense, right)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(factors.solve(right), expected, atol=1e-8 * scale)
    np.testing.assert_allclose(factors.solve(right[:, 0]), expected[:, 0], atol=1e-8 * scale)


def test_every_unknown_is_eliminated_once():
    places = pattern()
    solver = linear_solver("multifrontal", places, LINEAR_MESH.points, LINEAR_MESH.cells)
    own = np.concatenate([front.unknowns[: front.eliminated] for front in solver.fronts])
    np.testing.assert_array_equal(np.sort(own), np.arange(places.count))
    assert sum(len(front.cells) for front in solver.fronts) == len(LINEAR_MESH.cells)
    for front in solver.fronts:  # a boundary is eliminated later, in an ancestor
        assert len(np.unique(front.unknowns)) == len(front.unknowns)


def test_a_body_that_can_move_is_singular():
    places = pattern()
    A = elements("definite") * 0.0
    A[:, :6, :6] = np.eye(6)
    solver = linear_solver("multifrontal", places, LINEAR_MESH.points, LINEAR_MESH.cells)
    with pytest.raises(SingularError):
        solver.factors(A, symmetric=True)
    A[0, 0, 0] = np.nan
    with pytest.raises(SingularError, match="not finite"):
        solver.factors(A, symmetric=True)
    with pytest.raises(ValueError, match="linear must be one of"):
        linear_solver("gauss", places, LINEAR_MESH.points, LINEAR_MESH.cells)


def test_multigrid_solves_what_factors_solve():
    pytest.importorskip("pyamg")
    places, K = pattern(), elements("definite")
    right = np.random.default_rng(1).normal(size=places.count)
    found = [
        linear_solver(name, places, LINEAR_MESH.points, LINEAR_MESH.cells)
        .factors(K, symmetric=True)
        .solve(right)
        for name in ("amg", "multifrontal")
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-8 * np.abs(found[1]).max())


def test_multigrid_is_taken_where_factors_are_too_large(monkeypatch):
    pytest.importorskip("pyamg")
    places = pattern()
    solver = linear_solver("auto", places, LINEAR_MESH.points, LINEAR_MESH.cells)
    assert isinstance(solver, MultifrontalSolver)
    # by hand: every unknown keeps a row of its front
    rows = np.concatenate([np.full(f.eliminated, len(f.unknowns)) for f in solver.fronts])
    assert solver.bytes == 8 * rows.sum()
    monkeypatch.setattr("kolsky.equilibrium.linear.solvers.MANY", 10)
    assert isinstance(
        linear_solver("auto", places, LINEAR_MESH.points, LINEAR_MESH.cells), MultifrontalSolver
    )
    monkeypatch.setattr("kolsky.equilibrium.linear.solvers.LARGEST", 8 * rows.sum() - 1)
    assert isinstance(linear_solver("auto", places, LINEAR_MESH.points, LINEAR_MESH.cells), MultigridSolver)


def test_what_only_guides_is_solved_loosely():
    places, K = pattern(), elements("definite")
    right = np.random.default_rng(1).normal(size=places.count)
    for name, allowed in (("multifrontal", 1e-3), ("amg", 1e-2)):
        if name == "amg":
            pytest.importorskip("pyamg")
        solver = linear_solver(name, places, LINEAR_MESH.points, LINEAR_MESH.cells)
        exact = solver.factors(K, symmetric=True).solve(right)
        rough = solver.factors(K.astype(np.float32), symmetric=True).solve(right)
        apart = np.abs(rough - exact).max() / np.abs(exact).max()
        assert 0.0 < apart < allowed


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
