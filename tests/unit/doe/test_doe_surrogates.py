"""Surrogates: principal components, response and cost, and the battery of every entry of SURROGATES."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, RBFInterpolator

import doe
from doe.surrogates import (
    DEFAULT_KERNELS,
    Kernel,
    PrincipalComponents,
    QuadraticSurrogate,
    RadialBasis,
    SurrogateError,
)
from doe.surrogates.protocol import checked_runs, unit_points
from doe.surrogates.quadratic import runs_wanted, terms
from doe.surrogates.rbf import choose_kernel, loo_operator

FloatArray = NDArray[np.float64]
BOX = doe.Box(("m", "beta"), (0.75, 1e-6), (1.25, 1e-4), (False, True))
TIME = np.linspace(0.0, 1.0, 40)


def response(points: FloatArray) -> FloatArray:
    """A force of tens and a radius of thousandths: 40 + 40 entries, smooth in m and log(beta)."""
    m, b = points[:, :1], np.log10(points[:, 1:] / 1e-5)
    force = 50.0 * m * TIME**2 * (1.0 + 0.1 * b) + 5.0 * np.sin(8.0 * TIME * np.sqrt(m))
    radius = 5e-3 + 1e-3 * TIME / (1.0 + 0.3 * m + 0.05 * b)
    return np.concatenate([force, radius], axis=1)


SCALE = np.repeat([1.0, 1e-5], 40)


def fitted(kind: str) -> tuple[doe.Surrogate, FloatArray]:
    """Every kind of surrogate on the same runs, and the values it was given."""
    points = doe.sobol(BOX, 32, rng=0).points
    values = response(points)
    if kind == "cost":
        cost = np.sum(values[:, :40] ** 2, axis=1)
        return doe.CostSurrogate.fit(BOX, points, cost), cost[:, None]
    return doe.SURROGATES[kind].fit(BOX, points, values, scale=SCALE), values


@pytest.mark.parametrize("kind", [*doe.SURROGATES, "cost"])
def test_battery(kind: str) -> None:
    surrogate, values = fitted(kind)
    assert surrogate.box == BOX
    assert surrogate.loo_residuals.shape == values.shape
    lost: Any = getattr(surrogate, "truncation_error", 0.0)
    lost = lost + getattr(surrogate, "nugget_error", 0.0)
    # At the runs only truncation and a nugget are left, and 1e-8 of the longest (scaled) value that the
    # solve may lose.
    scale: Any = SCALE if values.shape[1] == 80 else 1.0
    misfit = np.abs(surrogate.predict(surrogate.points) - values)
    assert np.all(misfit <= lost + 1e-8 * np.linalg.norm(values / scale, axis=1).max() * scale)
    corner = surrogate.predict([BOX.lower])
    assert corner.shape == (1, values.shape[1])
    with pytest.raises(ValueError, match=r"point 0: m = 1.5 is outside \[0.75, 1.25\]"):
        surrogate.predict([[1.5, 1e-5]])
    assert np.isfinite(surrogate.predict([[1.5, 1e-5]], extrapolate=True)).all()
    with pytest.raises(ValueError, match=r"shape \[m, 2\]"):
        surrogate.predict([1.0, 1e-5])


def test_response_is_predicted_between_the_runs() -> None:
    surrogate, _ = fitted("response")
    assert isinstance(surrogate, doe.ResponseSurrogate)
    inside = doe.Box(("m", "beta"), (0.8, 2e-6), (1.2, 5e-5), (False, True))
    points = doe.sobol(inside, 64, rng=1).points
    error = np.sqrt(np.mean(((surrogate.predict(points) - response(points)) / SCALE) ** 2))
    # Leave-one-out is pessimistic: corners are extrapolated and the design is thinner by one run.
    assert error < surrogate.loo_rms
    assert error > 1e-3 * surrogate.loo_rms


def test_leave_one_out_of_the_response_is_the_refit() -> None:
    points = doe.full_factorial(BOX, 4).points
    values = response(points)
    kernel = (Kernel("cubic", 1),)
    surrogate = doe.ResponseSurrogate.fit(BOX, points, values, scale=SCALE, variance=1.0, kernels=kernel)
    for i in (0, 5, 15):
        rest = np.arange(16) != i
        other = doe.ResponseSurrogate.fit(
            BOX, points[rest], values[rest], scale=SCALE, variance=1.0, kernels=kernel
        )
        residual = values[i] - other.predict(points[i : i + 1], extrapolate=True)[0]
        # All components kept, so that the basis does not matter; round-off of the solve, in units of scale.
        np.testing.assert_allclose(surrogate.loo_residuals[i] / SCALE, residual / SCALE, atol=1e-9)
    assert surrogate.loo_rms == pytest.approx(
        np.sqrt(np.mean((surrogate.loo_residuals / SCALE) ** 2)), rel=1e-12
    )


def test_leave_one_out_contains_what_truncation_lost() -> None:
    points = doe.full_factorial(BOX, 4).points
    values = response(points)
    kernel = (Kernel("cubic", 1),)
    surrogate = doe.ResponseSurrogate.fit(BOX, points, values, scale=SCALE, variance=0.9, kernels=kernel)
    assert surrogate.n_components < 3
    # The truncated responses at the runs, interpolated in full without run 5, against the whole run 5.
    kept = surrogate.predict(points)
    rest = np.arange(16) != 5
    other = doe.ResponseSurrogate.fit(
        BOX, points[rest], kept[rest], scale=SCALE, variance=1.0, kernels=kernel
    )
    residual = (values[5] - other.predict(points[5:6])[0]) / SCALE
    np.testing.assert_allclose(
        surrogate.loo_residuals[5] / SCALE, residual, atol=1e-9
    )  # round-off of the solve
    assert np.abs(kept - values).max() > 1e-2  # something was lost


def test_truncation_error_is_honest() -> None:
    values = response(doe.sobol(BOX, 16, rng=3).points)
    reduced = PrincipalComponents.fit(values, scale=SCALE, variance=0.999)
    error = values - reduced.expand(reduced.scores(values))
    np.testing.assert_allclose(reduced.truncation / SCALE, error / SCALE, atol=1e-11)  # round-off of O(100)
    np.testing.assert_allclose(reduced.truncation_error, np.abs(error).max(axis=0), atol=1e-11)


@pytest.mark.parametrize("variance", [0.9, 0.999, 1.0 - 1e-8])
def test_kept_variance_is_that_of_the_covariance_matrix(variance: float) -> None:
    values = response(doe.sobol(BOX, 16, rng=3).points)
    reduced = PrincipalComponents.fit(values, scale=SCALE, variance=variance)
    # Eckart-Young by another road: eigenvalues of the covariance matrix.
    eigenvalues = np.linalg.eigvalsh(np.cov((values / SCALE).T))[::-1]
    share = np.cumsum(eigenvalues) / eigenvalues.sum()
    q = reduced.n_components
    assert share[q - 1] >= variance - 1e-12
    assert q == 1 or share[q - 2] < variance
    lost = np.sum((reduced.truncation / SCALE) ** 2) / np.sum(((values - values.mean(axis=0)) / SCALE) ** 2)
    assert lost == pytest.approx(1.0 - share[q - 1], abs=1e-12)


def test_scale_decides_what_is_kept() -> None:
    values = response(doe.sobol(BOX, 16, rng=3).points)
    # Without weights the radius (1e-3) is nothing beside the force (50): its truncation is far larger.
    careless = PrincipalComponents.fit(values, variance=0.999)
    careful = PrincipalComponents.fit(values, scale=SCALE, variance=0.999)
    assert careful.truncation_error[40:].max() < 0.5 * careless.truncation_error[40:].max()


def test_a_response_that_depends_on_nothing() -> None:
    points = doe.full_factorial(BOX, 3).points
    surrogate = doe.ResponseSurrogate.fit(BOX, points, np.full((9, 3), 7.0))
    assert surrogate.predict([[1.0, 1e-5]]).tolist() == [[7.0, 7.0, 7.0]]
    assert surrogate.loo_rms == 0.0


def test_the_response_beats_the_cost_with_a_kink() -> None:
    # |F(m) - F(1.12)| summed: the kink lies between two runs, where only the response can find it.
    box = doe.Box(("m",), (0.75,), (1.25,))
    points = doe.full_factorial(box, 9).points
    fine = np.linspace(0.75, 1.25, 2001)[:, None]

    def force(m: FloatArray) -> FloatArray:
        return 50.0 * np.sqrt(m) * TIME

    target = force(np.array([[1.12]]))
    from_response = doe.ResponseSurrogate.fit(box, points, force(points)).predict(fine)
    by_response = fine[np.argmin(np.abs(from_response - target).sum(axis=1)), 0]
    cost = doe.CostSurrogate.fit(box, points, np.abs(force(points) - target).sum(axis=1))
    by_cost = fine[np.argmin(cost.predict(fine)[:, 0]), 0]
    assert abs(by_response - 1.12) < 2.5e-4  # one step of the fine grid
    assert abs(by_cost - 1.12) > 4.0 * abs(by_response - 1.12)
    assert cost.cost([1.0]) == cost.predict([[1.0]])[0, 0]


def test_refusals() -> None:
    points = doe.full_factorial(BOX, 3).points
    values = response(points)
    with pytest.raises(ValueError, match="run 0: m = 0 is outside"):
        doe.ResponseSurrogate.fit(BOX, np.tile([0.0, 1e-5], (9, 1)), values)
    with pytest.raises(ValueError, match=r"values must have shape \[9, k\]"):
        doe.ResponseSurrogate.fit(BOX, points, values[:8])
    with pytest.raises(ValueError, match=r"costs must have shape \[n\]"):
        doe.CostSurrogate.fit(BOX, points, values)
    bad = values.copy()
    bad[[4, 7], 3:] = np.nan
    with pytest.raises(SurrogateError, match=r"run 4 has nan in entry 3 \(2 of 9 runs are not finite\)"):
        doe.ResponseSurrogate.fit(BOX, points, bad)
    with pytest.raises(ValueError, match=r"scale must be finite and > 0, got 0\.0 for entry 79"):
        doe.ResponseSurrogate.fit(BOX, points, values, scale=np.append(SCALE[:-1], 0.0))
    with pytest.raises(ValueError, match=r"variance must be in \(0, 1\], got 1.1"):
        doe.ResponseSurrogate.fit(BOX, points, values, variance=1.1)
    with pytest.raises(SurrogateError, match="at least 4 runs"):
        doe.ResponseSurrogate.fit(BOX, points[:3], values[:3])


class Nearest:
    """A made-up surrogate: the response of the nearest run."""

    def __init__(self, box: doe.Box, points: FloatArray, values: FloatArray) -> None:
        self.box, self.points, self.values = box, points, values

    @classmethod
    def fit(cls, box: doe.Box, points: Any, values: Any, *, scale: Any = 1.0) -> "Nearest":
        return cls(box, *checked_runs(box, points, values))

    def predict(self, points: Any, *, extrapolate: bool = False) -> FloatArray:
        away = unit_points(self.box, points, extrapolate=extrapolate)[:, None] - self.box.unit(self.points)
        rows = (away**2).sum(axis=2).argmin(axis=1)
        return np.asarray(self.values[rows])

    @property
    def loo_residuals(self) -> FloatArray:
        u = self.box.unit(self.points)
        away = ((u[:, None] - u) ** 2).sum(axis=2)
        np.fill_diagonal(away, np.inf)
        return np.asarray(self.values - self.values[away.argmin(axis=1)])


def test_a_made_up_surrogate_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(doe.SURROGATES, "nearest", Nearest)
    test_battery("nearest")


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


QUADRATIC_BOX = doe.Box(("m", "f", "beta"), (0.9, 0.1, 1e-6), (1.3, 0.5, 1e-4), (False, False, True))


def quadratic(points: np.ndarray) -> np.ndarray:
    """Two entries, quadratic in the unit coordinates."""
    u = QUADRATIC_BOX.unit(points)
    first = 3.0 + u[:, 0] - 2.0 * u[:, 1] * u[:, 2] + u[:, 2] ** 2
    return np.stack([first, 1e-3 * (u[:, 0] * u[:, 1] - u[:, 1])], axis=1)


def test_a_quadratic_is_found_exactly() -> None:
    points = doe.sobol(QUADRATIC_BOX, 16, rng=0).points
    surrogate = QuadraticSurrogate.fit(QUADRATIC_BOX, points, quadratic(points))
    other = doe.sobol(QUADRATIC_BOX, 32, rng=1).points
    # Round-off of a well-conditioned solve.
    np.testing.assert_allclose(surrogate.predict(other), quadratic(other), rtol=1e-11, atol=1e-14)
    assert surrogate.degrees_of_freedom == 6
    assert (terms(3), runs_wanted(3)) == (10, 25)


def test_roughness_is_the_scatter_of_single_runs() -> None:
    gain = np.array([[0.5, 0.0], [1.0, 2000.0]])
    noise = np.array([0.2, 3e-4])
    expected = gain @ np.diag(noise**2) @ gain.T
    found = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        points = doe.latin_hypercube(QUADRATIC_BOX, 25, rng=rng).points
        values = quadratic(points) + noise * rng.standard_normal((25, 2))
        found.append(QuadraticSurrogate.fit(QUADRATIC_BOX, points, values).roughness(gain))
    # Each has 15 degrees of freedom: a variance of 200 of them scatters by sqrt(2 / 3000) = 2.6 %; 4 sigma.
    np.testing.assert_allclose(np.mean(found, axis=0), expected, rtol=0.11)


def test_averaging_flattens_what_an_interpolant_follows() -> None:
    rng = np.random.default_rng(3)
    points = doe.latin_hypercube(QUADRATIC_BOX, 40, rng=rng).points
    values = quadratic(points) + 0.1 * rng.standard_normal((40, 2))
    surrogate = QuadraticSurrogate.fit(QUADRATIC_BOX, points, values)
    error = surrogate.predict(points)[:, 0] - quadratic(points)[:, 0]
    # Ten terms of forty runs keep a quarter of the variance, an interpolant all of it; 3 sigma of chi^2(10).
    assert 0.1**2 * 10 / 40 * 0.1 < np.mean(error**2) < 0.1**2 * 10 / 40 * 2.4


def test_leave_one_out_is_the_refit() -> None:
    rng = np.random.default_rng(1)
    points = doe.latin_hypercube(QUADRATIC_BOX, 18, rng=rng).points
    values = quadratic(points) + 0.1 * rng.standard_normal((18, 2))
    surrogate = QuadraticSurrogate.fit(QUADRATIC_BOX, points, values)
    for left in (0, 7):
        rest = np.arange(18) != left
        other = QuadraticSurrogate.fit(QUADRATIC_BOX, points[rest], values[rest])
        missed = values[left] - other.predict(points[left : left + 1])[0]
        np.testing.assert_allclose(surrogate.loo_residuals[left], missed, rtol=1e-9)


def test_what_does_not_determine_it_is_refused() -> None:
    points = doe.sobol(QUADRATIC_BOX, 32, rng=0).points.copy()
    with pytest.raises(
        SurrogateError, match=r"has 10 terms and takes at least 11 runs, better 25; there are 8"
    ):
        QuadraticSurrogate.fit(QUADRATIC_BOX, points[:8], quadratic(points[:8]))
    points[:, 1] = 0.3
    with pytest.raises(SurrogateError, match=r"the 32 runs do not determine a quadratic of 3 variables"):
        QuadraticSurrogate.fit(QUADRATIC_BOX, points, quadratic(points))


def test_roughness_of_four_runs_by_hand() -> None:
    # A parabola through four evenly spaced values leaves their third difference, (-1, 3, -3, 1) / sqrt(20).
    box = doe.Box(("m",), (0.0,), (3.0,))
    contrast = np.array([-1.0, 3.0, -3.0, 1.0]) / np.sqrt(20.0)
    values = (2.0 + np.arange(4.0) ** 2 + 0.6 * contrast)[:, None]
    surrogate = QuadraticSurrogate.fit(box, np.arange(4.0)[:, None], values)
    assert surrogate.degrees_of_freedom == 1
    np.testing.assert_allclose(surrogate.residuals[:, 0], 0.6 * contrast, atol=1e-12)  # round-off
    # The whole of 0.6^2 over one degree of freedom, through a gain of 2.
    np.testing.assert_allclose(surrogate.roughness(np.array([[2.0]])), [[4.0 * 0.36]], rtol=1e-9)
