"""Calibration pictures that cannot be read, are missing or have another size: named with their reason."""

from types import SimpleNamespace

import numpy as np
import pytest
from test_dic_calibration import CHESS, SIZE, sightings, true_poses
from test_dic_pair_order import TEXT

import dic.calibration.views
from dic.calibration.solve import calibrate
from dic.calibration.views import PairOutcome
from dic.images import PictureError
from dic.images.series import PicturesInMemory, PictureSizeError
from kolsky.base.errors import InputError
from kolsky.pictures import calibration
from kolsky.pictures.calibration import read_calibration_toml
from kolsky.report.pages.calibration import warnings


def test_a_picture_that_cannot_be_used_is_named_with_its_reason():
    views = sightings(true_poses(7))
    views[1][4] = PictureError("cam1_4.png", "the PNG file is cut off", frame=4)
    found = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", folds=0)
    pair = found.pairs[4]
    assert pair.outcome is PairOutcome.ONE_CAMERA
    assert "camera 1: the picture cannot be used" in pair.reason
    assert "cam1_4.png" in pair.reason
    assert "cut off" in pair.reason
    assert found.unusable == (pair,)
    assert any("pair 4" in said and "cut off" in said for said in warnings(found))
    assert calibrate(*sightings(true_poses(7)), CHESS, sensors=SIZE, distortion="k1", folds=0).unusable == ()


def test_a_picture_of_another_size_is_an_error_of_its_own():
    series = PicturesInMemory([np.zeros((4, 6), np.uint8), np.zeros((4, 5), np.uint8)])
    with pytest.raises(PictureSizeError, match="is 4 x 5, the series 4 x 6"):
        series.frame(1)


@pytest.mark.parametrize(
    ("wrong", "refused"), [(5, True), (3, False)], ids=["the first is odd", "three others are odd"]
)
def test_a_first_picture_of_another_size_is_refused(tmp_path, wrong, refused):
    (tmp_path / "calibration.toml").write_text(TEXT)
    toml, _ = read_calibration_toml(tmp_path)
    odd = PictureSizeError("cam0_1.png", "is 5 x 5, the series 4 x 4")
    views = [[object()] * (8 - wrong) + [odd] * wrong, [object()] * 8]
    series = [SimpleNamespace(shape=(240, 320))] * 2
    if not refused:
        calibration._refuse_odd_size(toml, series, views)
        return
    with pytest.raises(InputError, match="begins with a picture of 320 x 240 px, 5 of the others"):
        calibration._refuse_odd_size(toml, series, views)


def test_pictures_without_a_partner_are_named(tmp_path, monkeypatch):
    (tmp_path / "calibration.toml").write_text(TEXT)
    toml, section = read_calibration_toml(tmp_path)
    numbers = {"camera_0": (0, 1, 2, 3), "camera_1": (1, 2, 3)}
    monkeypatch.setattr(
        calibration,
        "_series",
        lambda toml, name, pattern: SimpleNamespace(n_frames=len(numbers[name]), numbers=numbers[name]),
    )
    monkeypatch.setattr(
        dic.calibration.views, "detect_in_background", lambda *given: pytest.fail("not reached")
    )
    with pytest.raises(InputError, match="camera 1 has none numbered 0"):
        calibration.calibration_of(toml, section, lambda *told: None)
    numbers["camera_1"] = (10, 11, 12)
    with pytest.raises(InputError, match="it is not known which are pairs") as error:
        calibration.calibration_of(toml, section, lambda *told: None)
    assert "has none" not in str(error.value)
