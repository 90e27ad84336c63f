"""Effect of a wrong input on the prediction of one run, compared with motions in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.bars.signals.transducers import bin_force
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.diagnosis.cause_inputs import changed_vector, contact_spread, leaves_length, radii
from kolsky.inverse.observations import Observations
from kolsky.shot.input_records import UNCHANGED, Change

STEP, FRAME = 1e-6, 1e-5
SLOPE, RADIUS, SWELL, TAPER = 4e5, 5e-3, 20.0, 0.1
"""Of the force [N/s]; radius at rest [m]; its growth [m/s] and slope along the axis [-]."""


def response() -> Any:
    """A force a t, and a cone whose radius grows evenly: one run."""
    t, frames = STEP * np.arange(201), FRAME * np.arange(21)
    y = np.tile(np.linspace(0.0, 6e-3, 9), (len(frames), 1))
    r = RADIUS + SWELL * frames[:, None] + TAPER * y
    return SimpleNamespace(
        force_times=t, force_transmission=(SLOPE * t)[None], impulse_transmission=(0.5 * SLOPE * t**2)[None],
        surface_times=frames, surface_r=r[None], surface_y=y[None],
    )  # fmt: skip


def observations() -> Observations:
    t, frames = STEP * np.arange(201), FRAME * np.arange(21)
    force = ForceHistory(t, np.zeros(201), np.ones(201))
    y = np.tile([1e-3, 3e-3], len(frames))
    line = CentreLine(
        time=np.repeat(frames, 2), frame=np.repeat(np.arange(21), 2), y=y, Z=np.full(42, RADIUS),
        sigma=np.full(42, 1e-6),
    )  # fmt: skip
    return Observations(force=force, bins=bin_force(force, window=(0.0, 2e-4), width=FRAME), centre_line=line)


def parts(change: Change) -> tuple[np.ndarray, np.ndarray]:
    vector = changed_vector(change, response(), observations())
    return vector[:20], vector[20:]


CENTRES = FRAME * (np.arange(20) + 0.5)
TIMES, HEIGHTS = np.repeat(FRAME * np.arange(21), 2), np.tile([1e-3, 3e-3], 21)


def test_unaltered_is_the_run_itself() -> None:
    force, Z = parts(UNCHANGED)
    np.testing.assert_allclose(force, SLOPE * CENTRES, rtol=1e-12)
    np.testing.assert_allclose(Z, RADIUS + SWELL * TIMES + TAPER * HEIGHTS, rtol=1e-12)


def test_scale_and_zero_of_the_force_leave_the_outline() -> None:
    force, Z = parts(Change(force_factor=2.0, force_offset=3.0))
    np.testing.assert_allclose(force, 2.0 * SLOPE * CENTRES + 3.0, rtol=1e-12)
    np.testing.assert_array_equal(Z, parts(UNCHANGED)[1])


@pytest.mark.parametrize("lag", [1.2e-5, -1.2e-5])
def test_a_lag_makes_a_recording_late(lag: float) -> None:
    force, _ = parts(Change(force_lag=lag))
    inside = (CENTRES - lag > FRAME) & (CENTRES - lag < 2e-4 - FRAME)  # whole bins of the run
    np.testing.assert_allclose(force[inside], SLOPE * (CENTRES - lag)[inside], rtol=1e-9)
    _, Z = parts(Change(outline_lag=lag))
    # At rest before the start; straight on after the end.
    np.testing.assert_allclose(Z, RADIUS + SWELL * np.maximum(TIMES - lag, 0.0) + TAPER * HEIGHTS, rtol=1e-12)


def test_a_force_goes_on_evenly_after_its_end() -> None:
    force, _ = parts(Change(force_lag=-3.0 * FRAME))
    np.testing.assert_allclose(force[-3:], SLOPE * 2e-4, rtol=1e-9)


def test_places_of_the_outline() -> None:
    Z = parts(UNCHANGED)[1]
    np.testing.assert_allclose(parts(Change(y_offset=5e-4))[1], Z + TAPER * 5e-4, rtol=1e-9)
    np.testing.assert_allclose(parts(Change(Z_offset=2e-5))[1], Z - 2e-5, rtol=1e-12)


def test_delays_of_a_tilted_face_have_the_density_of_a_semicircle() -> None:
    """Its moments are R^2 / 4 and R^4 / 8; the odd ones vanish."""
    lags, weights = contact_spread(2.0)
    assert weights.sum() == pytest.approx(1.0, rel=1e-12)
    assert weights @ lags == pytest.approx(0.0, abs=1e-14)
    assert weights @ lags**2 == pytest.approx(2.0**2 / 4.0, rel=1e-12)
    assert weights @ lags**4 == pytest.approx(2.0**4 / 8.0, rel=1e-12)
    # A ramp in the mean begins neither earlier nor later.
    force, _ = parts(Change(spread=5e-6))
    np.testing.assert_allclose(force[1:-1], SLOPE * CENTRES[1:-1], rtol=1e-9)


def test_radii_that_are_known_serve_every_change_that_sees_the_outline_alike() -> None:
    run, seen = response(), observations()
    late = Change(outline_lag=3e-6, y_offset=1e-4)
    known = radii(late, run, seen)
    for other in (late, replace(late, force_factor=1.1, force_lag=2e-6, Z_offset=5e-6)):
        assert other.sight == late.sight
        np.testing.assert_array_equal(
            changed_vector(other, run, seen, known=known), changed_vector(other, run, seen)
        )
    for other in (replace(late, outline_lag=0.0), replace(late, y_offset=0.0)):
        assert other.sight != late.sight
        assert not np.array_equal(radii(other, run, seen), known)


def cone(change: Change) -> np.ndarray:
    return changed_vector(change, response(), observations())[20:]


def test_frames_and_pictures_at_another_scale() -> None:
    """The run begins at the shot's zero: radii of f t; and lengths p y, seen p times too small."""
    film, picture = cone(Change(film=0.9)), cone(Change(picture=1.02))
    np.testing.assert_allclose(film, RADIUS + SWELL * 0.9 * TIMES + TAPER * HEIGHTS, rtol=1e-12)
    np.testing.assert_allclose(picture, (RADIUS + SWELL * TIMES + TAPER * 1.02 * HEIGHTS) / 1.02, rtol=1e-12)
    assert Change(film=0.9, motion=1.1, picture=1.02).path == pytest.approx((1.122, 0.9))


def test_a_film_at_another_rate_is_stretched_from_the_shot_s_zero() -> None:
    """A run begins at 30 us. An event at the file's time t is at f t, by its path at 30 us + f (t - 30 us):
    all of the run comes (1 - f) 30 us later than the force's clock says."""
    run, start = response(), 3e-5
    late = SimpleNamespace(**{**vars(run), "force_times": run.force_times + start})
    late.impulse_transmission = 0.5 * SLOPE * (late.force_times**2 - start**2)[None]
    late.force_transmission = SLOPE * late.force_times[None]
    force = changed_vector(Change(film=0.9), late, observations())[:20]
    inside = slice(4, 18)
    np.testing.assert_allclose(force[inside], SLOPE * (CENTRES + 0.1 * start)[inside], rtol=1e-9)


def test_heights_from_the_other_end() -> None:
    """The cone is 6 mm high."""
    mirrored = cone(Change(mirror=1e-4))
    np.testing.assert_allclose(mirrored, RADIUS + SWELL * TIMES + TAPER * (6.1e-3 - HEIGHTS), rtol=1e-12)


def test_a_slow_amplifier_and_a_leaking_charge() -> None:
    """Of a ramp a t a low-pass leaves a (t - tau + tau exp(-t / tau)), a leak a tau (1 - exp(-t / tau))."""
    tau, edges = 2e-5, FRAME * np.arange(21)

    def mean(integral: Any) -> np.ndarray:
        return np.asarray(np.diff(integral(edges)) / FRAME)

    slow = parts(Change(time_constant=tau))[0]
    leak = parts(Change(leak=1.0 / tau))[0]
    fall = -tau * np.exp(-edges / tau)  # integral of exp(-t / tau)
    lagged = mean(lambda t: SLOPE * (0.5 * t**2 - tau * t + tau * fall))
    # The impulse is a parabola, and the filter is exact for straight lines between samples a step apart.
    np.testing.assert_allclose(slow, lagged, atol=SLOPE * STEP**2 / tau)
    np.testing.assert_allclose(leak, SLOPE * CENTRES - lagged, atol=SLOPE * STEP**2 / tau)


def test_a_share_of_the_other_end_s_force() -> None:
    run = response()
    run.impulse_flyer, run.force_flyer = 3.0 * run.impulse_transmission, 3.0 * run.force_transmission
    force = changed_vector(Change(flyer_share=0.25), run, observations())[:20]
    np.testing.assert_allclose(force, 1.5 * SLOPE * CENTRES, rtol=1e-12)


def test_changes_add_up() -> None:
    one = Change(film=1.1, picture=1.02, time_constant=1e-5, leak=10.0, flyer_share=0.1, mirror=1e-4)
    both = one.then(Change(film=0.9, picture=1.01, time_constant=2e-5, leak=5.0, curve={"tilt": 0.1}))
    assert (both.film, both.picture) == pytest.approx((0.99, 1.0302))
    assert (both.time_constant, both.leak, both.flyer_share) == pytest.approx((3e-5, 15.0, 0.1))
    assert (both.mirror, both.curve) == (1e-4, {"tilt": 0.1})
    assert replace(one, mirror=2e-4).sight != one.sight
    assert UNCHANGED.sight == Change().sight  # NaN is no height
    for other in (Change(leak=1.0), Change(time_constant=1e-6), Change(flyer_share=0.1)):
        assert other.seen != UNCHANGED.seen


def test_a_length_is_tried_only_if_the_flyer_leaves_some_of_it() -> None:
    """3 mm of 6 mm: half; of a length that is 0.6 times the declared one 83 %."""
    path = SimpleNamespace(knots=np.array([0.0, 1.0]), position=lambda t: 3e-3 * t)
    problem = SimpleNamespace(shot=SimpleNamespace(specimen=SimpleNamespace(length=6e-3)))
    runner: Any = SimpleNamespace(front=SimpleNamespace(path=path), problem=problem)
    assert leaves_length(runner, UNCHANGED)
    assert leaves_length(runner, Change(specimen={"length": 0.65}))
    assert not leaves_length(runner, Change(specimen={"length": 0.6}))
    assert not leaves_length(runner, Change(motion=1.3, picture=1.3))
