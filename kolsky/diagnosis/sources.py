"""What a right model leaves of the data, by source: changes of the predicted data vector."""

from collections.abc import Mapping

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.fit_results import CURVE, FLYER, MESH
from kolsky.inverse.objective import Objective
from kolsky.inverse.staged_runs import Replicates, StagedRuns
from kolsky.uncertainty.input_directions import InputDirections
from kolsky.uncertainty.numerical import ORDER

MOTION = "motion scale"
"""The uncertainty of the scale of the front face's motion, where waves tell it."""
SCALE = "force scale"
"""The declared uncertainty of the force's scale."""
DECLARED = "declared inputs"
"""Everything else that [uncertainty] of the shot file declares."""


def residual_sources(
    stages: StagedRuns, objective: Objective, vector: FloatArray, directions: InputDirections | None
) -> dict[str, FloatArray]:
    """Changes of the predicted data vector by one standard uncertainty of each source.

    Parameters
    ----------
    stages
        The identification's simulations, with the replicates of its inputs if there were any.
    objective
        With the discrepancies of the optimum.
    vector
        Predicted data vector of the optimum on the refined mesh, shape [k].
    directions
        The directions of the inputs, and the data vector of the optimum on the surrogate's mesh; None if they
        are not known.

    Returns
    -------
    dict
        Source -> changes, shape [n, k] or [k].
    """
    found = {} if stages.replicates is None else replicate_changes(stages.replicates, objective)
    settings = stages.settings
    if directions is not None:
        ratio = settings.refined_mesh[0] / settings.numerics.mesh[0]
        found[MESH] = mesh_change(directions.vector, vector, ratio=ratio)
        declared = declared_changes(directions, stages.prepared.forward.shot.uncertainty)
        if len(declared):
            found[DECLARED] = declared
    if stages.observations.force_sigma_gain > 0.0:
        found[SCALE] = objective.scale_error
    return found


def replicate_changes(replicates: Replicates, objective: Objective) -> dict[str, FloatArray]:
    """Changes by the draws of flyer motion and curve, and by a scale of the motion, shape [n, k] each."""
    vectors = objective.vectors(replicates.prediction)
    change = vectors - vectors[0]
    rows = {FLYER: replicates.flyer, CURVE: replicates.curve, MOTION: replicates.scale}
    return {source: change[row] for source, row in rows.items() if row.any()}


def declared_changes(directions: InputDirections, uncertainty: Mapping[str, float]) -> FloatArray:
    """Changes by the declared standard uncertainties, in quadrature, shape [n, k].

    Each is larger by the root of their number: a mean square over the rows is then their sum.
    """
    keys = [key for key, sigma in uncertainty.items() if sigma > 0.0 and key in directions.keys]
    rows = [uncertainty[key] * directions[key].slope for key in keys]
    return np.sqrt(len(rows)) * np.array(rows)


def mesh_change(coarse: FloatArray, fine: FloatArray, *, ratio: float) -> FloatArray:
    """Remaining error of the finer mesh's data vector, by Richardson's extrapolation, shape [k].

    Parameters
    ----------
    coarse, fine
        Data vectors of one point on both meshes, shape [k].
    ratio
        Elements across the radius, of the fine mesh over the coarse one.
    """
    return np.asarray((fine - coarse) / (ratio**ORDER - 1.0))
