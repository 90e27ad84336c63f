"""Patch tests: a distorted mesh whose boundary follows a homogeneous deformation takes it everywhere."""

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.equilibrium.elements import ELEMENTS
from kolsky.equilibrium.meshes import Mesh, box
from kolsky.equilibrium.model import Model, Prescribed
from kolsky.equilibrium.solid import CompressibleNeoHookean, Isotropic, bulk
from kolsky.equilibrium.solve import solve

MOONEY = Isotropic(LAWS["mooney_rivlin"].of([9e3, 3.5e3, 400.0]), bulk(2e5))


def distorted(kind: str, cells: int = 2) -> Mesh:
    """A box whose inner points are moved by a smooth map; straight-sided, so quadratic elements stay affine
    enough for their Gauss rule."""
    d = ELEMENTS[kind].dimension
    mesh = box((1.0,) * d, (cells,) * d, kind=kind)
    X = mesh.points
    bubble = np.prod(X * (1.0 - X), axis=1)
    if ELEMENTS[kind].exponents.max() == 1:
        X = X + bubble[:, None] * np.array([1.2, -0.8, 1.0])[:d]
    else:
        X = X @ (np.eye(d) + 0.2 * np.triu(np.ones((d, d)), 1)).T  # sheared cells
    outer = np.flatnonzero(bubble < 1e-12)
    return Mesh(X, mesh.cells, kind, {"outer": outer, "all": np.arange(len(X))})


def patched(kind, kinematics, solid, volumetric):
    mesh = distorted(kind)
    d = mesh.dimension
    F = np.array([[1.2, 0.1, -0.1], [0.05, 0.9, 0.2], [0.0, 0.1, 1.1]])[:d, :d]
    target = mesh.points @ (F - np.eye(d)).T
    outer = mesh.nodes("outer")
    conditions = tuple(Prescribed("outer", i, "grow", target[outer, i]) for i in range(d))
    model = Model(mesh, solid, conditions, kinematics=kinematics, volumetric=volumetric)
    return solve(model, {"grow": [1.0]}), target


@pytest.mark.parametrize("kind", sorted(ELEMENTS))
def test_displacement_patch(kind):
    kinematics = "3d" if ELEMENTS[kind].dimension == 3 else "plane_strain"
    found, target = patched(kind, kinematics, CompressibleNeoHookean(9e3, 4e4), "displacement")
    assert found.outcome.ok
    np.testing.assert_allclose(found.displacements[0], target, atol=1e-9)


@pytest.mark.parametrize("kind", [k for k in sorted(ELEMENTS) if ELEMENTS[k].pressure_degree is not None])
def test_mixed_patch(kind):
    kinematics = "3d" if ELEMENTS[kind].dimension == 3 else "plane_strain"
    found, target = patched(kind, kinematics, MOONEY, "mixed")
    assert found.outcome.ok
    np.testing.assert_allclose(found.displacements[0], target, atol=1e-9)


@pytest.mark.parametrize("kind", ["quad9", "tri3"])
def test_plane_stress_patch(kind):
    found, target = patched(kind, "plane_stress", CompressibleNeoHookean(9e3, 4e4), "displacement")
    assert found.outcome.ok
    np.testing.assert_allclose(found.displacements[0], target, atol=1e-9)
