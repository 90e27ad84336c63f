"""Forces, clocks and events found in the signals of a simulated test; figures as on the page."""

import numpy as np
import pytest
import soft_forces as topic

from kolsky.bars.flyer.synchronisation import Agreement
from kolsky.bars.reduction.validity import Reason

pytestmark = pytest.mark.slow


def test_the_force_on_the_specimen_after_mass_compensation() -> None:
    result = topic.case()
    since = result.truth("separation")
    assert result.error(since) < topic.FORCE_TOLERANCE
    use = (result.time > since) & (result.time < result.time[-1] - 1e-4)
    # Without it: in flight the transducer feels a third of the force.
    assert topic.rms((result.raw - result.true)[use]) > 15.0 * topic.FORCE_TOLERANCE
    score = topic.low_pass(result.force.value - result.true, topic.SAMPLE, topic.CUTOFF) / result.force.sigma
    assert topic.rms(score[use]) < 1.0  # sigma is that of a sample, the filter averages over a hundred


def test_planted_lags_are_found() -> None:
    result = topic.case()
    for lag, sync in zip(topic.PLANTED, result.syncs, strict=True):
        assert sync.lag == pytest.approx(lag, abs=topic.LAG_SIGMAS * sync.sigma)
        assert sync.gain == pytest.approx(1.0, abs=topic.LAG_SIGMAS * sync.sigma_gain)
        assert sync.agreement is (Agreement.DIFFERS if lag else Agreement.AGREES)


@pytest.mark.parametrize("name", topic.EVENTS)
def test_events_are_found_at_their_times(name: str) -> None:
    result = topic.case()
    event = result.events[name]
    assert event.time is not None
    assert topic._beyond(result, event, name) < topic.EVENT_SIGMAS
    assert 0.0 < event.sigma < 12e-6  # a frame and a half: worth knowing


def test_the_displacement_alone_gives_the_first_ones() -> None:
    result = topic.case()
    assert result.alone["push-back"].time is None
    for name in ("full speed", "second impact"):
        assert topic._beyond(result, result.alone[name], name) < topic.EVENT_SIGMAS
    # It does not know that the back face moves at 0.03 m/s, which at 5000 m/s^2 is 6 us.
    late = result.alone["arrest"].time - result.truth("arrest")
    assert 3e-6 < late < 9e-6


def test_the_window_opens_late_and_is_told_why() -> None:
    found = topic.case().validity
    assert found.window is not None
    # Two transits of the wave, 1.4 ms, after its arrival the specimen begins to be balanced.
    assert found.window[0] > 1.4e-3
    assert found.start_reason is Reason.BALANCE
    before = found.time < 1.4e-3
    assert (
        np.mean(
            [reason is Reason.VALID for reason, early in zip(found.reasons, before, strict=True) if early]
        )
        < 0.1
    )
