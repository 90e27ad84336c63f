"""Calibration pictures whose pairs are out of order: refused, with the order that fits."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from test_dic_calibration import BOARD, SIZE, sightings, true_poses

import dic.calibration.views
from dic.calibration.refine import find_order
from kolsky.base.errors import InputError
from kolsky.pictures import calibration
from kolsky.pictures.calibration import read_calibration_toml

N = 8
SHUFFLED = [3, 0, 6, 1, 7, 2, 4, 5]


def mixed(poses):
    """What both cameras see, camera 1's pictures out of order; and the order that puts them right."""
    first, second = sightings(poses, target=BOARD)
    return first, [second[k] for k in SHUFFLED]


def test_the_order_of_the_pictures_is_found():
    first, second = mixed(true_poses(N))
    found = find_order((first, second), [BOARD] * N, SIZE)
    assert found == np.argsort(SHUFFLED).tolist()
    ordered = [second[k] for k in found]
    assert find_order((first, ordered), [BOARD] * N, SIZE) == list(range(N))


def test_pictures_of_other_poses_have_no_order():
    first, _ = sightings(true_poses(N), target=BOARD)
    _, second = sightings(true_poses(N, seed=99), target=BOARD)
    assert find_order((first, second), [BOARD] * N, SIZE) is None
    assert find_order((first[:2], second[:2]), [BOARD] * 2, SIZE) is None


TEXT = """
[calibration]
camera_0 = "cam0_*.png"
camera_1 = "cam1_*.png"
distortion = "k1"

[calibration.target]
kind = "fiducial_dots"
columns = 9
rows = 7
pitch = "2 mm"
diameter = "0.8 mm"
hole = "0.3 mm"
hollow = [[1, 1], [6, 1], [1, 4]]
"""


def test_pairs_out_of_order_are_refused_with_the_order_that_would_fit(tmp_path, monkeypatch):
    (tmp_path / "calibration.toml").write_text(TEXT)
    toml, section = read_calibration_toml(tmp_path)
    series = SimpleNamespace(n_frames=N, shape=SIZE[0][::-1], numbers=tuple(range(N)))
    monkeypatch.setattr(calibration, "_series", lambda *given: series)
    views = mixed(true_poses(N))
    seen = nullcontext(lambda progress: views)
    monkeypatch.setattr(dic.calibration.views, "detect_in_background", lambda *given: seen)
    with pytest.raises(InputError, match="do not fit two cameras") as refused:
        calibration.calibration_of(toml, section, lambda *told: None)
    order = ", ".join(str(k) for k in np.argsort(SHUFFLED))
    assert f"beside 0, 1, 2, 3, 4, 5, 6, 7 of camera 0, {order} of camera 1 would fit" in str(refused.value)
    views = sightings(true_poses(N), target=BOARD)  # the same name: what is seen from now on
    assert calibration.calibration_of(toml, section, lambda *told: None).rms < 0.1
