"""What the stiffness factor would be with the other free parameters held at the shot's values."""

from __future__ import annotations

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.front_noise import replicate_uncertainty
from kolsky.inverse.linear_step import linear_step
from kolsky.inverse.objective import Objective
from kolsky.inverse.optimum import CorrectedSurrogate, jacobian
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.result import Estimate
from kolsky.inverse.search import HeldSearch, Search
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.uncertainty_results import HeldAnswer


def held_answer(found: Search, estimate: Estimate) -> HeldAnswer | None:
    """The stiffness factor of one run with the others held, and a step from there; None if there is no run.

    Parameters
    ----------
    found
        The search; its stages have run the replicates.
    estimate
        The stiffness factor with all of them free: the mesh's correction and the share of the numerics are
        taken from it.
    """
    held, fine = found.held, found.fine
    if held is None or held.refined is None:
        return None
    prediction = held.refined.prediction
    counted = fine.objective.counted & held.coarse.objective.counted & prediction.inside[0]
    objective = Objective(found.stages.observations, counted, slowly=True)
    vector = objective.vectors(prediction)[0]
    i = found.stages.box.names.index(MOVED)
    x = held.refined.x[[i]]
    model = CorrectedSurrogate(held.coarse.surrogate).predict
    slope = jacobian(model, held.coarse.box, held.coarse.x)[_entries(held.coarse.objective, counted)]
    objective = objective.with_discrepancy(vector)
    step = linear_step(objective, slope, vector, x)
    vector = vector + slope @ step
    objective = objective.with_discrepancy(vector)
    parts = [
        float(np.sqrt(objective.residual_covariance(slope, vector)[0, 0])),
        estimate.sigma_numerical,
        *_noise(found.stages, objective, slope),
        *_declared(found.stages, held, fine, objective, slope),
    ]
    return HeldAnswer(
        name=MOVED,
        held=dict(held.values),
        value=float(x[0] + step[0]) + estimate.mesh_correction,
        sigma=float(np.hypot.reduce(parts)),
        **_misfit(objective, vector, ""),
        **_misfit(fine.objective, fine.objective.vectors(fine.check.prediction)[0], "free_"),
    )


def _entries(objective: Objective, counted: BoolArray) -> BoolArray:
    """Which entries of an objective's data vector are among the force bins and some outline points."""
    force = np.ones(objective.n_force, dtype=np.bool_)
    return np.concatenate([force, counted[objective.counted]])


def _noise(stages: StagedRuns, objective: Objective, slope: FloatArray) -> list[float]:
    """Standard uncertainties from the noise of flyer and curve; none without replicates."""
    if stages.replicates is None:
        return []
    vectors = objective.vectors(stages.replicates.prediction)
    moves = np.nan_to_num(vectors - vectors[0]) @ objective.gain(slope).T
    rows = (stages.replicates.flyer, stages.replicates.curve)
    return [float(replicate_uncertainty(moves[which])[0]) for which in rows if which.any()]


def _declared(
    stages: StagedRuns, held: HeldSearch, fine: RefinedOptimum, objective: Objective, slope: FloatArray
) -> list[float]:
    """Standard uncertainties from what the shot declares of the held parameters."""
    declared, names = stages.prepared.forward.shot.uncertainty, stages.box.names
    others = fine.jacobian[_entries(fine.objective, objective.counted)]
    gain = objective.gain(slope)[0]
    return [
        abs(float(gain @ others[:, names.index(name)])) * declared[name]
        for name in held.values
        if declared.get(name, 0.0) > 0.0
    ]


def _misfit(objective: Objective, vector: FloatArray, prefix: str) -> dict[str, float]:
    """Mean square of the residuals over the noise, of force and outline."""
    square = ((vector - objective.data) / objective.noise) ** 2
    force, shape = square[: objective.n_force], square[objective.n_force :]
    return {
        f"{prefix}chi2_force": float(force.mean()),
        f"{prefix}chi2_shape": float(shape.mean()) if shape.size else float("nan"),
    }
