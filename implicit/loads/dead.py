"""Loads that do not depend on the displacement: weight and forces on points."""

from collections.abc import Mapping

import numpy as np

from explicit.arrays import FloatArray
from implicit.conditions import Gravity, NodalForce
from implicit.integration.geometry import Geometry
from implicit.model import Model


def weight(model: Model, geometry: Geometry, at: Mapping[str, float]) -> FloatArray:
    """Weight of the points [N], shape [n d]; `at` holds the value of each history."""
    total = np.zeros(model.mesh.points.shape)
    for condition in model.conditions:
        if isinstance(condition, Gravity):
            factor = 1.0 if condition.history is None else at[condition.history]
            # Eq. (11): the integral of rho g . u, so every point carries that of its shape function
            share = np.einsum("mg,gk->mk", geometry.volumes, geometry.values)
            volume = np.bincount(model.mesh.cells.ravel(), weights=share.ravel(), minlength=len(total))
            total += volume[:, None] * (factor * condition.density * np.asarray(condition.acceleration))
    return total.reshape(-1)


def nodal_forces(model: Model, at: Mapping[str, float]) -> FloatArray:
    """Forces on points and on coupled points [N], shape [n d]."""
    total = np.zeros(model.mesh.points.shape)
    for condition in model.conditions:
        if isinstance(condition, NodalForce):
            nodes = model.mesh.nodes(condition.where)
            total[nodes, condition.axis] += at[condition.history] / len(nodes)
    flat = total.reshape(-1)
    for component, name in model.unknowns.forces:
        flat[component] += at[name]
    return flat
