"""The flyer's travel checked against its steps, the specimen's end and its shortening; regions that are
carried to another frame; pictures that repeat."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern

from dic.bodies.axial_displacement import AxialDisplacement
from dic.bodies.region import Region, carry_region
from dic.chain.follow_bodies import usable_region
from dic.chain.inputs import ChainError
from dic.chain.remarks import fastest_share, of_travel, uneven_steps
from dic.images.health import frame_health
from dic.outcome import FrameOutcome

SPEED, FRAME, STATIC = 2.5, 1e-5, 6


def travel(n: int = 40) -> AxialDisplacement:
    """At rest for six frames, set in motion within three, then 25 µm a frame."""
    t = FRAME * np.arange(n)
    since = np.maximum(t - FRAME * (STATIC - 1), 0.0)
    ramp = 3.0 * FRAME
    d = SPEED * np.where(since < ramp, since**2 / (2.0 * ramp), since - 0.5 * ramp)
    return AxialDisplacement(t, np.arange(n), d, np.full(n, 1e-7), np.full(n, 9), 1e-7)


def test_a_flyer_that_starts_and_goes_on_has_even_steps():
    assert uneven_steps(travel()).size == 0
    steady = travel()
    half = np.delete(np.arange(40), [20, 21])  # frames that are left out change no speed
    kept = AxialDisplacement(
        *(getattr(steady, name)[half] for name in ("t", "frame", "displacement", "sigma", "n_points")), 1e-7
    )
    assert uneven_steps(kept).size == 0


@pytest.mark.parametrize("share", [0.0, 0.6, 1.4, 2.0])
def test_a_doubled_and_a_missing_frame_are_named(share):
    """From frame 25 on the places are those of one frame earlier, or later."""
    right = travel()
    shifted = right.displacement.copy()
    shifted[25:] += (share - 1.0) * SPEED * FRAME
    assert uneven_steps(replace(right, displacement=shifted)).tolist() == [25]
    little = right.displacement.copy()
    little[25:] += 0.3 * SPEED * FRAME  # less than a third of a step: the flyer may do that
    assert uneven_steps(replace(right, displacement=little)).size == 0


def specimen(share: float) -> SimpleNamespace:
    """A hundred points, of which ten move `share` times as far as the flyer, the others half as far."""
    part = np.where(np.arange(100) < 10, share, 0.5)
    u = np.zeros((40, 100, 3))
    u[..., 1] = -part * travel().displacement[:, None]
    return SimpleNamespace(surface=SimpleNamespace(u=u, outcome=np.zeros((40, 100), dtype=int)))


@pytest.mark.parametrize(("share", "said"), [(0.8, 0), (1.04, 0), (1.06, 1), (1.4, 1)])
def test_no_point_of_the_specimen_outruns_the_flyer(share, said):
    """Ten of a hundred points, more than a twentieth, move `share` times as far as the flyer."""
    assert fastest_share(travel(), specimen(share)) == pytest.approx(share)
    assert len(of_travel(travel(), specimen(share))) == said


@pytest.mark.parametrize(("sigmas", "said"), [(4.9, 0), (5.1, 1), (-5.1, 1)])
def test_a_rim_off_the_specimens_end_is_said(sigmas, said):
    axial = replace(travel(), rim_disagreement=(sigmas * 5e-6, 5e-6))
    assert [r.name for r in of_travel(axial, specimen(1.0))] == ["flyer off the specimen's end"] * said
    assert of_travel(None, specimen(1.0)) == []


SHAPE, STEP = (96, 80), 2.3
PATTERN = speckle_pattern((260, 80), seed=4)


def picture(k: int, seed: int = 0) -> np.ndarray:
    """Speckles that come down by `STEP` a frame."""
    moved = render(PATTERN, SHAPE, material=lambda x: x + np.array([0.0, 120.0 - STEP * k]))
    return (
        np.round(moved + np.random.default_rng(100 * seed + k).normal(0.0, 1.0, SHAPE))
        .clip(0, 255)
        .astype(np.uint8)
    )


def series(frames) -> SimpleNamespace:
    return SimpleNamespace(
        shape=SHAPE, bits=8, path=Path("memory"), n_frames=len(frames), frame=lambda k: frames[k]
    )


REGION = Region(corners=((5.0, 30.0), (74.0, 30.0), (74.0, 80.0), (5.0, 80.0)), frame=9)


def test_a_region_is_carried_with_what_it_shows():
    frames = [picture(k) for k in range(10)]
    health = np.zeros(10, dtype=np.int64)
    found = carry_region(series(frames), health, REGION, 4, direction=(0.0, -1.0))
    assert found is not None
    assert found.frame == 4
    shift = np.asarray(found.corners) - np.asarray(REGION.corners)
    np.testing.assert_allclose(shift, np.tile([0.0, -5 * STEP], (4, 1)), atol=0.5)  # whole pixels
    other = [*frames[:4], *(picture(k, 7)[:, ::-1] for k in range(4, 9)), frames[9]]
    assert carry_region(series(other), health, REGION, 4, direction=(0.0, -1.0)) is None
    health[9] = FrameOutcome.UNREADABLE
    assert carry_region(series(frames), health, REGION, 4, direction=(0.0, -1.0)) is None


def test_a_region_is_used_in_another_frame_with_proof_only():
    frames = [picture(k) for k in range(10)]
    first, second = np.zeros(10, dtype=np.int64), np.zeros(10, dtype=np.int64)
    second[5:] = FrameOutcome.UNREADABLE
    inputs = SimpleNamespace(
        pictures=(series(frames), series(frames)),
        health=(first, second),
        static=np.arange(10) < 2,
        settings=SimpleNamespace(direction=(0.0, -1.0)),
    )
    assert usable_region(inputs, REGION, "flyer").frame == 4
    at_rest = replace(REGION, frame=1)
    assert usable_region(inputs, at_rest, "specimen") is at_rest
    second[1] = FrameOutcome.BLACK  # it rests in frame 0 as well
    assert usable_region(inputs, at_rest, "specimen") is at_rest
    first[9] = FrameOutcome.BLACK
    with pytest.raises(
        ChainError, match=r"frame 9, of which a camera has no usable picture.*declare it in frame 4"
    ):
        usable_region(inputs, REGION, "flyer")


def test_a_picture_that_is_the_one_before_is_not_used():
    frames = [picture(k) for k in range(24)]
    frames[13] = frames[12]
    outcome = frame_health(series(frames)).outcome
    assert np.flatnonzero(outcome == FrameOutcome.REPEATED).tolist() == [13]
    assert (np.delete(outcome, 13) == FrameOutcome.VALID).all()
    # computed pictures without noise are alike wherever nothing moves
    still = [frames[0]] * 12 + frames[:12]
    assert (frame_health(series(still)).outcome == FrameOutcome.VALID).all()
