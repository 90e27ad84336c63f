"""Single precision on the coarse meshes of a search: where it is used, and what its rounding changes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kolsky.inverse.joint_problem import JointProblem
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.settings import Numerics, Settings
from kolsky.shot.load import load_shot
from kolsky.uncertainty.profiles import APART

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


@pytest.fixture(scope="module")
def problem() -> InverseProblem:
    return InverseProblem.of(load_shot(OPEN_01), Settings())


def precisions(problem: InverseProblem) -> list[str | None]:
    return [one.precision for one in (problem.first, problem.numerics, problem.halfway, problem.refined)]


def test_coarse_meshes_of_a_search_are_in_single_precision_and_the_answer_in_double(
    problem: InverseProblem,
) -> None:
    assert precisions(problem) == ["fp32", "fp32", "fp32", None]
    sliding = Settings(held={"friction": 0.2})
    assert set(precisions(InverseProblem.of(problem.shot, sliding))) == {None}
    corrected = Settings(numerics=Numerics(compressible=0.495))
    assert set(precisions(InverseProblem.of(problem.shot, corrected))) == {None}
    with pytest.raises(ValueError, match="must be finer than that of the search"):
        InverseProblem.of(problem.shot, Settings(refined_mesh=(20, 27)))


@pytest.mark.parametrize("chosen", ["fp32", "fp64"])
def test_a_chosen_precision_is_that_of_all_runs(problem: InverseProblem, chosen: str) -> None:
    settings = Settings(numerics=Numerics(precision=chosen))  # type: ignore[arg-type]
    assert set(precisions(InverseProblem.of(problem.shot, settings))) == {chosen}


@pytest.mark.parametrize(("precision", "solver"), [(None, "fp64"), ("fp64", "fp64"), ("fp32", "fp32")])
def test_without_a_choice_the_solver_uses_double_precision(
    problem: InverseProblem, precision: str | None, solver: str
) -> None:
    numerics = Numerics(precision=precision)  # type: ignore[arg-type]
    assert problem.prepared.forward.problem({}, numerics).stepping.precision == solver


@pytest.mark.parametrize("slides", [False, True])
def test_several_shots_search_in_single_precision_unless_they_slide(slides: bool) -> None:
    joint = JointProblem.__new__(JointProblem)
    joint.settings = Settings()  # type: ignore[assignment]
    joint.__dict__["slides"] = slides
    assert (joint.mesh.precision, joint.refined.precision) == (None if slides else "fp32", None)


def test_rounding_moves_an_optimum_by_a_fiftieth_of_its_uncertainty_at_most(problem: InverseProblem) -> None:
    """By the linear map from a change of the data to the optimum, on both meshes in single precision."""
    values = {"stiffness_factor": 1.12, "poisson": 0.499, "damping": 2.5e-5}
    steps = {"stiffness_factor": 1e-2, "poisson": 1e-5, "damping": 1e-6}
    runs = [values]
    for name, step in steps.items():
        runs += [{**values, name: values[name] + sign * step} for sign in (1.0, -1.0)]
    points = {name: np.array([run[name] for run in runs]) for name in values}

    def predicted(points: dict[str, np.ndarray], numerics: Numerics) -> np.ndarray:
        seen = predict(problem.prepared.forward.run(points, numerics), problem.observations)
        return objective.vectors(seen)

    double = replace(problem.numerics, precision="fp64")
    first = predict(problem.prepared.forward.run(points, double), problem.observations)
    objective = Objective(problem.observations, np.asarray(first.inside.all(axis=0)))
    vectors = objective.vectors(first)
    slopes = (vectors[1::2] - vectors[2::2]).T / (2.0 * np.array(list(steps.values())))
    gain = objective.gain(slopes)
    sigma = np.sqrt(np.diag(np.linalg.inv(objective.information(slopes))))
    one = {name: column[:1] for name, column in points.items()}
    for numerics in (problem.numerics, problem.halfway):
        rounding = predicted(one, numerics) - predicted(one, replace(numerics, precision="fp64"))
        assert np.abs(rounding).max() > 1e-7  # the two precisions were run
        # 0.0007 and 0.002 here; 0.02 with Poisson's ratio at its limit of 0.49998, where the law is stiffest.
        assert (np.abs(gain @ np.nan_to_num(rounding[0])) < 0.02 * sigma).all()
        if numerics == problem.numerics:
            # Two runs of a profile's surrogate, APART: rounding as a change over the box, in sigma
            # of an entry. It is 0.13. At 1, a parameter without effect would have a bound.
            ratio = np.nan_to_num(rounding[0]) / objective.noise
            assert np.sqrt(2.0 * np.mean(ratio**2)) / APART < 0.5
