"""Forces that are not those of the body: dead loads, weight, and (in their files) pressure and contact."""

from collections.abc import Mapping

import numpy as np

from explicit.arrays import FloatArray
from implicit.conditions import Gravity, NodalForce
from implicit.integration.geometry import Geometry
from implicit.model import Model


def dead_forces(model: Model, geometry: Geometry, at: Mapping[str, float]) -> FloatArray:
    """Nodal forces that do not depend on the displacement [N], shape [n d].

    `at` holds the value of each history.
    """
    d = model.dimension
    total = np.zeros((len(model.mesh.points), d))
    for condition in model.conditions:
        if isinstance(condition, NodalForce):
            nodes = model.mesh.nodes(condition.where)
            total[nodes, condition.axis] += at[condition.history] / len(nodes)
        elif isinstance(condition, Gravity):
            factor = 1.0 if condition.history is None else at[condition.history]
            # Eq. (11): the integral of rho g . u, so every point carries that of its shape function
            share = np.einsum("mg,gk->mk", geometry.volumes, geometry.values)
            mass = np.bincount(model.mesh.cells.ravel(), weights=share.ravel(), minlength=len(total))
            weight = factor * condition.density * np.asarray(condition.acceleration)
            total += mass[:, None] * weight
    flat = total.reshape(-1)
    for unknown, name in model.unknowns.forces:
        first = int(np.flatnonzero(model.unknowns.index == unknown)[0])
        flat[first] += at[name]
    return flat
