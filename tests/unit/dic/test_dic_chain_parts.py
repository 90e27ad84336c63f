"""Parts of the chain of pictures on their own: the look at them, the rows of the outline, the clock."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern
from synthetic_dic import rig, synthetic_result

from dic.bodies.region import Region
from dic.chain import ChainError, ChainSettings, Clock
from dic.chain.inputs import check_cameras, inspect_images
from dic.chain.test_frame import outline_of
from dic.correlation.subsets import Shape
from dic.images import PictureError
from dic.outcome import FrameOutcome
from dic.surfaces.outline import outline

SHAPE = (96, 128)
FRAMES = 6
FLOOR, GAIN = 12.0, 0.25
"""Of the pictures' noise: variance FLOOR² + GAIN grey."""
SETTINGS = ChainSettings(toward_flyer="left", zero=(60.0, 90.0), strip_half_width=1e-3)
REGION = Region(((10.0, 10.0), (100.0, 10.0), (100.0, 80.0), (10.0, 80.0)))


@dataclass(frozen=True)
class Memory:
    """Pictures in memory; one that is None cannot be read."""

    frames: tuple
    bits: int = 12
    crop_offset: tuple[float, float] = (0.0, 0.0)
    times: None = None
    path: Path = Path("memory")
    shape: tuple[int, int] = SHAPE

    @property
    def n_frames(self) -> int:
        return len(self.frames)

    def frame(self, index: int) -> np.ndarray:
        if self.frames[index] is None:
            raise PictureError(self.path, "is not there", frame=index)
        return self.frames[index]


def at_rest(*, seed: int, floor: float = FLOOR, gain: float = GAIN) -> Memory:
    """A specimen that rests, with known noise."""
    clean = render(speckle_pattern(SHAPE, seed=3), SHAPE, gain=8.0, offset=200.0)  # well within 12 bits
    rng = np.random.default_rng(seed)
    noise = np.sqrt(floor**2 + gain * clean) * rng.standard_normal((FRAMES, *SHAPE))
    return Memory(tuple(np.rint(clean + noise).astype(np.uint16)))


def looked(first: Memory, second: Memory, *, frames: int = FRAMES):
    times = np.arange(frames) * 1e-3
    return inspect_images((first, second), rig(), SETTINGS, t=times, static=np.ones(frames, dtype=bool))


def without(series: Memory, gone) -> Memory:
    return replace(
        series, frames=tuple(None if k in gone else frame for k, frame in enumerate(series.frames))
    )


def test_a_look_tells_what_is_usable_and_how_noisy_each_camera_is():
    given = looked(at_rest(seed=1), without(at_rest(seed=2, floor=6.0, gain=0.0), [4]))
    assert given.health[0].tolist() == [FrameOutcome.VALID] * FRAMES
    assert given.health[1].tolist() == [FrameOutcome.VALID] * 4 + [
        FrameOutcome.UNREADABLE,
        FrameOutcome.VALID,
    ]
    # A line through 12 288 pixels of five pairs has its slope to 3.6 %: three of these.
    assert given.noise[0].gain == pytest.approx(GAIN, rel=0.11)
    # Rounding adds 1/12 to a variance of 36; the median of four pairs knows sigma to 0.4 %: four of these.
    assert given.grey[1].sigma == pytest.approx(np.hypot(6.0, 12.0**-0.5), rel=0.015)


def test_a_noise_that_does_not_grow_with_the_grey_is_taken_as_one_number():
    given = looked(at_rest(seed=1), at_rest(seed=2))
    falling = replace(given, grey=(replace(given.grey[0], slope=-1e-3), given.grey[1]))
    assert (falling.noise[0].floor, falling.noise[0].gain) == (given.grey[0].sigma, 0.0)
    assert falling.noise[1].gain > 0.0


@pytest.mark.parametrize(
    ("camera", "change", "words"),
    [
        (
            1,
            lambda series: replace(series, frames=series.frames[:-1]),
            "camera 1 has 5 pictures, there are 6",
        ),
        (0, lambda series: without(series, range(1, FRAMES)), "camera 0 has 1 usable static pictures"),
        (
            1,
            lambda series: replace(series, frames=series.frames[:1] * FRAMES),
            "camera 1: .*equal to the last",
        ),
    ],
    ids=["too few", "one usable", "copies"],
)
def test_pictures_that_tell_nothing_are_refused_by_camera(camera, change, words):
    both = [at_rest(seed=1), at_rest(seed=2)]
    both[camera] = change(both[camera])
    with pytest.raises(ChainError, match=words):
        looked(*both)


def test_cameras_that_never_saw_the_same_frame_are_refused():
    given = looked(without(at_rest(seed=1), [0, 2, 4]), without(at_rest(seed=2), [1, 3, 5]))
    with pytest.raises(ChainError, match="no frame has a usable picture of both"):
        check_cameras(given, REGION)


def test_rows_of_the_outline_above_the_largest_sigma_are_counted():
    body = synthetic_result().specimen
    whole = outline(
        body.surface,
        body.points,
        half_width=SETTINGS.strip_half_width,
        subset=SETTINGS.subset,
        shape=Shape.QUADRATIC,  # that of the match between the cameras, the higher of both
    )
    assert SETTINGS.stereo.shape is Shape.QUADRATIC
    limit = float(np.median(whole.sigma))
    line, left_out = outline_of(body, replace(SETTINGS, largest_sigma=limit))
    assert left_out == np.sum(whole.sigma > limit) > 0
    for name in ("t", "frame", "y", "Z", "sigma"):
        np.testing.assert_array_equal(getattr(line, name), getattr(whole, name)[whole.sigma <= limit])
    assert outline_of(body, SETTINGS)[1] == 0


def test_a_direction_points_toward_the_flyer_in_the_picture():
    assert SETTINGS.direction == (-1.0, 0.0)  # x to the right, y down
    assert replace(SETTINGS, toward_flyer="down").direction == (0.0, 1.0)


def test_the_clock_has_the_stages_that_ended():
    clock = Clock()
    assert clock("one", lambda: 7) == 7
    with pytest.raises(KeyError):
        clock("two", lambda: {}["nothing"])
    assert list(clock.seconds) == ["one"]
    assert clock.seconds["one"] >= 0.0
