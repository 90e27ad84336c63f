"""Simulations of an identification, stage by stage, each kept in the run table; compilation before the
first.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import explicit
from dic.processes import PendingResult
from doe import Box, Design, full_factorial, latin_hypercube
from explicit import Response
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.objective import Objective, Prior
from kolsky.inverse.observations import Observations, Prediction, predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.path_noise import MovedFront
from kolsky.inverse.problem import PreparedShot, Settings
from kolsky.inverse.run_table import CompletedRuns, Replicates, RunTable, first_lost, lost_in_words
from kolsky.inverse.work import Work


class StagedRuns:
    """Runs designs over a box of parameters; keeps every run.

    A coarse mesh answers like the refined one at other parameters: it is too soft, and its waves are too
    slow. `offsets` has, mesh by mesh, what is added to a point so that the mesh's run there resembles the
    refined mesh's run at the point; points, in and out, are the refined mesh's.
    """

    def __init__(
        self,
        prepared: PreparedShot,
        settings: Settings,
        box: Box,
        work: Work,
        *,
        prior: Prior | None = None,
    ) -> None:
        self.prepared, self.settings, self.box, self.work = prepared, settings, box, work
        self.progress = work.progress
        self.prior = prior
        self.offsets: dict[tuple[int, int], FloatArray] = {}
        self._replicates: Callable[[], Replicates | None] = lambda: None
        self.front: MovedFront | None = None
        self.rng = np.random.default_rng(settings.seed)
        self.table = RunTable(box.names)
        self._coarse: list[tuple[FloatArray, Prediction]] = []

    def offset(self, mesh: tuple[int, int], offset: FloatArray) -> None:
        """Run a mesh at shifted points from now on; its earlier runs count for the points they stand for.

        ``mesh``: elements across the radius and along the length. ``offset``: what is added to a point, in
        parameter units, shape [d].
        """
        change = offset - self.offsets.get(mesh, np.zeros(self.box.dimension))
        self.offsets[mesh] = offset
        if mesh == self.settings.numerics.mesh:
            self._coarse = [(points - change, prediction) for points, prediction in self._coarse]

    def solver_values(self, points: FloatArray, mesh: tuple[int, int]) -> FloatArray:
        """The points at which a mesh is run, shape [n, d].

        An offset that would leave a parameter's allowed range ends at its bound.
        """
        if mesh not in self.offsets:
            return points
        low, high = np.array([PARAMETERS[name].allowed for name in self.box.names]).T
        return np.clip(points + self.offsets[mesh], low, high)

    @property
    def observations(self) -> Observations:
        """The measurements that predictions are compared with."""
        return self.prepared.observations

    def know_front_noise(self, modes: FloatArray, offset: FloatArray | None = None) -> None:
        """Let all later objectives know the front face's noise, see `Observations.front_noise`."""
        seen = replace(self.prepared.observations, front_noise=modes, front_offset=offset)
        self.prepared = replace(self.prepared, observations=seen)

    def move_front(self, path: FlyerPath) -> None:
        """Run everything under another path of the front face; earlier runs serve no surrogate then."""
        forward = replace(self.prepared.forward, paths=(path,))
        self.prepared = replace(self.prepared, forward=forward)
        self._coarse = []

    def follow(self, front: MovedFront) -> None:
        """Run everything under a moved path from now on, and take the change off by its patterns."""
        self.front = front
        self.move_front(front.path)
        self.know_front_noise(front.modes.patterns, front.offset)

    def front_deviations(self, n: int) -> FloatArray:
        """Jerks of `n` paths of the front face drawn from its noise, less that of the path, [n, n_spans].

        In m/s^3; the same for the same number.
        """
        drawn = self.prepared.path.replicates(n, np.random.default_rng([self.settings.seed, 1]))
        return np.array([path.jerk for path in drawn]).reshape(n, -1) - self.prepared.path.jerk

    def design(self, box: Box) -> Design:
        """Seven levels of one parameter, or a Latin hypercube of twelve points for each of several."""
        if box.dimension == 1:
            return full_factorial(box, 7)
        return latin_hypercube(box, 12 * box.dimension, rng=self.rng, optimise=True)

    def simulate(
        self, stage: str, design: Design, numerics: Numerics, *, all_nodes: bool = False
    ) -> CompletedRuns:
        """Run a design.

        Raises ValueError if no run of it completed.
        """
        response, rows, prediction = self.run(stage, design.points, numerics, all_nodes=all_nodes)
        if prediction is None:
            raise ValueError(f"no run of the {stage} completed: {first_lost(design, response)}")
        kept = response.select(rows)
        return CompletedRuns(design.points[rows], rows, prediction, kept, lost_in_words(design, response))

    def vectors(self, stage: str, points: FloatArray, numerics: Numerics, objective: Objective) -> FloatArray:
        """Data vectors of runs at points of shape [n, d], shape [n, k]; NaN in the row of a lost run.

        An outline point that a run does not reach is given its measured value: it adds nothing.
        """
        _, rows, prediction = self.run(stage, points, numerics)
        found = np.full((len(points), len(objective.data)), np.nan)
        if prediction is not None:
            seen = objective.vectors(prediction)
            found[rows] = np.where(np.isnan(seen), objective.data, seen)
        return found

    def run(
        self, stage: str, points: FloatArray, numerics: Numerics, *, all_nodes: bool = False
    ) -> tuple[Response, NDArray[np.intp], Prediction | None]:
        """Run points and keep them: the response, its completed rows, and what those predict.

        Points may lie outside the box; no prediction is given if no run completed.
        """
        values = self.solver_values(points, numerics.mesh)
        named = {name: values[:, i] for i, name in enumerate(self.box.names)}
        with self.work.stage(stage, len(points)) as told:
            response = self.prepared.forward.run(
                {**self.settings.held, **named}, numerics, all_nodes=all_nodes, progress=told
            )
        rows = np.flatnonzero(response.completed)
        prediction = predict(response.select(rows), self.observations) if len(rows) else None
        if prediction is not None and numerics.mesh == self.settings.numerics.mesh:
            self._coarse.append((points[rows], prediction))
        self.table.add(stage, values, response.endings, rows, prediction, self.observations)
        return response, rows, prediction

    def evaluate(
        self, stage: str, points: FloatArray, numerics: Numerics, *, shifted: bool = True
    ) -> tuple[NDArray[np.intp], Prediction | None]:
        """Rows of the points whose runs completed, and their predictions, None if there are none.

        For a search that asks for many points beside each other: they join neither the table nor the runs
        on the surrogate's mesh. `shifted` points are those at which the mesh resembles the refined one.
        """
        at = self.solver_values(points, numerics.mesh) if shifted else points
        values = {name: at[:, i] for i, name in enumerate(self.box.names)}
        with self.work.stage(stage, len(points)) as told:
            response = self.prepared.forward.run({**self.settings.held, **values}, numerics, progress=told)
        rows = np.flatnonzero(response.completed)
        return rows, predict(response.select(rows), self.observations) if len(rows) else None

    def on_surrogate_mesh(self) -> tuple[FloatArray, Prediction]:
        """Points and predictions of all completed runs on the surrogate's mesh, in their order."""
        points, predictions = zip(*self._coarse, strict=True)
        parts = {
            name: np.concatenate([getattr(prediction, name) for prediction in predictions])
            for name in Prediction.__dataclass_fields__
        }
        return np.concatenate(points), Prediction(**parts)

    @property
    def replicates(self) -> Replicates | None:
        """Those that were asked for last; None if none were."""
        return self._replicates()

    def replicate(self, point: FloatArray, *, lesson: bool = True) -> Callable[[], Replicates]:
        """Run the point again under `settings.replicates` other motions, and as many other curves.

        The runs are made when they are asked for.

        With `lesson` the weights learn from as many motions more: what taught them does not judge them.

        One more run has the motion larger by the standard uncertainty of its scale, if that is known. What
        the runs depend on is as it is now.

        Returns: gives the replicates; raises ValueError if the reference among them did not complete.
        """
        n = self.settings.replicates
        moved = 2 * n if lesson else n
        forward = self.prepared.with_replicates(moved, self.rng, curves=n)
        scaled = len(forward.paths) - moved - 1
        motion = np.concatenate([np.arange(moved + 1), np.zeros(n, int), np.full(scaled, moved + 1)])
        material = np.concatenate([np.zeros(moved + 1, int), np.arange(1, n + 1), np.zeros(scaled, int)])
        at = self.solver_values(point[None], self.settings.replicate_mesh)[0]
        values = {**self.settings.held, **dict(zip(self.box.names, at, strict=True))}
        observations = self.observations

        def run() -> Replicates:
            numerics = self.settings.numerics.with_mesh(self.settings.replicate_mesh)
            with self.work.stage("noise", len(motion)) as told:
                response = forward.run(values, numerics, motion=motion, material=material, progress=told)
            rows = np.flatnonzero(response.completed)
            if 0 not in rows:
                raise ValueError(f"the noise stage's reference run ended {response.describe(0)}")
            return Replicates(
                prediction=predict(response.select(rows), observations),
                flyer=(rows > 0) & (rows <= n),
                lesson=(rows > n) & (rows <= moved),
                curve=(rows > moved) & (rows <= moved + n),
                scale=rows > moved + n,
                lost=response.n_samples - len(rows),
            )

        self._replicates = PendingResult(run)
        return self._replicates

    def under_other_motions(
        self, points: FloatArray, deviations: FloatArray, numerics: Numerics, *, shifted: bool = True
    ) -> list[Prediction | None]:
        """Run each point under the path of the front face, row 0, and under others.

        None for a point whose run under the path itself did not complete.

        ``points``: in parameter units, shape [p, d]. ``deviations``: jerks of the other paths less that of
        the path [m/s^3], shape [n, n_spans], see `front_deviations`. ``numerics``, ``shifted``: of the runs,
        and whether the mesh is run at the points at which it resembles the refined one.
        """
        path, n = self.prepared.path, len(deviations)
        others = [replace(path, jerk=path.jerk + change) for change in deviations]
        forward = replace(self.prepared.forward, paths=(path, *others))
        motion = np.tile(np.arange(n + 1), len(points))
        at = np.repeat(self.solver_values(points, numerics.mesh) if shifted else points, n + 1, axis=0)
        values = {name: at[:, i] for i, name in enumerate(self.box.names)}
        with self.work.stage("noise", len(motion)) as told:
            response = forward.run({**self.settings.held, **values}, numerics, motion=motion, progress=told)
        found: list[Prediction | None] = []
        for first in range(0, len(motion), n + 1):
            rows = first + np.flatnonzero(response.completed[first : first + n + 1])
            whole = len(rows) > 0 and rows[0] == first
            found.append(predict(response.select(rows), self.observations) if whole else None)
        return found


RUNS_OF_A_DESIGN = 64
"""Runs of a design: packs of lanes, where a few runs are made one by one."""


def compile_for(stages: StagedRuns) -> None:
    """Compile, side by side, what runs alone, a design's runs and the other element's need.

    It takes some seconds once on a machine, and is the stage "compile"; otherwise nothing is done.
    """
    numerics = stages.settings.numerics
    explicit.compile_time_loops(
        [_problem(stages, numerics, 1), _problem(stages, numerics, RUNS_OF_A_DESIGN)],
        also=[lambda: _problem(stages, numerics.with_other_element(), 1)],
        device=numerics.device,
        threads=numerics.threads,
        progress=lambda done, total: stages.progress("compile", done, total),
    )


def _problem(stages: StagedRuns, numerics: Numerics, runs: int) -> explicit.Problem:
    named = stages.box.as_dict(np.array(stages.box.lower))
    points = {name: np.full(runs, value) for name, value in {**stages.settings.held, **named}.items()}
    return stages.prepared.forward.problem(points, numerics)
