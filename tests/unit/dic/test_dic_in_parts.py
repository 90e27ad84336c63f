"""Work in several processes gives the result of one process: strains, the gate of the smooth surface, and the
inspection of two cameras."""

import os

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern
from test_dic_full_field import at_rest, history
from test_dic_full_field import strains_grid as grid

from dic import processes
from dic.chain import inputs, outliers
from dic.chain.inputs import ChainError, inspect_pictures
from dic.images.series import DecodedPictures, PicturesInMemory, decode_once
from dic.processes import allow_forks, can_fork, parts
from dic.surfaces.strains import StrainGauge, strains

pytestmark = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def divided(monkeypatch, work):
    """What work gives in one process and in three."""
    monkeypatch.setattr(processes, "cores", lambda: 4)
    alone = work()
    with allow_forks():
        assert parts() == 3
        return alone, work()


def test_one_core_is_left_for_other_work(monkeypatch):
    assert parts() == 1  # no forks here
    with allow_forks():
        for cores, wanted in ((2, 1), (3, 2), (5, 4), (64, processes.MOST_PARTS)):
            monkeypatch.setattr(processes, "cores", lambda cores=cores: cores)
            assert parts() == wanted


def test_strains_of_parts_are_those_of_the_whole(monkeypatch):
    points = grid(7, 6)
    X = at_rest(points)
    rng = np.random.default_rng(4)
    positions = X * np.array([1.05, 0.9, 1.0]) + rng.normal(0.0, 1e-6, (5, *X.shape))
    outcome = np.zeros((5, len(X)), dtype=np.int64)
    outcome[2, 7:9] = 1
    surface = history(X, positions, outcome)
    gauge = StrainGauge(window=3, step=6.0, subset=25.0)
    alone, together = divided(monkeypatch, lambda: strains(surface, points, gauge))
    assert (alone.outcome == 0).any()
    for name, value in vars(alone).items():
        np.testing.assert_array_equal(getattr(together, name), value, err_msg=name)


def test_the_gate_of_parts_is_that_of_the_whole(monkeypatch):
    side, frames = 9, 7
    cell = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    position = np.random.default_rng(5).normal(0.0, 2e-6, (frames, len(cell), 3))
    for frame in range(frames):
        position[frame, 11 + 8 * frame, 2] += 200e-6  # another point in every frame
    alone, together = divided(
        monkeypatch,
        lambda: outliers.off_surface(
            position,
            np.full(position.shape, 2e-6),
            np.ones(position.shape[:2], dtype=bool),
            cell,
            distance=0.4e-3,
        ),
    )
    assert [np.flatnonzero(row).tolist() for row in alone] == [[11 + 8 * frame] for frame in range(frames)]
    np.testing.assert_array_equal(together, alone)


def series():
    """Pictures of two cameras, one of each black."""
    pattern = speckle_pattern((64, 64), size=4.0, seed=3)
    made = []
    for camera in (0, 1):
        frames = [
            np.rint(1000.0 + 150.0 * render(pattern, (64, 64), noise=1.0, seed=10 * camera + k))
            for k in range(6)
        ]
        frames[4 + camera][:] = 5.0
        made.append(PicturesInMemory(tuple(frame.astype(np.uint16) for frame in frames)))
    return made[0], made[1]


def test_cameras_inspected_by_two_processes_are_those_inspected_by_one(monkeypatch):
    static = np.arange(6) < 3
    read = []
    frame = DecodedPictures.frame
    monkeypatch.setattr(DecodedPictures, "frame", lambda own, k: read.append(os.getpid()) or frame(own, k))
    alone, together = divided(monkeypatch, lambda: inspect_pictures(series(), static))
    assert set(read) == {os.getpid()}
    for camera in (0, 1):
        np.testing.assert_array_equal(together.health[camera], alone.health[camera])
        assert together.grey[camera].sigma == alone.grey[camera].sigma
        assert together.pictures[camera].in_memory.keys() == alone.pictures[camera].in_memory.keys()
        for k, picture in alone.pictures[camera].in_memory.items():
            np.testing.assert_array_equal(together.pictures[camera].in_memory[k], picture)
            assert not together.pictures[camera].in_memory[k].flags.writeable
    assert alone.health[0][4] != 0
    assert alone.health[1][5] != 0


def test_what_is_wrong_with_camera_1_is_said(monkeypatch):
    first, second = series()
    short = PicturesInMemory(second.pictures[:5])
    monkeypatch.setattr(processes, "cores", lambda: 4)
    with allow_forks(), pytest.raises(ChainError, match="camera 1 has"):
        inspect_pictures((first, short), np.arange(6) < 3)


def test_large_series_are_inspected_in_one_process(monkeypatch):
    monkeypatch.setattr(inputs, "MOST_SENT", 6 * 64 * 64 - 1)
    monkeypatch.setattr(inputs, "background", None)
    monkeypatch.setattr(processes, "cores", lambda: 4)
    with allow_forks():
        assert inspect_pictures(series(), np.arange(6) < 3).health[0][4] != 0


def test_pictures_of_another_process_are_held_up_to_the_limit():
    own = DecodedPictures(series()[0], most=2 * 64 * 64 * 2)
    own.frame(0)
    given = np.full((64, 64), 7, dtype=np.uint16)
    own.hold({0: given, 1: given, 2: given})
    assert sorted(own.in_memory) == [0, 1]
    assert own.in_memory[0][0, 0] != 7  # the one read here
    assert decode_once(own) is own
    assert own.frame(1) is given
