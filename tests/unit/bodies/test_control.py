"""The loop against closed forms: limit of stability, memory of what the model is wrong by, bounds."""

from dataclasses import dataclass

import numpy as np
import pytest

from kolsky.bodies import actuator_control
from kolsky.bodies.actuator_control import (
    Controller,
    Plant,
    ReducedBend,
    largest_gain,
    reduce_actuator,
    run_loop,
)
from kolsky.equilibrium.reduction import ReducedState
from kolsky.equilibrium.solution import Outcome
from tests.unit.bodies.small import DOWN, MOST, actuator

MODEL_SLOPE = 1e-5


@dataclass
class Line:
    """An actuator whose bend is a straight line: the loop's arithmetic alone."""

    broken: bool = False

    def bend(self, pressure: float, *, start: object = None, tolerance: float = 0.0) -> ReducedBend:
        outcome = Outcome.NOT_CONVERGED if self.broken and pressure > 5e4 else Outcome.COMPLETED
        state = ReducedState(np.zeros(1), np.zeros((1, 1)), outcome, 1)
        return ReducedBend(MODEL_SLOPE * pressure, MODEL_SLOPE, state)


def _run(gain: float, delay: int, *, gamma: float = 1.0, n: int = 400, noise: float = 0.0):
    p = np.linspace(0.0, 1e5, 5)
    plant = Plant(p, gamma * MODEL_SLOPE * p, 0.0, delay, noise)
    return run_loop(Controller(Line(), gain=gain, most=1e5), plant, np.full(n, 0.5), rate=20.0, seed=1)


def test_limit_of_the_gain() -> None:
    # z - 1 + K, z^2 - z + K, z^3 - z^2 + K on the unit circle
    assert largest_gain(0) == pytest.approx(2.0)
    assert largest_gain(1) == pytest.approx(1.0)
    assert largest_gain(2) == pytest.approx((np.sqrt(5.0) - 1.0) / 2.0)


@pytest.mark.parametrize("delay", [1, 2, 3])
def test_the_loop_is_stable_below_it_and_not_above(delay: int) -> None:
    gamma, bound = 1.05, largest_gain(delay)
    calm = _run(0.9 * bound / gamma, delay, gamma=gamma, n=900)
    wild = _run(1.1 * bound / gamma, delay, gamma=gamma)
    assert np.abs(calm.angle[-20:] - 0.5).max() < 1e-3
    assert np.abs(wild.angle[-20:] - 0.5).max() > 0.05


def test_a_wrong_stiffness_is_learnt_geometrically() -> None:
    # gamma (wanted + s) = wanted in the end; without delay the error falls by 1 - K gamma each tick
    found = _run(0.2, 0, gamma=0.8)
    errors = 0.5 - found.angle[2:12]
    assert errors[1:] / errors[:-1] == pytest.approx(1.0 - 0.2 * 0.8, rel=1e-9)
    # the inverse ends within 1e-5 rad of the 0.5 / 0.8 rad that it is asked for
    assert found.pressure[-1] == pytest.approx(0.5 / (0.8 * MODEL_SLOPE), rel=1.6e-5)


def test_the_sum_does_not_grow_at_a_bound() -> None:
    controller = Controller(Line(), gain=0.5, most=1e5)
    for _ in range(50):
        assert controller.tick(1.5, 0.9).pressure == 1e5
    assert controller.sum == 0.0
    assert controller.tick(0.5, 0.5).pressure == pytest.approx(5e4)


def test_where_the_model_gives_none_the_pressure_is_held_and_said() -> None:
    controller = Controller(Line(broken=True), gain=0.5, most=1e5)
    first = controller.tick(0.4, 0.4)
    assert not first.held
    second = controller.tick(0.8, 0.8)
    assert second.held
    assert second.pressure == first.pressure


def test_in_real_time_a_tick_begins_when_it_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = {"now": 100.0}

    def wait(seconds: float) -> None:
        clock["now"] += seconds + 2e-3  # it wakes up 2 ms late

    class Slow(Line):
        def bend(self, pressure: float, **options: object) -> ReducedBend:
            clock["now"] += 1e-3
            return super().bend(pressure)

    monkeypatch.setattr(actuator_control, "perf_counter", lambda: clock["now"])
    monkeypatch.setattr(actuator_control, "sleep", wait)
    p = np.linspace(0.0, 1e5, 5)
    controller = Controller(Slow(), gain=0.5, most=1e5)  # type: ignore[arg-type]
    plant, wanted = Plant(p, MODEL_SLOPE * p, 0.0, 0, 0.0), np.full(5, 0.5)
    found = run_loop(controller, plant, wanted, rate=20.0, seed=1, real_time=True)
    # one bend of 1 ms on a line in every tick; all but the first begin with a wait
    assert found.wall == pytest.approx([1e-3, 3e-3, 3e-3, 3e-3, 3e-3])
    assert found.real_time
    assert clock["now"] == pytest.approx(100.009 + 4 * 50e-3 + 3e-3)  # nine bends make the controller
    assert not run_loop(controller, plant, wanted, rate=20.0, seed=1).real_time


def test_error_is_judged_where_it_has_settled() -> None:
    found = _run(0.5, 0, gamma=1.0, n=100, noise=0.0)
    assert found.settled_error() == pytest.approx([0.0], abs=1e-5)  # the inverse ends within 1e-5 rad
    assert _run(0.5, 0, gamma=1.0, n=100, noise=0.01).settled_error()[0] > 1e-3


@pytest.fixture(scope="module")
def reduction():
    return reduce_actuator(actuator(), DOWN, most=MOST, modes=6, tolerance=1e-4, seen=7)


def test_reduced_bend_is_that_of_the_whole_at_pressures_it_has_not_seen(reduction) -> None:
    assert len(reduction.model.reduced.sample.cells) < 40
    # the sampling leaves 1e-4 of the forces; the angle of a slender body is that many times more sensitive
    assert reduction.largest_error < 5e-3 * float(reduction.angle.max())


def test_reduced_slope_is_the_difference_of_bends(reduction) -> None:
    ends = [reduction.model.bend(p, tolerance=1e-12).angle for p in (29.9e3, 30.1e3)]
    assert reduction.model.bend(30e3, tolerance=1e-12).slope == pytest.approx(
        (ends[1] - ends[0]) / 200.0, rel=1e-6
    )


def test_loop_with_the_reduced_model_reaches_the_angle_of_a_softer_plant(reduction) -> None:
    soft = actuator()
    p = np.linspace(0.0, MOST, 5)
    angle = soft.simulate(DOWN, p, solid=soft.solid.with_parameters(0.85 * soft.solid.parameters())).angle
    wanted = np.repeat([0.03, 0.05], 60)
    controller = Controller(reduction.model, gain=0.3, most=MOST)
    found = run_loop(controller, Plant(p, angle, 0.02, 1, 0.0), wanted, rate=20.0, seed=1)
    # the inverse ends within 1e-5 rad; of the first error of 15 % the loop leaves (1 - 0.3)^30 = 2e-5
    assert found.settled_error().max() < 1e-5
    assert not found.held.any()
