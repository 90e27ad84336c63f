"""Runs on graded meshes: separate entries in the ledger, errors from two meshes, new patterns."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe.least_squares import Whitening, secant
from kolsky.base.records import MaterialCurve
from kolsky.inverse import joint_search
from kolsky.inverse.joint_runs import Unknowns, kind_of, node_strains, smoothness, with_factors
from kolsky.inverse.joint_search import (
    COARSE_SLOPE_RUNS,
    MOST_RUNS,
    WORSE_STEP,
    Optimum,
    refined_optimum,
    with_refined_patterns,
)
from kolsky.inverse.settings import JointSettings, Numerics
from kolsky.inverse.valleys import from_search, search_box, to_search
from kolsky.uncertainty.mesh_error import joint_mesh_change

NUMERICS = Numerics(mesh=(8, 10))
REFINED = (16, 22)


@pytest.mark.parametrize(
    "other",
    [
        {"mesh": (8, 11)},
        {"grading": 5.0},
        {"element": "fbar"},
        {"precision": "fp32"},
        {"safety": 0.8},
        {"past_data": "stop"},
        {"hourglass_form": "viscous"},
    ],
    ids=lambda other: next(iter(other)),
)
def test_runs_of_other_numerics_are_other_runs(other: dict[str, Any]) -> None:
    assert kind_of(NUMERICS) == kind_of(replace(NUMERICS, device="cuda", threads=3))
    assert kind_of(NUMERICS) != kind_of(replace(NUMERICS, **other))
    for number in kind_of(NUMERICS):  # what a ledger keeps as a float
        assert float(number) == number


class Made:
    """Two data, x + 1 and 2 x + 1 on an infinitely fine mesh; other meshes err, each by its own amount."""

    def __init__(
        self, *, slides: bool = False, replicates: int = 4, lost: tuple[int, int] | None = None
    ) -> None:
        self.slides = slides
        self.settings = SimpleNamespace(replicates=replicates, refined_mesh=REFINED)
        self.mesh, self.refined = NUMERICS, NUMERICS.with_mesh(REFINED)
        self.unknowns = SimpleNamespace(box=SimpleNamespace(lower=(-9.0,), upper=(9.0,)))
        shot = SimpleNamespace(objective=SimpleNamespace(times=np.array([0.0, 1.0])))
        self.stack = SimpleNamespace(
            data=np.array([3.0, 5.0]), shots=(shot,), ends=(2,), weighting=self.whitening
        )
        self.lost, self.learnt = lost, []  # type: ignore[var-annotated]

    def predict(self, stage: str, points: np.ndarray, numerics: Numerics) -> np.ndarray:
        if numerics.mesh == self.lost:
            return np.full((len(points), 2), np.nan)
        even, edge = (16.0 / numerics.mesh[0]) ** 2, numerics.grading == 5.0
        error = np.array([0.01, 0.02]) * even if edge else np.array([0.3, -0.1]) * even
        if numerics.element == "fbar":
            error = -error
        return points * np.array([1.0, 2.0]) + 1.0 + error

    def deviance(self, vector: np.ndarray) -> float:
        return float(((vector - self.stack.data) ** 2).sum())

    def whitening(self, residual: np.ndarray) -> Whitening:
        # The noise's pattern is none before it is learnt anew, and the second datum's after.
        pattern = np.array([[0.0, 1e6]]) if self.learnt else np.zeros((0, 2))
        return Whitening(np.full(2, 0.01), pattern)

    def slopes(self, x: np.ndarray, sigma: np.ndarray, numerics: Numerics) -> Any:
        return self.predict("slopes", x[None], numerics)[0], np.array([[1.0], [2.0]])

    def learn_noise(self, x: np.ndarray, numerics: Numerics) -> None:
        self.learnt.append((float(x[0]), numerics.mesh, numerics.grading))


def optimum(made: Made, *, confirmed: bool = True) -> Optimum:
    x = np.array([1.9])
    vector = made.predict("check", x[None], made.refined)[0]
    return Optimum(x, np.array([1.5]), vector, np.array([[1.0], [2.0]]), None, confirmed)


def test_the_mesh_error_is_that_of_the_refined_mesh() -> None:
    """Errors of second order on graded meshes: Richardson's is exact, whatever the refined mesh does."""
    made = Made()
    change = joint_mesh_change(made, optimum(made))  # type: ignore[arg-type]
    np.testing.assert_allclose(change.error, [0.3, -0.1], rtol=1e-9)
    assert change.element is not None
    np.testing.assert_allclose(change.element, [-2.0 * 0.3 * 4.0, 2.0 * 0.1 * 4.0])
    np.testing.assert_allclose(change.coarser, [0.3 * 3.0, -0.1 * 3.0])


def test_patterns_are_made_at_the_refined_optimum_and_the_search_goes_on_with_them() -> None:
    """With them the second datum has no weight left: the first alone, 3 = x + 1 + 0.3, says x = 1.7."""
    made = Made()
    found = with_refined_patterns(made, optimum(made))  # type: ignore[arg-type]
    assert made.learnt == [(1.9, (10, 14), 5.0)]
    np.testing.assert_allclose(found.x, 1.7, atol=1e-6)
    np.testing.assert_allclose(found.start, 1.5)  # where the search's own mesh has its optimum


@pytest.mark.parametrize(
    ("given", "confirmed"),
    [({"slides": True}, True), ({"replicates": 0}, True), ({"lost": (10, 14)}, True), ({}, False)],
    ids=["slides", "no noise", "lost", "not at rest"],
)
def test_what_has_no_patterns_of_a_fine_mesh_stays_as_it_is(given: dict[str, Any], confirmed: bool) -> None:
    made = Made(**given)
    before = optimum(made, confirmed=confirmed)
    assert with_refined_patterns(made, before) is before  # type: ignore[arg-type]
    assert not made.learnt


@pytest.mark.parametrize(
    ("anew", "old", "kept"), [(True, True, "anew"), (False, True, "old"), (False, False, "anew")]
)
def test_patterns_with_which_the_search_does_not_rest_are_put_back(
    monkeypatch: pytest.MonkeyPatch, anew: bool, old: bool, kept: str
) -> None:
    made = Made()
    before, stacks = optimum(made), {"old": made.stack, "anew": SimpleNamespace(data=made.stack.data)}

    def with_patterns(problem: Any, found: Optimum) -> Optimum:
        problem.stack = stacks["anew"]
        return replace(found, x=np.array([1.7]))

    def scattered(problem: Any, found: Optimum) -> Optimum:
        return replace(found, confirmed=anew if problem.stack is stacks["anew"] else old)

    monkeypatch.setattr(joint_search, "with_refined_patterns", with_patterns)
    monkeypatch.setattr(joint_search, "with_scatter", scattered)
    said: list[str] = []
    found = joint_search.with_patterns_and_scatter(made, before, said)  # type: ignore[arg-type]
    assert said == ([] if kept == "anew" else [joint_search.COARSE_PATTERNS])
    assert made.stack is stacks[kept]
    assert found.x.tolist() == [1.7 if kept == "anew" else 1.9]
    assert found.confirmed == (anew or old)


TRUE = np.array([0.3, -0.2])
SLOPES = np.array([[20.0, 0.0], [0.0, 50.0], [10.0, 10.0]])
"""Of the refined mesh, in standard deviations of the data."""


class MadeSteps:
    """Data that are linear in two unknowns; what is asked of it is counted."""

    def __init__(self, given: np.ndarray = SLOPES, lost: bool = False, rough: float = 0.0) -> None:
        self.given, self.lost, self.rough = given, lost, rough
        self.runs: list[np.ndarray] = []
        self.costs: list[float] = []
        self.rng = np.random.default_rng(3)
        self.batches = 0
        self.refined = Numerics(mesh=(64, 86))
        self.unknowns = SimpleNamespace(box=SimpleNamespace(lower=(-1.0, -1.0), upper=(1.0, 1.0)))
        self.stack = SimpleNamespace(data=SLOPES @ TRUE, weighting=self.whitening)

    def predict(self, stage: str, points: np.ndarray, numerics: Numerics) -> np.ndarray:
        assert numerics.mesh == (64, 86)
        self.runs += list(points)
        seen = points @ SLOPES.T + self.rough * self.rng.standard_normal((len(points), 3))
        self.costs += [self.deviance(row) for row in seen]
        return np.full_like(seen, np.nan) if self.lost else seen

    def deviance(self, vector: np.ndarray) -> float:
        return float(((vector - self.stack.data) ** 2).sum())

    def whitening(self, residual: np.ndarray) -> Whitening:
        return Whitening(np.ones(len(residual)), np.zeros((0, len(residual))))

    def slopes(self, x: np.ndarray, sigma: np.ndarray, numerics: Numerics) -> Any:
        self.batches += 1
        return x @ SLOPES.T, self.given


def refined(made: MadeSteps, x: np.ndarray, slopes: np.ndarray) -> Optimum:
    return refined_optimum(made, x, slopes)  # type: ignore[arg-type]


def test_right_slopes_take_two_runs_and_no_others() -> None:
    made = MadeSteps()
    start = np.array([0.5, 0.5])
    found = refined(made, start, SLOPES)
    np.testing.assert_allclose(found.x, TRUE, atol=1e-12)
    np.testing.assert_array_equal(found.start, start)
    np.testing.assert_allclose(found.vector, SLOPES @ TRUE)
    assert found.confirmed
    assert (len(made.runs), made.batches) == (2, 0)


def test_a_start_within_a_quarter_of_a_standard_deviation_is_confirmed_there() -> None:
    sigma = np.sqrt(np.diag(np.linalg.inv(SLOPES.T @ SLOPES)))
    for share, runs in ((0.9, 1), (1.1, 2)):
        made = MadeSteps()
        start = TRUE + share * 0.25 * sigma * np.array([1.0, 0.0])
        assert refined(made, start, SLOPES).confirmed
        assert len(made.runs) == runs


def test_slopes_that_lead_astray_are_taken_anew() -> None:
    made = MadeSteps()
    found = refined(made, np.array([0.4, 0.0]), -0.3 * SLOPES)  # away from the optimum
    np.testing.assert_allclose(found.x, TRUE, atol=1e-12)
    assert found.confirmed
    # The start, the step that led away, and the one from the start with the right slopes.
    assert (len(made.runs), made.batches) == (3, 1)
    np.testing.assert_allclose(found.slopes, SLOPES, atol=1e-9)


def test_slopes_that_grope_are_taken_anew() -> None:
    made = MadeSteps()
    steep = 4.0 * SLOPES @ np.array([[1.0, 0.6], [-0.6, 1.0]])  # short steps, turned
    found = refined(made, np.array([0.9, 0.9]), steep)
    assert found.confirmed
    assert made.batches == 1
    assert len(made.runs) == COARSE_SLOPE_RUNS + 1


def test_a_misfit_that_jumps_is_not_confirmed_and_ends() -> None:
    made = MadeSteps(rough=3.0)
    found = refined(made, np.array([0.5, 0.5]), SLOPES)
    assert not found.confirmed
    assert len(made.runs) == MOST_RUNS
    assert made.deviance(found.vector) <= min(made.costs) + WORSE_STEP


def test_a_lost_run_is_refused() -> None:
    with pytest.raises(ValueError, match="refined mesh of 64 x 86 elements did not complete"):
        refined(MadeSteps(lost=True), TRUE, SLOPES)


def test_the_secant_explains_the_last_change_and_nothing_else() -> None:
    wrong = SLOPES + np.array([[3.0, -1.0], [2.0, 5.0], [0.0, 1.0]])
    sigma, before, x = np.array([0.1, 0.5]), np.array([0.1, 0.1]), np.array([0.2, 0.4])
    found = secant(wrong, before, SLOPES @ before, sigma, x, SLOPES @ x)
    np.testing.assert_allclose(found @ (x - before), SLOPES @ (x - before))
    step = (x - before) / sigma
    across = sigma * np.array([-step[1], step[0]])  # at right angles, in standard deviations
    np.testing.assert_allclose(found @ across, wrong @ across)
    np.testing.assert_array_equal(secant(wrong, x, SLOPES @ x, sigma, x, SLOPES @ x), wrong)


STRETCH = np.linspace(1.0, 0.4, 13)
CURVE = MaterialCurve(STRETCH, 1e4 * (STRETCH - STRETCH**-2.0), np.ones(13))


def test_parameters_come_first_in_their_own_coordinates() -> None:
    both = Unknowns({"poisson": (0.49, 0.499), "prony_time_1": (1e-5, 1e-3)}, nodes=4)
    assert both.names == ("poisson", "prony_time_1", "curve_1", "curve_2", "curve_3", "curve_4")
    x = np.array([0.495, 2e-4, 0.1, -0.2, 0.3, 0.0])
    inner = to_search(both.box, x)
    np.testing.assert_allclose(inner, [0.01, *x[1:]])
    np.testing.assert_allclose(from_search(both.box, inner), x)
    assert search_box(both.box).logarithmic == (True, True, False, False, False, False)
    with pytest.raises(ValueError, match="cannot be free together with them"):
        Unknowns({"stiffness_factor": None}, nodes=4)
    alone = Unknowns({}, nodes=4)
    assert alone.parameters is None
    np.testing.assert_array_equal(to_search(alone.box, np.ones(4)), np.ones(4))


def test_the_stiffness_of_all_is_m_or_all_nodes_together() -> None:
    slopes = np.arange(12.0).reshape(2, 6)
    nodes = Unknowns({"poisson": None, "damping": None}, nodes=4)
    x = np.array([0.4, 1.0, 0.0, 0.0, 0.0, 0.0])
    # With the bulk modulus held 1 - 2 nu goes with the stiffness: nu falls by (1 - 0.8) / 2.
    expected = [14.0, 38.0 - 0.1 * 6.0]
    np.testing.assert_allclose(nodes.relative_stiffness(slopes, x), expected)
    m = Unknowns({"poisson": None, "stiffness_factor": None})
    # d F / d ln m = m d F / d m
    np.testing.assert_allclose(
        m.relative_stiffness(slopes[:, :2], np.array([0.49, 1.5])), [1.5, 10.5 - 0.01 * 6.0]
    )


def test_factors_stand_at_the_nodes_and_their_logarithm_is_linear_between() -> None:
    np.testing.assert_allclose(node_strains(CURVE, 4), [0.0, -0.2, -0.4, -0.6])
    logs = np.log([1.0, 1.2, 1.5, 1.5])
    factor = np.divide(with_factors(CURVE, logs), CURVE.stress, where=CURVE.stress != 0.0, out=np.ones(13))
    at = np.abs(STRETCH - 1.0)
    assert factor[np.isclose(at, 0.2)] == pytest.approx(1.2)
    assert factor[np.isclose(at, 0.3)] == pytest.approx(np.sqrt(1.2 * 1.5))
    assert factor[np.isclose(at, 0.6)] == pytest.approx(1.5)


def test_smoothness_is_the_second_difference_over_its_sigma() -> None:
    rows = smoothness(5, 0.1)
    assert rows.shape == (3, 5)
    np.testing.assert_allclose(rows @ (2.0 + 0.7 * np.arange(5.0)), 0.0, atol=1e-12)  # a line is smooth
    np.testing.assert_allclose(rows @ np.arange(5.0) ** 2, 20.0)  # second difference 2 over 0.1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"curve_nodes": 3}, "curve_nodes must be 0 or 4 to 24, got 3"),
        ({"curve_nodes": -3}, r"curve_nodes must be in \[0, inf\], got -3"),
        ({"seed": -1}, r"seed must be in \[0, inf\), got -1"),
        ({"replicates": -1}, r"replicates must be in \[0, inf\), got -1"),
        ({"curve_roughness": 0.0}, "curve_roughness must be in"),
        ({"gain_each": 1.0}, "gain_each must be in"),
        ({"refined_mesh": (16, 22)}, "must be finer"),
        ({"numerics": Numerics(mesh=(16, 22), compressible=0.495)}, "leave the correction out"),
    ],
)
def test_settings_that_cannot_be_are_refused(given: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(ValueError, match=words):
        JointSettings(**given)
