"""Noise and speckle quality, compared with closed forms and with matches of another program."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.ndimage import fourier_shift, gaussian_filter
from test_dic_calibration import CHESS, SIZE, TEXT, sightings, true_poses

import dic.calibration.views
from dic import images
from dic.calibration.solve import calibrate
from dic.calibration.views import PairOutcome
from dic.chain.remarks import Speckles
from dic.images.__main__ import main
from dic.images.quality import gradient, noise_gain
from dic.images.series import PicturesInMemory, PictureSizeError
from kolsky.base.errors import InputError
from kolsky.pictures import calibration
from kolsky.pictures.calibration import read_calibration_toml
from kolsky.report.canvas import build
from kolsky.report.figures import SPECKLES
from kolsky.report.pages.surfaces import calibration_warnings


def blurred(side=160, width=2.0, contrast=400.0, mean=1500.0, seed=1):
    """Gaussian white noise smoothed by a Gaussian: its autocorrelation is exp(-r²/(4 width²))."""
    f = gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), width, mode="wrap")
    return mean + contrast * f / f.std()


def waves(side=147, period=7, amplitude=100.0):
    x = np.arange(side)
    wave = np.sin(2.0 * np.pi * x / period)
    return 1000.0 + amplitude * (wave[None, :] + wave[:, None])


# --- gradient -----------------------------------------------------------------------------------------


def test_gradient_of_waves():
    k = 2.0 * np.pi / 7
    gx, gy = gradient(waves())
    x = np.arange(147)
    expected = np.broadcast_to(100.0 * k * np.cos(k * x), (147, 147))
    inside = slice(20, -20)
    # the quintic spline's derivative of a wave of 7 px: error (k/π)^6-like, below 0.3 %
    np.testing.assert_allclose(gx[inside, inside], expected[inside, inside], atol=3e-3 * 100.0 * k)
    np.testing.assert_allclose(gy[inside, inside], expected.T[inside, inside], atol=3e-3 * 100.0 * k)


def test_noise_gain_is_that_of_noise():
    noise = np.random.default_rng(2).normal(size=(400, 400))
    gx, gy = gradient(noise)
    # 160 000 values, correlated over some pixels: 1 % is three standard errors
    np.testing.assert_allclose([gx.var(), gy.var()], noise_gain(), rtol=0.01)


# --- noise --------------------------------------------------------------------------------------------


def static(n=12, *, intercept=100.0, slope=0.2, flicker=0.02, motion=0.0, seed=4):
    rng = np.random.default_rng(seed)
    clean = blurred(seed=seed)
    gains = 1.0 + flicker * rng.normal(size=n)
    moves = motion * rng.normal(size=(n, 2))
    spectrum = np.fft.fft2(clean)
    frames = []
    for gain, (ux, uy) in zip(gains, moves, strict=True):
        moved = np.fft.ifft2(fourier_shift(spectrum, (uy, ux))).real
        frames.append(gain * moved + np.sqrt(intercept + slope * clean) * rng.normal(size=clean.shape))
    return frames, gains, moves


def test_noise_and_its_dependence_on_brightness():
    frames, gains, _ = static()
    noise = images.grey_noise(frames, range(12))
    # median over 11 pairs of 25 600 pixels: 0.5 % each
    assert noise.sigma == pytest.approx(np.sqrt(100.0 + 0.2 * 1500.0), rel=0.01)
    assert noise.slope == pytest.approx(0.2, abs=4.0 * noise.slope_sigma)
    assert noise.slope_sigma < 0.01
    assert noise.intercept == pytest.approx(100.0, abs=4.0 * 1500.0 * noise.slope_sigma)
    # a frame's mean of 25 600 pixels is known to 20/160/1500 = 8e-5
    np.testing.assert_allclose(noise.gain, gains / gains.mean(), atol=5e-4)
    np.testing.assert_allclose(noise.variance(np.array([1500.0])), noise.sigma**2, rtol=0.02)


def test_flicker_and_a_trembling_rig_are_not_noise():
    frames, _, moves = static(slope=0.0, flicker=0.05, motion=0.05)
    noise = images.grey_noise(frames, range(12))
    trembling = 0.05 * np.sqrt(np.mean(gradient(frames[0])[0] ** 2)) * np.sqrt(2.0)
    assert trembling > 9.0  # nearly as much again as the noise: worth taking off
    # what first order leaves of a motion of up to 0.1 px, ½ u² f'': under 2 % of the noise in the square
    assert noise.sigma == pytest.approx(10.0, rel=0.02)
    # known to σ/sqrt(Σ Gx²) = 10/(160 · 141) = 0.5 mpx; the second order adds as much
    np.testing.assert_allclose(noise.motion, moves - moves.mean(axis=0), atol=3e-3)


def test_noise_of_whole_numbers_contains_their_rounding():
    rng = np.random.default_rng(6)
    clean = blurred(contrast=25.0, mean=120.0)
    frames = [np.rint(clean + 0.8 * rng.normal(size=clean.shape)).astype(np.uint8) for _ in range(6)]
    assert images.grey_noise(frames, range(6)).sigma == pytest.approx(np.sqrt(0.64 + 1.0 / 12.0), rel=0.02)


def test_noise_that_cannot_be_measured_is_refused():
    with pytest.raises(ValueError, match="at least 2 static frames, got 1"):
        images.grey_noise([blurred()], [0])
    with pytest.raises(ValueError, match="equal to the last bit"):
        images.grey_noise([blurred(), blurred()], [0, 1])
    with pytest.raises(ValueError, match="at least 100 pixels"):
        images.grey_noise([blurred(), blurred()], [0, 1], mask=np.zeros((160, 160), dtype=bool))


# --- speckles -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("sigma", [0.0, 100.0])
def test_size_by_autocorrelation(width, sigma):
    f = blurred(256, width) + sigma * np.random.default_rng(3).normal(size=(256, 256))
    quality = images.speckle_quality(f, None, 31, max(sigma, 1e-3))
    expected = 4.0 * np.sqrt(np.log(2.0)) * width
    # a sample of some 256²/(4π width²) speckles; a straight line between whole lags adds up to 0.1 px
    np.testing.assert_allclose(quality.size, expected, rtol=0.04, atol=0.1)


@pytest.mark.parametrize("diameter", [8, 14])
@pytest.mark.parametrize("bright", [False, True])
def test_size_by_edges_and_coverage_of_discs_thrown_at_random(diameter, bright):
    rng = np.random.default_rng(9)
    side, fine = 256, 4
    count = rng.poisson(-np.log(1.0 - 0.4) * side**2 / (np.pi / 4.0 * diameter**2))
    discs = np.zeros((side * fine, side * fine), dtype=np.uint8)
    for x, y in rng.uniform(0, side * fine, (count, 2)):
        cv2.circle(discs, (int(x), int(y)), diameter * fine // 2, 1, -1)
    covered = discs.mean()
    f = cv2.resize(discs.astype(np.float64), (side, side), interpolation=cv2.INTER_AREA)
    f = 600.0 + 800.0 * f if bright else 1400.0 - 800.0 * f
    f += 10.0 * rng.normal(size=f.shape)
    quality = images.speckle_quality(f, None, 31, 10.0)
    share = 1.0 - quality.coverage if bright else quality.coverage
    assert share == pytest.approx(covered, abs=0.01)  # the threshold lies within the pixels at the edges
    # chords shorter than a pixel are not seen: 1 px of 8, and the sample of discs scatters by 3 %
    assert quality.size_by_edges == pytest.approx(diameter, rel=0.15)


def test_mean_gradient_of_a_wave_with_and_without_noise():
    x, k = np.arange(140), 2.0 * np.pi / 14
    f = np.tile(1000.0 + 100.0 * np.sin(k * x), (140, 1))
    expected = np.mean(100.0 * k * np.abs(np.cos(k * x)))
    mask = np.zeros(f.shape, dtype=bool)
    mask[:, 14:-14] = True
    assert images.speckle_quality(f, mask, 21, 1e-3).mean_gradient == pytest.approx(expected, rel=2e-3)
    noisy = f + 3.0 * np.random.default_rng(1).normal(size=f.shape)
    # the noise's own |∇f| is 1.4 · 3 beside 29: taken off in the square but for where the gradient is nil
    assert images.speckle_quality(noisy, mask, 21, 3.0).mean_gradient == pytest.approx(expected, rel=0.02)


def test_floor_of_waves_is_the_closed_form():
    # 21 px hold three whole waves: ΣGx² = A² k² 21²/2, and the cross term is nil
    quality = images.speckle_quality(waves(), None, 21, 2.0)
    expected = np.sqrt(2.0 * 2.0**2 / ((100.0 * 2.0 * np.pi / 7) ** 2 * 21**2 / 2.0))
    inside = quality.floor[40:-40, 40:-40]
    # the noise's part, 1.9 σ² of a mean square of 4000, is taken off though none is there: 0.1 %
    np.testing.assert_allclose(inside, expected, rtol=5e-3)
    assert quality.median_floor == pytest.approx(expected, rel=0.05)  # the picture's edge has larger ones


@pytest.mark.parametrize("slope", [0.0, 0.4])
def test_floor_is_the_scatter_of_another_programs_matches(slope):
    clean = blurred(61, 2.0, seed=21).astype(np.float64)
    rng = np.random.default_rng(8)
    line = np.sqrt(100.0 + slope * clean)
    frames = [clean + line * rng.normal(size=clean.shape) for _ in range(300)]
    noise = images.grey_noise(frames, range(8)) if slope else 10.0
    quality = images.speckle_quality(np.mean(frames[:8], axis=0), None, 21, noise, averaged=8)
    found = []
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 1e-6)
    for a, b in zip(frames[::2], frames[1::2], strict=True):
        start = np.array([[1.0, 0.0, 20.0], [0.0, 1.0, 20.0]], dtype=np.float32)
        template = np.ascontiguousarray(a[20:41, 20:41]).astype(np.float32)
        _, warp = cv2.findTransformECC(
            template, b.astype(np.float32), start, cv2.MOTION_TRANSLATION, stop, None, 1
        )
        found.append(warp[:, 2])
    # 150 pairs: a standard deviation is known to 6 %; OpenCV interpolates linearly, some per cent more
    np.testing.assert_allclose(np.std(found, axis=0), quality.floor[30, 30], rtol=0.18)


def test_the_subset_needed_for_a_floor():
    f = blurred(120, 2.0)
    wanted = 0.008
    quality = images.speckle_quality(f, None, 15, 20.0, wanted=wanted)
    assert 0.05 < quality.too_small.mean() < 1.0
    for row, column in ((60, 60), (40, 75)):
        side = int(quality.needed[row, column])
        assert side > 5
        assert np.all(images.speckle_quality(f, None, side, 20.0).floor[row, column] <= wanted)
        assert np.any(images.speckle_quality(f, None, side - 2, 20.0).floor[row, column] > wanted)
    assert not images.speckle_quality(f, None, 15, 20.0).too_small.any()  # nothing was asked for


def test_where_there_are_no_speckles_no_subset_is_enough():
    f = blurred(120)
    f[:, :60] = 1500.0
    mask = np.ones(f.shape, dtype=bool)
    mask[90:] = False
    quality = images.speckle_quality(f, mask, 21, 20.0, wanted=0.02)
    assert np.all(np.isinf(quality.floor[20:70, 15:45]))
    assert np.all(quality.too_small[20:70, 15:45])
    assert np.all(np.isnan(quality.floor[105:]))
    assert not quality.too_small[105:].any()
    assert np.all(quality.needed[105:] == 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"subset": 20}, "subset must be odd"),
        ({"subset": 103}, "subset must be odd"),
        ({"noise": 0.0}, "noise must be a positive"),
        ({"noise": float("nan")}, "noise must be a positive"),
        ({"wanted": 0.0}, "wanted must be a positive"),
        ({"averaged": 0}, "averaged must be at least 1"),
        ({"mask": np.ones((3, 3), dtype=bool)}, "mask must be of the picture's shape"),
        ({"picture": np.ones((50, 50))}, "no speckles"),
    ],
)
def test_what_cannot_be_judged_is_refused(change, message):
    given = {"picture": waves(), "mask": None, "subset": 21, "noise": 2.0, **change}
    with pytest.raises(ValueError, match=message):
        images.speckle_quality(
            given.pop("picture"), given.pop("mask"), given.pop("subset"), given.pop("noise"), **given
        )


# --- the report ---------------------------------------------------------------------------------------


def test_the_report_says_what_the_functions_say(tmp_path, capsys):
    frames, _, _ = static(8)
    for k, frame in enumerate(frames):
        cv2.imwrite(str(tmp_path / f"a{k}.png"), np.rint(frame).astype(np.uint16))
    (tmp_path / "a6.png").unlink()
    options = ["--bits", "12", "--static", "8", "--wanted", "0.005"]
    assert main([str(tmp_path), *options]) == 0
    said = capsys.readouterr().out
    whole = [np.rint(frame) for k, frame in enumerate(frames) if k != 6]
    noise = images.grey_noise(whole, range(7))
    quality = images.speckle_quality(np.mean(whole, axis=0), None, 21, noise, averaged=7)
    assert "8 frames of 160 x 160 px, 12 bits, no times" in said
    assert "7 good frames" in said
    assert "no file has the number 6" in said
    assert f"noise {noise.sigma:.3g}: " in said
    assert f"floor of a subset of 21 px: {quality.median_floor * 1e3:.2f} mpx" in said
    assert "of the points miss 5 mpx" in said


def test_the_report_names_what_is_wrong(tmp_path, capsys):
    assert main([str(tmp_path / "gone.tif")]) == 1
    assert "gone.tif: cannot be read" in capsys.readouterr().err
    cv2.imwrite(str(tmp_path / "a1.png"), np.zeros((20, 20), dtype=np.uint8))
    assert main([str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "0 good frames" in said
    assert "frame 0: constant" in said
    assert "give --static N" in said


@pytest.mark.parametrize("wanted", [None, 0.008])
def test_the_figure_names_its_axes_and_shows_every_panel(wanted):
    f = blurred(80)
    mask = np.ones(f.shape, dtype=bool)
    mask[:, 60:] = False
    quality = images.speckle_quality(f, mask, 21, 20.0, wanted=wanted)
    figure = build(SPECKLES["speckle-floor"], Speckles(f, quality))
    labels = {ax.get_xlabel() for ax in figure.axes}
    assert {"$x$ (px)", "Floor (mpx)", "Predicted floor (mpx)"} <= labels
    share = next(ax for ax in figure.axes if ax.get_xlabel() == "Floor (mpx)")
    # the curve of x crosses one half at the median that the numbers give
    x, parts = share.lines[0].get_data()
    known = quality.floor[np.all(np.isfinite(quality.floor), axis=2)]
    assert np.interp(0.5, parts, x) == pytest.approx(1e3 * np.median(known[:, 0]), rel=1e-3)
    assert ("asked for" in [text.get_text() for text in share.get_legend().get_texts()]) == bool(wanted)
    assert ("wanted floor" in SPECKLES["speckle-floor"].caption(Speckles(f, quality))) == bool(wanted)


def test_light_is_evened_out_where_there_is_some():
    """Half of the pixels dark under light that falls to nothing beside the body: no division by that."""
    from dic.images.quality import coverage_and_diameter

    level = np.tile(np.linspace(1.0, 2.0, 64), (64, 1))
    f = level * np.where(np.indices((64, 64)).sum(axis=0) % 16 < 8, 0.2, 1.0)
    used = np.ones((64, 64), dtype=bool)
    used[:, 56:] = False
    dark, _ = coverage_and_diameter(f, np.where(used, level, 1e-310), used, 0.0)
    assert dark == np.mean(f[used] < 0.5 * level[used])


def test_a_picture_that_cannot_be_used_is_named_with_its_reason():
    views = sightings(true_poses(7))
    views[1][4] = images.PictureError("cam1_4.png", "the PNG file is cut off", frame=4)
    found = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", folds=0)
    pair = found.pairs[4]
    assert pair.outcome is PairOutcome.ONE_CAMERA
    assert "camera 1: the picture cannot be used" in pair.reason
    assert "cam1_4.png" in pair.reason
    assert "cut off" in pair.reason
    assert found.unusable == (pair,)
    assert any("pair 4" in said and "cut off" in said for said in calibration_warnings(found))
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
        "calibration_pictures",
        lambda *given: [SimpleNamespace(n_frames=len(own), numbers=own) for own in numbers.values()],
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


RNG = np.random.default_rng(5)
SMOOTH = cv2.GaussianBlur(RNG.normal(size=(60, 70)), (0, 0), 2.0)


def scene(i):
    """A moving pattern with the noise of a camera, in 8 bits."""
    grey = 120.0 + 300.0 * np.roll(SMOOTH, i, axis=1) + RNG.normal(0.0, 1.5, SMOOTH.shape)
    return np.clip(grey, 0, 255).astype(np.uint8)


def cut(i):
    return cv2.imencode(".png", scene(i))[1].tobytes()[:1500]


def sixteen(i):
    return scene(i).astype(np.uint16) * 16


@pytest.mark.parametrize(
    ("picture", "ending", "words"),
    [
        (
            lambda i: scene(i)[:50] if i == 3 else scene(i),
            "png",
            r"1 of 6 .*a_3.png, frame 3: is 50 x 70, the",
        ),
        (
            lambda i: sixteen(i) if i == 3 else scene(i),
            "png",
            r"a_3.png, frame 3: has grey values of 16 bits, the",
        ),
        (
            lambda i: scene(i) if i == 3 else sixteen(i),
            "tif",
            r"a_3.tif, frame 3: has grey values of 8 bits, the",
        ),
        (lambda i: np.full((60, 70), 100, np.uint8), "png", r"\(6 constant\), .*frame 0: constant.*lens cap"),
        (lambda i: np.zeros((60, 70), np.uint8), "png", r"\(6 constant\)"),
        (
            lambda i: scene(0) if i == 0 else np.full((60, 70), 9, np.uint8),
            "png",
            r"5 of 6 .*frame 1: constant",
        ),
        (lambda i: RNG.integers(2, 9, (60, 70), np.uint8), "png", r"\(6 black\), .*lens cap"),
        (lambda i: np.full((60, 70), 255, np.uint8), "png", r"\(6 saturated\), .*expose shorter"),
        (lambda i: np.clip(scene(i) + 150.0, 0, 255).astype(np.uint8), "png", r"\(6 saturated\)"),
        (cut, "png", r"none of 6 .*a_0.png.*the PNG file is cut off"),
        (
            lambda i: cut(i) if i > 0 else scene(i),
            "png",
            r"\(5 unreadable\).*a_1.png.*cut off.*copy or export",
        ),
        (lambda i: np.repeat(scene(i)[..., None], 3, 2), "tif", r"none of 6 .*a_0.tif.*is a colour picture"),
    ],
)
def test_series_that_cannot_be_correlated_are_refused_by_their_cause(tmp_path, picture, ending, words):
    write_series(tmp_path, picture, ending)
    with pytest.raises(images.PictureError, match=words):
        images.check_series(series := images.open_pictures(tmp_path), images.frame_health(series))


def write_series(folder, picture, ending):
    for i in range(6):
        made = picture(i)
        data = made if isinstance(made, bytes) else cv2.imencode(f".{ending}", made)[1].tobytes()
        (folder / f"a_{i}.{ending}").write_bytes(data)


def test_grey_in_three_colours_is_read_with_a_remark_and_one_lost_frame_stands_apart(tmp_path):
    pictures = [scene(i) for i in range(6)]
    (tmp_path / "three").mkdir()
    write_series(tmp_path / "three", lambda i: np.repeat(pictures[i][..., None], 3, 2), "png")
    series = images.open_pictures(tmp_path / "three")
    np.testing.assert_array_equal(series.frame(2), pictures[2])
    assert [remark.name for remark in images.of_colours([series])] == ["grey in three colours"]
    (tmp_path / "one").mkdir()
    write_series(tmp_path / "one", lambda i: cut(i) if i == 4 else pictures[i], "png")
    series = images.open_pictures(tmp_path / "one")
    health = images.frame_health(series)
    images.check_series(series, health)
    assert "a_4.png" in health.notes[4]
    assert images.of_colours([series]) == ()
