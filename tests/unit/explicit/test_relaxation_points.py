"""One stress point of the time loop's branches along a path with shear and hoop strain, beside NumPy."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from order import assert_order

from explicit.device import select_device
from explicit.materials import neo_hookean
from explicit.precision import PRECISIONS
from explicit.relaxation import BergstromBoyce, PronySeries
from explicit.relaxation.base import RateDependence, Relaxation

FloatArray = NDArray[np.float64]

LAW = neo_hookean(20e3)
SERIES = PronySeries((0.6, 0.3), (0.2, 0.05))
NETWORK = BergstromBoyce(1.2, 8e3, 3.0, -0.5, 0.05)
GRADIENT_R, GRADIENT_Y = np.array([0.3, 0.7, -0.1, 0.2]), np.array([-0.4, 0.1, 0.6, 0.3])
HOOP, WEIGHT, SCALE = np.array([0.25, 0.5, 0.2, 0.4]), 1.7, 1.3
END = 0.4


@cache
def _kernel(kind: Relaxation) -> Any:
    numbers = PRECISIONS["fp64"]
    relax = kind.point(type(LAW), numbers, "trace").relax
    real, vec4 = numbers.real, numbers.vec4

    @wp.kernel(module="unique", enable_backward=False)
    def walk(
        u: wp.array2d(dtype=vec4),
        row: wp.array(dtype=real),
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        constants: wp.array(dtype=vec4),
        dt: real,
        force: wp.array2d(dtype=vec4),
        done: wp.array(dtype=real),
        omega: wp.array(dtype=real),
    ):
        for n in range(1, u.shape[0]):
            vr, vy = (u[n, 0] - u[n - 1, 0]) / dt, (u[n, 1] - u[n - 1, 1]) / dt
            f_r, f_y, work, stiff = relax(
                real(WEIGHT), constants[0], constants[1], constants[2], constants[3], constants[3],
                real(SCALE), row, branches, memory, 0, 1, 0, u[n, 0], u[n, 1], vr, vy, dt, dt, 1,
            )  # fmt: skip
            force[n, 0] = f_r
            force[n, 1] = f_y
            done[n] = work
            omega[n] = stiff

    return walk


def path(n: int, turned: float = 0.0) -> FloatArray:
    """Deformation gradients (rr, ry; yr, yy; tt) from rest, turned in the plane, shape [n + 1, 5]."""
    s = np.linspace(0.0, 1.0, n + 1)
    wave = np.sin(2.5 * s) * np.array([[0.25], [0.35], [-0.2], [-0.3]]) + s**2 * 0.1
    f11, f12, f21, f22 = np.array([[1.0], [0.0], [0.0], [1.0]]) + wave
    angle = turned * s
    c, z = np.cos(angle), np.sin(angle)
    turned_f = (c * f11 - z * f21, c * f12 - z * f22, z * f11 + c * f21, z * f12 + c * f22)
    return np.stack([*turned_f, 1.0 + 0.2 * s], axis=1)


def walk(branches: RateDependence, F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Added corner forces [N], shape [n, 2, 4], what was done on the branches and step bounds, by step."""
    where, n = select_device("cpu"), len(F)
    kind = branches.kind(len(branches))
    # Corner displacements that give F: ur . (gradient_r, gradient_y, hoop) and uy . (gradient_r, gradient_y).
    radial = np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y, HOOP]))
    axial = np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y]))
    ur = (F[:, [0, 1, 4]] - [1.0, 0.0, 1.0]) @ radial.T
    uy = (F[:, [2, 3]] - [0.0, 1.0]) @ axial.T

    def array(values: Any, dtype: Any = wp.float64) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=where)

    memory = wp.zeros(
        kind.point(type(LAW), PRECISIONS["fp64"], "trace").memory, dtype=wp.float64, device=where
    )
    force = wp.zeros((n, 2), dtype=wp.vec4d, device=where)
    done, omega = (wp.zeros(n, dtype=wp.float64, device=where) for _ in range(2))
    constants = np.stack([GRADIENT_R, GRADIENT_Y, HOOP, np.ones(4)])
    wp.launch(
        _kernel(kind), 1,
        [array(np.stack([ur, uy], axis=1), wp.vec4d), array(LAW.parameters()),
         array(branches.row(len(branches))), memory, array(constants, wp.vec4d),
         END / (n - 1), force, done, omega], device=where,
    )  # fmt: skip
    return force.numpy(), done.numpy(), omega.numpy()


def matrix(F: FloatArray) -> FloatArray:
    M = np.zeros((len(F), 3, 3))
    M[:, 0, 0], M[:, 0, 1], M[:, 1, 0], M[:, 1, 1], M[:, 2, 2] = F.T
    return M


def deviator(A: FloatArray) -> FloatArray:
    return A - np.trace(A, axis1=-2, axis2=-1)[..., None, None] / 3.0 * np.eye(3)


def corner_forces(tau: FloatArray, M: FloatArray) -> FloatArray:
    """WEIGHT P : dF/du of a Kirchhoff stress, shape [n, 2, 4]."""
    P = WEIGHT * tau @ np.swapaxes(np.linalg.inv(M), 1, 2)
    radial = P[:, 0, 0, None] * GRADIENT_R + P[:, 0, 1, None] * GRADIENT_Y + P[:, 2, 2, None] * HOOP
    axial = P[:, 1, 0, None] * GRADIENT_R + P[:, 1, 1, None] * GRADIENT_Y
    return np.stack([radial, axial], axis=1)


def prony_reference(F: FloatArray) -> FloatArray:
    """Forces of -dev(F q F^T) with q as a convolution, by tensors; S linear between the samples."""
    M = matrix(F)
    bar = M / np.cbrt(np.linalg.det(M))[:, None, None]
    tau = 20e3 * deviator(bar @ np.swapaxes(bar, 1, 2))
    back = np.linalg.inv(bar)
    S = back @ tau @ np.swapaxes(back, 1, 2)
    dt, q = END / (len(F) - 1), np.zeros_like(S)
    for g, time in zip(SERIES.instantaneous_shares, SERIES.times, strict=True):
        H, decay = np.zeros_like(S), np.exp(-dt / time)
        for n in range(1, len(S)):
            H[n] = decay * H[n - 1] + time / dt * (1.0 - decay) * g * (S[n] - S[n - 1])
        q += g * S - H
    return corner_forces(-SCALE * deviator(bar @ q @ np.swapaxes(bar, 1, 2)), M)


def creep_reference(F: FloatArray, substeps: int = 40) -> FloatArray:
    """Forces of tau_B - s tau_W by explicit midpoint steps of C_v^-1, many to a sample."""
    M, share = matrix(F), NETWORK.ratio / NETWORK.instantaneous
    Ci, dt = np.eye(3), END / (len(F) - 1) / substeps
    added = np.zeros_like(M)

    def rate(bar: FloatArray, Ci: FloatArray) -> FloatArray:
        b = bar @ Ci @ bar.T
        tau = SCALE * share * 20e3 * deviator(b[None])[0]
        size = np.sqrt((tau * tau).sum())
        chain = np.sqrt(np.trace(np.linalg.inv(Ci)) / 3.0)
        back = np.linalg.inv(bar)
        return np.asarray(
            -2.0 * float(NETWORK.flow_rate(size, chain)) / max(size, 1e-30) * back @ tau @ b @ back.T
        )

    for n in range(1, len(M)):
        for k in range(substeps):
            between = M[n - 1] + (k + 0.5) / substeps * (M[n] - M[n - 1])
            bar = between / np.cbrt(np.linalg.det(between))
            Ci = Ci + dt * rate(bar, Ci + 0.5 * dt * rate(bar, Ci))
        bar = M[n] / np.cbrt(np.linalg.det(M[n]))
        b, whole = bar @ Ci @ bar.T, bar @ bar.T
        added[n] = SCALE * share * 20e3 * deviator((b - whole)[None])[0]
    return corner_forces(added, M)


def test_a_prony_point_is_the_convolution_to_second_order() -> None:
    sizes, errors = [40, 80, 160, 320], []
    for n in sizes:
        F = path(n)
        errors.append(np.abs(walk(SERIES, F)[0] - prony_reference(F)).max())
    scale = np.abs(prony_reference(path(320))).max()
    # the rule is a Pade quotient at half steps, the reference piecewise linear: both of second order
    assert_order([1.0 / n for n in sizes], errors, 2.0, 0.2)
    assert errors[-1] < 1e-4 * scale  # (h / tau)^2 / 10 for h = END / 320, tau = 0.05


def test_a_creeping_point_follows_its_equations() -> None:
    sizes, errors = [40, 80, 160], []
    for n in sizes:
        F = path(n)
        errors.append(np.abs(walk(NETWORK, F)[0] - creep_reference(F, 3200 // n)).max())
    scale = np.abs(creep_reference(path(40))).max()
    assert_order([1.0 / n for n in sizes], errors, 1.0, 0.2)  # trial and flow in turn: first order
    assert errors[-1] < 0.01 * scale  # and halves with every halving of the step


@pytest.mark.parametrize("branches", [SERIES, NETWORK], ids=["prony", "creep"])
def test_a_turned_path_gives_turned_forces(branches: RateDependence) -> None:
    straight, turned = walk(branches, path(60))[0], walk(branches, path(60, 0.9))[0]
    c, z = np.cos(0.9), np.sin(0.9)
    hoop = straight[-1, 0] @ np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y, HOOP]))
    r = hoop[0] * GRADIENT_R + hoop[1] * GRADIENT_Y  # without the hoop's share, which does not turn
    y = straight[-1, 1]
    scale = np.abs(straight[-1]).max()
    np.testing.assert_allclose(turned[-1, 0], c * r - z * y + hoop[2] * HOOP, rtol=0.0, atol=1e-10 * scale)
    np.testing.assert_allclose(turned[-1, 1], z * r + c * y, rtol=0.0, atol=1e-10 * scale)


@pytest.mark.parametrize("branches", [SERIES, NETWORK], ids=["prony", "creep"])
def test_what_is_done_is_the_work_of_the_forces(branches: RateDependence) -> None:
    """held + sum of done = work of the branches' own stress, by the trapezoid over the same path."""
    sizes, errors = [40, 80, 160, 320], []
    share = 1.0 - 1.0 / branches.instantaneous
    for n in sizes:
        F = path(n)
        force, done, _ = walk(branches, F)
        M = matrix(F)
        bar = M / np.cbrt(np.linalg.det(M))[:, None, None]
        whole = bar @ np.swapaxes(bar, 1, 2)
        full = corner_forces(SCALE * share * 20e3 * deviator(whole), M)
        radial = np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y, HOOP]))
        axial = np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y]))
        u = np.stack([(F[:, [0, 1, 4]]) @ radial.T, F[:, [2, 3]] @ axial.T], axis=1)
        own = force + full
        work = float((0.5 * (own[1:] + own[:-1]) * np.diff(u, axis=0)).sum())
        if branches is SERIES:
            held = WEIGHT * SCALE * share * 10e3 * (np.trace(whole[-1]) - 3.0)
        else:
            # b_e from the force itself: neo-Hookean, so its deviator is known, and det b_e = 1 gives the rest
            dev = _deviator_of(own[-1], M[-1]) / (SCALE * share * 20e3)
            roots = np.roots(np.poly(-dev) - [0.0, 0.0, 0.0, 1.0])
            mean = float(roots[np.abs(roots.imag) < 1e-9].real.max())
            held = WEIGHT * SCALE * share * 10e3 * (3.0 * mean - 3.0)
        errors.append(abs(held + done.sum() - work) / abs(work))
    assert errors[-1] < 2e-4
    assert_order([1.0 / n for n in sizes], errors, 2.0, 0.6, at_least=True)


def _deviator_of(force: FloatArray, M: FloatArray) -> FloatArray:
    """The Kirchhoff stress that gives corner forces."""
    radial = force[0] @ np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y, HOOP]))
    axial = force[1] @ np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y]))
    P = np.zeros((3, 3))
    P[0, 0], P[0, 1], P[2, 2], P[1, 0], P[1, 1] = *radial, *axial
    return np.asarray(P @ M.T / WEIGHT)


@pytest.mark.parametrize("branches", [SERIES, NETWORK], ids=["prony", "creep"])
def test_nothing_happens_at_rest(branches: RateDependence) -> None:
    force, done, omega = walk(branches, np.tile([1.0, 0.0, 0.0, 1.0, 1.0], (5, 1)))
    assert np.abs(force).max() < 1e-9  # of 2e4 N: displacements of a pseudo-inverse, 1e-16
    assert np.abs(done).max() < 1e-15
    assert omega.max() < 1e-8
