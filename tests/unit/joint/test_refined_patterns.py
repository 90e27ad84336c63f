"""Runs on graded meshes: no mistake for others of the ledger, errors by two of them, patterns made anew."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe.least_squares import Whitening
from kolsky.base.apparatus import Interface
from kolsky.inverse import joint_search
from kolsky.inverse.forward import Numerics
from kolsky.inverse.joint_runs import kind_of
from kolsky.inverse.joint_search import Optimum, with_refined_patterns
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
        self, *, side: str = "bonded", replicates: int = 4, lost: tuple[int, int] | None = None
    ) -> None:
        interface = Interface(faces="bonded", side=side, friction=0.2)
        self.first = SimpleNamespace(shot=SimpleNamespace(interface=interface))
        self.settings = SimpleNamespace(replicates=replicates, refined_mesh=REFINED)
        self.mesh, self.refined = NUMERICS, NUMERICS.with_mesh(REFINED)
        self.unknowns = SimpleNamespace(
            bounds={"stiffness_factor": None}, box=SimpleNamespace(lower=(-9.0,), upper=(9.0,))
        )
        self.runs = SimpleNamespace(held={})
        shot = SimpleNamespace(
            objective=SimpleNamespace(times=np.array([0.0, 1.0])),
        )
        self.stack = SimpleNamespace(data=np.array([3.0, 5.0]), shots=(shot,), ends=(2,))
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
    [({"side": "coulomb"}, True), ({"replicates": 0}, True), ({"lost": (10, 14)}, True), ({}, False)],
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
