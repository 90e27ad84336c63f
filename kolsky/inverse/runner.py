"""Runs at points of an inverse problem, recorded in the run table; compilation before the first run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

import explicit
from dic.processes import PendingResult
from doe import Box, Design, full_factorial, latin_hypercube
from explicit import Response
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.forward import Forward
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction, predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.path_noise import PATTERNS, FrontPath
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.run_table import CompletedRuns, Replicates, Runs, RunTable
from kolsky.inverse.settings import Numerics
from kolsky.inverse.work import Work

Mesh = tuple[int, int]
"""Elements across the radius and along the length."""


@dataclass(frozen=True)
class Runner:
    """Runs points of a problem under a path of the front face.

    A coarse mesh is too soft and too slow: it responds like the refined mesh at other parameters. All points
    passed in and out refer to the refined mesh.
    """

    problem: InverseProblem
    front: FrontPath
    table: RunTable
    """Table of every run. Runners made by `under` use the same table."""
    work: Work
    rng: np.random.Generator
    """Random generator of designs and replicates, used in the order of the calls."""
    offsets: Mapping[Mesh, FloatArray] = field(default_factory=dict)
    """Offset of a point for each mesh, [d], with which it responds like the refined mesh."""

    @classmethod
    def of(cls, problem: InverseProblem, work: Work) -> Runner:
        """A runner with the path fitted to the record and an empty table."""
        rng = np.random.default_rng(problem.settings.seed)
        return cls(problem, FrontPath(problem.prepared.path), RunTable(problem.box.names), work, rng)

    def under(self, front: FrontPath, offsets: Mapping[Mesh, FloatArray] | None = None) -> Runner:
        """The same runner with another path and, if given, other offsets. The table is shared."""
        return replace(self, front=front, offsets=self.offsets if offsets is None else offsets)

    @property
    def forward(self) -> Forward:
        """The shot prepared to run with the path."""
        forward = self.problem.prepared.forward
        return forward if forward.paths[0] is self.front.path else replace(forward, paths=(self.front.path,))

    def objective(self, counted: BoolArray, *, slowly: bool = False) -> Objective:
        """Chi-square over some outline points, with the path's noise and the prior."""
        problem = self.problem
        return Objective(problem.observations, counted, self.front.noise, prior=problem.prior, slowly=slowly)

    def offset(self, mesh: Mesh) -> FloatArray:
        """Offset of a mesh, shape [d]; zero if none is known."""
        return self.offsets.get(mesh, np.zeros(self.problem.box.dimension))

    def solver_values(self, points: FloatArray, mesh: Mesh) -> FloatArray:
        """The points at which a mesh is run, [n, d], clipped to the parameters' allowed ranges."""
        if mesh not in self.offsets:
            return points
        low, high = np.array([PARAMETERS[name].allowed for name in self.problem.box.names]).T
        return np.clip(points + self.offsets[mesh], low, high)

    def at(self, x: FloatArray, mesh: Mesh) -> dict[str, float]:
        """The named parameters run on a mesh for a point of shape [d]."""
        return self.problem.point(self.solver_values(x[None], mesh)[0])

    @property
    def front_jerks(self) -> FloatArray:
        """Changes of the path's jerk by its leading patterns of noise [m/s^3], shape [q, n_spans]."""
        return self.front.path.noise_patterns(PATTERNS)

    def design(self, box: Box) -> Design:
        """Seven levels of one parameter, or a Latin hypercube of twelve points for each of several."""
        if box.dimension == 1:
            return full_factorial(box, 7)
        return latin_hypercube(box, 12 * box.dimension, rng=self.rng, optimise=True)

    def respond(
        self,
        stage: str,
        points: FloatArray,
        numerics: Numerics,
        *,
        forward: Forward | None = None,
        motion: ArrayLike = 0,
        material: ArrayLike = 0,
        all_nodes: bool = False,
    ) -> Response:
        """Run points of shape [n, d] as part of a stage, without recording them in the table.

        They may lie outside the box. ``forward``: in place of the path's; `motion` and `material` refer to
        it.
        """
        values = self.problem.point(self.solver_values(points, numerics.mesh))
        with self.work.stage(stage, len(points)) as report:
            return (forward or self.forward).run(
                values, numerics, motion=motion, material=material, all_nodes=all_nodes, progress=report
            )

    def run(self, stage: str, points: FloatArray, numerics: Numerics, *, all_nodes: bool = False) -> Runs:
        """Run points of shape [n, d], also outside the box, and add them to the table."""
        problem, mesh = self.problem, numerics.mesh
        response = self.respond(stage, points, numerics, all_nodes=all_nodes)
        runs = Runs.of(problem.box.names, points, response, problem.observations)
        place = mesh, self.front.path, self.offset(mesh)
        self.table.add(stage, self.solver_values(points, mesh), runs, problem.observations, on=place)
        return runs

    def simulate(self, stage: str, design: Design, numerics: Numerics) -> CompletedRuns:
        """Run a design and record it; raises ValueError if no run completed."""
        runs = self.run(stage, design.points, numerics)
        return runs.completed(f"no run of the {stage} completed")

    def vectors(self, stage: str, points: FloatArray, numerics: Numerics, objective: Objective) -> FloatArray:
        """Data vectors of runs, [n, d] -> [n, k], see `Objective.reached`; NaN in the row of a failed run."""
        runs = self.run(stage, points, numerics)
        vectors = np.full((len(points), len(objective.data)), np.nan)
        if runs.prediction is not None:
            vectors[runs.rows] = objective.reached(runs.prediction)
        return vectors

    def on_surrogate_mesh(self) -> tuple[FloatArray, Prediction]:
        """Points and predictions of all completed runs on the surrogate's mesh under the path, in order."""
        mesh = self.problem.numerics.mesh
        return self.table.on(mesh, self.front.path, self.offset(mesh))

    def replicate(self, x: FloatArray, *, lesson: bool = True) -> PendingResult[Replicates]:
        """Run a point with `settings.replicates` other curves and the same number of other motions.

        They are drawn immediately, and run when the result is requested. No motion is drawn if the patterns
        of the path are known. ``x``: in parameter units, [d]. ``lesson``: True for the same number of further
        motions for the weights. The result raises ValueError if the reference run did not complete.
        """
        settings = self.problem.settings
        n = settings.replicates
        motions = 0 if self.front.noise.patterns is not None else n
        moved = 2 * motions if lesson else motions
        forward = self.problem.prepared.with_replicates(moved, self.rng, curves=n, path=self.front.path)
        scaled = len(forward.paths) - moved - 1
        motion = np.concatenate([np.arange(moved + 1), np.zeros(n, int), np.full(scaled, moved + 1)])
        material = np.concatenate([np.zeros(moved + 1, int), np.arange(1, n + 1), np.zeros(scaled, int)])
        numerics = self.problem.numerics.with_mesh(settings.replicate_mesh)
        points = np.tile(x, (len(motion), 1))

        def run() -> Replicates:
            response = self.respond(
                "noise", points, numerics, forward=forward, motion=motion, material=material
            )
            rows = np.flatnonzero(response.completed)
            if 0 not in rows:
                raise ValueError(f"the noise stage's reference run ended {response.describe(0)}")
            return Replicates(
                prediction=predict(response.select(rows), self.problem.observations),
                flyer=(rows > 0) & (rows <= motions),
                lesson=(rows > motions) & (rows <= moved),
                curve=(rows > moved) & (rows <= moved + n),
                scale=rows > moved + n,
                lost=response.n_samples - len(rows),
            )

        return PendingResult(run)

    def under_other_motions(
        self, points: FloatArray, jerks: FloatArray, numerics: Numerics
    ) -> list[Prediction | None]:
        """Run each point with the front face's path (row 0) and with others; None if the first fails.

        ``points``: in parameter units, shape [p, d]. ``jerks``: jerk of each other path minus that of the
        path [m/s^3], shape [n, n_spans], see `front_jerks`.
        """
        path, n = self.front.path, len(jerks)
        forward = replace(
            self.forward, paths=(path, *(replace(path, jerk=path.jerk + change) for change in jerks))
        )
        motion = np.tile(np.arange(n + 1), len(points))
        at = np.repeat(points, n + 1, axis=0)
        response = self.respond("noise", at, numerics, forward=forward, motion=motion)
        predictions: list[Prediction | None] = []
        for first in range(0, len(motion), n + 1):
            rows = first + np.flatnonzero(response.completed[first : first + n + 1])
            whole = len(rows) > 0 and rows[0] == first
            predictions.append(predict(response.select(rows), self.problem.observations) if whole else None)
        return predictions


RUNS_OF_A_DESIGN = 64
"""Number of runs of a design. Designs run in vector lanes; a few runs are made one by one."""


def compile_for(problem: InverseProblem, work: Work) -> None:
    """Compile the solver in parallel for single runs, a design, the refined mesh and the other element."""
    numerics = problem.numerics

    def of(numerics: Numerics, runs: int) -> explicit.Problem:
        point = problem.point(problem.box.lower)
        columns = {name: np.full(runs, value) for name, value in point.items()}
        return problem.prepared.forward.problem(columns, numerics)

    explicit.compile_time_loops(
        [of(numerics, 1), of(numerics, RUNS_OF_A_DESIGN), of(problem.refined, 1)],
        also=[lambda: of(numerics.with_other_element(), 1)],
        device=numerics.device,
        threads=numerics.threads,
        progress=lambda done, total: work.progress("compile", done, total),
    )
