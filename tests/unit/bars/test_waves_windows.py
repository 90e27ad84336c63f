"""Windows of the three pulses for exact waves with known times."""

from dataclasses import replace

import numpy as np
import pytest
from elastic_layer import ALUMINIUM, Layer

from kolsky.bars.records import Windows
from kolsky.bars.reduction.windows import check_windows, find_windows, usable_limits

SCENE = Layer(first=ALUMINIUM, gauges=(0.7, 0.5))


def travel(scene):
    return tuple(x / bar.wave_speed for bar, x in scene.stations)


@pytest.mark.parametrize("scene", [SCENE, SCENE.pulled()], ids=["compression", "tension"])
def test_windows_lie_where_the_waves_are(scene):
    first, second = scene.signals(noise=2e-6)
    windows = find_windows(first, second, tension=scene.sign < 0)
    x1, x2 = travel(scene)
    lead = 2 * ALUMINIUM.diameter / ALUMINIUM.wave_speed
    # Time 0 is the arrival at the specimen. The onset may be earlier than the tangent by some samples.
    for (begin, _), wave in zip(
        (windows.incident, windows.reflected, windows.transmitted), (-x1, x1, x2), strict=True
    ):
        assert wave - lead - 3e-6 < begin < wave - lead + 0.5e-6
    lengths = [b - a for a, b in (windows.incident, windows.reflected, windows.transmitted)]
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-12)
    pulse = 2 * scene.rise + scene.hold
    assert lengths[0] == pytest.approx(1.25 * pulse + lead, abs=5e-6)
    assert windows.source == "travel times"


def test_the_next_wave_ends_the_windows():
    """A transmission gauge near the free end: its own reflection is back after 2 (L - x) / c0."""
    scene = replace(SCENE, second=replace(SCENE.second, length=0.85))
    first, second = SCENE.signals()
    second = replace(second, bar=scene.second)
    windows = find_windows(first, second)
    back = 2 * (0.85 - 0.5) / scene.second.wave_speed
    x2 = travel(scene)[1]
    assert windows.transmitted[1] < x2 + back
    assert windows.transmitted[1] > x2 + back - 6e-6  # one diameter's travel of the aluminium bar, 3.5 us
    limits = usable_limits(first, second)
    assert min(limits, key=lambda limit: limit.time).reason.endswith("far end of the transmission bar")


def test_a_long_pulse_overlaps_with_its_reflection():
    scene = replace(SCENE, hold=300e-6)
    first, second = scene.signals()
    with pytest.raises(ValueError, match=r"they overlap\. It must be shorter than 2 x / c0\. Cure: a second"):
        find_windows(first, second)


def test_a_pulse_of_the_other_sign_is_not_taken():
    """A compressive shot declared one of tension: its reflected pulse is not taken for the incident one."""
    first, second = SCENE.signals(noise=1e-6)
    with pytest.raises(
        ValueError, match=r"a pulse of compression comes first.* declared one of tension\. Cure"
    ):
        find_windows(first, second, tension=True)
    first, second = SCENE.pulled().signals(noise=1e-6)
    with pytest.raises(ValueError, match=r"a pulse of tension comes first.* declared one of compression"):
        find_windows(first, second)


def test_distances_are_checked_against_what_is_seen():
    """A gauge that sits 20 mm from where it is declared: the reflected pulse is seen 2 x 20 mm / c0 off."""
    first, second = replace(SCENE, modulus=0.5e9).signals(noise=1e-6)
    right = check_windows(first, second)
    # The specimen's own reflection begins with the incident pulse's slope; its foot is as straight.
    assert abs(right[0].delay) < 0.3e-6
    wrong = check_windows(replace(first, position=0.72), second)
    expected = -2 * 0.02 / ALUMINIUM.wave_speed
    assert wrong[0].delay - right[0].delay == pytest.approx(expected, abs=0.02e-6)  # of the noise in the tail
    assert "earlier than predicted" in wrong[0].reason
    # The transmitted wave comes a transit of the specimen later, 7.7 us, and rises in steps of two transits,
    # between which its tangent may meet the baseline half a transit early.
    transit = replace(SCENE, modulus=0.5e9).transit
    assert 0.5 * transit < right[1].delay < 2 * transit


def test_nothing_transmitted_is_said():
    first, second = SCENE.signals()
    silent = replace(second, strain=replace(second.strain, value=0.0 * second.strain.value, sigma=1e-6))
    _, transmitted = check_windows(first, silent)
    assert transmitted.observed is None
    assert np.isnan(transmitted.delay)
    assert "no positive pulse" in transmitted.reason


def test_windows_by_hand_are_kept():
    first, second = SCENE.signals()
    hand = Windows((-150e-6, 0.0), (130e-6, 280e-6), (90e-6, 240e-6), source="shot file")
    assert find_windows(first, second, manual=hand) is hand


@pytest.mark.parametrize(
    ("hand", "message"),
    [
        (((0.0, -1e-6), (0.0, 1e-4), (0.0, 1e-4)), r"the incident window \[0\.0, -1e-06\] s must end after"),
        (
            ((-1e-4, 0.0), (0.0, 1.0), (0.0, 1e-4)),
            r"the reflected window .* leaves the record of incident ga",
        ),
        (((-1e-4, 0.0), (0.0, 1e-4), (-1.0, 1e-4)), r"the transmitted window .* leaves the record of transm"),
        (((0.0, 1e-4), (-1e-4, 0.0), (0.0, 1e-4)), r"begins at -0\.0001 s, before the incident one"),
        (((float("nan"), 0.0), (0.0, 1e-4), (0.0, 1e-4)), r"the incident window .* must end after it begins"),
    ],
)
def test_windows_by_hand_are_checked(hand, message):
    first, second = SCENE.signals()
    with pytest.raises(ValueError, match=message):
        find_windows(first, second, manual=Windows(*hand, source="shot file"))


def test_stations_are_checked():
    first, second = SCENE.signals()
    with pytest.raises(ValueError, match="is of the transmission bar, it must be of the incident bar"):
        find_windows(second, first)
    with pytest.raises(ValueError, match=r"= 1\.4 m must lie between 0 and the bar's length, 1\.4 m"):
        find_windows(replace(first, position=1.4), second)
    short = replace(second, strain=replace(second.strain, value=second.strain.value[:1500]))
    with pytest.raises(ValueError, match=r"transmission gauge: the record ends .* Cure: a longer record"):
        find_windows(first, short)
