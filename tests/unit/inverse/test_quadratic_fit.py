"""The quadratic on the refined mesh, for a synthetic model with known optimum, mesh error and jumps."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.base.records import ForceHistory
from kolsky.inverse.observations import Prediction, observe
from kolsky.inverse.path_noise import FrontPath
from kolsky.inverse.refined_search import EDGE, confirms, search_by_quadratic
from kolsky.inverse.run_table import Runs
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics, Settings
from tests.unit.inverse.test_several_parameters import problem_of

BOX = Box(("stiffness_factor", "friction"), (0.8, 0.0), (1.6, 1.0), (False, False))
TRUTH = np.array([1.17, 0.42])
TIME = np.linspace(0.0, 1e-3, 2001)
NOISE = 0.05
REFINED = (16, 22)
MESH_ERROR = np.array([0.03, -0.02])
"""By how much the coarse mesh's optimum lies off the refined one's."""
"""By how much the other element's does."""


def force(m: float, f: float) -> np.ndarray:
    """Smooth in both, and different in time."""
    t = TIME / TIME[-1]
    return 10.0 * m * t**2 + 4.0 * f * np.sin(9.0 * t) + 1.5 * m * f * t


class MadeUp:
    """A stand-in for `kolsky.inverse.runner.Runner`: forces of a formula plus jumps."""

    problem = property(problem_of)
    objective = Runner.objective
    front = FrontPath(None)  # type: ignore[arg-type]

    def __init__(
        self, *, jumps: float, side: str = "coulomb", ringing: float = 0.0, lost: bool = False
    ) -> None:
        self.box, self.rng = BOX, np.random.default_rng(4)
        self.settings = Settings(
            free=dict.fromkeys(BOX.names), numerics=Numerics(mesh=(8, 11)), refined_mesh=REFINED
        )
        if side == "bonded":  # a free friction would make every surface slide
            self.settings = Settings(numerics=Numerics(mesh=(8, 11)), refined_mesh=REFINED)
        interface = SimpleNamespace(faces="bonded", side=side)
        self.prepared = SimpleNamespace(forward=SimpleNamespace(shot=SimpleNamespace(interface=interface)))
        noise = np.random.default_rng(0).standard_normal(TIME.size) * NOISE
        self.ringing, self.jumps, self.lost = ringing, jumps, lost
        sigma = np.full(TIME.size, NOISE)
        self.observations = observe(
            ForceHistory(TIME, self.clean(TRUTH) + noise, sigma), None, window=(0.0, 1e-3), bin_width=1e-5
        )
        bins = self.observations.bins  # binned as the model is
        self.observations = replace(
            self.observations, bins=replace(bins, mean=self.binned(self.clean(TRUTH) + noise))
        )
        self.designs: list[tuple[str, np.ndarray]] = []

    def binned(self, curve: np.ndarray) -> np.ndarray:
        """Mean of each bin's samples."""
        edges = self.observations.bins.edges
        cells = np.searchsorted(edges, TIME, side="right")
        return np.array([curve[cells == k].mean() for k in range(1, len(edges))])

    def clean(self, x: np.ndarray) -> np.ndarray:
        """The force at a point."""
        return force(*x) + self.ringing * np.sin(60.0 * (x[0] - TRUTH[0]) + 40.0 * TIME / TIME[-1])

    def predicted(self, points: np.ndarray, numerics: Numerics) -> Prediction:
        """Bin means of the forces, those of other meshes off by their error."""
        off = np.zeros(2) if numerics.mesh == REFINED else MESH_ERROR
        curves = np.array([self.clean(x - off) for x in points])
        bins = np.array([self.binned(curve) for curve in curves])
        bins = bins + self.jumps * self.rng.standard_normal(bins.shape)
        none = np.zeros((len(points), 0))
        return Prediction(curves, bins, none, none.astype(bool))

    def simulate(self, stage: str, design: Any, numerics: Numerics, *, all_nodes: bool = False) -> Any:
        """Run a design."""
        self.designs.append((stage, design.points))
        rows = np.arange(len(design.points))
        return SimpleNamespace(
            points=design.points, rows=rows, prediction=self.predicted(design.points, numerics), lost=""
        )

    def run(
        self,
        stage: str,
        points: np.ndarray,
        numerics: Numerics,
        *,
        all_nodes: bool = False,
        recorded: bool = True,
    ) -> Runs:
        """Run points; beside the table they may be lost."""
        lost = self.lost and not recorded
        if recorded:
            self.designs.append((stage, points))
        response: Any = SimpleNamespace(select=lambda rows: None)
        seen, rows = None if lost else self.predicted(points, numerics), np.arange(0 if lost else len(points))
        return Runs(self.box.names, points, response, rows, seen)


def run(made: MadeUp, start: np.ndarray) -> Any:
    """The stage, from an optimum of the surrogate's mesh."""
    runner: Any = made
    coarse: Any = SimpleNamespace(x=start, box=BOX)
    return search_by_quadratic(runner, coarse)


def test_a_rough_response_is_averaged_and_its_roughness_told() -> None:
    made = MadeUp(jumps=0.2)
    found = run(made, TRUTH + MESH_ERROR)
    gain = found.objective.gain(found.jacobian)
    planted = np.sqrt(np.diag(gain @ gain.T)) * 0.2
    # 15 runs, 6 terms: 9 degrees of freedom, a standard deviation is known to 24 %; three of it.
    np.testing.assert_allclose(found.roughness, planted, rtol=0.72)
    assert found.deviations is not None  # what the routes' maps make of them, the joint one makes the same
    np.testing.assert_allclose(np.sum((found.deviations @ gain.T) ** 2, axis=0), found.roughness**2)
    # The data's noise and what the quadratic does not average of the jumps: 6 of 15 of their variance.
    assert (np.abs(found.x - TRUTH) < 3.0 * np.hypot(found.sigma, found.roughness)).all()
    assert found.confirmed
    edges = np.diff(BOX.unit(np.array([found.box.lower, found.box.upper])), axis=0)
    np.testing.assert_allclose(edges, EDGE, rtol=1e-9)  # a sliding surface keeps the wide box


def test_the_other_mesh_moves_it_as_it_should() -> None:
    found = run(MadeUp(jumps=0.0), TRUTH + MESH_ERROR)
    # One linear step back over a response that is bilinear: its curvature over the step is 3 %.
    np.testing.assert_allclose(found.mesh_shift, -MESH_ERROR, rtol=0.05)
    assert found.moved < 0.01


def test_runs_that_are_lost_beside_it_leave_the_search() -> None:
    start = TRUTH + MESH_ERROR
    found = run(MadeUp(jumps=0.0, lost=True), start)
    np.testing.assert_allclose(found.mesh_shift, found.x - start)


def test_the_box_follows_an_optimum_that_leaves_it() -> None:
    found = run(MadeUp(jumps=0.0), np.array([0.9, 0.8]))
    assert (np.abs(found.x - TRUTH) < 3.0 * found.sigma).all()
    assert found.confirmed


def test_a_smooth_response_that_is_not_quadratic_gets_a_smaller_box() -> None:
    made = MadeUp(jumps=0.0, side="bonded", ringing=3.0)
    found = run(made, TRUTH + MESH_ERROR)
    edges = np.diff(BOX.unit(np.array([found.box.lower, found.box.upper])), axis=0)
    assert edges.max() < 0.5 * EDGE
    assert (found.roughness < 0.5 * found.sigma).all()
    assert (np.abs(found.x - TRUTH) < 3.0 * found.sigma).all()
    # The width was found on the surrogate's mesh: every design on the refined one is that narrow.
    refined = [points for stage, points in made.designs if stage == "check" and len(points) > 1]
    assert all((np.ptp(BOX.unit(points), axis=0) < 0.5 * EDGE).all() for points in refined)


def test_too_few_completed_runs_are_refused() -> None:
    made = MadeUp(jumps=0.0)
    whole = made.simulate

    def losing(*given: Any, **options: Any) -> Any:
        runs = whole(*given, **options)
        part = {name: getattr(runs.prediction, name)[:5] for name in Prediction.__dataclass_fields__}
        return SimpleNamespace(
            points=runs.points[:5],
            rows=runs.rows[:5],
            prediction=Prediction(**part),
            lost="10 runs were lost",
        )

    made.simulate = losing  # type: ignore[method-assign]
    with pytest.raises(
        ValueError, match=r"has 6 terms and takes at least 7 .* there are 5.*10 runs were lost"
    ):
        run(made, TRUTH)


def test_a_run_confirms_within_a_fifth_of_sigma_or_three_times_the_roughness() -> None:
    sigma = np.array([1.0, 2.0])
    assert confirms(np.array([0.199, -0.399]), sigma)
    assert not confirms(np.array([0.201, 0.0]), sigma)
    assert not confirms(np.array([0.0, -0.401]), sigma)
    rough = np.array([0.1, 0.0])
    assert confirms(np.array([0.299, 0.399]), sigma, rough)
    assert not confirms(np.array([0.301, 0.0]), sigma, rough)
    assert not confirms(np.array([0.0, 0.401]), sigma, rough)
