"""Search: known minima inside, on a face and in a corner of a box, and the refusals."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from doe import Box, SearchOutcome, nelder_mead

FloatArray = NDArray[np.float64]
BOX = Box(("x", "y"), (-2.0, -1.0), (2.0, 3.0))


def rosenbrock(p: FloatArray) -> float:
    """Minimum 0 at (1, 1) at the end of a bent valley."""
    return float((1.0 - p[0]) ** 2 + 100.0 * (p[1] - p[0] ** 2) ** 2)


@pytest.mark.parametrize("start", [None, (-1.2, 1.0), (2.0, 3.0), (-2.0, -1.0)])
def test_rosenbrock_inside_the_box(start: tuple[float, float] | None) -> None:
    result = nelder_mead(rosenbrock, BOX, start=start, tolerance=1e-7)
    # Tolerance 1e-7 of an edge of 4; the valley's curvatures differ by 2500, so allow 10 of it.
    np.testing.assert_allclose(result.x, [1.0, 1.0], atol=4e-6)
    assert result.outcome is SearchOutcome.CONVERGED
    assert result.outcome.ok
    assert result.at_bound == {}
    assert result.value == rosenbrock(result.x)


def test_rosenbrock_on_a_face() -> None:
    # With x <= 0.5 the constrained minimum is at (0.5, 0.25), value 0.25, on the upper face of x.
    result = nelder_mead(rosenbrock, Box(("x", "y"), (-2.0, -1.0), (0.5, 3.0)), start=(-1.2, 1.0))
    assert result.outcome is SearchOutcome.AT_BOUND
    assert result.at_bound == {"x": "upper"}
    np.testing.assert_allclose(result.x, [0.5, 0.25], atol=4e-5)  # 10 tolerances of 1e-6 times the edge 4
    assert result.value == pytest.approx(0.25, abs=1e-4)  # slope -1 in x along the valley, times 4e-5
    assert "beyond" in result.outcome.cause
    assert "widen" in result.outcome.cure


def test_linear_function_ends_in_the_corner() -> None:
    result = nelder_mead(lambda p: float(p[0] - 2.0 * p[1]), BOX)
    assert result.at_bound == {"x": "lower", "y": "upper"}
    np.testing.assert_allclose(result.x, [-2.0, 3.0], atol=4e-5)


def test_logarithmic_parameter_in_one_dimension() -> None:
    box = Box(("damping",), (1e-6,), (1e-2,), (True,))
    result = nelder_mead(lambda p: float(np.log10(p[0] / 2.5e-5) ** 2), box)
    assert result.outcome is SearchOutcome.CONVERGED
    # 10 tolerances of 1e-6 over a range of log(1e4) = 9.2.
    assert result.x[0] == pytest.approx(2.5e-5, rel=1e-4)


def test_kink_is_found() -> None:
    result = nelder_mead(lambda p: float(abs(p[0] - 1.12) + abs(p[1] - 0.3)), BOX)
    np.testing.assert_allclose(result.x, [1.12, 0.3], atol=4e-5)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_quadratics_with_optima_inside_near_and_on_faces(d: int) -> None:
    # A clipped simplex alone reports optima near a face as on it (one in ten in 1-D); none may be wrong.
    rng = np.random.default_rng(1)
    box = Box(tuple(f"p{j}" for j in range(d)), (0.0,) * d, (1.0,) * d)
    for _ in range(15):
        root = rng.normal(size=(d, d)) + 0.5 * np.eye(d)
        root = np.vstack([root, 0.3 * np.eye(d)])  # curvature of at least 0.09 in every direction
        centre = rng.choice([rng.uniform(-0.3, 1.3), 1e-3, 0.02], size=d)
        exact = lsq_linear(root, root @ centre, bounds=(0.0, 1.0), method="bvls", tol=1e-14).x
        result = nelder_mead(lambda p, a=root, c=centre: float(np.sum((a @ (p - c)) ** 2)), box)
        # Within the 10 tolerances of 1e-6 that an agreeing restart allows.
        np.testing.assert_allclose(result.x, exact, atol=1e-5)
        on_face = {
            n: "lower" if u == 0 else "upper" for n, u in zip(box.names, exact, strict=True) if u in (0, 1)
        }
        assert result.at_bound == on_face
        assert result.outcome is (SearchOutcome.AT_BOUND if on_face else SearchOutcome.CONVERGED)


def test_trace_holds_every_call() -> None:
    calls: list[FloatArray] = []

    def counted(p: FloatArray) -> float:
        calls.append(p.copy())
        value = rosenbrock(p)
        p[:] = 99.0  # a careless function must not disturb the search
        return value

    result = nelder_mead(counted, BOX, start=(-1.2, 1.0))
    assert result.evaluations == len(calls) == len(result.trace_values)
    assert np.array_equal(result.trace_points, calls)
    assert result.trace_values.tolist() == [rosenbrock(p) for p in calls]
    np.testing.assert_allclose(calls[0], [-1.2, 1.0], rtol=1e-14)  # round trip through the unit box
    assert BOX.contains(result.trace_points).all()
    assert result.value == result.trace_values.min()


@pytest.mark.parametrize("limit", [3, 10, 57])
def test_running_out_of_evaluations_is_said(limit: int) -> None:
    result = nelder_mead(rosenbrock, BOX, start=(-1.2, 1.0), max_evaluations=limit)
    assert result.outcome is SearchOutcome.NOT_CONVERGED
    assert not result.outcome.ok
    assert result.evaluations <= limit
    assert "max_evaluations" in result.outcome.cause
    assert result.value == result.trace_values.min()


def test_not_a_number_is_refused_with_the_point() -> None:
    def broken(p: FloatArray) -> float:
        return float("nan") if p[0] > 0.5 else rosenbrock(p)

    with pytest.raises(ValueError, match=r"the function is nan at x = .*, y = .*; it must be finite"):
        nelder_mead(broken, BOX)


def test_refusals() -> None:
    with pytest.raises(ValueError, match=r"start 0: x = 3 is outside \[-2, 2\]"):
        nelder_mead(rosenbrock, BOX, start=(3.0, 0.0))
    with pytest.raises(ValueError, match="start must be one point"):
        nelder_mead(rosenbrock, BOX, start=[[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(ValueError, match=r"tolerance must be in \[1e-9, 0.1\)"):
        nelder_mead(rosenbrock, BOX, tolerance=0.0)
    with pytest.raises(ValueError, match="max_evaluations must be at least 3"):
        nelder_mead(rosenbrock, BOX, max_evaluations=2)
