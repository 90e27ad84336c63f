"""Valleys, meshes and steps of the search with several parameters, for synthetic oscillating responses."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_objective import objective

from doe import Box
from explicit import Ending, Outcome
from kolsky.base.records import MaterialCurve
from kolsky.inverse.gauss_newton import (
    CONFIRMED,
    RefinedRun,
    Step,
    _chord_steps,
    _search_on,
    gauss_newton_step,
    search_by_gauss_newton,
    slopes,
)
from kolsky.inverse.objective import Objective, Prior
from kolsky.inverse.observations import Prediction
from kolsky.inverse.path_noise import FrontPath
from kolsky.inverse.run_table import Runs, RunTable
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.surrogate_mesh_search import MeshOptimum, search_meshes, starts
from kolsky.inverse.valleys import from_search, search_box, to_search
from kolsky.inverse.work import Work

BOX = Box.of({"stiffness_factor": (0.75, 1.5), "poisson": (0.49, 0.4999)})
COARSE, FINE = (16, 22), (64, 86)
TRUTH = np.array([1.1, 0.4988])
SHIFT = np.array([0.01, -1e-5])
TIME = np.linspace(0.0, 1.0, 400)
NOISE = 0.3


def ringing(x: np.ndarray) -> np.ndarray:
    """A force that rings some ten times, with the period of the pressure waves, shape [n, k]."""
    m, nu = np.atleast_2d(x)[:, :1], np.atleast_2d(x)[:, 1:]
    turns = 0.5 * np.sqrt(m / (1.0 - 2.0 * nu))
    return 20.0 * m * TIME**2 + 4.0 * np.exp(-TIME) * np.sin(2.0 * np.pi * turns * TIME)


def problem_of(made: Any) -> Any:
    """What the problem of a stand-in for a runner says of itself."""
    settings = made.settings
    numerics, prepared = settings.numerics, getattr(made, "prepared", None)
    return SimpleNamespace(
        box=made.box,
        prior=None,
        settings=settings,
        observations=getattr(made, "observations", None),
        prepared=prepared,
        shot=None if prepared is None else prepared.forward.shot,
        numerics=numerics,
        refined=numerics.with_mesh(settings.refined_mesh),
        first=numerics.with_mesh(min(numerics.mesh, settings.replicate_mesh)),
    )


class MadeUp:
    """A stand-in for `kolsky.inverse.runner.Runner`; a coarse mesh answers at shifted points."""

    problem = property(problem_of)
    objective = Runner.objective

    def __init__(self) -> None:
        self.box, self.offsets, self.front = BOX, {}, FrontPath(None)  # type: ignore[arg-type]
        self.settings = Settings(numerics=Numerics(mesh=COARSE), refined_mesh=FINE, replicates=0)
        noise = NOISE * np.random.default_rng(3).standard_normal(TIME.size)
        self.observations = objective(ringing(TRUTH)[0] + noise, np.empty(0)).observations
        # A wave whose number of passages is 0.5 sqrt(m / (1 - 2 nu)): G = m, unit density, T = L.
        stretch = np.linspace(0.9, 1.1, 11)
        edges = self.observations.bins.edges
        shot = SimpleNamespace(
            curve=MaterialCurve(stretch, 3.0 * (stretch - 1.0), np.ones(11)),
            specimen=SimpleNamespace(density=1.0, length=float(edges[-1] - edges[0])),
        )
        self.prepared = SimpleNamespace(forward=SimpleNamespace(shot=shot), observations=self.observations)
        self.points: dict[tuple[int, int], int] = {}
        self.last: np.ndarray = TRUTH

    def predicted(self, points: np.ndarray, mesh: tuple[int, int]) -> Prediction:
        self.points[mesh] = self.points.get(mesh, 0) + len(points)
        at = points - SHIFT if mesh == COARSE else points
        empty = np.empty((len(points), 0))
        return Prediction(empty, ringing(at), empty, empty.astype(bool))

    def simulate(self, stage: str, design: Any, numerics: Numerics) -> Any:
        prediction = self.predicted(design.points, numerics.mesh)
        return SimpleNamespace(
            points=design.points, rows=np.arange(len(design.points)), prediction=prediction, lost=""
        )

    @property
    def front_jerks(self) -> np.ndarray:
        return np.zeros((2, 1))

    def under_other_motions(self, points: np.ndarray, deviations: Any, numerics: Any) -> Any:
        n = len(deviations) + 1
        return [self.predicted(np.repeat(x[None], n, axis=0), numerics.mesh) for x in points]

    def vectors(self, stage: str, points: np.ndarray, numerics: Numerics, one: Objective) -> np.ndarray:
        return one.vectors(self.predicted(points, numerics.mesh))

    def run(self, stage: str, points: np.ndarray, numerics: Numerics, *, all_nodes: bool = False) -> Any:
        self.last = points[-1]
        response = SimpleNamespace(completed=np.ones(len(points), dtype=bool), select=lambda rows: None)
        rows, seen = np.arange(len(points)), self.predicted(points, numerics.mesh)
        return Runs(self.box.names, points, response, rows, seen)  # type: ignore[arg-type]

    def under(self, front: FrontPath, offsets: Any = None) -> Any:
        self.front = front
        return self


def test_coordinates_of_the_search_and_back() -> None:
    inner = search_box(BOX)
    assert inner.lower[1] == pytest.approx(1.0 - 2.0 * 0.4999)
    assert inner.upper[1] == pytest.approx(0.02)
    assert inner.logarithmic == (False, True)
    s = to_search(BOX, TRUTH)
    assert s[1] == pytest.approx(0.0024)
    np.testing.assert_allclose(from_search(BOX, s), TRUTH, rtol=1e-15)
    other = Box.of({"damping": (0.0, 1e-4)})
    assert search_box(other) is other


def test_a_scan_finds_the_valley_from_a_bad_start() -> None:
    made: Any = MadeUp()
    bad = np.array([1.05, 0.4955])  # 4 oscillations off
    points, weights = starts(made, bad, made.settings.numerics)
    assert weights.balanced
    # Within half an oscillation of ten: 10 % of 1 - 2 nu, and the stiffness is 5 % off.
    assert 1.0 - 2.0 * points[0, 1] == pytest.approx(0.0024, rel=0.1)
    found = search_meshes(made, bad).optima[COARSE]
    # The mesh answers at shifted points; its own noise moves it by no more than a few sigma.
    assert (np.abs(found.x - TRUTH - SHIFT) < 4.0 * found.sigma).all()


def test_steps_with_the_coarse_slopes_end_at_the_least_squares_of_the_refined_mesh() -> None:
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    start = search_meshes(made, np.array([1.05, 0.4955])).optima[COARSE].x
    h = 1e-6 * np.array([1.0, 0.01])
    slope = np.column_stack(
        [(ringing(start - SHIFT + d) - ringing(start - SHIFT - d))[0] / (2.0 * d.sum()) for d in np.diag(h)]
    )
    found = _chord_steps(made, one, slope, start, made.problem.refined)
    assert found.confirmed
    assert made.points[FINE] <= 5
    assert (np.abs(found.x - TRUTH) < 4.0 * found.step.sigma).all()
    # It stops where a full Gauss-Newton step with the mesh's own slopes is short.
    own = np.column_stack(
        [(ringing(found.x + d) - ringing(found.x - d))[0] / (2.0 * d.sum()) for d in np.diag(h)]
    )
    full = np.linalg.lstsq(own, one.data - ringing(found.x)[0], rcond=None)[0]
    assert (np.abs(full) < 1.5 * CONFIRMED * found.step.sigma).all()


class Bins:
    """Ten bins of a force that follows from the parameter x, of data that are zero; runs may be lost."""

    problem = property(problem_of)

    def __init__(self, force: Callable[[np.ndarray], np.ndarray] = lambda x: x) -> None:
        self.force = force
        self.box = Box.of({"damping": (-1e4, 1e4)})
        self.settings = Settings(refined_mesh=FINE)
        self.visited: list[float] = []
        self.precisions: list[str | None] = []
        self.lost: set[int] = set()

    def predicted(self, points: np.ndarray) -> Prediction:
        empty = np.empty((len(points), 0))
        return Prediction(empty, self.force(points) * np.ones((1, 10)), empty, empty.astype(bool))

    def vectors(self, stage: str, points: np.ndarray, numerics: Numerics, one: Objective) -> np.ndarray:
        return one.vectors(self.predicted(points))

    def run(self, stage: str, points: np.ndarray, numerics: Numerics, *, all_nodes: bool = False) -> Any:
        self.visited += points[:, 0].tolist()
        self.precisions.append(numerics.precision)
        gone = len(self.visited) in self.lost
        response = SimpleNamespace(
            completed=np.full(len(points), not gone), select=lambda rows: None, describe=lambda row: "folded"
        )
        seen = None if gone else self.predicted(points)
        rows = np.arange(0 if gone else len(points))
        return Runs(self.box.names, points, response, rows, seen)  # type: ignore[arg-type]


@pytest.mark.parametrize(("rise", "taken_back"), [(3.0, False), (3.9, False), (4.1, True), (6.0, True)])
def test_a_step_that_makes_the_misfit_worse_by_more_than_four_is_halved(
    rise: float, taken_back: bool
) -> None:
    """With the discrepancy |x| of each of n = 10 bins -2 ln L is n ln x^2 + n. A slope of 1 / (1 + q) leads
    from -10 to 10 q, where it is higher by 20 ln q; from there to 0, if that is not too much."""
    made: Any = Bins()
    q = np.exp(rise / 20.0)
    slope = np.full((10, 1), 1.0 / (1.0 + q))
    one = objective(np.zeros(10), np.empty(0))
    _chord_steps(made, one, slope, np.array([-10.0]), made.problem.refined)
    third = 0.5 * (-10.0 + 10.0 * q) if taken_back else 0.0  # Broyden's update of a linear force is exact
    assert made.visited[:3] == pytest.approx([-10.0, 10.0 * q, third], rel=1e-6, abs=1e-6)


def test_steps_learn_from_the_runs_and_another_mesh_continues_with_it() -> None:
    """A slope of 1.5 for a force x of slope 1: the step is -x / 1.5, so the point changes 1.5 times as much
    as the step."""
    made: Any = Bins()
    slope, one = np.full((10, 1), 1.5), objective(np.zeros(10), np.empty(0))
    found = _chord_steps(made, one, slope, np.array([-9.0]), made.problem.refined)
    assert made.visited == pytest.approx([-9.0, -3.0, 0.0], abs=1e-6)
    assert found.confirmed
    assert found.pace == pytest.approx(np.array([[-1.5]]), rel=1e-6)
    made.visited = []
    _chord_steps(made, one, slope, np.array([-9.0]), made.problem.refined, found.pace)
    assert made.visited == pytest.approx([-9.0, 0.0], abs=1e-6)


def test_a_corrected_step_is_three_times_as_long_at_most() -> None:
    """A slope of 10 for a force of slope 1 would need a step ten times as long: from -9 by 0.9 to -8.1, then
    by 3 * 0.81."""
    made: Any = Bins()
    _chord_steps(
        made, objective(np.zeros(10), np.empty(0)), np.full((10, 1), 10.0), np.array([-9.0]),
        made.problem.refined,
    )  # fmt: skip
    assert made.visited[:3] == pytest.approx([-9.0, -8.1, -8.1 + 3.0 * 0.81], rel=1e-6)


def test_a_run_confirms_when_no_step_is_longer_than_sigma_or_three_and_a_half_of_the_noise() -> None:
    sigma = np.array([1.0, 2.0])
    for change, noise, confirmed in (
        ([0.99, -1.98], [1.0, 1.0], True),
        ([1.01, 0.0], [1.0, 1.0], False),
        ([0.0, -2.02], [1.0, 1.0], False),
        ([0.0, -1.04], [1.0, 0.3], True),
        ([0.0, -1.06], [1.0, 0.3], False),
    ):
        step = Step(np.array(change), sigma, np.array(noise), None)  # type: ignore[arg-type]
        run = RefinedRun(TRUTH, TIME, None, Numerics(), step, TIME)  # type: ignore[arg-type]
        assert run.confirmed is confirmed


def test_the_noise_of_a_step_leaves_out_the_discrepancies() -> None:
    """Ten bins of slope 2 with noise 0.3 and a prior of 0.1: 1 / sigma^2 = 10 (2 / 0.3)^2 + 1 / 0.1^2."""
    prior = Prior(np.zeros(1), np.array([0.1]))
    one = replace(objective(np.zeros(10), np.empty(0)), prior=prior)
    vector = 50.0 * one.noise * np.tile([1.0, -1.0], 5)
    step = gauss_newton_step(
        one, np.full((10, 1), 2.0), vector, np.zeros(1), Box.of({"damping": (-9.0, 9.0)})
    )
    precision = 40.0 / float(one.noise[0]) ** 2 + 100.0
    assert step.noise_sigma == pytest.approx([precision**-0.5], rel=1e-9)
    assert step.objective.force_discrepancy > 40.0 * one.noise[0]


def test_the_optimum_of_a_linear_force_is_a_corrected_step_from_the_run_that_confirms_it() -> None:
    """With a slope of 1.5 for a force x of slope 1, the run at -0.1 of the noise is 0.3 sigma away."""
    made: Any = Bins()
    slope, one = np.full((10, 1), 1.5), objective(np.zeros(10), np.empty(0))
    start, pace = -0.1 * one.noise[:1], np.array([[-1.5]])
    double = replace(made.problem.refined, precision="fp64")
    found, _ = _search_on(made, one, slope, start, double, pace)
    assert found.step.moved == pytest.approx(0.1 * np.sqrt(10.0), rel=1e-6)
    assert made.visited == pytest.approx(start)
    np.testing.assert_allclose([*found.x, *found.vector], 0.0, atol=1e-9 * one.noise[0])
    # Inside the box.
    made.box = Box.of({"damping": (-1.0, 0.5 * float(start[0]))})
    assert _search_on(made, one, slope, start, double, pace)[0].x == 0.5 * start


@pytest.mark.parametrize("start", [-9.0, -1e-3])
def test_the_first_run_is_in_single_precision_and_the_one_that_confirms_in_double(start: float) -> None:
    made: Any = Bins()
    one = objective(np.zeros(10), np.empty(0))
    found = _chord_steps(made, one, np.ones((10, 1)), np.array([start]), made.problem.refined)
    assert made.visited == pytest.approx([start, 0.0], abs=1e-9)
    assert found.confirmed
    assert made.precisions == ["fp32", None]


def test_a_mesh_in_step_with_another_is_run_at_shifted_points() -> None:
    problem: Any = SimpleNamespace(box=BOX, numerics=Numerics(mesh=(24, 32)), observations=None)
    path: Any = object()
    table = RunTable(BOX.names)
    first = Runner(problem, FrontPath(path), table, Work(), np.random.default_rng(1))
    points = np.array([[1.0, 0.4998], [1.1, 0.499]])
    np.testing.assert_array_equal(first.solver_values(points, (24, 32)), points)
    empty = np.empty((2, 0))
    response: Any = SimpleNamespace(endings=[])
    runs = Runs(BOX.names, points, response, np.arange(2), Prediction(empty, empty, empty, empty))
    table.add("design", np.empty((0, 2)), runs, problem.observations, on=((24, 32), path, np.zeros(2)))
    table.add("design", np.empty((0, 2)), runs, problem.observations, on=((16, 22), path, np.zeros(2)))
    np.testing.assert_array_equal(first.on_surrogate_mesh()[0], points)
    shifted = first.under(first.front, {(24, 32): np.array([0.02, 3e-4])})
    # 0.4998 + 0.0003 is beyond what is allowed: the end of the range.
    np.testing.assert_allclose(shifted.solver_values(points, (24, 32)), [[1.02, 0.49999], [1.12, 0.4993]])
    np.testing.assert_array_equal(shifted.solver_values(points, (16, 22)), points)
    # The runs that were made stand for the points 0.02 and 0.0003 lower.
    np.testing.assert_allclose(shifted.on_surrogate_mesh()[0], points - [0.02, 3e-4])
    # What is run with the offset stands for its own points; what is run under another path serves no longer.
    table.add(
        "design", np.empty((0, 2)), runs, problem.observations, on=((24, 32), path, shifted.offset((24, 32)))
    )
    np.testing.assert_allclose(shifted.on_surrogate_mesh()[0], np.vstack([points - [0.02, 3e-4], points]))
    other: Any = object()
    table.add("design", np.empty((0, 2)), runs, problem.observations, on=((24, 32), other, np.zeros(2)))
    assert len(first.under(FrontPath(other)).on_surrogate_mesh()[0]) == 2


def test_runs_of_another_table_are_taken_with_what_they_held() -> None:
    whole, part = RunTable(("poisson", "stiffness_factor")), RunTable(("stiffness_factor",))
    part.points, part.endings = [np.array([1.2])], [Ending(Outcome.COMPLETED, 1e-3)]
    part.stages, part.terms = ["design"], [None]
    whole.take(part, {"poisson": 0.499})
    np.testing.assert_array_equal(whole.points, [[0.499, 1.2]])
    assert (whole.stages, whole.terms) == (["design"], [None])


class Faint(MadeUp):
    """The second parameter adds to the force, in double precision only."""

    effect = 1e-3
    """Force for each unit of the parameter."""

    def simulate(self, stage: str, design: Any, numerics: Numerics) -> Any:
        points, empty = design.points, np.empty((len(design.points), 0))
        seen = self.effect * points[:, 1:] if numerics.precision == "fp64" else 0.0
        force = ringing(np.column_stack([points[:, 0], np.full(len(points), TRUTH[1])])) + seen
        prediction = Prediction(empty, force, empty, empty.astype(bool))
        return SimpleNamespace(points=points, prediction=prediction, lost="")


def test_an_effect_that_rounding_hides_is_found_in_double_precision() -> None:
    optimum = MeshOptimum(x=TRUTH, sigma=np.array([1e-3, np.inf]), least_sigma=np.array([1e-3, np.inf]))
    slope, _ = slopes(Faint(), optimum)  # type: ignore[arg-type]
    np.testing.assert_allclose(slope[:, 1], 1e-3, rtol=1e-6)  # round-off of forces of one over 0.001 of nu
    known = replace(optimum, sigma=np.array([1e-3, 1e-4]))
    assert not slopes(Faint(), known)[0][:, 1].any()  # type: ignore[arg-type]


def test_a_parameter_without_effect_is_refused() -> None:
    made: Any = Faint()
    made.effect = 0.0
    optimum = MeshOptimum(x=TRUTH, sigma=np.array([1e-3, np.inf]), least_sigma=np.array([1e-3, np.inf]))
    with pytest.raises(ValueError, match=r"do not depend on poisson: hold it \(--hold poisson\)"):
        search_by_gauss_newton(made, {COARSE: optimum})
