"""The analysis of a sweep: maps of the misfits, main effects, shares of their variance."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.views import ResultViews
from doe import Box, CostSurrogate, SearchResult, nelder_mead
from doe.sensitivity import SobolIndices, sobol_indices
from doe.surrogates import SurrogateError
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import predict
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.run_table import DesignTable
from kolsky.inverse.settings import Numerics
from kolsky.shot.records import Shot
from kolsky.studies.sweep import Sweep, least_run, misfit_sum

OUTPUTS = {"Phi_F": "N", "Phi_S": "1", "Phi": "1"}
"""Misfits in the analysis, Eqs. (M.3) to (M.5), and their units."""
MOST_FITTED = 400
"""Maximum number of runs used for an interpolant, because its equations are dense. The other runs test it."""
LARGEST_ERROR = 0.2
"""Largest accepted error (rms) of an interpolant, divided by the standard deviation of the runs. Its square,
4 % of the variance, is the uncertainty of the variance shares."""
LEVELS = 41
"""Number of points along each parameter of an effect and of a map."""
MOST_FORCES = 64
"""Maximum number of runs along one parameter with forces that are simulated again. This takes about one
second."""
SAMPLE, SEED = 1024, 1
"""Number of points of each sample of the indices, and seed of all samples."""


@dataclass(frozen=True)
class Effect:
    """The mean of an output over all other parameters, along one parameter."""

    x: FloatArray
    """Values of the parameter [SI], shape [LEVELS]."""
    mean: FloatArray
    """Mean of the output, shape [LEVELS]."""
    low: FloatArray
    """Tenth percentile over the others, shape [LEVELS]."""
    high: FloatArray
    """Ninetieth percentile, shape [LEVELS]."""


@dataclass(frozen=True)
class Output:
    """One misfit over the box."""

    name: str
    """Key of `OUTPUTS`."""
    values: FloatArray
    """Values at every run, NaN if it did not complete, shape [n_runs]."""
    error: float
    """Error of the interpolant, divided by the standard deviation of the runs [-]. It is the root mean square
    of leave-one-out residuals. With many runs, it is that of the runs not used for it."""
    refused: str
    """The reason why the interpolant is not used. Empty if it is accurate enough."""
    surrogate: CostSurrogate | None
    """The interpolant. None if it could not be computed, or if it is not accurate enough."""
    effects: dict[str, Effect]
    """Main effects by parameter; empty without an interpolant."""


@dataclass(frozen=True)
class ForcesAlong:
    """Forces of the completed runs along one parameter."""

    x: FloatArray
    """Values of the parameter [SI], increasing, shape [n]."""
    steps: NDArray[np.int64]
    """Time steps of each run, shape [n]."""
    time: FloatArray
    """Recorded times [s], shape [P]."""
    force: FloatArray
    """Simulated transmitted force [N], shape [n, P]."""
    measured: FloatArray
    """Measured force [N], shape [P]."""


@dataclass(frozen=True)
class SweepAnalysis(ResultViews):
    """The analysis of a complete sweep."""

    shot: str
    box: Box
    table: DesignTable
    outputs: dict[str, Output]
    """The misfits by name. Without an outline, only those of the force."""
    indices: SobolIndices | None
    """Shares of the variance of the outputs with an interpolant. None without an interpolant, or for one
    parameter."""
    best: int | None
    """Run with the smallest Phi (Phi_F without an outline). None if no run completed."""
    optimum: SearchResult | None = None
    """Minimum of the interpolant of `judged`, in its unit. None without an accurate interpolant."""
    forces: ForcesAlong | None = None
    """Forces of a sweep over one parameter, if requested; see `forces_along`."""

    @property
    def judged(self) -> str:
        """The output that ranks the runs: "Phi", or "Phi_F" without an outline."""
        return "Phi" if "Phi" in self.outputs else "Phi_F"

    def map(self, output: str, first: str, second: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """An output in the plane of two parameters.

        The other parameters have the values of the best run.

        Returns: values of the two parameters [SI], shape [LEVELS]. Returns: the output, shape [LEVELS,
        LEVELS], rows along y. Raises ValueError if the output has no interpolant.
        """
        surrogate = self.outputs[output].surrogate
        if surrogate is None or self.best is None:
            raise ValueError(f"{output} has no interpolant: {self.outputs[output].refused}")
        i, j = self.box.names.index(first), self.box.names.index(second)
        u = np.tile(self.box.unit(self.table.points[self.best]), (LEVELS, LEVELS, 1))
        u[..., i], u[..., j] = np.meshgrid(np.linspace(0.0, 1.0, LEVELS), np.linspace(0.0, 1.0, LEVELS))
        points = self.box.scale(u)
        values = surrogate.predict(points.reshape(-1, self.box.dimension))
        return points[0, :, i], points[:, 0, j], values.reshape(LEVELS, LEVELS)


def analyse_sweep(shot: str, box: Box, table: DesignTable) -> SweepAnalysis:
    """Interpolate the misfits of a sweep's runs and analyse the complete sweep.

    Parameters
    ----------
    shot
        Name of the shot.
    box
        The design's box.
    table
        Every run.
    """
    outputs = {name: _output(name, box, table.points, values) for name, values in _misfits(table).items()}
    best = least_run(table)
    judged = outputs.get("Phi", outputs.get("Phi_F"))
    return SweepAnalysis(
        shot=shot, box=box, table=table, outputs=outputs, indices=_indices(box, outputs), best=best,
        optimum=None if judged is None or best is None else _optimum(judged, box, table.points[best]),
    )  # fmt: skip


def _misfits(table: DesignTable) -> dict[str, FloatArray]:
    """Misfits of `OUTPUTS` that a run has, shape [n_runs]. Without an outline, only those of the force."""
    found = dict(zip(OUTPUTS, (table.phi_force, table.phi_shape, misfit_sum(table)), strict=True))
    return {name: values for name, values in found.items() if np.isfinite(values).any()}


def _optimum(output: Output, box: Box, start: FloatArray) -> SearchResult | None:
    """Minimum of an interpolant by downhill simplex, from the best run and the best point of a scan."""
    surrogate = output.surrogate
    if surrogate is None:
        return None
    scan = box.scale(np.random.default_rng(SEED).random((SAMPLE, box.dimension)))
    starts = (start, scan[int(np.argmin(surrogate.predict(scan)[:, 0]))])
    return min((nelder_mead(surrogate.cost, box, start=x) for x in starts), key=lambda end: end.value)


def surface_optimum(analysis: SweepAnalysis) -> dict[str, Any]:
    """Minimum of the interpolant in plain types: point, value and bounds reached. If there is none, the
    reason. The value is that of Phi. Without an outline, it is Phi_F in newtons."""
    found = analysis.optimum
    if found is None:
        output = analysis.outputs.get(analysis.judged)
        return {"surface_optimum": None, "no_surface": output.refused if output else "no run completed"}
    at_bound = {"surface_at_bound": found.at_bound} if found.at_bound else {}
    key = "surface_phi" if analysis.judged == "Phi" else "surface_phi_force"
    return {"surface_optimum": analysis.box.as_dict(found.x), key: found.value, **at_bound}


def _output(name: str, box: Box, points: FloatArray, values: FloatArray) -> Output:
    done = np.flatnonzero(np.isfinite(values))
    _, single = np.unique(points[done], axis=0, return_index=True)
    rows = np.random.default_rng(SEED).permutation(done[single])
    fitted, rest = rows[:MOST_FITTED], rows[MOST_FITTED:]
    spread = float(values[rows].std())
    if len(rows) < 4 or spread == 0.0:
        return _without(name, values, "fewer than four runs differ")
    try:
        surrogate = CostSurrogate.fit(box, points[fitted], values[fitted])
    except SurrogateError as refusal:
        return _without(name, values, str(refusal))
    if len(rest):
        error = float(np.sqrt(np.mean((surrogate.predict(points[rest])[:, 0] - values[rest]) ** 2))) / spread
    else:
        error = surrogate.loo_rms / spread
    if not error <= LARGEST_ERROR:
        return _without(name, values, _too_large(error, len(fitted), box.dimension), error)
    return Output(name, values, error, "", surrogate, _effects(box, surrogate))


def _too_large(error: float, runs: int, dimension: int) -> str:
    """The reason for rejection. The runs needed assume an error of second order in their distance."""
    needed = int(np.ceil(runs * (error / LARGEST_ERROR) ** (dimension / 2.0)))
    return (
        f"an interpolant of {runs} runs is wrong by {100.0 * error:.0f} % of their standard deviation, at "
        f"most {100.0 * LARGEST_ERROR:.0f} % are allowed; about {needed} runs would be enough if the "
        "misfit is smooth"
    )


def _without(name: str, values: FloatArray, why: str, error: float = float("nan")) -> Output:
    return Output(name, values, error, why, None, {})


def _effects(box: Box, surrogate: CostSurrogate) -> dict[str, Effect]:
    others = np.random.default_rng(SEED).random((256, box.dimension))
    effects = {}
    for i, name in enumerate(box.names):
        u = np.repeat(others[None], LEVELS, axis=0)
        u[..., i] = np.linspace(0.0, 1.0, LEVELS)[:, None]
        points = box.scale(u)
        values = surrogate.predict(points.reshape(-1, box.dimension)).reshape(LEVELS, -1)
        low, high = np.percentile(values, (10.0, 90.0), axis=1)
        effects[name] = Effect(points[:, 0, i], values.mean(axis=1), low, high)
    return effects


def _indices(box: Box, outputs: dict[str, Output]) -> SobolIndices | None:
    able = {name: output.surrogate for name, output in outputs.items() if output.surrogate is not None}
    if not able or box.dimension < 2:
        return None
    return sobol_indices(
        box,
        lambda points: np.column_stack([surrogate.predict(points)[:, 0] for surrogate in able.values()]),
        outputs=tuple(able),
        n=SAMPLE,
        rng=SEED,
    )


def forces_along(shot: Shot, swept: Sweep, numerics: Numerics) -> ForcesAlong | None:
    """Simulate the levels of one parameter again to get the forces.

    The ledger stores only misfits.

    Returns: None for several parameters, for more than `MOST_FORCES` runs, or if no run completed.
    """
    if len(swept.table.names) != 1 or len(swept.table.points) > MOST_FORCES:
        return None
    prepared, (name,) = prepare_shot(shot), swept.table.names
    x = np.unique(swept.table.points[:, 0])
    response = prepared.forward.run({**swept.held, name: x}, numerics)
    rows = np.flatnonzero(response.completed)
    if not rows.size:
        return None
    prediction, force = predict(response.select(rows), prepared.observations), prepared.observations.force
    return ForcesAlong(x[rows], response.steps[rows], force.time, prediction.force, force.force)
