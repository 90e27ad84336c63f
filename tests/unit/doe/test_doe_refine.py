"""Adaptive refinement: known optima in few runs, faces, failed runs, roughness."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from doe import Box, latin_hypercube
from doe.refine import CONVERGED_MOVE, Refinement, refine
from doe.surrogates import ProcessSurrogate

FloatArray = NDArray[np.float64]
BOX = Box(("m", "f"), (0.5, 0.0), (2.0, 1.0))
TIME = np.linspace(0.0, 1.0, 50)
SIGMA = 0.02
TRUTH = np.array([1.1, 0.35])


def model(points: FloatArray) -> FloatArray:
    """A history with a narrow valley: the phase of a wave depends on both parameters."""
    m, f = points[:, :1], points[:, 1:]
    return 10.0 * m * TIME**2 + np.sin(9.0 * np.sqrt(m) * TIME + 2.0 * f) + f * TIME


DATA = model(TRUTH[None])[0] + SIGMA * np.random.default_rng(1).standard_normal(50)


def misfit(responses: FloatArray) -> FloatArray:
    return np.asarray((((responses - DATA) / SIGMA) ** 2).sum(axis=1))


def locate(surrogate: ProcessSurrogate, region: Box, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    def cost(u: FloatArray) -> float:
        return float(misfit(surrogate.predict(region.scale(np.clip(u, 0.0, 1.0))[None], extrapolate=True))[0])

    found = minimize(
        cost, np.clip(region.unit(start), 0.0, 1.0), method="Nelder-Mead", bounds=[(0.0, 1.0)] * 2,
        options={"xatol": 1e-5, "fatol": 1e-6},
    )  # fmt: skip
    x, h = region.scale(np.clip(found.x, 0.0, 1.0)), 1e-4
    slope = [
        (surrogate.predict([x + e], extrapolate=True) - surrogate.predict([x - e], extrapolate=True))[0]
        / (2 * h)
        for e in h * np.eye(2)
    ]
    return x, np.sqrt(np.diag(np.linalg.inv(np.array(slope) @ np.array(slope).T / SIGMA**2)))


def refined(run=model, box: Box = BOX, **options: int) -> Refinement:
    points = latin_hypercube(box, 16, rng=3).points
    return refine(run, box, points, run(points), misfit=misfit, locate=locate, scale=SIGMA, **options)


def optimum(lower: tuple[float, float] = BOX.lower, upper: tuple[float, float] = BOX.upper) -> FloatArray:
    """On the model itself."""
    found = minimize(
        lambda x: misfit(model(x[None]))[0], np.clip(TRUTH, lower, upper), method="Nelder-Mead",
        bounds=list(zip(lower, upper, strict=True)), options={"xatol": 1e-9, "fatol": 1e-9},
    )  # fmt: skip
    return np.asarray(found.x)


def test_the_models_optimum_is_found_in_few_runs() -> None:
    found = refined()
    assert found.converged
    # What it promises: the last runs moved it by no more than 0.2 sigma, and the surrogate is exact there.
    np.testing.assert_array_less(np.abs(found.x - optimum()), CONVERGED_MOVE * found.sigma)
    # A grid that resolves the valley (0.2 sigma) over the box would have 10^5 points.
    assert len(found.points) <= 16 + 6 * 6
    last = found.rounds[-1]
    assert last.shift <= CONVERGED_MOVE
    assert last.predicted == pytest.approx(last.confirmed, abs=1.0)  # far below the 3.84 of an interval
    # Every run is there, in the order it was made, and each is what the function gives.
    assert len(found.points) == 16 + sum(len(each.points) for each in found.rounds)
    np.testing.assert_array_equal(found.responses, model(found.points))


def test_it_is_reproducible() -> None:
    first = refined(rng=5, max_rounds=2).points
    np.testing.assert_array_equal(first, refined(rng=5, max_rounds=2).points)
    assert not np.array_equal(first, refined(rng=6, max_rounds=2).points)


def test_new_runs_are_apart_and_in_the_region() -> None:
    found = refined()
    for each in found.rounds:
        assert BOX.contains(each.points).all()
        u = BOX.unit(each.points)
        gaps = np.abs(u[:, None] - u).max(axis=2)[~np.eye(len(u), dtype=bool)]
        assert gaps.min() > 1e-4


def test_an_optimum_on_a_face_of_the_box_is_no_reason_to_go_on() -> None:
    box = Box(("m", "f"), (0.5, 0.0), (2.0, 0.3))
    found = refined(box=box)
    assert found.converged
    assert found.x[1] == pytest.approx(0.3, abs=1e-5)
    best = optimum(upper=(2.0, 0.3))
    assert abs(found.x[0] - best[0]) < CONVERGED_MOVE * found.sigma[0]


def test_failed_runs_are_left_out() -> None:
    lost = 0

    def fragile(points: FloatArray) -> FloatArray:
        nonlocal lost
        values = model(points)
        bad = (points[:, 1] > 0.5) & (np.arange(len(points)) % 2 == 1) & (len(points) < 16)
        values[bad] = np.nan
        lost += int(bad.sum())
        return values

    found = refined(run=fragile)
    assert lost > 0
    assert len(found.points) == 16 + sum(len(each.points) for each in found.rounds) - lost
    np.testing.assert_array_less(np.abs(found.x - optimum()), CONVERGED_MOVE * found.sigma)


def test_a_rough_function_keeps_its_region_wide() -> None:
    def rough(points: FloatArray) -> FloatArray:
        """Chatter as large as the noise, another at every point."""
        phase = 1e6 * points.sum(axis=1, keepdims=True)
        return model(points) + SIGMA * np.sin(phase + 40.0 * TIME)

    found = refined(run=rough)
    # Chatter is not followed: the region is kept wider than it would be for a smooth function ...
    assert found.rounds[-1].edge >= refined().rounds[-1].edge
    # ... and the optimum is that without chatter, to what its own size allows.
    np.testing.assert_array_less(np.abs(found.x - optimum()), 2.0 * found.sigma)


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="must be at least 1, got 0"):
        refined(max_rounds=0)
    cut = refined(max_rounds=1)
    assert not cut.converged
    assert "rounds were used up" in cut.ended
