"""Homogeneous rate-dependent responses against closed forms, full tensors and each other."""

import numpy as np
import pytest
from numpy.typing import NDArray
from order import assert_order
from scipy.integrate import solve_ivp

from explicit.materials import neo_hookean
from explicit.relaxation import (
    BergstromBoyce,
    PronySeries,
    bergstrom_boyce_stress,
    prony_stress,
    uniaxial_stress,
)

FloatArray = NDArray[np.float64]

LAW = neo_hookean(20e3)
YOUNG = 60e3
SERIES = PronySeries((0.5, 0.2), (1e-2, 0.3))
NETWORK = BergstromBoyce(1.2, 6e3, 3.5, -0.5, 0.05)


def test_a_held_step_relaxes_as_the_series_at_any_strain() -> None:
    held = np.concatenate([[0.0], np.geomspace(1e-3, 2.0, 30)])
    for stretch in (0.4, 0.9, 1.5):
        t, lam = np.concatenate([[0.0], held]), np.concatenate([[1.0], np.full(31, stretch)])
        expected = uniaxial_stress(LAW, stretch) * SERIES.relaxation(held)
        # exact in arithmetic: S does not change while the stretch is held
        np.testing.assert_allclose(prony_stress(LAW, SERIES, t, lam)[1:], expected, rtol=1e-13)


def test_a_small_ramp_is_the_integral_of_the_relaxation_modulus() -> None:
    t, rate = np.linspace(0.0, 1.0, 400), 1e-6
    c, tau = np.array(SERIES.strengths), np.array(SERIES.times)
    expected = YOUNG * rate * (t + (c * tau * (1.0 - np.exp(-t[:, None] / tau))).sum(axis=1))
    got = prony_stress(LAW, SERIES, t, 1.0 + rate * t)
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
        return float(prony_stress(LAW, SERIES, t, np.exp(-0.8 * np.sin(3.0 * t)))[-1])

    exact, sizes = end_stress(25600), [25, 50, 100, 200]
    errors = [abs(end_stress(n) - exact) for n in sizes]
    assert_order([1.0 / n for n in sizes], errors, 2.0, 0.1)


def test_fast_and_slow_limits() -> None:
    lam = np.linspace(1.0, 0.5, 60)
    for time, factor in ((1e-9, SERIES.instantaneous), (1e9, 1.0)):
        got = prony_stress(LAW, SERIES, np.linspace(0.0, time, 60), lam)
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
    got, viscous = bergstrom_boyce_stress(LAW, NETWORK, t, stretch_at(t))
    # log stretch is linear between 4000 samples: second order, (h omega)^2 / 12
    np.testing.assert_allclose(got[-1], (tau[0, 0] - tau[1, 1]) / F[0, 0], rtol=1e-6)
    np.testing.assert_allclose(viscous[-1], found.y[0, -1] ** -0.5, rtol=1e-6)


def test_a_held_step_of_the_network_relaxes_towards_network_a() -> None:
    t = np.concatenate([[0.0, 0.0], np.geomspace(1e-6, 1e4, 60)])
    lam = np.where(np.arange(62) == 0, 1.0, 0.6)
    stress, viscous = bergstrom_boyce_stress(LAW, NETWORK, t, lam)
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
        (lambda: prony_stress(LAW, SERIES, [0.0, -1.0], [1.0, 1.0]), "not descend"),
        (lambda: prony_stress(LAW, SERIES, [0.0, 1.0], [1.0]), "as many stretches as times"),
        (lambda: prony_stress(LAW, SERIES, [0.0, 1.0], [1.0, 0.0]), "stretch must be > 0"),
    ],
)
def test_what_makes_no_sense_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
