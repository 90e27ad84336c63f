"""Distances of the walls of neighbouring chambers."""

import numpy as np

from kolsky.actuator.model import Bending
from kolsky.base.arrays import FloatArray


def smallest_gap(run: Bending) -> FloatArray:
    """Smallest distance of the facing walls of neighbouring chambers [m], shape [n].

    Each pair of facing points is taken along the line between the middles of its two walls; negative where
    they have passed each other.
    """
    mesh, u = run.solution.model.mesh, run.solution.displacements
    smallest = np.full(len(u), np.nan)
    number = 1
    while f"gap_{number}_left" in mesh.sets:
        left, right = (
            mesh.points[mesh.sets[f"gap_{number}_{side}"]] + u[:, mesh.sets[f"gap_{number}_{side}"]]
            for side in ("left", "right")
        )
        across = (right - left).mean(axis=1)
        across = across / np.linalg.norm(across, axis=-1, keepdims=True)
        each = np.einsum("npd,nd->np", right - left, across).min(axis=1)
        smallest = np.fmin(smallest, each)
        number += 1
    return smallest
