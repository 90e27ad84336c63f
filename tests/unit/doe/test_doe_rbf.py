"""Radial basis functions: leave-one-out against refits, exactness on polynomials, order of convergence."""

from contextlib import suppress

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, RBFInterpolator

from doe.surrogates import DEFAULT_KERNELS, Kernel, RadialBasis, SurrogateError
from doe.surrogates.rbf import choose_kernel, loo_operator

FloatArray = NDArray[np.float64]


def smooth(u: FloatArray) -> FloatArray:
    """Two smooth columns of any number of parameters."""
    s = u @ np.arange(1.0, u.shape[1] + 1.0)
    return np.stack([np.sin(2.0 * s), np.exp(-0.5 * s) + u[:, 0] ** 2], axis=1)


def scattered(n: int, d: int) -> FloatArray:
    return np.random.default_rng(11).random((n, d))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kernel", DEFAULT_KERNELS, ids=str)
def test_closed_form_leave_one_out_is_the_refit(kernel: Kernel, d: int) -> None:
    # Evenly spread in 1-D (random numbers come too close for the smoothest kernels).
    n = 9 if d == 1 else kernel.n_needed(d) + 6
    u = np.linspace(0.0, 1.0, n)[:, None] if d == 1 else scattered(n, d)
    values = smooth(u)
    fit = RadialBasis.fit(u, values, kernel)
    refits = np.empty_like(values)
    for i in range(n):
        rest = np.arange(n) != i
        epsilon = 1.0 if kernel.shape is None else kernel.shape
        other = RBFInterpolator(
            u[rest], values[rest], kernel=kernel.name, degree=kernel.degree, epsilon=epsilon
        )
        refits[i] = values[i] - other(u[i : i + 1])[0]
    # A solve leaves a residual of eps |Phi| |c|; it enters e_i with weights B_ij / B_ii, up to about 100
    # at the ends of a row of runs (binomial coefficients), where a smooth kernel extrapolates.
    coefficients = loo_operator(u, kernel)[0] @ values
    size = np.linalg.norm(kernel.matrix(u), 2) * np.linalg.norm(coefficients) + np.abs(values).max()
    tolerance = 100.0 * np.finfo(float).eps * size
    np.testing.assert_allclose(fit.loo_residuals, refits, rtol=0, atol=tolerance)
    assert np.abs(refits).max() > 10.0 * tolerance  # the comparison has something to compare


@pytest.mark.parametrize("kernel", DEFAULT_KERNELS[:6], ids=str)
def test_operator_is_the_block_of_the_inverse_saddle_matrix(kernel: Kernel) -> None:
    u = scattered(20, 2)
    P = kernel.tail(u)
    saddle = np.block([[kernel.matrix(u), P], [P.T, np.zeros((P.shape[1],) * 2)]])
    block = np.linalg.inv(saddle)[:20, :20]
    operator, condition = loo_operator(u, kernel)
    # Both lose the digits of the condition number.
    assert np.abs(operator - block).max() < 1e3 * np.finfo(float).eps * condition * np.abs(block).max()


@pytest.mark.parametrize("kernel", DEFAULT_KERNELS, ids=str)
def test_polynomials_of_the_tail_are_reproduced(kernel: Kernel) -> None:
    u = scattered(30, 2) if kernel.shape is None or kernel.shape >= 4 else scattered(12, 2)
    x, y = np.random.default_rng(2).random((2, 200))
    coefficients = np.random.default_rng(3).normal(size=(kernel.degree + 1, kernel.degree + 1))
    # Total degree of the tail: a_ij x^i y^j with i + j <= degree.
    allowed = np.add.outer(np.arange(kernel.degree + 1), np.arange(kernel.degree + 1)) <= kernel.degree
    exact = np.polynomial.polynomial.polyval2d(x, y, coefficients * allowed)
    values = np.polynomial.polynomial.polyval2d(u[:, 0], u[:, 1], coefficients * allowed)
    fit = RadialBasis.fit(u, values[:, None], kernel)
    # Round-off of the solve; the polynomial is O(1). Up to 1e-16 times a condition number of 1e6 or so.
    tolerance = 1e-13 * max(1.0, 1e-3 * fit.condition)
    assert np.abs(fit.predict(np.stack([x, y], axis=1))[:, 0] - exact).max() < max(tolerance, 1e-11)
    assert fit.loo_rms < max(tolerance, 1e-11)


def test_cubic_in_one_dimension_is_the_natural_cubic_spline() -> None:
    u = np.sort(scattered(9, 1), axis=0)
    values = smooth(u)
    spline = CubicSpline(u[:, 0], values, bc_type="natural")
    x = np.linspace(u[0, 0], u[-1, 0], 101)
    fit = RadialBasis.fit(u, values, Kernel("cubic", 1))
    np.testing.assert_allclose(fit.predict(x[:, None]), spline(x), atol=1e-11)  # condition number ~1e4


def test_error_converges_with_the_order_of_the_spline() -> None:
    # f'' = 0 at both ends, as the natural spline has it: fourth order everywhere.
    x = np.linspace(0.0, 1.0, 501)[:, None]
    counts = np.array([9, 17, 33, 65])
    errors, estimates = [], []
    for n in counts:
        u = np.linspace(0.0, 1.0, n)[:, None]
        fit = RadialBasis.fit(u, np.sin(2.0 * np.pi * u), Kernel("cubic", 1))
        errors.append(np.abs(fit.predict(x) - np.sin(2.0 * np.pi * x)).max())
        estimates.append(fit.loo_rms)
    order = -np.polyfit(np.log(counts - 1), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.3)  # the coarsest grid has 8 intervals a period
    assert np.all(np.diff(estimates) < 0.0)
    # Leaving a run out doubles the gap there, so the estimate lies above the error.
    assert np.all(np.array(estimates) > errors)


@pytest.mark.parametrize("n", [7, 9, 12])
def test_nine_runs_are_plenty_for_a_smooth_response(n: int) -> None:
    u, x = np.linspace(0.0, 1.0, n)[:, None], np.linspace(0.0, 1.0, 301)[:, None]
    fit = choose_kernel(u, np.sqrt(0.75 + 0.5 * u), DEFAULT_KERNELS)
    # sqrt(m) over m in [0.75, 1.25]: what a wave speed does with a stiffness. 1e-5 of its size.
    assert np.abs(fit.predict(x) - np.sqrt(0.75 + 0.5 * x)).max() < 1e-5
    others = []
    for kernel in DEFAULT_KERNELS:
        with suppress(SurrogateError):
            others.append(RadialBasis.fit(u, np.sqrt(0.75 + 0.5 * u), kernel).loo_rms)
    assert fit.loo_rms == min(others)


def test_rough_data_choose_a_rough_kernel() -> None:
    u = np.linspace(0.0, 1.0, 11)[:, None]
    fit = choose_kernel(u, np.abs(u - 0.47), DEFAULT_KERNELS)
    # Smooth kernels ring at a kink; the leave-one-out error must see it.
    assert fit.kernel.name in ("thin_plate_spline", "cubic")


def test_a_cluster_of_runs_is_not_ill_conditioned() -> None:
    # The condition number of the reduced matrix does not change with the size of the cloud.
    u = scattered(12, 2)
    _, wide = loo_operator(u, Kernel("cubic", 1))
    _, narrow = loo_operator(0.5 + 1e-3 * u, Kernel("cubic", 1))
    assert narrow == pytest.approx(wide, rel=1e-6)  # cancellation in 0.5 + 1e-3 u costs three digits


def test_too_few_runs_are_refused_with_the_number_needed() -> None:
    # Quadratic tail in two parameters: 6 terms, one run more to leave out.
    with pytest.raises(SurrogateError, match=r"at least 7 runs for 2 parameter\(s\) \(6 terms .* got 6"):
        RadialBasis.fit(scattered(6, 2), np.ones((6, 1)), Kernel("quintic", 2))
    with pytest.raises(SurrogateError, match=r"no kernel can be used with 2 runs.*at least 3 runs"):
        choose_kernel(scattered(2, 1), np.ones((2, 1)), DEFAULT_KERNELS)


def test_bad_runs_are_refused() -> None:
    u = scattered(8, 2)
    with pytest.raises(SurrogateError, match="runs 2 and 5 are the same point"):
        RadialBasis.fit(np.insert(u, 5, u[2], axis=0), np.ones((9, 1)), Kernel("cubic", 1))
    line = np.stack([u[:, 0], u[:, 0]], axis=1)
    with pytest.raises(SurrogateError, match=r"do not determine the 3 terms .* lie on a curve"):
        RadialBasis.fit(line, np.ones((8, 1)), Kernel("cubic", 1))
    line[7, 1] = 0.9
    line[:7, 1] = 0.3
    with pytest.raises(SurrogateError, match="without run 7 the other 7 do not determine"):
        RadialBasis.fit(line, np.ones((8, 1)), Kernel("cubic", 1))
    with pytest.raises(SurrogateError, match=r"ill-conditioned: condition number .* take a rougher kernel"):
        RadialBasis.fit(np.linspace(0, 1, 15)[:, None], np.ones((15, 1)), Kernel("gaussian", 0, 0.5))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wendland", 1), "unknown kernel 'wendland'; one of"),
        (("quintic", 1), "needs degree >= 2, got 1"),
        (("cubic", 1, 2.0), "has no shape parameter"),
        (("gaussian", 1), "needs a shape parameter > 0, got None"),
        (("gaussian", 1, 0.0), "needs a shape parameter > 0, got 0"),
    ],
)
def test_bad_kernels_are_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Kernel(*arguments)
