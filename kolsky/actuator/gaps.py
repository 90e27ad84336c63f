"""Distances of the walls of neighbouring chambers, and how they press on each other."""

from dataclasses import dataclass

import numpy as np

from implicit.loads.surface_contact import surface_contacts
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


@dataclass(frozen=True)
class Touching:
    """Contact of neighbouring chambers over a history."""

    force: FloatArray
    """Sum of the pressures between all walls over their area [N], of the whole actuator, shape [n]."""
    depth: FloatArray
    """Depth of the deepest point, which the penalty leaves [m], shape [n]."""


def touching(run: Bending) -> Touching | None:
    """Contact forces and depths of equilibria; None of a model without contact."""
    model = run.solution.model
    contacts = surface_contacts(model)
    if not contacts:
        return None
    share = 2.0 if "mirror" in model.mesh.sets else 1.0
    each = [u.reshape(-1) for u in run.solution.displacements]
    return Touching(
        np.array([share * sum(one.force(u) for one in contacts) for u in each]),
        np.array([max(one.deepest(u) for one in contacts) for u in each]),
    )
