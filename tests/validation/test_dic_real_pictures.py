"""Picture readers, frame health and speckle quality for public pictures."""

import cv2
import numpy as np
import pytest
from shared_data import data

from dic import FrameOutcome, PointOutcome
from dic.correlation import Correlation, Noise, PictureStack, correlate, subsets
from dic.images import PictureError, frame_health, grey_noise, open_pictures, speckle_quality

N_FRAMES, STATIC = 186, 12  # of the shot open-01: its README and facts.json


@pytest.fixture(scope="module")
def shot():
    return data("shots", "open-01")


@pytest.fixture(scope="module")
def pictures():
    return data("dic")


def test_a_compressed_tiff_is_what_opencv_reads(shot):
    series = open_pictures(shot / "cam0.tif", bits=12, crop_offset=(192, 192))
    _, expected = cv2.imreadmulti(str(shot / "cam0.tif"), flags=cv2.IMREAD_UNCHANGED)
    assert (series.n_frames, series.shape) == (N_FRAMES, (128, 128))
    np.testing.assert_array_equal([series.frame(k) for k in range(N_FRAMES)], expected)


def test_a_truncated_tiff_loses_what_was_cut_off_and_nothing_else(shot, tmp_path):
    whole = (shot / "cam0.tif").read_bytes()
    (tmp_path / "cam0.tif").write_bytes(whole[: len(whole) // 2])
    series = open_pictures(tmp_path / "cam0.tif", n_frames=N_FRAMES)
    expected = open_pictures(shot / "cam0.tif")
    lost = []
    for k in range(N_FRAMES):
        try:
            np.testing.assert_array_equal(series.frame(k), expected.frame(k))
        except PictureError:
            lost.append(k)
    # the frames lie one after the other in the file and are of like size: about half of them are there
    assert lost == list(range(lost[0], N_FRAMES))
    assert lost[0] == pytest.approx(N_FRAMES / 2, rel=0.1)
    health = frame_health(series)
    np.testing.assert_array_equal(np.flatnonzero(health.outcome == FrameOutcome.UNREADABLE), lost)
    assert np.all(health.outcome[: lost[0]] == FrameOutcome.VALID)


@pytest.mark.parametrize("camera", [0, 1])
def test_all_frames_of_a_good_shot_are_good(shot, camera):
    health = frame_health(open_pictures(shot / f"cam{camera}.tif", bits=12))
    assert np.all(health.outcome == FrameOutcome.VALID)
    assert not health.flashed.any()
    assert health.ceiling == 4095


def test_noise_is_that_of_the_plain_differences(shot):
    series = open_pictures(shot / "cam0.tif", bits=12)
    noise = grey_noise(series, range(STATIC))
    frames = np.array([series.frame(k) for k in range(STATIC)], dtype=np.float64)
    even = frames / frames.mean(axis=(1, 2), keepdims=True) * frames.mean()
    plain = np.sqrt(np.mean(np.diff(even, axis=0) ** 2) / 2.0)
    # the plain way takes the flicker for a factor of the mean, which leaves a part of its offset
    assert noise.sigma == pytest.approx(plain, rel=0.01)
    assert noise.slope > 10.0 * noise.slope_sigma  # photon noise
    assert np.all(np.abs(noise.motion) < 5e-3)  # 12 static frames, README; known to 25/(128 · 235) = 1 mpx


def test_the_shots_speckles_are_fit_for_their_subset(shot):
    series = open_pictures(shot / "cam0.tif", bits=12)
    mean = np.mean([series.frame(k) for k in range(STATIC)], axis=0)
    quality = speckle_quality(mean, None, 21, grey_noise(series, range(STATIC)), averaged=STATIC, wanted=0.02)
    assert 3.0 < min(quality.size) < max(quality.size) < 10.0  # 3 px: the field's rule; half of a subset
    assert 0.4 < quality.coverage < 0.7
    assert quality.median_floor < 0.02
    assert quality.too_small.mean() < 0.02


def test_jpegs_are_turned_as_opencv_turns_them(pictures):
    folder = pictures / "multidic_cylinder" / "speckle"
    series = open_pictures(folder, pattern="201_*.jpg")
    assert (series.n_frames, series.shape, series.bits) == (5, (3280, 2464), 8)
    expected = cv2.imread(str(folder / "201_3.jpg"), cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(series.frame(2), expected)


def test_files_whose_names_hold_no_frame_numbers_are_opened_as_a_list(pictures):
    files = sorted((pictures / "qdic_compression_75pct").glob("lam_*.png"), reverse=True)
    series = open_pictures(files)
    assert series.n_frames == len(files)
    np.testing.assert_array_equal(series.frame(1), cv2.imread(str(files[1]), cv2.IMREAD_GRAYSCALE))


def test_two_cameras_in_one_folder_need_a_pattern(shot):
    with pytest.raises(PictureError, match=r'"cam0_\*\.png", "cam1_\*\.png"'):
        open_pictures(shot / "calibration")
    assert open_pictures(shot / "calibration", pattern="cam1_*.png").n_frames == 20


@pytest.mark.slow  # the first match compiles its kernels
def test_the_predicted_floor_is_nearly_that_of_the_match(shot):
    series = open_pictures(shot / "cam0.tif", bits=12)
    frames = np.array([series.frame(k) for k in range(STATIC)])
    noise = grey_noise(series, range(STATIC))
    floor = speckle_quality(frames.mean(axis=0), None, 21, noise, averaged=STATIC).floor
    side = np.arange(16, 113, 4)
    points = np.array([(x, y) for y in side for x in side], dtype=np.float64)
    stack = PictureStack.prepare(frames, noise=Noise(np.sqrt(noise.intercept), noise.slope))
    normalised = []
    for k in range(1, STATIC):
        before, after = (np.full(len(points), frame) for frame in (k - 1, k))
        match = correlate(
            stack, stack, points, subsets.identity(len(points)), Correlation(subset=21),
            reference_picture=before, deformed_picture=after,
        )  # fmt: skip
        assert np.all(match.outcome == PointOutcome.VALID)
        moved = match.warp[:, :2] - np.median(match.warp[:, :2], axis=0)
        normalised.append(moved / floor[points[:, 1].astype(int), points[:, 0].astype(int)])
    # no match is better than the floor; six parameters and two of brightness are estimated from some nine
    # speckles, and the reference is noisy too: about a tenth more
    assert np.all(np.std(normalised, axis=(0, 1)) > 1.0)
    assert np.all(np.std(normalised, axis=(0, 1)) < 1.2)


@pytest.mark.parametrize("name", ["open-01", "open-02"])
def test_faults_put_into_a_good_shot_are_found_and_nothing_else(shot, name):
    series = open_pictures(shot.parent / name / "cam1.tif", bits=12)
    frames = [series.frame(k) for k in range(series.n_frames)]
    rng = np.random.default_rng(3)
    row, column = np.mgrid[:128, :128]
    spot = 3500.0 * np.exp(-((row - 70) ** 2 + (column - 50) ** 2) / (2.0 * 9.0**2))
    for k in (60, 61, 62):  # a specular highlight that comes and goes
        frames[k] = np.minimum(frames[k] + spot, 4095).astype(np.uint16)
    frames[30] = np.clip(np.rint(15.0 + 10.0 * rng.normal(size=(128, 128))), 0, 4095).astype(np.uint16)
    frames[120] = np.minimum(5 * frames[120].astype(int), 4095).astype(np.uint16)
    frames[150] = (frames[150] * 0.6).astype(np.uint16)  # the lamp flickers: nothing to report
    health = frame_health(Faulty(series, frames))
    assert np.flatnonzero(health.outcome == FrameOutcome.BLACK).tolist() == [30]
    assert np.flatnonzero(health.outcome == FrameOutcome.SATURATED).tolist() == [120]
    assert np.flatnonzero(health.flashed).tolist() == [60, 61, 62]
    assert sorted(health.notes) == [30, 60, 61, 62, 120]


class Faulty:
    """A series with some of its frames replaced."""

    def __init__(self, series, frames):
        self.path, self.n_frames, self.shape, self.bits = series.path, series.n_frames, series.shape, 12
        self.crop_offset, self.times, self._frames = (0.0, 0.0), None, frames

    def frame(self, index):
        return self._frames[index]
