"""Every solid: stress, tangent and dP/dp against differences of its energy, energy against NumPy."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest
import warp as wp

from explicit.materials import LAWS
from explicit.materials.volumetric import VolumetricLaw
from kolsky.equilibrium.elements import ELEMENTS, element, hypercube_rule, simplex_rule
from kolsky.equilibrium.equations import Equations
from kolsky.equilibrium.meshes import Mesh, box
from kolsky.equilibrium.model import Model, Prescribed
from kolsky.equilibrium.point_kernels import mat99
from kolsky.equilibrium.sensitivity import direct
from kolsky.equilibrium.solid import (
    VOLUMETRIC_PARAMETERS,
    CompressibleNeoHookean,
    Isotropic,
    Volumetric,
    bulk,
)
from kolsky.equilibrium.solve import solve
from tests.unit.equilibrium.models import PULL, TIGHT, clamped

DEFORMATIONS = np.array(
    [
        np.array([[1.3, 0.1, -0.2], [0.05, 0.8, 0.15], [0.1, 0.2, 1.1]]),
        np.diag([1.6, 1.6, 0.4]),  # two equal stretches
        np.eye(3) * 1.02,  # three
        np.diag([2.25, 0.7, 0.64]),
    ]
)
"""Deformation gradients: general, with equal stretches, and long."""


def point_values(solid, F):
    """Energy, P and A of deformation gradients [n, 3, 3], from the Warp functions."""
    energy, stress, tangent = solid.functions()

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(
        F: wp.array(dtype=wp.mat33d),
        row: wp.array(dtype=wp.float64),
        W: wp.array(dtype=wp.float64),
        P: wp.array(dtype=wp.mat33d),
        A: wp.array(dtype=mat99),
    ):
        g = wp.tid()
        W[g] = energy(F[g], row)
        P[g] = stress(F[g], row)
        A[g] = tangent(F[g], row)

    n = len(F)
    W, P, A = (wp.zeros(n, dtype=t, device="cpu") for t in (wp.float64, wp.mat33d, mat99))
    given = wp.array(np.ascontiguousarray(F), dtype=wp.mat33d, device="cpu")
    row = wp.array(solid.row(), dtype=wp.float64, device="cpu")
    wp.launch(evaluate, n, inputs=[given, row], outputs=[W, P, A], device="cpu")
    return W.numpy(), P.numpy().reshape(n, 9), A.numpy()


def in_directions(F, h):
    """F moved by +-h in each of its nine components, shape [n, 9, 2, 3, 3]."""
    moves = np.eye(9).reshape(9, 1, 3, 3) * np.array([1.0, -1.0]).reshape(1, 2, 1, 1) * h
    return F[:, None, None] + moves[None]


SOLIDS = {
    **{name: Isotropic(law.example(), bulk(2e5)) for name, law in LAWS.items()},
    "compressible_neo_hookean": CompressibleNeoHookean(9e3, 4e4),
}
QUICK = ("mooney_rivlin", "ogden2", "compressible_neo_hookean")


def battery(solid):
    W, P, A = point_values(solid, DEFORMATIONS)
    h = 1e-5
    moved = in_directions(DEFORMATIONS, h)
    around_W, around_P, _ = point_values(solid, moved.reshape(-1, 3, 3))
    around_W, around_P = around_W.reshape(-1, 9, 2), around_P.reshape(-1, 9, 2, 9)
    scale = solid.shear_modulus
    by_W = (around_W[..., 0] - around_W[..., 1]) / (2.0 * h)
    by_P = (around_P[:, :, 0] - around_P[:, :, 1]) / (2.0 * h)
    # h^2 of the differences against K = 2e5 Pa over mu, and 1e-16 W / h of rounding
    np.testing.assert_allclose(P, by_W, atol=1e-6 * scale, rtol=1e-6)
    np.testing.assert_allclose(A, np.swapaxes(by_P, 1, 2), atol=1e-5 * scale, rtol=1e-6)
    np.testing.assert_allclose(A, np.swapaxes(A, 1, 2), rtol=1e-12)
    return W


@pytest.mark.parametrize("name", QUICK)
def test_stress_and_tangent_are_derivatives_of_the_energy(name):
    battery(SOLIDS[name])


@pytest.mark.slow  # one of the first invariant; every law is compared with its twin in tests/unit/explicit
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.long] * (name != "arruda_boyce"))
        for name in sorted(set(SOLIDS) - set(QUICK))
    ],
)
def test_the_other_laws_too(name):
    battery(SOLIDS[name])


@pytest.mark.parametrize("name", ["mooney_rivlin", "ogden2"])
def test_the_energy_is_that_of_the_law(name):
    solid = SOLIDS[name]
    W, _, _ = point_values(solid, DEFORMATIONS)
    stretches = np.linalg.svd(DEFORMATIONS, compute_uv=False)
    J = stretches.prod(axis=1)
    own = solid.law.strain_energy(*(stretches / np.cbrt(J)[:, None]).T) + 1e5 * (J - 1.0) ** 2
    np.testing.assert_allclose(W, own, rtol=1e-9)


def test_the_coupled_energy_by_hand():
    W, P, _ = point_values(CompressibleNeoHookean(2.0, 3.0), np.array([np.diag([2.0, 1.0, 1.0])]))
    # mu/2 (I1 - 3 - 2 ln J) + lam/2 (ln J)^2 with I1 = 6, J = 2; P11 = mu (l - 1/l) + lam ln J / l
    log = np.log(2.0)
    np.testing.assert_allclose(W, 3.0 - 2.0 * log + 1.5 * log**2, rtol=1e-14)
    np.testing.assert_allclose(P[0, [0, 4]], [2.0 * 1.5 + 1.5 * log, 3.0 * log], rtol=1e-14)


@pytest.mark.parametrize("form", sorted(VOLUMETRIC_PARAMETERS))
def test_volumetric_forms_are_derivatives_of_their_energy(form):
    volumetric = Volumetric(form, (3e5, 2e5, 1e5)[: len(VOLUMETRIC_PARAMETERS[form])])
    J, h = np.array([0.6, 0.95, 1.0, 1.1, 1.7]), 1e-5
    slope = (volumetric.energy(J + h) - volumetric.energy(J - h)) / (2.0 * h)
    np.testing.assert_allclose(volumetric.slope(J), slope, atol=1e-3, rtol=1e-8)
    curvature = (volumetric.slope(J + h) - volumetric.slope(J - h)) / (2.0 * h)
    np.testing.assert_allclose(volumetric.curvature(J), curvature, rtol=1e-7)
    by = volumetric.slope_by_constants(J)
    np.testing.assert_allclose(
        sum(c * b for c, b in zip(volumetric.values, by, strict=True)), volumetric.slope(J)
    )
    assert volumetric.curvature(np.ones(1))[0] == pytest.approx(volumetric.bulk_modulus, rel=1e-12)


def test_the_quadratic_form_is_that_of_the_explicit_solver():
    J = np.array([0.8, 1.3])
    np.testing.assert_array_equal(bulk(5.0).energy(J), VolumetricLaw(5.0).energy(J))
    np.testing.assert_array_equal(bulk(5.0).slope(J), VolumetricLaw(5.0).pressure(J))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Volumetric("cubic", (1.0,)), "must be one of"),
        (lambda: Volumetric("quadratic", (1.0, 2.0)), "got 2 values"),
        (lambda: Volumetric("quadratic", (-1.0,)), "must be > 0 Pa"),
        (lambda: Volumetric("quadratic", (np.inf,)), "finite"),
        (lambda: CompressibleNeoHookean(-1.0, 1.0), "must be > 0 Pa"),
        (lambda: CompressibleNeoHookean.from_young(1.0, 0.5), "poisson"),
        (lambda: CompressibleNeoHookean(1.0, 1.0).isochoric_functions(), "displacement"),
    ],
)
def test_what_a_solid_refuses(make, text):
    with pytest.raises(ValueError, match=text):
        make()


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


SPACE = {kind: "3d" if one.dimension == 3 else "plane_strain" for kind, one in sorted(ELEMENTS.items())}
MIXED = [kind for kind in SPACE if ELEMENTS[kind].pressure_degree is not None]


@pytest.mark.parametrize(
    ("kind", "kinematics", "volumetric"),
    [
        *((kind, kinematics, "displacement") for kind, kinematics in SPACE.items()),
        *((kind, SPACE[kind], "mixed") for kind in MIXED),
        *((kind, "plane_stress", "displacement") for kind in ("quad9", "tri3")),
    ],
)
def test_patch(kind, kinematics, volumetric):
    solid = MOONEY if volumetric == "mixed" else CompressibleNeoHookean(9e3, 4e4)
    found, target = patched(kind, kinematics, solid, volumetric)
    assert found.outcome.ok
    np.testing.assert_allclose(found.displacements[0], target, atol=1e-9)


MODELS = {
    "plane stress": clamped(),
    "axisymmetric": clamped("quad8", "axisymmetric"),
    "3d": clamped("hex8", "3d"),
}


def test_stiffness_is_the_derivative_of_the_forces():
    model = MODELS["plane stress"]
    equations = Equations(model, model.parameters())
    rng = np.random.default_rng(4)
    u, du = rng.normal(scale=0.02, size=(2, model.n_dofs))
    state, h = equations.evaluate(u, {"pull": 0.0}), 1e-5
    moved = [equations.evaluate(u + sign * h * du, {"pull": 0.0}).body.forces for sign in (1.0, -1.0)]
    by = (moved[0] - moved[1]) / (2.0 * h)
    np.testing.assert_allclose(
        equations.times(equations.stiffness(state), du), by, atol=1e-6 * np.abs(by).max()
    )


@pytest.mark.parametrize("name", MODELS)
def test_a_gpu_gives_the_same(name, cuda):
    model = MODELS[name]
    own, other = (
        direct(solve(replace(model, device=device), PULL, newton=TIGHT)) for device in ("cpu", cuda)
    )
    np.testing.assert_allclose(other.solution.forces, own.solution.forces, atol=1e-6)
    np.testing.assert_allclose(other.forces, own.forces, atol=1e-6 * np.abs(own.forces).max())
