"""Bad frames are found and named, good ones are left alone whatever the lamp does."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from dic import FrameOutcome
from dic.images import PictureError, frame_health, saturated_mask

SIDE, FRAMES = 96, 24
NOISE = 8.0


class Series:
    """Pictures in memory; None cannot be read."""

    def __init__(self, frames, bits):
        self.frames, self.bits, self.shape, self.n_frames = frames, bits, (SIDE, SIDE), len(frames)
        self.path, self.crop_offset, self.times = Path("memory"), (0.0, 0.0), None

    def frame(self, index):
        if self.frames[index] is None:
            raise PictureError(self.path, "is gone", frame=index)
        return self.frames[index]


def scene(*, bits=12, flicker=0.05, gain=1.0, at_bits=None):
    """A speckled specimen on a dark ground that moves and is pressed flat, under a flickering lamp."""
    rng = np.random.default_rng(11)
    speckles = gaussian_filter(rng.normal(size=(SIDE, SIDE)), 1.5)
    speckles = 0.35 + 0.12 * speckles / speckles.std()
    ground = np.zeros((SIDE, SIDE))
    frames = []
    for k in range(FRAMES):
        height = int(70 - 1.6 * k)
        light = gain * (1.0 + flicker * rng.normal())
        picture = ground + 0.03
        picture[10 : 10 + height, 12:84] = shift(speckles, (0, 0.5 * k), order=1, mode="wrap")[:height, :72]
        grey = light * picture * (2**bits - 1) + NOISE * 2 ** (bits - 12) * rng.normal(size=picture.shape)
        frames.append(np.clip(np.rint(grey), 0, 2**bits - 1).astype(np.uint8 if bits == 8 else np.uint16))
    return Series(frames, at_bits or bits)


def dark(bits=12):
    """What a camera sees without light: its offset, noise, a few hot pixels."""
    grey = 20 + NOISE * np.random.default_rng(3).normal(size=(SIDE, SIDE))
    grey[::30, ::30] = 2**bits - 1
    return np.clip(np.rint(grey), 0, 2**bits - 1).astype(np.uint16)


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("flicker", [0.0, 0.05])
def test_good_frames_are_left_alone(bits, flicker):
    health = frame_health(scene(bits=bits, flicker=flicker))
    assert np.all(health.outcome == FrameOutcome.VALID)
    assert not health.flashed.any()
    assert not health.notes
    assert health.ceiling == 2**bits - 1


def test_each_bad_frame_has_its_outcome_and_the_others_stand():
    series = scene()
    series.frames[3] = None
    series.frames[7] = dark()
    series.frames[8] = np.zeros((SIDE, SIDE), dtype=np.uint16)
    series.frames[15] = np.full((SIDE, SIDE), 4095, dtype=np.uint16)
    bright = scene(gain=1.0).frames[20].astype(int) * 12
    series.frames[20] = np.minimum(bright, 4095).astype(np.uint16)  # overexposed: the specimen burnt out
    health = frame_health(series, mask=specimen())
    expected = np.full(FRAMES, int(FrameOutcome.VALID))
    expected[3] = FrameOutcome.UNREADABLE
    expected[[7, 8]] = FrameOutcome.BLACK
    expected[[15, 20]] = FrameOutcome.SATURATED
    np.testing.assert_array_equal(health.outcome, expected)
    assert sorted(health.notes) == [3, 7, 8, 15, 20]
    assert "is gone" in health.notes[3]
    assert health.notes[7].startswith("memory, frame 7: black: mean")
    assert np.isnan(health.mean[3])
    assert health.saturated[15] == 1.0


def specimen():
    mask = np.zeros((SIDE, SIDE), dtype=bool)
    mask[10:50, 12:84] = True
    return mask


def test_a_dim_frame_is_not_black_and_a_dim_series_neither():
    series = scene()
    series.frames[9] = (series.frames[9] * 0.3).astype(np.uint16)
    assert np.all(frame_health(series).outcome == FrameOutcome.VALID)
    assert np.all(frame_health(scene(gain=0.1)).outcome == FrameOutcome.VALID)


def test_a_series_without_light_is_black_throughout():
    series = Series([dark() for _ in range(4)], 12)
    assert np.all(frame_health(series).outcome == FrameOutcome.BLACK)


def test_a_smooth_glow_is_black_once_the_noise_is_known():
    series = scene()
    glow = np.tile(np.linspace(10.0, 24.0, SIDE), (SIDE, 1))  # no noise at all: neighbours correlate
    series.frames[5] = np.rint(glow).astype(np.uint16)
    assert frame_health(series, noise=NOISE).outcome[5] == FrameOutcome.BLACK


@pytest.mark.parametrize("gain", [0.5, 1.0, 1.3])
def test_a_flash_is_seen_and_its_frame_stands(gain):
    series = scene(gain=gain)
    for k in (6, 7):  # a highlight of 3 % of the picture, whatever the exposure
        series.frames[k][20:36, 30:48] = 4095
    health = frame_health(series)
    assert np.flatnonzero(health.flashed).tolist() == [6, 7]
    assert np.all(health.outcome == FrameOutcome.VALID)
    assert "flash" in health.notes[6]
    share = 16 * 18 / SIDE**2
    np.testing.assert_allclose(health.flash[[6, 7]], share, rtol=0.05)  # a few bright speckles beside it


def test_where_saturation_is_the_rule_flicker_is_no_flash():
    health = frame_health(scene(gain=2.4))
    assert np.all(health.saturated > 0.05)
    assert not health.flashed.any()
    assert np.all(np.isnan(health.flash))


def test_where_pixels_pile_up_is_found_though_the_file_says_16_bits():
    health = frame_health(scene(gain=3.0, at_bits=16))
    assert health.ceiling == 4095
    assert frame_health(scene(gain=1.0, at_bits=16)).ceiling == 65535  # nothing piles up: nothing is guessed


def test_saturated_pixels_and_their_neighbours():
    picture = np.zeros((9, 9), dtype=np.uint16)
    picture[4, 4] = 4095
    assert saturated_mask(picture, 4095, grow=0).sum() == 1
    np.testing.assert_array_equal(np.argwhere(saturated_mask(picture, 4095))[[0, -1]], [[3, 3], [5, 5]])


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"most_saturated": 0.0}, "most_saturated"),
        ({"least_contrast": 1.5}, "least_contrast"),
        ({"flash_share": 0.0}, "flash_share"),
        ({"noise": -1.0}, "noise"),
        ({"mask": np.ones((3, 3), dtype=bool)}, "mask"),
        ({"mask": np.zeros((SIDE, SIDE), dtype=bool)}, "mask"),
    ],
)
def test_limits_out_of_range_are_refused(limits, message):
    with pytest.raises(ValueError, match=message):
        frame_health(scene(), **limits)
