"""Data vectors with an input changed, on the refined mesh, and the residual of a correct model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from explicit import Response, Stepping
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.diagnosis.cause_fit import ExpectedResidual
from kolsky.diagnosis.cause_inputs import changed_vector, radii
from kolsky.inverse.forward import material_law
from kolsky.inverse.observations import Observations
from kolsky.inverse.parameters import PARAMETERS, any_slides
from kolsky.inverse.path_noise import PATTERNS
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics
from kolsky.inverse.work import Launch, run_side_by_side
from kolsky.shot.corrections import changed_curve
from kolsky.shot.input_records import UNCHANGED, Cause, Change

MOST_POINTS = 800
"""Maximum number of compared outline points. Neighbours in a frame give the same information."""
MOST_KEPT = 128
"""Number of latest runs kept in memory, because a search returns to the end of its last step."""
MOST_STEPS = 12
"""A run fails if it needs this many times the time steps of the run at the answer. Ten times the stiffness,
the largest scanned value, needs six times the steps. A run with more steps crushes the specimen."""
SHARES = {"damping": 1e-6, "friction": 0.02}
"""Steps for differences by a free parameter, in its unit. Other parameters use 1 % of their value."""


@dataclass(frozen=True)
class Point:
    """One simulation: free parameters and a changed input."""

    x: FloatArray
    """Free parameters in SI, then the coordinate of a free input, if any, shape [d]."""
    changed: Change = UNCHANGED


class CauseModel:
    """Data vectors at points on the surrogate's mesh, corrected by a run on the refined mesh.

    ``x``, ``refined``: point of that run, shape [d], and the run, a batch of one. ``first``: an input that is
    free in addition to the parameters, or None; its coordinate is the last entry of every x. ``numerics``:
    another mesh than the surrogate's. Raises ValueError if the run at `x` fails on its mesh.
    """

    def __init__(
        self,
        runner: Runner,
        x: FloatArray,
        refined: Response,
        first: Cause | None = None,
        numerics: Numerics | None = None,
    ) -> None:
        self.runner, self.x, self.refined, self.first = runner, x, refined, first
        self.numerics = numerics or runner.problem.numerics
        box = runner.problem.box
        self.lower, self.upper = np.array(box.lower), np.array(box.upper)
        if first is not None:
            self.lower = np.append(self.lower, first.lowest)
            self.upper = np.append(self.upper, first.highest)
        self.observations, self.offset = _thinned(runner.problem.observations, runner.front.noise.offset)
        self._recent: dict[tuple[object, object], Response | None] = {}
        self._most_steps = Stepping.max_steps
        reference = self.respond([Point(x)])[0]
        if reference is None:
            raise ValueError("the run at the answer did not complete on the surrogate's mesh")
        self.reference: Response = reference
        self._most_steps = MOST_STEPS * int(reference.steps[0])
        self._shifts: dict[tuple[float, ...], FloatArray] = {}
        self._radii: dict[tuple[float, ...], list[FloatArray]] = {}

    @property
    def data(self) -> FloatArray:
        """The measured data, shape [k]."""
        return np.concatenate([self.observations.force_mean, self.observations.centre_line.Z])

    def vectors(self, points: Sequence[Point]) -> FloatArray:
        """Predictions, shape [n, k]; NaN if a run did not complete or does not reach a point."""
        found = np.full((len(points), len(self.data)), np.nan)
        points = [self.whole(point) for point in points]
        seen: dict[object, FloatArray] = {}
        for i, (point, response) in enumerate(zip(points, self.respond(points), strict=True)):
            if response is not None:
                change = point.changed
                key = (id(response), change.sight)
                if key not in seen:
                    seen[key] = radii(change, response, self.observations)
                made = changed_vector(change, response, self.observations, known=seen[key])
                found[i] = made + self.shift(change)
        return found if self.offset is None else found - self.offset

    @cached_property
    def screen(self) -> CauseModel:
        """This model on the mesh of the replicates, to screen values before a few are tried on this mesh."""
        mesh = self.runner.problem.settings.replicate_mesh
        if mesh[0] >= self.numerics.mesh[0]:
            return self
        numerics = self.numerics.with_mesh(mesh)
        return CauseModel(self.runner, self.x, self.refined, self.first, numerics)

    def whole(self, point: Point) -> Point:
        """The point with the free input among its changes."""
        d = self.runner.problem.box.dimension
        if self.first is None or len(point.x) == d:
            return point
        return Point(point.x[:d], self.first.changed(float(point.x[d])).then(point.changed))

    def refined_run(self, point: Point) -> Response | None:
        """A run on the refined mesh; None if it does not complete."""
        launch = self._launch([self.whole(point)], self.runner.problem.refined)
        (response,) = run_side_by_side([launch])
        return response if response.outcomes[0].ok else None

    def shift(self, change: Change) -> FloatArray:
        """Correction by the refined mesh at the answer with the same change, shape [k]."""
        if change.seen not in self._shifts:
            o, both = self.observations, (self.refined, self.reference)
            if change.sight not in self._radii:
                self._radii[change.sight] = [radii(change, one, o) for one in both]
            known = zip(both, self._radii[change.sight], strict=True)
            fine, coarse = (changed_vector(change, one, o, known=at) for one, at in known)
            self._shifts[change.seen] = fine - coarse
        return self._shifts[change.seen]

    def respond(self, points: Sequence[Point]) -> list[Response | None]:
        """One response per point; None for a run that did not complete.

        Runs with the same mesh and laws form one launch, and all launches run in parallel. Points share a run
        if only its processing differs. Recent runs are not repeated.
        """
        points = [self.whole(point) for point in points]
        keys = [_key(self.runner, point) for point in points]
        found = {key: self._recent[key] for key in keys if key in self._recent}
        fresh: dict[object, dict[tuple[object, object], Point]] = {}
        for key, point in zip(keys, points, strict=True):
            if key not in found:
                fresh.setdefault(key[0], {})[key] = point
        made = run_side_by_side([self._launch([*group.values()]) for group in fresh.values()])
        for group, response in zip(fresh.values(), made, strict=True):
            for row, key in enumerate(group):
                found[key] = response.select([row]) if response.outcomes[row].ok else None
        self._recent = dict([*self._recent.items(), *found.items()][-MOST_KEPT:])
        return [found[key] for key in keys]

    def _launch(self, points: Sequence[Point], numerics: Numerics | None = None) -> Launch:
        problem, path = self.runner.problem, self.runner.front.path
        motions = {point.changed.path: None for point in points}
        paths = tuple(path if m == (1.0, 1.0) else path.scaled(m[0]).faster(1.0 / m[1]) for m in motions)
        curves = {tuple(sorted(point.changed.curve.items())): None for point in points}
        forward, shot = self.runner.forward, self.runner.forward.shot
        factors = points[0].changed.specimen
        if factors:
            specimen = {name: factor * getattr(shot.specimen, name) for name, factor in factors.items()}
            shot = replace(shot, specimen=replace(shot.specimen, **specimen))
            forward = replace(forward, shot=shot)
        curve = shot.curve
        laws = tuple(material_law(changed_curve(curve, dict(c))) if c else forward.laws[0] for c in curves)
        forward = replace(forward, paths=paths, laws=laws)
        if numerics is None:
            numerics, forward = self.numerics, replace(forward, most_steps=self._most_steps)
        at = self.runner.solver_values(np.array([p.x for p in points]), numerics.mesh)
        rows = [{**problem.point(x), **p.changed.values} for p, x in zip(points, at, strict=True)]
        named = {name for row in rows for name in row}
        declared = {name: PARAMETERS[name].held(shot) for name in named}
        values = {name: np.array([row.get(name, declared[name]) for row in rows]) for name in named}
        motion = [list(motions).index(point.changed.path) for point in points]
        material = [list(curves).index(tuple(sorted(point.changed.curve.items()))) for point in points]
        return Launch(forward, values, numerics, motion, material)

    def slopes(self, x: FloatArray, changed: Change) -> list[Point]:
        """The neighbours of a point for `columns`, one step along each free parameter."""
        return [Point(x + step, changed) for step in np.diag(self.steps(x))]

    def steps(self, x: FloatArray) -> FloatArray:
        """Steps for differences by the free parameters, inside the design, shape [d]."""
        steps = [
            0.01 * (0.5 - x[i]) if name == "poisson" else SHARES.get(name, 0.01 * abs(x[i]) or 1e-3)
            for i, name in enumerate(self.runner.problem.box.names)
        ]
        if self.first is not None and len(x) > len(steps):
            steps.append(self.first.step)
        up = np.array(steps)
        return np.where(x + up > self.upper[: len(x)], -up, up)


def _thinned(o: Observations, offset: FloatArray | None) -> tuple[Observations, FloatArray | None]:
    """The observations with fewer outline points, evenly chosen, and a change of their bins and points."""
    n = len(o.centre_line.Z)
    if n <= MOST_POINTS:
        return o, offset
    kept: IntArray = np.linspace(0, n - 1, MOST_POINTS).round().astype(np.int64)
    if offset is not None:
        offset = np.concatenate([offset[: o.n_force], offset[o.n_force :][kept]])
    return replace(o, centre_line=o.centre_line.select(kept)), offset


def _key(runner: Runner, point: Point) -> tuple[object, object]:
    """Key of a run: the part common to all runs of its launch, and the part of this run."""
    named = [*runner.problem.settings.held, *runner.problem.box.names, *point.changed.values]
    change = point.changed
    # A closed-form law and a table cannot run in one launch.
    launch = (tuple(sorted(change.specimen.items())), any_slides(named), bool(change.curve))
    values, curve = (tuple(sorted(one.items())) for one in (change.values, change.curve))
    run = (tuple(point.x.tolist()), values, change.path, curve)
    return launch, run


FIRST_ORDER = 1.0
"""Order of the mesh error's common part. It is 1, not 2, if the side surface rolls onto a platen."""
SECOND_ORDER = 2.0
"""Order of the error of the ringing. Its phase differs from mesh to mesh."""
AVERAGED_BINS = 7
"""Number of bins over which the size of the mesh error is averaged."""


def expected_residual(model: CauseModel, numerics: Numerics) -> ExpectedResidual:
    """The expected residual of a correct model at the answer, from the data and both meshes' runs there.

    ``numerics``: the mesh on which the flyer's noise is propagated.
    """
    o, n = model.observations, model.observations.n_force
    meshes = model.runner.problem.settings
    ratio = meshes.refined_mesh[0] / meshes.numerics.mesh[0]
    moved = np.nan_to_num(model.shift(UNCHANGED))
    rough = moved / (ratio**SECOND_ORDER - 1.0)
    ringing = np.sqrt(np.convolve(rough[:n] ** 2, np.ones(AVERAGED_BINS) / AVERAGED_BINS, "same"))
    noise = np.concatenate([o.force_sigma, o.centre_line.sigma])
    sigma = np.hypot(noise, np.concatenate([ringing, np.abs(rough[n:])]))
    common = moved / (ratio**FIRST_ORDER - 1.0)
    shared = () if o.centre_line.modes is None else np.pad(o.centre_line.modes, ((0, 0), (n, 0)))
    patterns = np.column_stack([common, _flyer_noise(model, numerics), *shared])
    times = np.concatenate([o.force_times, o.centre_line.time])
    width = float(np.diff(o.bins.edges).mean())
    channel = (np.arange(len(times)) >= n).astype(np.int64)
    block = ((times - times.min()) / width).astype(np.int64)
    return ExpectedResidual(sigma=sigma, patterns=patterns, channel=channel, block=block, tau=np.zeros(2))


def _flyer_noise(model: CauseModel, numerics: Numerics) -> FloatArray:
    """Changes of the data vector by one standard deviation of each pattern of the path, shape [k, q]."""
    runner, path = model.runner, model.runner.front.path
    paths = (path, *(replace(path, jerk=path.jerk + jerk) for jerk in path.noise_patterns(PATTERNS)))
    forward = replace(runner.forward, paths=paths)
    response = forward.run(runner.at(model.x, numerics.mesh), numerics, motion=np.arange(len(paths)))
    vectors = np.full((len(paths), len(model.data)), np.nan)
    for i in np.flatnonzero(response.completed).tolist():
        vectors[i] = changed_vector(UNCHANGED, response, model.observations, i)
    return np.asarray(np.nan_to_num(vectors[1:] - vectors[0]).T)
