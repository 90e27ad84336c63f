"""Surrogates: principal components, response and cost, and the battery of every entry of SURROGATES."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from doe import SURROGATES, Box, CostSurrogate, ResponseSurrogate, Surrogate, full_factorial, sobol
from doe.surrogates import Kernel, PrincipalComponents, SurrogateError, SurrogateKind
from doe.surrogates.protocol import checked_runs, unit_points

FloatArray = NDArray[np.float64]
BOX = Box(("m", "beta"), (0.75, 1e-6), (1.25, 1e-4), (False, True))
TIME = np.linspace(0.0, 1.0, 40)


def response(points: FloatArray) -> FloatArray:
    """A force of tens and a radius of thousandths: 40 + 40 entries, smooth in m and log(beta)."""
    m, b = points[:, :1], np.log10(points[:, 1:] / 1e-5)
    force = 50.0 * m * TIME**2 * (1.0 + 0.1 * b) + 5.0 * np.sin(8.0 * TIME * np.sqrt(m))
    radius = 5e-3 + 1e-3 * TIME / (1.0 + 0.3 * m + 0.05 * b)
    return np.concatenate([force, radius], axis=1)


SCALE = np.repeat([1.0, 1e-5], 40)


def fitted(kind: str) -> tuple[Surrogate, FloatArray]:
    """Every kind of surrogate on the same runs, and the values it was given."""
    points = sobol(BOX, 32, rng=0).points
    values = response(points)
    if SURROGATES[kind].scalar:
        cost = np.sum(values[:, :40] ** 2, axis=1, keepdims=True)
        return SURROGATES[kind].fit(BOX, points, cost), cost
    return SURROGATES[kind].fit(BOX, points, values, scale=SCALE), values


@pytest.mark.parametrize("kind", SURROGATES)
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
    assert isinstance(surrogate, ResponseSurrogate)
    inside = Box(("m", "beta"), (0.8, 2e-6), (1.2, 5e-5), (False, True))
    points = sobol(inside, 64, rng=1).points
    error = np.sqrt(np.mean(((surrogate.predict(points) - response(points)) / SCALE) ** 2))
    # Leave-one-out is pessimistic: corners are extrapolated and the design is thinner by one run.
    assert error < surrogate.loo_rms
    assert error > 1e-3 * surrogate.loo_rms


def test_leave_one_out_of_the_response_is_the_refit() -> None:
    points = full_factorial(BOX, 4).points
    values = response(points)
    kernel = (Kernel("cubic", 1),)
    surrogate = ResponseSurrogate.fit(BOX, points, values, scale=SCALE, variance=1.0, kernels=kernel)
    for i in (0, 5, 15):
        rest = np.arange(16) != i
        other = ResponseSurrogate.fit(
            BOX, points[rest], values[rest], scale=SCALE, variance=1.0, kernels=kernel
        )
        residual = values[i] - other.predict(points[i : i + 1], extrapolate=True)[0]
        # All components kept, so that the basis does not matter; round-off of the solve, in units of scale.
        np.testing.assert_allclose(surrogate.loo_residuals[i] / SCALE, residual / SCALE, atol=1e-9)
    assert surrogate.loo_rms == pytest.approx(
        np.sqrt(np.mean((surrogate.loo_residuals / SCALE) ** 2)), rel=1e-12
    )


def test_leave_one_out_contains_what_truncation_lost() -> None:
    points = full_factorial(BOX, 4).points
    values = response(points)
    kernel = (Kernel("cubic", 1),)
    surrogate = ResponseSurrogate.fit(BOX, points, values, scale=SCALE, variance=0.9, kernels=kernel)
    assert surrogate.n_components < 3
    # The truncated responses at the runs, interpolated in full without run 5, against the whole run 5.
    kept = surrogate.predict(points)
    rest = np.arange(16) != 5
    other = ResponseSurrogate.fit(BOX, points[rest], kept[rest], scale=SCALE, variance=1.0, kernels=kernel)
    residual = (values[5] - other.predict(points[5:6])[0]) / SCALE
    np.testing.assert_allclose(
        surrogate.loo_residuals[5] / SCALE, residual, atol=1e-9
    )  # round-off of the solve
    assert np.abs(kept - values).max() > 1e-2  # something was lost


def test_truncation_error_is_honest() -> None:
    values = response(sobol(BOX, 16, rng=3).points)
    reduced = PrincipalComponents.fit(values, scale=SCALE, variance=0.999)
    error = values - reduced.expand(reduced.scores(values))
    np.testing.assert_allclose(reduced.truncation / SCALE, error / SCALE, atol=1e-11)  # round-off of O(100)
    np.testing.assert_allclose(reduced.truncation_error, np.abs(error).max(axis=0), atol=1e-11)


@pytest.mark.parametrize("variance", [0.9, 0.999, 1.0 - 1e-8])
def test_kept_variance_is_that_of_the_covariance_matrix(variance: float) -> None:
    values = response(sobol(BOX, 16, rng=3).points)
    reduced = PrincipalComponents.fit(values, scale=SCALE, variance=variance)
    # Eckart-Young by another road: eigenvalues of the covariance matrix.
    eigenvalues = np.linalg.eigvalsh(np.cov((values / SCALE).T))[::-1]
    share = np.cumsum(eigenvalues) / eigenvalues.sum()
    q = reduced.n_components
    assert reduced.kept_variance == pytest.approx(
        share[q - 1], abs=1e-12
    )  # eigenvalues are good to 1e-16 of the sum
    assert share[q - 1] >= variance - 1e-12
    assert q == 1 or share[q - 2] < variance
    lost = np.sum((reduced.truncation / SCALE) ** 2) / np.sum(((values - values.mean(axis=0)) / SCALE) ** 2)
    assert lost == pytest.approx(1.0 - share[q - 1], abs=1e-12)


def test_scale_decides_what_is_kept() -> None:
    values = response(sobol(BOX, 16, rng=3).points)
    # Without weights the radius (1e-3) is nothing beside the force (50): its truncation is far larger.
    careless = PrincipalComponents.fit(values, variance=0.999)
    careful = PrincipalComponents.fit(values, scale=SCALE, variance=0.999)
    assert careful.truncation_error[40:].max() < 0.5 * careless.truncation_error[40:].max()


def test_a_response_that_depends_on_nothing() -> None:
    points = full_factorial(BOX, 3).points
    surrogate = ResponseSurrogate.fit(BOX, points, np.full((9, 3), 7.0))
    assert surrogate.predict([[1.0, 1e-5]]).tolist() == [[7.0, 7.0, 7.0]]
    assert surrogate.loo_rms == 0.0


def test_the_response_beats_the_cost_with_a_kink() -> None:
    # |F(m) - F(1.12)| summed: the kink lies between two runs, where only the response can find it.
    box = Box(("m",), (0.75,), (1.25,))
    points = full_factorial(box, 9).points
    fine = np.linspace(0.75, 1.25, 2001)[:, None]

    def force(m: FloatArray) -> FloatArray:
        return 50.0 * np.sqrt(m) * TIME

    target = force(np.array([[1.12]]))
    from_response = ResponseSurrogate.fit(box, points, force(points)).predict(fine)
    by_response = fine[np.argmin(np.abs(from_response - target).sum(axis=1)), 0]
    cost = CostSurrogate.fit(box, points, np.abs(force(points) - target).sum(axis=1))
    by_cost = fine[np.argmin(cost.predict(fine)[:, 0]), 0]
    assert abs(by_response - 1.12) < 2.5e-4  # one step of the fine grid
    assert abs(by_cost - 1.12) > 4.0 * abs(by_response - 1.12)
    assert cost.cost([1.0]) == cost.predict([[1.0]])[0, 0]


def test_refusals() -> None:
    points = full_factorial(BOX, 3).points
    values = response(points)
    with pytest.raises(ValueError, match="run 0: m = 0 is outside"):
        ResponseSurrogate.fit(BOX, np.tile([0.0, 1e-5], (9, 1)), values)
    with pytest.raises(ValueError, match=r"values must have shape \[9, k\]"):
        ResponseSurrogate.fit(BOX, points, values[:8])
    with pytest.raises(ValueError, match=r"costs must have shape \[n\]"):
        CostSurrogate.fit(BOX, points, values)
    bad = values.copy()
    bad[[4, 7], 3:] = np.nan
    with pytest.raises(SurrogateError, match=r"run 4 has nan in entry 3 \(2 of 9 runs are not finite\)"):
        ResponseSurrogate.fit(BOX, points, bad)
    with pytest.raises(ValueError, match=r"scale must be finite and > 0, got 0\.0 for entry 79"):
        ResponseSurrogate.fit(BOX, points, values, scale=np.append(SCALE[:-1], 0.0))
    with pytest.raises(ValueError, match=r"variance must be in \(0, 1\], got 1.1"):
        ResponseSurrogate.fit(BOX, points, values, variance=1.1)
    with pytest.raises(SurrogateError, match="at least 4 runs"):
        ResponseSurrogate.fit(BOX, points[:3], values[:3])


class Nearest:
    """A made-up surrogate: the response of the nearest run."""

    def __init__(self, box: Box, points: FloatArray, values: FloatArray) -> None:
        self.box, self.points, self.values = box, points, values

    @classmethod
    def fit(cls, box: Box, points: Any, values: Any, *, scale: Any = 1.0) -> "Nearest":
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


@pytest.mark.parametrize("scalar", [False, True])
def test_a_made_up_surrogate_is_one_line(monkeypatch: pytest.MonkeyPatch, scalar: bool) -> None:
    made_up: Any = Nearest
    if scalar:
        made_up = type("Scalar", (), {"fit": lambda box, x, y: Nearest.fit(box, x, y[:, None])})
    monkeypatch.setitem(SURROGATES, "nearest", SurrogateKind(made_up, "the nearest run", scalar=scalar))
    test_battery("nearest")


def test_values_of_a_scalar_response_have_one_column() -> None:
    points = sobol(BOX, 8, rng=0).points
    with pytest.raises(ValueError, match=r"shape \[n, 1\], got \[8, 2\]"):
        SURROGATES["cost"].fit(BOX, points, np.ones((8, 2)))
