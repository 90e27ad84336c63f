"""Directions of the inputs: the effect of each on the data vector in closed form, with synthetic runs."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from doe import Box
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.objective import Objective, Prior
from kolsky.inverse.observations import observe
from kolsky.inverse.parameters import PARAMETERS
from kolsky.shot.input_records import CLOCK
from kolsky.shot.inputs import INPUTS
from kolsky.uncertainty.input_changes import (
    InputDirection,
    InputDirections,
    ModelAtOptimum,
    MovedRuns,
    height_follows,
    outline_follows,
    parameter_step,
    plain_amount,
)

FloatArray = NDArray[np.float64]
TIME = np.linspace(0.0, 1e-3, 101)
FRAMES = np.array([0.25e-3, 0.75e-3])
STEEP = 2e5  # slope of the model's force [N/s]
WIDENING, TAPER = 1.5, 0.2  # growth of the model's radius with time [m/s] and with height [-]


def objective() -> Objective:
    """Ten bins of a force of 1e5 N/s, and two points of an outline."""
    line = CentreLine(FRAMES, np.arange(2), np.array([1e-3, 2e-3]), np.array([5e-3, 6e-3]), np.full(2, 1e-6))
    history = ForceHistory(TIME, 1e5 * TIME, np.full(TIME.size, 0.5))
    return Objective(observe(history, line, window=(0.0, 1e-3), bin_width=1e-4), np.ones(2, dtype=bool))


def response() -> Any:
    """A force of `STEEP`, and a cone that widens with time; the surface kept beside the frames too."""
    surface = np.sort(np.concatenate([FRAMES - CLOCK, FRAMES, FRAMES + CLOCK]))
    y = np.broadcast_to(np.linspace(0.0, 4e-3, 9), (1, surface.size, 9))
    return SimpleNamespace(
        n_samples=1,
        completed=np.array([True]),
        force_times=TIME,
        force_transmission=np.array([STEEP * TIME]),
        impulse_transmission=np.array([0.5 * STEEP * TIME**2]),
        surface_times=surface,
        surface_y=np.array(y),
        surface_r=5e-3 + WIDENING * surface[None, :, None] + TAPER * y,
    )


def change(key: str, step: float) -> FloatArray:
    one = objective()
    seen = INPUTS[key].seen
    assert seen is not None
    return seen(ModelAtOptimum(one, one.observations, response()), step)


MODEL_FORCE = STEEP * (0.05e-3 + 1e-4 * np.arange(10))


def test_a_larger_sensitivity_is_a_smaller_force() -> None:
    # Prediction minus data rises where the data fall, by a share of the force; the outline stays.
    np.testing.assert_allclose(change("sensitivity", 0.02)[:10], 0.02 * MODEL_FORCE, rtol=1e-12)
    np.testing.assert_array_equal(change("sensitivity", 0.02)[10:], 0.0)


def test_a_larger_zero_is_a_smaller_force() -> None:
    np.testing.assert_array_equal(change("force_zero", 0.3), [0.3] * 10 + [0.0] * 2)


def test_a_later_clock_is_a_force_of_an_earlier_time() -> None:
    np.testing.assert_allclose(change("clock_offset", 1e-6)[:10], 1e-6 * STEEP, rtol=1e-9)
    np.testing.assert_array_equal(change("clock_offset", 1e-6)[10:], 0.0)


def test_a_later_outline_is_one_of_an_earlier_time() -> None:
    np.testing.assert_array_equal(change("outline_clock", 2e-6)[:10], 0.0)
    np.testing.assert_allclose(change("outline_clock", 2e-6)[10:], 2e-6 * WIDENING, rtol=1e-6)


def test_a_later_flyer_is_a_prediction_that_comes_later() -> None:
    """Force and outline later by the same is a flyer that is earlier: three clocks, two differences."""
    others = change("clock_offset", 1e-6) + change("outline_clock", 1e-6)
    np.testing.assert_allclose(change("flyer_clock", 1e-6), -others, rtol=1e-12)
    np.testing.assert_allclose(change("flyer_clock", 1e-6)[:10], -1e-6 * STEEP, rtol=1e-9)


def test_offsets_of_the_outline() -> None:
    np.testing.assert_array_equal(change("Z_offset", 3e-6), [0.0] * 10 + [-3e-6] * 2)
    # A point that is higher by the step is on a wider part of the cone.
    np.testing.assert_allclose(change("y_offset", 1e-5)[10:], 1e-5 * TAPER, rtol=1e-9)
    np.testing.assert_allclose(change("y_offset", 1e-5)[:10], 0.0, atol=1e-12)


class Quadratic(MovedRuns):
    """Runs whose data vector is 3 p + 2 p^2 of the parameter p in every entry."""

    def moved(self, key: str, sign: int, step: float) -> FloatArray | None:
        value = (self.value(key) if key else 0.4) + sign * step
        if key and not PARAMETERS[key].allowed[0] <= value <= PARAMETERS[key].allowed[1]:
            return None
        return np.full(12, 3.0 * value + 2.0 * value**2)


def runs(kind: type[MovedRuns], **held: float) -> MovedRuns:
    interface = SimpleNamespace(friction=0.1, faces="coulomb", side="coulomb")
    model = SimpleNamespace(poisson=0.4, damping=0.0, mass_damping=0.0)
    problem = SimpleNamespace(
        observations=SimpleNamespace(frame_times=np.zeros(0)),
        settings=SimpleNamespace(held=held),
        numerics=SimpleNamespace(mesh=None),
        box=Box.of({"stiffness_factor": (0.5, 1.5)}),
    )
    runner: Any = SimpleNamespace(
        problem=problem,
        forward=SimpleNamespace(shot=SimpleNamespace(model=model, interface=interface)),
        solver_values=lambda points, mesh: points,
        at=lambda x, mesh: {**held, "stiffness_factor": x[0]},
    )
    return kind(runner, np.ones(1), objective(), {"poisson": 0.05, "damping": 1e-3, "friction": 0.1})


def test_a_parameter_is_moved_to_both_sides_or_to_the_one_that_is_allowed() -> None:
    # Central: ((3 + 4 p) step) at p = 0.4, exact for a quadratic.
    np.testing.assert_allclose(runs(Quadratic).change("poisson", 0.05), (3.0 + 1.6) * 0.05, rtol=1e-12)
    # No Poisson's ratio above 0.49999: p(0.4) - p(0.3), which is 0.3 + 2 (0.16 - 0.09).
    np.testing.assert_allclose(runs(Quadratic).change("poisson", 0.1), 0.44, rtol=1e-12)


def test_no_damping_below_zero() -> None:
    class FromZero(Quadratic):
        def moved(self, key: str, sign: int, step: float) -> FloatArray | None:
            return np.zeros(12) if not key else super().moved(key, sign, step)

    # p(0.001) - p(0).
    np.testing.assert_allclose(runs(FromZero).change("damping", 1e-3), 3e-3 + 2e-6, rtol=1e-12)


def test_the_common_batch_holds_what_is_allowed_and_no_friction_that_is_not_named() -> None:
    one = replace(
        runs(MovedRuns), steps={"poisson": 0.1, "damping": 1e-6, "friction": 0.1, "curve_scale": 0.01}
    )
    moved = {(key, sign) for key, sign in one.rows if key}
    both = {(key, sign) for key in ("stiffness_factor", "curve_scale") for sign in (1, -1)}
    assert moved == {*both, ("poisson", -1), ("damping", 1)}
    # Named already, its value is all that changes.
    held = replace(one, runner=runs(MovedRuns, friction=0.5).runner)
    assert {("friction", 1), ("friction", -1)} < set(held.rows)


def test_friction_that_is_not_named_is_changed_in_the_shot(monkeypatch: pytest.MonkeyPatch) -> None:
    def changed(shot: Any, value: float) -> Any:
        return SimpleNamespace(interface=SimpleNamespace(friction=value))

    monkeypatch.setitem(PARAMETERS, "friction", replace(PARAMETERS["friction"], changed=changed))
    monkeypatch.setattr(
        "kolsky.uncertainty.input_changes.replace",
        lambda forward, shot: SimpleNamespace(friction=shot.interface.friction),
    )
    monkeypatch.setattr(
        "kolsky.uncertainty.input_changes.run_side_by_side",
        lambda launches: [(one.points, one.forward.friction) if one else None for one in launches],
    )

    class Told(MovedRuns):
        _common: Any = None

        def _seen(self, response: Any, row: int, key: str) -> FloatArray:
            point, friction = response
            assert "friction" not in point
            return np.full(12, 3.0 * friction + 2.0 * friction**2)

    one = replace(runs(Told), steps={"friction": 0.1})
    np.testing.assert_allclose(one.change("friction", 0.1), 3.4 * 0.1, rtol=1e-12)
    with pytest.raises(ValueError, match=r"friction was moved by 0\.1, not by 0\.2"):
        one.change("friction", 0.2)


def linear(**changes: list[float]) -> InputDirections:
    """Four data of sigma 2 and one parameter, Jacobian (1, 1, 0, 0)."""
    one: Any = SimpleNamespace(
        whitened=lambda rows: rows / 2.0, gain=lambda J: np.linalg.solve(J.T @ J / 4.0, J.T / 4.0)
    )
    return InputDirections(
        names=("stiffness_factor",),
        objective=one,
        vector=np.zeros(4),
        jacobian=np.array([[1.0], [1.0], [0.0], [0.0]]),
        directions=tuple(
            InputDirection(key, 0.5, np.array(change), float("nan")) for key, change in changes.items()
        ),
        absent={"friction": "no effect: nothing slides"},
    )


def test_the_optimum_follows_what_it_can_and_leaves_the_rest() -> None:
    found = linear(a=[3.0, 1.0, 2.0, 0.0], b=[5.0, 5.0, 0.0, 0.0], c=[7.0, 5.0, 2.0, 0.0], d=[0, 0, 0, 1.0])
    # The least-squares slope of (3, 1) over (1, 1) is 2; what is left is (1, -1, 2, 0), 6 of 14.
    np.testing.assert_allclose(found.shift("a"), [-2.0], rtol=1e-14)
    np.testing.assert_allclose(found.rest("a"), [1.0, -1.0, 2.0, 0.0], atol=1e-14)
    assert found.visible("a") == pytest.approx(6.0 / 14.0, rel=1e-12)
    np.testing.assert_allclose(found["a"].slope, [6.0, 2.0, 4.0, 0.0], rtol=1e-15)
    # The parameter's own direction leaves nothing; a multiple of it beside another changes no residual.
    assert found.visible("b") == pytest.approx(0.0, abs=1e-28)
    assert found.likeness("a", "c") == pytest.approx(1.0, rel=1e-12)
    assert found.likeness("a", "d") == pytest.approx(0.0, abs=1e-12)
    assert found.visible("d") == 1.0


def test_the_weights_of_a_repeated_identification_follow_the_error() -> None:
    """One parameter moves ten bins and ten points alike. Their residuals are 3 and -3, 5 and -5 in turn.

    The input changes the points by 6. If the parameter follows by -1, the mean squares are 3^2 + 1 = 10 and
    5^2 + 5^2 = 50, and the points have a sixth of the weight: -6 / 6 = -1. With the weights of the residuals
    before, 1/9 and 1/25, it would be -6 * 9 / 34.
    """
    line = CentreLine(np.linspace(0.0, 9e-4, 10), np.arange(10), np.zeros(10), np.ones(10), np.full(10, 1e-3))
    history = ForceHistory(TIME, 0.0 * TIME, np.full(TIME.size, 1e-3))
    plain = Objective(observe(history, line, window=(0.0, 1e-3), bin_width=1e-4), np.ones(10, dtype=bool))
    vector = plain.data + np.repeat([3.0, 5.0], 10) * np.tile([1.0, -1.0], 10)
    change = np.repeat([0.0, 6.0], 10)
    found = InputDirections(
        ("stiffness_factor",), plain.with_discrepancy(vector), vector, np.ones((20, 1)),
        (InputDirection("a", 0.5, change / 4.0, float("nan")),),
    )  # fmt: skip
    assert 4.0 * found.shift("a")[0] == pytest.approx(-6.0 * 9.0 / 34.0, rel=1e-6)
    assert found.repeated_shift("a", 2.0)[0] == pytest.approx(-1.0, rel=0.1)  # iterations leave 0.08
    # A prior as strong as the data halves a step that is too small to change the weights.
    prior = Prior(np.ones(1), np.array([9.0 * 25.0 / 340.0]) ** 0.5)
    held = replace(found, objective=replace(found.objective, prior=prior))
    assert held.repeated_shift("a", 1e-4)[0] == pytest.approx(1e-4 * found.shift("a")[0], rel=1e-6)


def test_an_input_without_a_direction_says_why() -> None:
    with pytest.raises(KeyError, match="friction: no effect: nothing slides"):
        linear()["friction"]
    with pytest.raises(KeyError, match="no such input"):
        linear()["colour"]


def test_steps_and_plain_amounts() -> None:
    # A hundredth of the distance from 1/2; 0.003 of m; a twentieth of beta, not of less than 10 us.
    assert parameter_step("poisson", 0.499) == pytest.approx(1e-5, rel=1e-9)
    assert parameter_step("stiffness_factor", 1.2) == pytest.approx(0.0036, rel=1e-12)
    assert parameter_step("damping", 4e-5) == pytest.approx(2e-6, rel=1e-12)
    assert parameter_step("damping", 0.0) == pytest.approx(5e-7, rel=1e-12)
    expected = {
        "specimen_length": 0.01, "clock_offset": 1e-6, "y_offset": 1e-5, "damping": 1e-6, "friction": 0.01,
    }  # fmt: skip
    assert {key: plain_amount(key, float("nan")) for key in expected} == expected
    # The power of ten that is not above a hundredth of 1/2 - nu.
    for poisson, amount in ((0.499, 1e-5), (0.4985, 1e-5), (0.4995, 1e-6), (0.45, 1e-4)):
        assert plain_amount("poisson", poisson) == pytest.approx(amount, rel=1e-9)


def test_an_axis_placed_by_the_radius_moves_with_it() -> None:
    """0.1 % of 10 mm: the model's outline grows by what the bulge makes of 5 um, the measured one by 5 um."""
    change = np.array([3.0, 4.0, 6e-6, 5e-6])
    np.testing.assert_allclose(outline_follows(change, 1e-3, 10e-3, 2), [3.0, 4.0, 1e-6, 0.0], atol=1e-18)
    assert change[2] == 6e-6


def test_heights_go_with_a_length_that_the_pictures_have_a_part_in() -> None:
    """0.1 % of 6 mm are 6 um, of which a quarter goes into the heights."""
    shot: Any = SimpleNamespace(specimen=SimpleNamespace(length=6e-3), length_by_pictures=None)
    assert height_follows(shot, 1e-3) == 0.0
    shot.length_by_pictures = SimpleNamespace(y_per_length=0.25)
    assert height_follows(shot, 1e-3) == pytest.approx(1.5e-6)
    assert height_follows(shot, -1e-3) == pytest.approx(-1.5e-6)
    one = objective()
    moved = ModelAtOptimum(one, one.observations, response()).heights_with_length(shot, 1e-3)
    np.testing.assert_allclose(moved[10:], 1.5e-6 * TAPER, rtol=1e-6)  # higher, on a wider part of the cone
    np.testing.assert_allclose(moved[:10], 0.0, atol=1e-12)
    shot.length_by_pictures = None
    assert not ModelAtOptimum(one, one.observations, response()).heights_with_length(shot, 1e-3).any()
