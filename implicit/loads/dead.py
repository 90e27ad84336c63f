"""Loads that do not depend on the displacement: weight and forces on points."""

from collections.abc import Mapping

import numpy as np

from explicit.arrays import FloatArray
from implicit.conditions import Gravity, NodalForce, Traction
from implicit.integration.geometry import Geometry
from implicit.loads.surface import faces_on
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
    """Forces on points, on coupled points and on faces [N], shape [n d]."""
    total = np.zeros(model.mesh.points.shape)
    for condition in model.conditions:
        if isinstance(condition, NodalForce):
            nodes = model.mesh.nodes(condition.where)
            total[nodes, condition.axis] += at[condition.history] / len(nodes)
        elif isinstance(condition, Traction):
            total[:, condition.axis] += at[condition.history] * areas(model, condition.where)
    flat = total.reshape(-1)
    for component, name in model.unknowns.forces:
        flat[component] += at[name]
    return flat


def areas(model: Model, where: str) -> FloatArray:
    """Share of each point in the undeformed faces of a set, the integrals of the shape functions [m2],
    shape [n]."""
    total = np.zeros(len(model.mesh.points))
    for faces in faces_on(model.mesh, where, model.gauss):
        nodes = model.mesh.cells[faces.cells]
        X = model.mesh.points[nodes]
        tangents = np.einsum("gkt,fkd->fgtd", faces.slopes, X)
        if X.shape[2] == 3:
            area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)
        else:
            area = np.linalg.norm(tangents[:, :, 0], axis=-1)
            if model.kinematics == "axisymmetric":
                area = area * (2.0 * np.pi * np.einsum("gk,fk->fg", faces.values, X[..., 0]))
            else:
                area = area * model.thickness
        np.add.at(total, nodes, np.einsum("g,gk,fg->fk", faces.weights, faces.values, area))
    return total
