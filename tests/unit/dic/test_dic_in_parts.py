"""Several processes give the result of one: strains, the gate of the smooth surface, the inspection."""

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern
from test_dic_full_field import at_rest, history
from test_dic_full_field import strains_grid as grid

from dic import processes
from dic.chain import inputs, outliers
from dic.chain.inputs import ChainError, inspect_pictures
from dic.images.health import frame_health
from dic.images.series import PicturesInMemory
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
            position, np.full(position.shape, 2e-6), np.ones(position.shape[:2], dtype=bool), cell,
            distance=0.4e-3,
        ),
    )  # fmt: skip
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


def test_known_health_is_not_inspected_again(monkeypatch):
    static, pictures = np.arange(6) < 3, series()
    first = inspect_pictures(pictures, static)
    known = frame_health(pictures[0]), frame_health(pictures[1])
    monkeypatch.setattr(inputs, "frame_health", None)
    again = inspect_pictures(pictures, static, known)
    for camera in (0, 1):
        np.testing.assert_array_equal(again.health[camera], first.health[camera])
        assert again.health[camera][4 + camera] != 0
        assert again.grey[camera].sigma == first.grey[camera].sigma


def test_what_is_wrong_with_camera_1_is_said():
    first, second = series()
    short = PicturesInMemory(second.pictures[:5])
    with pytest.raises(ChainError, match="camera 1 has"):
        inspect_pictures((first, short), np.arange(6) < 3)
