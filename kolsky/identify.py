"""The inverse method: design -> batch of runs -> surrogate of the response -> search -> finer mesh.

Stages of `identify`:

1. A design over the free parameters is run on the surrogate mesh; a surrogate of the *response* (force
   bins and profile points) gives a first optimum.
2. A second, small design around it makes the surrogate exact where it matters.
3. The optimum is run on the refined mesh. The difference of the two meshes at one point shifts the
   surrogate, the search is repeated, and the new optimum is confirmed by a real run on the refined mesh.
4. Noise: the residuals' covariance (see `kolsky.objective`), and replicates of the flyer's motion and of
   the quasi-static curve drawn from their own noise. Numerics: the shift between the meshes.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doe import Box, CostSurrogate, Design, ResponseSurrogate, from_points, full_factorial, latin_hypercube
from doe import nelder_mead as minimise
from kolsky.cautions import cautions
from kolsky.forward import Forward, Numerics
from kolsky.identification import (
    Comparison,
    Estimate,
    Identification,
    Route,
    SurrogateCurve,
    Verdict,
)
from kolsky.misfit import Observations, Prediction, predict, terms
from kolsky.objective import Objective, Part
from kolsky.parameters import PARAMETERS, design_box
from kolsky.prepare import Prepared, prepare
from kolsky.provenance import provenance
from kolsky.shots import Shot
from kolsky.table import RunTable

FloatArray = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

ORDER = 2.0
"""Order of the mesh error used for the refined mesh's remaining error; fitted in the verification manual."""
SAFETY_FACTOR = 1.25
"""Factor on the extrapolated mesh error (Roache's grid convergence index with a fitted order)."""
LOCAL_FRACTION = 0.12
"""Edge of the second design's box over the first one's."""
CONFIRMED = 0.2
"""An optimum is confirmed when the check run moves it by less than this share of the residuals' sigma."""
MOST_REFINEMENTS = 3
"""Most second designs, each around the optimum of the last one."""
MOST_CHECKS = 4
"""Most rounds on the refined mesh."""
COMPANION = 0.05
"""Distance of the first check's companion run over the second design's edge."""


@dataclass(frozen=True)
class Settings:
    """What `identify` is asked to do."""

    free: Mapping[str, tuple[float, float] | None] = field(default_factory=lambda: {"stiffness_factor": None})
    """Free parameters and the bounds of their design; None takes the default bounds."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Parameters held at another value than the shot's."""
    numerics: Numerics = field(default_factory=Numerics)
    """The surrogate's mesh and the arithmetic."""
    refined_mesh: tuple[int, int] = (48, 64)
    """The mesh the answer is given on."""
    replicates: int = 16
    """Draws of the flyer's motion and of the curve, each; 0 leaves their noise out of the interval."""
    replicate_mesh: tuple[int, int] = (16, 22)
    """The mesh of the replicates: a difference of two runs needs no fine one."""
    seed: int = 1
    """Seed of every random draw."""


def identify(
    shot: Shot, settings: Settings | None = None, *, progress: Progress | None = None
) -> Identification:
    """Identify the free parameters of a shot.

    Parameters
    ----------
    shot
        A loaded shot.
    settings
        What is free, what is held, numerical choices.
    progress : callable, optional
        Called as ``progress(stage, runs done, runs in the stage)``.

    Returns
    -------
    Identification
        Estimates with intervals and verdicts, the check run beside the data, every run of the design.

    Raises
    ------
    ValueError
        If a parameter is unknown, a bound or value is outside its range, or no run of the design
        completed.
    """
    return _Identify(shot, settings or Settings(), progress or (lambda stage, done, total: None)).run()


class _Identify:
    """One identification on its way; every stage adds its runs to the table."""

    def __init__(self, shot: Shot, settings: Settings, progress: Progress) -> None:
        self.shot, self.settings, self.progress = shot, settings, progress
        self.box = design_box(settings.free)
        clash = set(settings.free) & set(settings.held)
        if clash:
            raise ValueError(f"{', '.join(sorted(clash))}: a parameter is either free or held")
        self.rng = np.random.default_rng(settings.seed)
        self.seconds: dict[str, float] = {}
        self.prepared: Prepared = prepare(shot)
        self.forward: Forward = self.prepared.forward
        self.observations: Observations = self.prepared.observations
        self.table = RunTable(self.box.names)
        self.lost_replicates = 0

    def run(self) -> Identification:
        settings = self.settings
        coarse, fine = settings.numerics, settings.numerics.with_mesh(settings.refined_mesh)
        wide = self._design(self.box)
        predictions = self._simulate("design", wide, coarse)
        objective, surrogate = self._surrogate(self.box, predictions)
        first, objective = self._search(self.box, objective, _Corrected(surrogate).predict)

        for _ in range(MOST_REFINEMENTS):
            box = self.box.around(first, LOCAL_FRACTION)
            local = self._simulate("refinement", self._design(box), coarse)
            objective, surrogate = self._surrogate(box, local)
            on_coarse, objective = self._search(box, objective, _Corrected(surrogate).predict)
            if not _on_edge(on_coarse, box) or _on_edge(on_coarse, self.box):
                break
            first = on_coarse

        # The first check has a companion beside it: their difference corrects the surrogate's slope.
        beside = on_coarse.copy()
        # It lies below, because a coarse mesh is too soft and its optimum too high (verification manual).
        down = min(COMPANION * (box.upper[0] - box.lower[0]), on_coarse[0] - self.box.lower[0])
        beside[0] -= down if down > 0.0 else -COMPANION * (box.upper[0] - box.lower[0])
        wave = np.stack([on_coarse, beside])
        model = _Corrected(surrogate)
        optimum = on_coarse
        for _ in range(MOST_CHECKS):
            check = self._simulate("check", from_points(self.box, wave), fine, all_nodes=True)
            if len(check.points) < len(wave):
                raise ValueError("a run on the refined mesh did not complete; see its outcome in a sweep")
            checked = objective.vectors(check.prediction)
            guess = model.predict(optimum)[0]
            for point, vector in zip(check.points[::-1], checked[::-1], strict=True):
                model = model.through(point, vector)
            better, objective = self._search(box, objective, model.predict)
            jacobian = _jacobian(model.predict, box, better)
            sigma = np.sqrt(np.diag(objective.covariance(jacobian, model.predict(better)[0])))
            moved = float(np.max(np.abs(better - optimum) / sigma))
            if moved <= CONFIRMED and len(wave) == 1:
                break
            optimum, wave = better, better[None]
        parts = {"force and shape": sigma, **self._input_noise(optimum, objective, jacobian)}
        ratio = settings.refined_mesh[0] / coarse.mesh[0]
        numerical = 0.5 * SAFETY_FACTOR * np.abs(optimum - on_coarse) / (ratio**ORDER - 1.0)
        n_force = objective.n_force
        found = Identification(
            shot=self.shot.name,
            estimates=self._estimates(
                optimum,
                parts,
                numerical,
                optimum - on_coarse,
                confirmed=moved <= CONFIRMED and not _on_edge(optimum, box),
            ),
            fixed=self._fixed(),
            routes=self._routes(box, objective, model.predict, jacobian),
            terms=terms(check.prediction, self.observations, 0),
            comparison=self._comparison(check.prediction),
            response=check.response,
            mesh=coarse.mesh,
            refined_mesh=fine.mesh,
            design=self.table.build(self.box),
            curves=self._curves(box, objective, model.predict, optimum),
            surrogate={
                **_quality(surrogate, n_force),
                "check_shift_sigmas": moved,
                "check_force": _rms((checked[0] - guess)[:n_force]),
                "check_shape": _rms((checked[0] - guess)[n_force:]),
                "counted_points": float(objective.counted.sum()),
                "force_discrepancy": objective.force_discrepancy,
                "shape_discrepancy": objective.shape_discrepancy,
            },
            seconds=self.seconds,
            provenance=self._provenance(),
        )
        warnings = cautions(
            found,
            checks=self.prepared.checks,
            interface=self.shot.interface,
            lost_replicates=self.lost_replicates,
        )
        return replace(found, warnings=warnings)

    # ---- stages -------------------------------------------------------------------------------------

    def _design(self, box: Box) -> Design:
        if box.dimension == 1:
            return full_factorial(box, 7)
        return latin_hypercube(box, 12 * box.dimension, rng=self.rng, optimise=True)

    def _simulate(
        self, stage: str, design: Design, numerics: Numerics, *, all_nodes: bool = False
    ) -> "_Runs":
        started, done = time.perf_counter(), 0

        def report(n: int) -> None:
            nonlocal done
            done += n
            self.progress(stage, done, len(design))

        self.progress(stage, 0, len(design))
        points = {name: design.points[:, i] for i, name in enumerate(self.box.names)}
        response = self.forward.run(
            {**self.settings.held, **points}, numerics, all_nodes=all_nodes, progress=report
        )
        rows = np.flatnonzero(response.completed)
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - started
        if len(rows) == 0:
            ended = response.outcomes[0]
            raise ValueError(f"no run of the {stage} completed: {ended.cause}. Cure: {ended.cure}")
        kept = response.select(rows)
        prediction = predict(kept, self.observations)
        self.table.add(stage, design.points, response.outcomes, rows, prediction, self.observations)
        return _Runs(design.points[rows], prediction, kept)

    def _surrogate(self, box: Box, runs: "_Runs") -> tuple[Objective, ResponseSurrogate]:
        counted = np.asarray(runs.prediction.inside.all(axis=0))
        objective = Objective(self.observations, counted)
        use = box.contains(runs.points)
        vectors = objective.vectors(runs.prediction)
        return objective, ResponseSurrogate.fit(box, runs.points[use], vectors[use], scale=objective.noise)

    def _search(
        self, box: Box, objective: Objective, model: Callable[[FloatArray], FloatArray], part: Part = "joint"
    ) -> tuple[FloatArray, Objective]:
        """Optimum and the objective with the discrepancies of that optimum (they depend on each other)."""
        start = None
        for _ in range(3):
            weighted = objective

            def cost(x: FloatArray, weighted: Objective = weighted) -> float:
                return float(weighted.chi2(model(x)[0], part))

            result = minimise(cost, box, start=start, tolerance=1e-7)
            start = result.x
            objective = objective.with_discrepancy(model(start)[0])
        return result.x, objective

    def _input_noise(
        self, optimum: FloatArray, objective: Objective, jacobian: FloatArray
    ) -> dict[str, FloatArray]:
        """Standard uncertainties from the noise of the flyer's motion and of the quasi-static curve."""
        n = self.settings.replicates
        if n == 0:
            return {}
        started = time.perf_counter()
        forward = self.prepared.with_replicates(n, self.rng)
        motion = np.concatenate([[0], np.arange(1, n + 1), np.zeros(n, dtype=int)])
        material = np.concatenate([[0], np.zeros(n, dtype=int), np.arange(1, n + 1)])
        done = 0

        def report(count: int) -> None:
            nonlocal done
            done += count
            self.progress("noise", done, 2 * n + 1)

        response = forward.run(
            {**self.settings.held, **dict(zip(self.box.names, optimum, strict=True))},
            self.settings.numerics.with_mesh(self.settings.replicate_mesh),
            motion=motion,
            material=material,
            progress=report,
        )
        rows = np.flatnonzero(response.completed)
        self.lost_replicates = response.n_samples - len(rows)
        if 0 not in rows:
            ended = response.outcomes[0]
            raise ValueError(f"the noise stage's reference run failed: {ended.cause}. Cure: {ended.cure}")
        vectors = objective.vectors(predict(response.select(rows), self.observations))
        change = np.nan_to_num(vectors - vectors[0])  # a point that one replicate leaves adds nothing
        moves = change @ objective.gain(jacobian).T
        self.seconds["noise"] = time.perf_counter() - started
        flyer, curve = (rows > 0) & (rows <= n), rows > n
        return {
            "flyer motion": np.sqrt((moves[flyer] ** 2).mean(axis=0)),
            "material curve": np.sqrt((moves[curve] ** 2).mean(axis=0)),
        }

    # ---- what is reported ---------------------------------------------------------------------------

    def _estimates(
        self,
        optimum: FloatArray,
        parts: dict[str, FloatArray],
        numerical: FloatArray,
        shift: FloatArray,
        *,
        confirmed: bool,
    ) -> dict[str, Estimate]:
        found = {}
        for i, name in enumerate(self.box.names):
            noise = {source: float(sigma[i]) for source, sigma in parts.items()}
            total = float(np.sqrt(sum(sigma**2 for sigma in noise.values())))
            width = self.box.upper[i] - self.box.lower[i]
            if _on_edge(optimum[i : i + 1], self.box, i):
                verdict = Verdict.AT_BOUND
            elif 4.0 * total > width:
                verdict = Verdict.NOT_SEEN
            else:
                verdict = Verdict.IDENTIFIED if confirmed else Verdict.DISAGREEING
            found[name] = Estimate(
                name=name,
                unit=PARAMETERS[name].unit,
                value=float(optimum[i]),
                sigma_noise=total,
                sigma_numerical=float(numerical[i]),
                mesh_shift=float(shift[i]),
                noise_parts=noise,
                outcome=verdict,
            )
        return found

    def _routes(
        self,
        box: Box,
        objective: Objective,
        model: Callable[[FloatArray], FloatArray],
        jacobian: FloatArray,
    ) -> tuple[Route, ...]:
        routes = []
        names: tuple[tuple[str, Part], ...] = (
            ("joint", "joint"),
            ("force only", "force"),
            ("shape only", "shape"),
        )
        for label, part in names:
            best, weighted = self._search(box, objective, model, part)
            covariance = weighted.covariance(_jacobian(model, box, best), model(best)[0], part)
            routes.append(
                Route(
                    name=label,
                    parameters=box.as_dict(best),
                    cost=float(weighted.chi2(model(best)[0], part)),
                    sigma=dict(zip(box.names, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
                )
            )
        points, cost = self.table.paper_cost()
        paper = CostSurrogate.fit(self.box, points, cost)
        found = minimise(paper.cost, self.box, start=points[np.argmin(cost)])
        routes.append(Route("paper", self.box.as_dict(found.x), found.value, {}))
        return tuple(routes)

    def _curves(
        self, box: Box, objective: Objective, model: Callable[[FloatArray], FloatArray], optimum: FloatArray
    ) -> tuple[SurrogateCurve, ...]:
        curves = []
        for i, name in enumerate(box.names):
            x = np.linspace(box.lower[i], box.upper[i], 121)
            points = np.tile(optimum, (len(x), 1))
            points[:, i] = x
            vectors = model(points)
            force, shape = objective.mask("force"), objective.mask("shape")
            residual = np.abs(vectors - objective.data)
            samples = len(self.observations.force.time) / objective.n_force
            curves.append(
                SurrogateCurve(
                    parameter=name,
                    x=x,
                    chi2=objective.chi2(vectors),
                    phi_shape=(residual / objective.data)[:, shape].mean(axis=1),
                    phi_force=residual[:, force].sum(axis=1) * samples,
                )
            )
        return tuple(curves)

    def _comparison(self, prediction: Prediction) -> Comparison:
        bins = self.observations.bins
        return Comparison(
            force_time=0.5 * (bins.edges[1:] + bins.edges[:-1]),
            force_measured=bins.mean,
            force_sigma=bins.sigma,
            force_model=prediction.force_bins[0],
            centre_line=self.observations.centre_line,
            Z_model=prediction.Z[0],
            inside=prediction.inside[0],
            recorded=self.observations.force,
        )

    def _fixed(self) -> dict[str, float]:
        held = {name: p.held(self.shot) for name, p in PARAMETERS.items() if name not in self.box.names}
        return {**held, **dict(self.settings.held)}

    def _provenance(self) -> dict[str, Any]:
        sliding = "friction" in self.settings.free or "friction" in self.settings.held
        return provenance(self.shot, self.settings, self.prepared, sliding=sliding)


@dataclass(frozen=True)
class _Runs:
    """Completed runs of one stage."""

    points: FloatArray
    prediction: Prediction
    response: Any


@dataclass(frozen=True)
class _Corrected:
    """A surrogate made to agree with runs on another mesh: exactly at the last one, and in the slope
    between the last two (Broyden's update)."""

    surrogate: ResponseSurrogate
    anchor: FloatArray | None = None
    shift: FloatArray | float = 0.0
    slope: FloatArray | float = 0.0

    def predict(self, points: FloatArray) -> FloatArray:
        x = np.atleast_2d(points)
        change = 0.0 if self.anchor is None else (x - self.anchor) @ np.transpose(self.slope)
        return self.surrogate.predict(x, extrapolate=True) + self.shift + change

    def through(self, point: FloatArray, vector: FloatArray) -> "_Corrected":
        miss = vector - self.predict(point)[0]
        if self.anchor is None:
            return replace(self, anchor=point, shift=miss, slope=np.zeros((len(vector), len(point))))
        step = point - self.anchor
        if not step.any():
            return replace(self, shift=self.shift + miss)
        slope = self.slope + np.outer(miss, step) / (step @ step)
        moved = replace(self, anchor=point, slope=slope)
        return replace(moved, shift=self.shift + vector - moved.predict(point)[0])


def _jacobian(model: Callable[[FloatArray], FloatArray], box: Box, x: FloatArray) -> FloatArray:
    """Central differences of the surrogate, one-sided at a bound, shape [k, d]."""
    columns = []
    for i in range(box.dimension):
        step = 1e-3 * (box.upper[i] - box.lower[i])
        up, down = x.copy(), x.copy()
        up[i], down[i] = min(x[i] + step, box.upper[i]), max(x[i] - step, box.lower[i])
        columns.append((model(up)[0] - model(down)[0]) / (up[i] - down[i]))
    return np.array(columns).T


def _on_edge(x: FloatArray, box: Box, first: int = 0) -> bool:
    """Whether a coordinate (numbered from `first`) lies on a bound of the box."""
    lower, upper = (np.array(bound)[first : first + len(x)] for bound in (box.lower, box.upper))
    return bool((np.minimum(x - lower, upper - x) < 1e-5 * (upper - lower)).any())


def _quality(surrogate: ResponseSurrogate, n_force: int) -> dict[str, float]:
    loo = surrogate.loo_residuals
    return {"loo_force": _rms(loo[:, :n_force]), "loo_shape": _rms(loo[:, n_force:])}


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.asarray(x) ** 2)))
