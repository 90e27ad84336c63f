"""The quadratic on the refined mesh, runs of the noise stage, and the table of runs."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from explicit import Ending, Outcome
from kolsky.base.records import ForceHistory
from kolsky.inverse import run_table
from kolsky.inverse import runner as runner_module
from kolsky.inverse.observations import Prediction, observe
from kolsky.inverse.path_noise import FrontPath
from kolsky.inverse.problem import Freed, InverseProblem, prepare_shot
from kolsky.inverse.refined_search import EDGE, confirms, search_by_quadratic
from kolsky.inverse.run_table import Replicates, Runs, RunTable, Terms
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.work import Work
from kolsky.shot.load import load_shot
from tests.unit.inverse.test_several_parameters import problem_of

# The quadratic on the refined mesh, for a synthetic model with known optimum, mesh error and jumps.

BOX = Box(("stiffness_factor", "friction"), (0.8, 0.0), (1.6, 1.0), (False, False))
TRUTH = np.array([1.17, 0.42])
TIME = np.linspace(0.0, 1e-3, 2001)
NOISE = 0.05
REFINED = (16, 22)
MESH_ERROR = np.array([0.03, -0.02])  # by how much the coarse mesh's optimum lies off the refined one's
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

    def __init__(self, *, jumps: float, side: str = "coulomb", ringing: float = 0.0) -> None:
        self.box, self.rng = BOX, np.random.default_rng(4)
        self.settings = Settings(
            free=dict.fromkeys(BOX.names), numerics=Numerics(mesh=(8, 11)), refined_mesh=REFINED
        )
        if side == "bonded":  # a free friction would make every surface slide
            self.settings = Settings(numerics=Numerics(mesh=(8, 11)), refined_mesh=REFINED)
        interface = SimpleNamespace(faces="bonded", side=side)
        self.prepared = SimpleNamespace(forward=SimpleNamespace(shot=SimpleNamespace(interface=interface)))
        noise = np.random.default_rng(0).standard_normal(TIME.size) * NOISE
        self.ringing, self.jumps = ringing, jumps
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

    def run(self, stage: str, points: np.ndarray, numerics: Numerics, *, all_nodes: bool = False) -> Runs:
        """Run points."""
        self.designs.append((stage, points))
        response: Any = SimpleNamespace(select=lambda rows: None)
        return Runs(
            self.box.names, points, response, np.arange(len(points)), self.predicted(points, numerics)
        )


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


# Runs of the noise stage with another motion, another curve, or another scale.

PATH: Any = "a path"


class Shot:
    """A prepared shot whose motion has a scale of its own; its runs only say what they were asked for."""

    observations = None
    forward = SimpleNamespace(shot=SimpleNamespace(interface=SimpleNamespace(faces="bonded", side="bonded")))

    def __init__(self, lost: tuple[int, ...] = ()) -> None:
        self.lost, self.motion, self.material = lost, np.empty(0), np.empty(0)

    def with_replicates(self, n: int, rng: Any, *, curves: int, path: Any) -> Any:
        assert (curves, path) == (3, PATH)
        return SimpleNamespace(paths=list(range(n + 2)), run=self.run)

    def run(
        self, values: Any, numerics: Any, *, motion: Any, material: Any, progress: Any, all_nodes: bool
    ) -> Any:
        self.motion, self.material = motion, material
        completed = ~np.isin(np.arange(len(motion)), self.lost)
        return SimpleNamespace(completed=completed, n_samples=len(motion), select=lambda rows: rows)


def runner(shot: Any, monkeypatch: pytest.MonkeyPatch) -> Runner:
    for module in (run_table, runner_module):
        monkeypatch.setattr(module, "predict", lambda rows, observations: rows)
    settings, box = Settings(free={}, replicates=3), Box.of({"stiffness_factor": (0.5, 2.0)})
    problem = InverseProblem(shot, Freed(settings, by_default=False, reasons={}), box, None)
    return Runner(problem, FrontPath(PATH), RunTable(box.names), Work(), np.random.default_rng(1))


def replicated(shot: Any, monkeypatch: pytest.MonkeyPatch, *, lesson: bool) -> Replicates:
    return runner(shot, monkeypatch).replicate(np.array([1.1]), lesson=lesson)()


def test_motions_then_curves_then_the_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    found = replicated(shot, monkeypatch, lesson=False)
    assert shot.motion.tolist() == [0, 1, 2, 3, 0, 0, 0, 4]
    assert shot.material.tolist() == [0, 0, 0, 0, 1, 2, 3, 0]
    assert np.flatnonzero(found.flyer).tolist() == [1, 2, 3]
    assert np.flatnonzero(found.curve).tolist() == [4, 5, 6]
    assert np.flatnonzero(found.scale).tolist() == [7]
    assert not found.lesson.any()


def test_where_the_patterns_are_known_no_motion_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    one = runner(shot, monkeypatch)
    found = one.under(one.front.with_noise(np.ones((1, 4)))).replicate(np.array([1.1]), lesson=False)()
    assert shot.motion.tolist() == [0, 0, 0, 0, 1]
    assert not found.flyer.any()
    assert np.flatnonzero(found.curve).tolist() == [1, 2, 3]


def test_what_teaches_the_weights_does_not_judge_them(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    found = replicated(shot, monkeypatch, lesson=True)
    assert shot.motion.tolist() == [0, 1, 2, 3, 4, 5, 6, 0, 0, 0, 7]
    assert shot.material.tolist() == [0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 0]
    assert np.flatnonzero(found.flyer).tolist() == [1, 2, 3]
    assert np.flatnonzero(found.lesson).tolist() == [4, 5, 6]
    assert np.flatnonzero(found.curve).tolist() == [7, 8, 9]
    assert np.flatnonzero(found.scale).tolist() == [10]


def test_a_lost_run_keeps_the_others_in_their_place(monkeypatch: pytest.MonkeyPatch) -> None:
    found = replicated(Shot(lost=(2, 5)), monkeypatch, lesson=False)
    assert found.lost == 2
    assert np.flatnonzero(found.flyer).tolist() == [1, 2]
    assert np.flatnonzero(found.curve).tolist() == [3, 4]
    assert np.flatnonzero(found.scale).tolist() == [5]


def test_they_are_run_when_they_are_asked_for_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    asked = runner(shot, monkeypatch).replicate(np.array([1.1]))
    assert shot.motion.size == 0
    assert asked() is asked()
    assert shot.motion.size == 11


# The table of runs: each point once for the paper's cost, and NaN where a run did not complete.


def terms(phi: float) -> Terms:
    return Terms(1e-3 * phi, 10.0 * phi, phi, 0.0, 0.0, 0.0, 1.0, 2.0, 3, 4, 0)


def table() -> RunTable:
    made = RunTable(("stiffness_factor",))
    rows = (
        ("design", 0.75, "COMPLETED", 5.0),
        ("design", 1.0, "INVERTED", None),
        ("design", 1.25, "COMPLETED", 3.0),
        ("refinement", 1.25, "COMPLETED", 3.0),  # the same point again, the same run
        ("refinement", 1.25 + 1e-14, "COMPLETED", 3.0),  # and but for round-off
        ("refinement", 1.1, "COMPLETED", 1.0),
        ("check", 1.12, "COMPLETED", 0.5),  # another mesh
    )
    for stage, point, outcome, phi in rows:
        made.points.append(np.array([point]))
        made.stages.append(stage)
        made.endings.append(
            Ending(Outcome.COMPLETED, 1e-3)
            if outcome == "COMPLETED"
            else Ending(Outcome[outcome], 4e-4, 17, (4.6e-3, 0.2e-3))
        )
        made.terms.append(None if phi is None else terms(phi))
    return made


def test_paper_cost_has_each_completed_point_of_the_surrogates_mesh_once() -> None:
    points, cost = table().paper_cost()
    np.testing.assert_allclose(points[:, 0], [0.75, 1.1, 1.25], rtol=1e-12)
    np.testing.assert_array_equal(cost, [5.0, 1.0, 3.0])


def test_a_lost_run_keeps_its_place_with_nan_misfits() -> None:
    built = table().build(Box.of({"stiffness_factor": (0.5, 1.5)}))
    assert len(built.outcomes) == len(built.points) == 7
    assert np.isnan(built.phi_force[1])
    assert np.isnan(built.chi2_shape[1])
    assert built.outcomes[1] == "INVERTED"
    assert built.lost == (1,)
    assert built.ending(1).where == "at 400.0 us in element 17 (R = 4.60 mm, Y = 0.20 mm)"
    assert built.ending(0).outcome.ok
    np.testing.assert_array_equal(built.phi_force[[0, 2, 6]], [50.0, 30.0, 5.0])
    assert (built.lower[0], built.upper[0]) == (0.5, 1.5)


OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def test_a_mesh_is_kept_for_its_specimen_and_its_numerics() -> None:
    forward = prepare_shot(load_shot(OPEN_01)).forward
    numerics = Numerics(mesh=(6, 8))
    mesh = forward.mesh(numerics)
    specimen = forward.shot.specimen
    assert replace(forward, paths=forward.paths[:1]).mesh(replace(numerics, safety=0.5)) is mesh
    assert (mesh.nodes[:, 0].max(), mesh.length) == (specimen.radius, specimen.length)
    assert forward.mesh(replace(numerics, mesh=(8, 6))).n_elements == 48
    graded = forward.mesh(replace(numerics, grading=1.0 + numerics.grading))
    assert not np.array_equal(graded.nodes, mesh.nodes)
    longer = replace(forward.shot, specimen=replace(specimen, length=1.01 * specimen.length))
    assert replace(forward, shot=longer).mesh(numerics).length == 1.01 * specimen.length
    wider = replace(forward.shot, specimen=replace(specimen, diameter=1.01 * specimen.diameter))
    assert replace(forward, shot=wider).mesh(numerics).nodes[:, 0].max() == 0.5 * 1.01 * specimen.diameter
