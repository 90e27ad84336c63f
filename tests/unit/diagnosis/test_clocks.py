"""Lags of clocks: known lags are estimated with the standard uncertainty of the normal equations."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_fit_verdicts import objective

from kolsky.diagnosis.clocks import (
    DIRECTIONS,
    Reruns,
    clock_lags,
    fit_lag,
    late_prediction,
    origin,
    slopes,
    without_lag,
)
from kolsky.inverse.objective import Objective

FloatArray = NDArray[np.float64]
PERIOD = 400e-6


def force(t: FloatArray) -> FloatArray:
    return 20.0 * np.sin(2.0 * np.pi * t / PERIOD) + 1e4 * t


def radius(t: FloatArray) -> FloatArray:
    return 5e-3 + 3e-5 * np.sin(2.0 * np.pi * t / PERIOD)


def shifted(one: Objective) -> Any:
    """Bins taken at their middle, and all points at one radius."""
    times = one.times

    def predict(lags: FloatArray) -> FloatArray:
        n = one.n_force
        return np.concatenate([force(times[:n] - lags[0]), radius(times[n:] - lags[1])])

    return predict


def with_data(one: Objective, data: FloatArray) -> Objective:
    """The objective with other measurements at the same times."""
    seen, n = one.observations, one.n_force
    return replace(
        one,
        observations=replace(
            seen, bins=replace(seen.bins, mean=data[:n]), centre_line=replace(seen.centre_line, Z=data[n:])
        ),
    )


# A late flyer makes the model late: force and outline are early beside it.
@pytest.mark.parametrize(("name", "late"), [("force", (1, 0)), ("outline", (0, 1)), ("flyer", (-1, -1))])
@pytest.mark.parametrize("planted", [-23e-6, 1.5e-6])
def test_a_planted_lag_is_found(name: str, late: tuple[int, int], planted: float) -> None:
    one = objective()
    predict, rng = shifted(one), np.random.default_rng(3)
    jacobian = np.concatenate([np.full(one.n_force, 1e3), np.full(len(one.data) - one.n_force, 1e-6)])[
        :, None
    ]
    true = predict(planted * np.array(late)) + 0.01 * jacobian[:, 0]
    seen = with_data(one, true + one.noise * rng.standard_normal(len(true)))
    found = fit_lag(seen, predict, lambda _: jacobian, DIRECTIONS[name], {})
    assert found.settled
    assert abs(found.lag - planted) < 3.0 * found.sigma
    assert found.sigma < 0.7e-6
    assert found.evidence > 5.0


def test_the_uncertainty_of_a_lag_is_that_of_the_normal_equations() -> None:
    one = objective()
    predict, h = shifted(one), 1e-9
    jacobian = np.ones((len(one.data), 1))
    seen = with_data(one, predict(np.zeros(2)))  # no residual: the noise alone
    found = fit_lag(seen, predict, lambda _: jacobian, DIRECTIONS["force"], {})
    slope = (predict(np.array([h, 0.0])) - predict(np.array([-h, 0.0]))) / (2.0 * h)
    wide = np.column_stack([jacobian, slope]) / one.noise[:, None]
    assert found.sigma == pytest.approx(np.linalg.inv(wide.T @ wide)[1, 1] ** 0.5, rel=1e-3)
    # A source that makes the force late by 2 us adds so much in quadrature.
    late = predict(np.array([1e-6, 0.0])) - predict(np.array([-1e-6, 0.0]))
    other = fit_lag(seen, predict, lambda _: jacobian, DIRECTIONS["force"], {"flyer motion": late[None]})
    assert other.sigma == pytest.approx(np.hypot(found.sigma, 2e-6), rel=1e-3)


def test_a_slow_error_of_the_outline_widens_a_lag_and_does_not_take_it() -> None:
    """Of an outline 20 us late with a slow error of 3 um: the lag of weights that know none, its variance
    with what the error does to it."""
    one = objective()
    predict, rng, h = shifted(one), np.random.default_rng(4), 1e-9
    jacobian = np.concatenate([np.full(one.n_force, 1e3), np.zeros(len(one.data) - one.n_force)])[:, None]
    slow = replace(one, slowly=True)
    common = 3e-6 * rng.standard_normal(len(slow.slow_patterns)) @ slow.slow_patterns
    seen = with_data(
        one, predict(np.array([0.0, 20e-6])) + common + one.noise * rng.standard_normal(len(common))
    )
    plain = fit_lag(seen, predict, lambda _: jacobian, DIRECTIONS["outline"], {})
    found = fit_lag(replace(seen, slowly=True), predict, lambda _: jacobian, DIRECTIONS["outline"], {})
    assert found.lag == pytest.approx(plain.lag, rel=1e-12)
    assert abs(found.lag - 20e-6) < 2.0 * found.sigma
    assert found.evidence == pytest.approx(plain.evidence, rel=1e-12)
    slope = (predict(np.array([0.0, found.lag + h])) - predict(np.array([0.0, found.lag - h]))) / (2.0 * h)
    weights = 1.0 / plain.objective.own_sigma**2
    wide = np.column_stack([jacobian, slope])
    normal = wide.T @ (weights[:, None] * wide)
    gain = np.linalg.solve(normal, wide.T * weights)[1]
    more = found.objective.slow_discrepancy**2 * ((slow.slow_patterns @ gain) ** 2).sum()
    assert found.objective.slow_discrepancy > 1e-6
    # The discrepancies at rest differ from those of the last step by what STILL allows.
    assert (found.sigma**2 - plain.sigma**2) / more == pytest.approx(1.0, rel=1e-2)


def test_the_parameters_act_as_late_as_the_recording() -> None:
    """A model linear in its one parameter: the lag and the parameter are exact in one fit, far away."""
    one = objective()
    predict = shifted(one)
    seen = with_data(one, 1.3 * predict(np.array([20e-6, 0.0])))
    runs = [lambda lags, x=x: x * predict(lags) for x in (1.0, 1.01)]
    slope = slopes(np.array([[1.0], [1.01]]), runs)
    np.testing.assert_allclose(slope(np.array([5e-6, 0.0]))[:, 0], predict(np.array([5e-6, 0.0])), rtol=1e-10)
    found = fit_lag(seen, predict, slope, DIRECTIONS["force"], {})
    assert found.lag == pytest.approx(20e-6, abs=1e-8)  # STILL
    assert found.move[0] == pytest.approx(0.3, abs=1e-4)


def test_the_effect_of_each_parameter_is_found_beside_the_point() -> None:
    """f = 3 x + 5 y + t x: slopes 3 + t and 5; at the upper bound the step goes down."""

    def run(points: FloatArray) -> Any:
        raise AssertionError

    again = Reruns(np.zeros(2), np.zeros(2), np.array([0.0, 0.0]), np.array([1.0, 2.0]), run)
    points = again.beside(np.array([0.5, 2.0]))
    np.testing.assert_allclose(points - points[0], [[0.0, 0.0], [1e-3, 0.0], [0.0, -2e-3]], atol=1e-15)
    t = np.array([0.0, 1.0, np.nan])
    seen = [lambda lags, x=x, y=y: 3.0 * x + 5.0 * y + t * x for x, y in points]
    found = slopes(points, seen)(np.zeros(2))
    np.testing.assert_allclose(found, [[3.0, 5.0], [4.0, 5.0], [0.0, 0.0]], rtol=1e-9)


def test_evidence_is_that_of_the_lag_alone() -> None:
    """A residual that the parameter takes away is no evidence of a lag; what a lag takes away is."""
    one = objective()
    predict = shifted(one)
    jacobian = predict(np.zeros(2))[:, None]
    scaled = with_data(one, 1.2 * predict(np.zeros(2)))
    assert abs(fit_lag(scaled, predict, lambda _: jacobian, DIRECTIONS["force"], {}).evidence) < 1e-3
    # Without discrepancy -2 ln L without a lag is the chi-square that least squares leave.
    late = with_data(one, predict(np.array([0.1e-6, 0.0])))
    rows, aim = jacobian[:, 0] / one.noise, (late.data - jacobian[:, 0]) / one.noise
    left = aim - rows * (rows @ aim) / (rows @ rows)
    floor = 2.0 * np.log(one.noise).sum()
    assert without_lag(late, predict, lambda _: jacobian) - floor == pytest.approx(left @ left, rel=1e-6)


def test_a_late_recording_shows_an_earlier_time() -> None:
    one = objective()
    t = np.linspace(0.0, 1.6e-3, 1601)
    nodes = np.linspace(0.0, 6e-3, 13)
    response: Any = SimpleNamespace(
        force_times=t,
        impulse_transmission=np.array([0.5e4 * t**2]),  # a force of 1e4 N/s
        surface_times=(np.arange(16) + 0.5) * 1e-4,
        surface_r=np.tile(5e-3 + 2.0 * (np.arange(16) + 0.5)[:, None] * 1e-4, (1, 13))[None],  # 2 m/s outward
        surface_y=np.tile(nodes, (16, 1))[None],
    )
    seen = late_prediction(response, one)
    before, after = seen(np.zeros(2)), seen(np.array([10e-6, 20e-6]))
    n = one.n_force
    np.testing.assert_allclose((before - after)[1:n], 1e4 * 10e-6, rtol=1e-3)
    moving = one.times[n:] > 1e-4  # the first frame has nothing before it
    np.testing.assert_allclose((before - after)[n:][moving], 2.0 * 20e-6, rtol=1e-6)
    # Behind the end of the simulation nothing is known, and the value stays.
    early = seen(np.array([-60e-6, -60e-6]))
    assert early[n - 1] == before[n - 1]
    np.testing.assert_array_equal(early[n:][one.times[n:] > 1.5e-3], before[n:][one.times[n:] > 1.5e-3])


def test_a_clock_is_named_by_its_file_and_key() -> None:
    tables = {"force": {"file": "scope.csv"}, "frames": {"file": "f.csv"}, "flyer": {"file": "flyer.csv"}}
    shot: Any = SimpleNamespace(file=SimpleNamespace(content=tables))
    assert origin(shot, "force") == ("scope.csv", "force.clock_offset")
    assert origin(shot, "flyer") == ("flyer.csv", "flyer.frame")
    assert origin(SimpleNamespace(file=None), "outline") == ("shot.toml", "pictures")  # type: ignore[arg-type]


def test_where_the_map_is_not_linear_the_solver_is_run_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A force that goes with the square of a parameter: far off, one linear step does not explain the data,
    runs where it leads do. A flyer 20 us late is told from an outline by the force."""
    one = objective()
    times, n = one.times, one.n_force

    def vector(x: float, lags: FloatArray) -> FloatArray:
        return np.concatenate([x**2 * force(times[:n] - lags[0]), x**2 * radius(times[n:] - lags[1])])

    def late(response: Any, _: Objective) -> Any:
        return lambda lags: vector(response.x, lags)

    asked: list[FloatArray] = []

    def run(points: FloatArray) -> Any:
        asked.append(points[:, 0])
        ok = SimpleNamespace(ok=True)
        return SimpleNamespace(
            outcomes=[ok] * len(points), select=lambda rows: SimpleNamespace(x=float(points[rows[0], 0]))
        )

    def left(objective: Objective, vector: FloatArray, *_: Any, **__: Any) -> Any:
        chi2 = float((((objective.data - vector) / objective.noise) ** 2).mean())
        return (SimpleNamespace(explained=chi2 < 1.5),)

    monkeypatch.setattr("kolsky.diagnosis.clocks.late_prediction", late)
    monkeypatch.setattr("kolsky.diagnosis.clocks.fit_quality", left)
    rng = np.random.default_rng(5)
    true = vector(1.0, np.array([-20e-6, -20e-6]))
    seen = with_data(one, true + one.noise * rng.standard_normal(len(true)))
    wrong = 1.2
    slope = 2.0 / wrong * vector(wrong, np.zeros(2))[:, None]
    shot, here = SimpleNamespace(file=None), SimpleNamespace(x=wrong)
    again = Reruns(np.array([wrong]), np.array([np.nan]), np.array([0.5]), np.array([2.0]), run)
    args: Any = (shot, here, seen, slope, {})
    plain = {lag.recording: lag for lag in clock_lags(*args)}
    found = {lag.recording: lag for lag in clock_lags(*args, again=again)}
    assert not any(lag.explains for lag in plain.values())
    assert {name for name, lag in found.items() if lag.explains} == {"flyer"}
    flyer = found["flyer"]
    assert abs(flyer.lag - 20e-6) < 3.0 * flyer.sigma
    assert flyer.evidence > max(lag.evidence for name, lag in found.items() if name != "flyer")
    assert np.abs(asked[0] - wrong).min() > 0.05  # where the first fits lead, not where the search had ended
    assert asked[-1].min() == pytest.approx(1.0, abs=0.02)
    assert [len(points) for points in asked] == [4, 2, 2]  # each with one beside it; two recordings first
    # An optimum that is explained, or a lag inside its uncertainty, asks for no run.
    asked.clear()
    clock_lags(shot, SimpleNamespace(x=1.0), seen, slope, {}, again=again)  # type: ignore[arg-type]
    assert not asked


def test_runs_begin_at_moved_and_at_declared_parameters() -> None:
    def run(points: FloatArray) -> Any:
        raise AssertionError

    again = Reruns(
        x=np.array([1.0, 0.4999]), declared=np.array([np.nan, 0.499]), lower=np.array([0.5, 0.49]),
        upper=np.array([1.5, 0.4999]), run=run,
    )  # fmt: skip
    moved, declared = again.starts(np.array([1.8, 0.4995]))
    np.testing.assert_array_equal(moved, [1.5, 0.4995])
    np.testing.assert_array_equal(declared, [1.5, 0.499])
    assert len(again.starts(np.array([1.2, 0.499]))) == 1
