"""Relaxation as a part of a model: rejected inputs, and no cost for a model without it."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from order import assert_order
from scipy.integrate import solve_ivp

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.device import select_device
from explicit.materials import neo_hookean
from explicit.precision import PRECISIONS
from explicit.relaxation import (
    BergstromBoyce,
    PronySeries,
    bergstrom_boyce_stress,
    prony_stress,
    uniaxial_stress,
)
from explicit.relaxation.base import RateDependence, Relaxation

TIMES = np.linspace(0.0, 2e-4, 5)
SAMPLING = Sampling(TIMES, TIMES)
MOTION = PlatenMotion.sampled(lambda t: 2e4 * t**2, lambda t: 4e4 * t, start=0.0, end=2e-4, n_knots=65)
MODEL = Model(cylinder(4.75e-3, 6.5e-3, n_radial=2, n_axial=3), 870.0, (neo_hookean(20e3),), (MOTION,))
SERIES = PronySeries((0.5,), (1e-4,))


def test_a_branch_of_no_strength_changes_nothing_but_round_off() -> None:
    plain = run(MODEL, Samples.of(poisson=0.49, damping=1e-5), SAMPLING)
    idle = run(
        replace(MODEL, relaxation=(PronySeries((0.0,), (1e-4,)),)),
        Samples.of(poisson=0.49, damping=1e-5),
        SAMPLING,
    )
    np.testing.assert_allclose(idle.force_transmission, plain.force_transmission, rtol=1e-12, atol=1e-14)
    assert (plain.energy.viscous == 0.0).all()
    assert np.abs(idle.energy.viscous).max() < 1e-15 * plain.energy.external.max()


def test_the_step_is_that_of_the_instantaneous_modulus() -> None:
    samples = Samples.of(poisson=0.49)
    stiff = run(replace(MODEL, relaxation=(PronySeries((3.0,), (1e3,)),)), samples, SAMPLING)
    plain = run(MODEL, Samples.of(stiffness_factor=4.0, poisson=0.49), SAMPLING)
    # nothing relaxes within 1e-7 of its time, so the run is that of a law four times as stiff
    np.testing.assert_allclose(stiff.force_flyer, plain.force_flyer, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(stiff.smallest_step, plain.smallest_step, rtol=1e-5)


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="all relaxation laws in a model must be of one class"):
        replace(MODEL, relaxation=(SERIES, BergstromBoyce(1.0, 1e3)))
    with pytest.raises(ValueError, match="names relaxation 1, the model has 0 to 0"):
        run(replace(MODEL, relaxation=(SERIES,)), Samples.of(relaxation=1), SAMPLING)


FloatArray = NDArray[np.float64]

LAW = neo_hookean(20e3)
POINTS_SERIES = PronySeries((0.6, 0.3), (0.2, 0.05))
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
    for g, time in zip(POINTS_SERIES.instantaneous_shares, POINTS_SERIES.times, strict=True):
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


@pytest.mark.parametrize(
    ("branches", "reference", "sizes", "order", "last"),
    [
        # a Pade quotient at half steps, the reference piecewise linear: both of second order;
        # (h / tau)^2 / 10 for h = END / 320, tau = 0.05
        (POINTS_SERIES, prony_reference, [40, 80, 160, 320], 2.0, 1e-4),
        # trial and flow in turn: first order, so that the last error halves with every halving of the step
        (NETWORK, lambda F: creep_reference(F, 1600 // (len(F) - 1)), [40, 80, 160], 1.0, 0.01),
    ],
    ids=["convolution of a series", "equations of a creeping point"],
)
def test_a_point_follows_its_own(
    branches: RateDependence, reference: Any, sizes: list[int], order: float, last: float
) -> None:
    exact = [reference(path(n)) for n in sizes]
    errors = [np.abs(walk(branches, path(n))[0] - e).max() for n, e in zip(sizes, exact, strict=True)]
    assert_order([1.0 / n for n in sizes], errors, order, 0.2)
    assert errors[-1] < last * np.abs(exact[-1]).max()


@pytest.mark.parametrize("branches", [POINTS_SERIES, NETWORK], ids=["prony", "creep"])
def test_a_turned_path_gives_turned_forces(branches: RateDependence) -> None:
    straight, turned = walk(branches, path(60))[0], walk(branches, path(60, 0.9))[0]
    c, z = np.cos(0.9), np.sin(0.9)
    hoop = straight[-1, 0] @ np.linalg.pinv(np.stack([GRADIENT_R, GRADIENT_Y, HOOP]))
    r = hoop[0] * GRADIENT_R + hoop[1] * GRADIENT_Y  # without the hoop's share, which does not turn
    y = straight[-1, 1]
    scale = np.abs(straight[-1]).max()
    np.testing.assert_allclose(turned[-1, 0], c * r - z * y + hoop[2] * HOOP, rtol=0.0, atol=1e-10 * scale)
    np.testing.assert_allclose(turned[-1, 1], z * r + c * y, rtol=0.0, atol=1e-10 * scale)


@pytest.mark.parametrize("branches", [POINTS_SERIES, NETWORK], ids=["prony", "creep"])
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
        if branches is POINTS_SERIES:
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


@pytest.mark.parametrize("branches", [POINTS_SERIES, NETWORK], ids=["prony", "creep"])
def test_nothing_happens_at_rest(branches: RateDependence) -> None:
    force, done, omega = walk(branches, np.tile([1.0, 0.0, 0.0, 1.0, 1.0], (5, 1)))
    assert np.abs(force).max() < 1e-9  # of 2e4 N: displacements of a pseudo-inverse, 1e-16
    assert np.abs(done).max() < 1e-15
    assert omega.max() < 1e-8


YOUNG = 60e3
TWINS_SERIES = PronySeries((0.5, 0.2), (1e-2, 0.3))
TWINS_NETWORK = BergstromBoyce(1.2, 6e3, 3.5, -0.5, 0.05)


def test_a_held_step_relaxes_as_the_series_at_any_strain() -> None:
    held = np.concatenate([[0.0], np.geomspace(1e-3, 2.0, 30)])
    for stretch in (0.4, 0.9, 1.5):
        t, lam = np.concatenate([[0.0], held]), np.concatenate([[1.0], np.full(31, stretch)])
        expected = uniaxial_stress(LAW, stretch) * TWINS_SERIES.relaxation(held)
        # exact in arithmetic: S does not change while the stretch is held
        np.testing.assert_allclose(prony_stress(LAW, TWINS_SERIES, t, lam)[1:], expected, rtol=1e-13)


def test_a_small_ramp_is_the_integral_of_the_relaxation_modulus() -> None:
    t, rate = np.linspace(0.0, 1.0, 400), 1e-6
    c, tau = np.array(TWINS_SERIES.strengths), np.array(TWINS_SERIES.times)
    expected = YOUNG * rate * (t + (c * tau * (1.0 - np.exp(-t[:, None] / tau))).sum(axis=1))
    got = prony_stress(LAW, TWINS_SERIES, t, 1.0 + rate * t)
    np.testing.assert_allclose(got[1:], expected[1:], rtol=3e-6)  # strain 1e-6: what is not linear in it


@pytest.mark.parametrize("x", [0.1, 1.0, 10.0])
def test_small_oscillations_have_the_storage_and_loss_modulus(x: float) -> None:
    series = PronySeries((0.7,), (0.02,))
    omega, amplitude = x / 0.02, 1e-6
    last = 2.0 * np.pi / omega
    t = np.linspace(0.0, 8.0 * last + 20.0 * 0.02, 40001)
    stress = prony_stress(LAW, series, t, 1.0 + amplitude * np.sin(omega * t))
    late = t > t[-1] - 4.0 * last
    basis = np.column_stack([np.sin(omega * t[late]), np.cos(omega * t[late])])
    storage, loss = np.linalg.lstsq(basis, stress[late] / amplitude, rcond=None)[0]
    # 5000 samples a period or fewer by a factor of 3: the trapezoid's error is (omega h)^2 / 12
    np.testing.assert_allclose(storage, YOUNG * series.storage(omega), rtol=1e-4)
    np.testing.assert_allclose(loss, YOUNG * series.loss(omega), rtol=1e-4)


def test_the_recursion_is_the_convolution_of_full_tensors() -> None:
    """dev(F H F^T) with 3 x 3 tensors and the convolution summed by itself, neo-Hookean."""
    series, mu = PronySeries((0.8,), (0.05,)), 20e3
    t = np.linspace(0.0, 0.2, 1601)
    lam = 1.0 - 0.4 * np.sin(np.pi * t / 0.25) ** 2
    F = np.zeros((len(t), 3, 3))
    F[:, 0, 0], F[:, 1, 1], F[:, 2, 2] = lam, lam**-0.5, lam**-0.5
    C = np.swapaxes(F, 1, 2) @ F
    S = mu * (np.eye(3) - np.trace(C, axis1=1, axis2=2)[:, None, None] / 3.0 * np.linalg.inv(C))
    end = len(t) - 1
    middle = 0.5 * (t[1:] + t[:-1])
    H = 0.8 * (np.exp(-(t[end] - middle) / 0.05)[:, None, None] * np.diff(S, axis=0)).sum(axis=0)
    tau = F[end] @ (S[end] + H) @ F[end].T
    expected = (tau[0, 0] - tau[1, 1]) / lam[end]
    # 1601 samples: the sum at the middles is of second order, (h / tau)^2 / 24
    np.testing.assert_allclose(prony_stress(LAW, series, t, lam)[end], expected, rtol=1e-5)


def test_samples_of_a_large_history_converge_with_second_order() -> None:
    def end_stress(n: int) -> float:
        t = np.linspace(0.0, 0.4, n + 1)
        return float(prony_stress(LAW, TWINS_SERIES, t, np.exp(-0.8 * np.sin(3.0 * t)))[-1])

    exact, sizes = end_stress(25600), [25, 50, 100, 200]
    errors = [abs(end_stress(n) - exact) for n in sizes]
    assert_order([1.0 / n for n in sizes], errors, 2.0, 0.1)


def test_fast_and_slow_limits() -> None:
    lam = np.linspace(1.0, 0.5, 60)
    for time, factor in ((1e-9, TWINS_SERIES.instantaneous), (1e9, 1.0)):
        got = prony_stress(LAW, TWINS_SERIES, np.linspace(0.0, time, 60), lam)
        # the test is 1e-7 of the shortest time, the longest 3e-8 of it; a step's rise is left out
        np.testing.assert_allclose(got[2:], factor * uniaxial_stress(LAW, lam)[2:], rtol=2e-6)
    for resistance, factor in ((1e9, 2.2), (1.0, 1.0)):
        network = BergstromBoyce(1.2, resistance)
        got = bergstrom_boyce_stress(LAW, network, np.linspace(0.0, 1.0, 60), lam)[0]
        # what is left of network B at 0.7 / s and m = 4 is of the size of tau_hat, 1 Pa of 500 and more
        np.testing.assert_allclose(got[1:], factor * uniaxial_stress(LAW, lam)[1:], rtol=1e-5, atol=2.0)


def test_conventions_of_the_shares_agree() -> None:
    series = PronySeries((0.6, 0.4), (0.01, 0.1))
    np.testing.assert_allclose(series.instantaneous_shares, [0.3, 0.2], rtol=1e-14)
    assert series.instantaneous == pytest.approx(2.0)
    np.testing.assert_allclose(series.relaxation([0.0, 1e6]), [2.0, 1.0], rtol=1e-14)


def test_the_creeping_network_follows_its_own_tensor_equations() -> None:
    """C_v^-1 as a full tensor: dC_v^-1/dt = -2 F^-1 (gamma N b_e) F^-T."""
    mu, end = 20e3, 0.02
    stretch_at = lambda s: np.exp(-0.6 * np.sin(2.0 * np.pi * s / (1.6 * end)))  # noqa: E731

    def parts(time: float, flat: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        lam = stretch_at(time)
        F = np.diag([lam, lam**-0.5, lam**-0.5])
        Ci = flat.reshape(3, 3)
        b = F @ Ci @ F.T
        return F, b, 1.2 * mu * (b - np.trace(b) / 3.0 * np.eye(3))

    def rate(time: float, flat: FloatArray) -> FloatArray:
        F, b, tau = parts(time, flat)
        size = np.sqrt((tau * tau).sum())
        if size == 0.0:
            return np.zeros(9)
        chain = np.sqrt(np.trace(np.linalg.inv(flat.reshape(3, 3))) / 3.0)
        gamma = (chain - 1.0 + 0.05) ** -0.5 * (size / 6e3) ** 3.5
        back = np.linalg.inv(F)
        return np.asarray(-2.0 * gamma / size * back @ tau @ b @ back.T).ravel()

    found = solve_ivp(rate, (0.0, end), np.eye(3).ravel(), rtol=1e-9, atol=1e-12)
    F, _, tau_b = parts(end, found.y[:, -1])
    b = F @ F.T
    tau = mu * (b - np.trace(b) / 3.0 * np.eye(3)) + tau_b
    t = np.linspace(0.0, end, 4001)
    got, viscous = bergstrom_boyce_stress(LAW, TWINS_NETWORK, t, stretch_at(t))
    # log stretch is linear between 4000 samples: second order, (h omega)^2 / 12
    np.testing.assert_allclose(got[-1], (tau[0, 0] - tau[1, 1]) / F[0, 0], rtol=1e-6)
    np.testing.assert_allclose(viscous[-1], found.y[0, -1] ** -0.5, rtol=1e-6)


def test_a_held_step_of_the_network_relaxes_towards_network_a() -> None:
    t = np.concatenate([[0.0, 0.0], np.geomspace(1e-6, 1e4, 60)])
    lam = np.where(np.arange(62) == 0, 1.0, 0.6)
    stress, viscous = bergstrom_boyce_stress(LAW, TWINS_NETWORK, t, lam)
    assert stress[1] == pytest.approx(2.2 * float(uniaxial_stress(LAW, 0.6)), rel=1e-8)  # the table's spline
    assert (np.diff(np.abs(stress[1:])) < 0.0).all()
    assert (np.diff(viscous[1:]) < 0.0).all()
    # at 1e4 s the flow is below 1e-4 / s: |tau_B| = tau_hat (1e-5)^(1/3.5) = 0.04 tau_hat or less
    assert abs(stress[-1] - uniaxial_stress(LAW, 0.6)) < 0.05 * 6e3 / 0.6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PronySeries((0.1,), ()), "one time for each strength"),
        (lambda: PronySeries((-0.1,), (1.0,)), "strength 0 must be >= 0"),
        (lambda: PronySeries((0.1,), (0.0,)), "relaxation time 0 must be > 0"),
        (lambda: PronySeries((0.1,), (np.nan,)), "relaxation time 0"),
        (lambda: BergstromBoyce(1.0, 0.0), "resistance must be > 0 Pa"),
        (lambda: BergstromBoyce(1.0, 1.0, exponent=0.5), "exponent must be in"),
        (lambda: BergstromBoyce(1.0, 1.0, chain_exponent=0.5), "chain_exponent must be in"),
        (lambda: prony_stress(LAW, TWINS_SERIES, [0.0, -1.0], [1.0, 1.0]), "not descend"),
        (lambda: prony_stress(LAW, TWINS_SERIES, [0.0, 1.0], [1.0]), "as many stretches as times"),
        (lambda: prony_stress(LAW, TWINS_SERIES, [0.0, 1.0], [1.0, 0.0]), "stretch must be > 0"),
    ],
)
def test_a_model_that_makes_no_sense_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
