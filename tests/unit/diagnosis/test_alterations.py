"""What a wrong input does to the prediction of one run, against motions known in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.bars.signals.transducers import bin_force
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.diagnosis.cause_inputs import changed_vector, contact_spread, radii
from kolsky.inverse.observations import Observations
from kolsky.shot.inputs import UNCHANGED, Change

STEP, FRAME = 1e-6, 1e-5
SLOPE, RADIUS, SWELL, TAPER = 4e5, 5e-3, 20.0, 0.1
"""Of the force [N/s]; radius at rest [m]; its growth [m/s] and slope along the axis [-]."""


def response() -> Any:
    """A force a t, and a cone whose radius grows evenly: one run."""
    t, frames = STEP * np.arange(201), FRAME * np.arange(21)
    y = np.tile(np.linspace(0.0, 6e-3, 9), (len(frames), 1))
    r = RADIUS + SWELL * frames[:, None] + TAPER * y
    return SimpleNamespace(
        force_times=t,
        force_transmission=(SLOPE * t)[None],
        impulse_transmission=(0.5 * SLOPE * t**2)[None],
        surface_times=frames,
        surface_r=r[None],
        surface_y=y[None],
    )


def observations() -> Observations:
    t, frames = STEP * np.arange(201), FRAME * np.arange(21)
    force = ForceHistory(t, np.zeros(201), np.ones(201))
    y = np.tile([1e-3, 3e-3], len(frames))
    line = CentreLine(
        time=np.repeat(frames, 2),
        frame=np.repeat(np.arange(21), 2),
        y=y,
        Z=np.full(42, RADIUS),
        sigma=np.full(42, 1e-6),
    )
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
