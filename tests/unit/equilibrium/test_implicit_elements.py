"""Shape functions, Gauss rules and faces of every element."""

from math import factorial

import numpy as np
import pytest

from kolsky.equilibrium.elements import ELEMENTS, element, hypercube_rule, simplex_rule
from kolsky.equilibrium.meshes import box

EVERY = pytest.mark.parametrize("name", sorted(ELEMENTS))


@EVERY
def test_shape_functions_interpolate(name):
    item = ELEMENTS[name]
    np.testing.assert_allclose(item.values(item.nodes), np.eye(item.n_nodes), atol=1e-13)
    points = item.rule(3)[0]
    np.testing.assert_allclose(item.values(points).sum(axis=1), 1.0, rtol=1e-13)
    np.testing.assert_allclose(item.values(points) @ item.nodes, points, atol=1e-13)


@EVERY
def test_gradients_are_derivatives(name):
    item = ELEMENTS[name]
    points, h = item.rule(2)[0], 1e-6
    for j in range(item.dimension):
        step = h * np.eye(item.dimension)[j]
        by = (item.values(points + step) - item.values(points - step)) / (2.0 * h)
        np.testing.assert_allclose(item.gradients(points)[..., j], by, atol=1e-9)


@pytest.mark.parametrize("gauss", [1, 2, 3, 5])
@pytest.mark.parametrize("dimension", [2, 3])
def test_rules_are_exact(gauss, dimension):
    points, weights = hypercube_rule(gauss, dimension)
    degree = 2 * gauss - 1
    even = degree - degree % 2
    assert weights @ points[:, 0] ** even == pytest.approx(2.0**dimension / (even + 1), rel=1e-13)
    points, weights = simplex_rule(gauss, dimension)
    degree = {1: 1, 2: 2}.get(gauss, 2 * gauss - 1)
    for a in range(degree + 1):  # x^a y^b over the unit simplex is a! b! / (a + b + d)!
        b = degree - a
        exact = factorial(a) * factorial(b) / factorial(a + b + dimension)
        assert weights @ (points[:, 0] ** a * points[:, -1] ** b) == pytest.approx(exact, rel=1e-12)


@EVERY
def test_faces_close_the_element(name):
    # Gauss's theorem: int n . x da = d V, with normals that point outwards
    item = ELEMENTS[name]
    total = 0.0
    points, weights = item.face_rule(2)
    for face in item.faces:
        tangents = np.asarray(face.tangents)
        normal = np.cross(*tangents) if item.dimension == 3 else np.array([tangents[0, 1], -tangents[0, 0]])
        total += weights @ ((np.asarray(face.origin) + points @ tangents) @ normal)
        assert len(item.nodes_on(face)) < item.n_nodes
    volume = item.rule(1)[1].sum()
    assert total == pytest.approx(item.dimension * volume, rel=1e-13)


@EVERY
def test_a_box_is_filled(name):
    item = ELEMENTS[name]
    size = (1.0, 2.0, 3.0)[: item.dimension]
    mesh = box(size, (2, 1, 2)[: item.dimension], kind=name)
    points, weights = item.rule(item.gauss)
    jacobian = np.einsum("cki,gkj->cgij", mesh.points[mesh.cells], item.gradients(points))
    volumes = np.linalg.det(jacobian) * weights
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(np.prod(size), rel=1e-12)
    assert len(np.unique(mesh.cells)) == len(mesh.points)


def test_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match=r"kind must be one of .*'hex20'"):
        element("hex20")
    with pytest.raises(ValueError, match="gauss must be in"):
        hypercube_rule(0, 2)
