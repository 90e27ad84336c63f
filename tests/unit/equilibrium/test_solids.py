"""Every solid: stress and tangent against differences of its energy, the energy against NumPy, dP/dp."""

import numpy as np
import pytest
import warp as wp

from explicit.materials import LAWS
from explicit.materials.volumetric import VolumetricLaw
from kolsky.equilibrium.point_kernels import mat99
from kolsky.equilibrium.solid import (
    VOLUMETRIC_PARAMETERS,
    CompressibleNeoHookean,
    Isotropic,
    Volumetric,
    bulk,
)

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


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(SOLIDS) - set(QUICK)))
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
