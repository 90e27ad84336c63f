"""What a right model leaves of the data of one shot, from two meshes and the flyer's noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.alterations import UNALTERED
from kolsky.diagnosis.cause_model import CauseModel
from kolsky.diagnosis.expected_residual import ExpectedResidual
from kolsky.inverse.forward import Numerics

PATTERNS = 40
"""Most patterns of the flyer's noise."""
FIRST_ORDER = 1.0
"""Order of the mesh error's common part: where the side surface rolls onto a platen it is 1, not 2."""
SECOND_ORDER = 2.0
"""Order of what rings, whose phase differs from mesh to mesh."""
NEAR = 7
"""Bins over which the size of the mesh's error is averaged."""


def expected_residual(model: CauseModel, numerics: Numerics) -> ExpectedResidual:
    """What a right model leaves of the data vector at the answer.

    Parameters
    ----------
    model
        The data and both meshes' runs at the answer.
    numerics
        The mesh on which the flyer's noise is carried to the data.
    """
    o, n = model.observations, model.observations.n_force
    meshes = model.stages.settings
    ratio = meshes.refined_mesh[0] / meshes.numerics.mesh[0]
    moved = np.nan_to_num(model.shift(UNALTERED))
    rough = moved / (ratio**SECOND_ORDER - 1.0)
    ringing = np.sqrt(np.convolve(rough[:n] ** 2, np.ones(NEAR) / NEAR, "same"))
    noise = np.concatenate([o.force_sigma, o.centre_line.sigma])
    sigma = np.hypot(noise, np.concatenate([ringing, np.abs(rough[n:])]))
    common = moved / (ratio**FIRST_ORDER - 1.0)
    shared = () if o.centre_line.modes is None else np.pad(o.centre_line.modes, ((0, 0), (n, 0)))
    patterns = np.column_stack([common, _flyer_noise(model, numerics), *shared])
    times = np.concatenate([o.force_times, o.centre_line.time])
    width = float(np.diff(o.bins.edges).mean())
    return ExpectedResidual(
        sigma=sigma,
        patterns=patterns,
        channel=(np.arange(len(times)) >= n).astype(np.int64),
        block=((times - times.min()) / width).astype(np.int64),
        tau=np.zeros(2),
    )


def _flyer_noise(model: CauseModel, numerics: Numerics) -> FloatArray:
    """Changes of the data vector by one standard deviation of each pattern of the path, shape [k, q]."""
    stages, path = model.stages, model.stages.prepared.path
    jerks = leading_patterns(path.covariance, np.diff(path.knots), PATTERNS)
    paths = (path, *(replace(path, jerk=path.jerk + jerk) for jerk in jerks.T))
    forward = replace(stages.prepared.forward, paths=paths)
    (at,) = stages.solver_values(model.x[None], numerics.mesh)
    values = {**stages.settings.held, **dict(zip(stages.box.names, at, strict=True))}
    response = forward.run(values, numerics, motion=np.arange(len(paths)))
    model.runs += len(paths)
    vectors = np.array(
        [
            UNALTERED.vector(response, model.observations, i)
            if response.outcomes[i].ok
            else np.full(len(model.data), np.nan)
            for i in range(len(paths))
        ]
    )
    return np.asarray(np.nan_to_num(vectors[1:] - vectors[0]).T)


def leading_patterns(covariance: FloatArray, spans: FloatArray, count: int) -> FloatArray:
    """Patterns of jerk of one standard deviation each, those that move the velocity most, shape [n, q].

    The columns' outer products sum to the covariance where all of them are kept.

    Parameters
    ----------
    covariance
        Of the jerks of the spans [m^2/s^6], shape [n, n].
    spans
        Their lengths [s], shape [n].
    count
        Most patterns.
    """
    scale = np.sqrt(np.diag(covariance))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    root = safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    velocity = np.cumsum(np.cumsum(root * spans[:, None], axis=0) * spans[:, None], axis=0)
    _, _, turned = np.linalg.svd(velocity, full_matrices=False)
    return np.asarray(root @ turned[:count].T)
