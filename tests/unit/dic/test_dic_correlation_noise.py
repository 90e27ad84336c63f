"""Noise in a match: comparison of the covariance with repeated pictures, and bias by noise."""

from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scipy import ndimage
from speckle_pictures import render, speckle_pattern

from dic import tracking
from dic.correlation import Correlation, PictureStack, Shape, correlate
from dic.correlation.kernels import launch
from dic.correlation.kernels import launch as transfer
from dic.correlation.kernels.device import between_pixels, gradient_noise, select_device
from dic.correlation.kernels.launch import search_kernel
from dic.correlation.kernels.search import BLOCK
from dic.tracking import inputs, track

SIDE = 190
CENTRE = (SIDE - 1) / 2
SIGMA = 2.0
REPEATS = 10
SHIFT = np.array([0.3, -0.2])


@cache
def clean(F=None):
    """The pattern without noise, still or after x = c + F (X - c) + SHIFT."""
    pattern = speckle_pattern((SIDE, SIDE), seed=5, margin=160.0)
    if F is None:
        return render(pattern, (SIDE, SIDE))
    back = np.linalg.inv(np.array(F))
    return render(pattern, (SIDE, SIDE), material=lambda x: (x - CENTRE - SHIFT) @ back.T + CENTRE)


def repeated(F, prefilter, *, backwards=False):
    """Errors [n, 2] and covariances of matches in independent noisy pictures; warps start at the truth."""
    gradient = np.array(F)
    rng = np.random.default_rng(1)
    first, second = (
        PictureStack.prepare(
            picture + rng.normal(0.0, SIGMA, (REPEATS, SIDE, SIDE)), noise=SIGMA, prefilter=prefilter
        )
        for picture in (clean(), clean(F))
    )
    a = np.arange(40.0, SIDE - 40.0, 13.0)
    points = np.stack(np.meshgrid(a, a), axis=-1).reshape(-1, 2)
    true = np.zeros((len(points), 12))
    true[:, :2] = (points - CENTRE) @ (gradient - np.eye(2)).T + SHIFT
    true[:, 2:6] = (gradient - np.eye(2)).ravel()
    inside = np.all(np.abs(points + true[:, :2] - CENTRE) < CENTRE - 32.0, axis=1)
    points, true = np.tile(points[inside], (REPEATS, 1)), np.tile(true[inside], (REPEATS, 1))
    picture = np.repeat(np.arange(REPEATS), inside.sum())
    still = np.zeros_like(true)
    pair = (second, first) if backwards else (first, second)
    target = still if backwards else true
    found = correlate(
        *pair, points, target, Correlation(prefilter=prefilter),
        reference_picture=picture, deformed_picture=picture, reference_warp=true if backwards else None,
    )  # fmt: skip
    assert np.all(found.outcome == 0)
    error = (found.warp - target)[:, :2].reshape(REPEATS, -1, 2)
    return error, found.covariance.reshape(REPEATS, -1, 2, 2)


COMPRESSED = ((1.0, 0.0), (0.0, 0.5))
WIDE = ((1.6, 0.0), (0.0, 0.8))
SHEARED = ((1.1, 0.15), (-0.1, 0.8))
STILL = ((1.0, 0.0), (0.0, 1.0))


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(
    ("F", "prefilter"), [(STILL, 0.0), (STILL, 1.0), (SHEARED, 0.0), (COMPRESSED, 0.0), (WIDE, 0.0)]
)
def test_covariance_is_what_repeated_pictures_show(F, prefilter, backwards):
    error, covariance = repeated(F, prefilter, backwards=backwards)
    scatter = error - error.mean(axis=0)  # what interpolation does is the same in every repeat
    factor = np.linalg.inv(np.linalg.cholesky(covariance))
    z = np.einsum("rnij,rnj->rni", factor, scatter) * np.sqrt(REPEATS / (REPEATS - 1.0))
    # 500 matches and more, of which one in three is independent: 5 % of a standard deviation; the theory has
    # one frequency for all the pattern, and takes in what of the residual the noise does not explain: 15 %
    assert np.all(np.abs(z.std(axis=(0, 1)) - 1.0) < 0.2)


def test_noise_of_a_template_read_between_pixels_does_not_shift_the_match():
    error, covariance = repeated(STILL, 0.0, backwards=True)
    mean = error.mean(axis=(0, 1))
    sigma = np.sqrt(covariance[..., 0, 0].mean() / error[..., 0].size * 3.0)  # neighbours overlap
    # without the term B of Eq. (C.7) it is shifted by 3 mpx, at 0.3 px and -0.2 px alike
    assert np.all(np.abs(mean) < 3.0 * sigma + 0.3e-3)  # 0.3 mpx: interpolation
    assert sigma < 0.7e-3


def test_a_residual_that_noise_does_not_explain_widens_the_covariance():
    still = clean()
    rng = np.random.default_rng(3)
    first, second = (still + rng.normal(0.0, SIGMA, still.shape) for _ in range(2))
    point, guess = np.full((1, 2), CENTRE), np.zeros((1, 12))

    def variance(noise):
        stacks = [PictureStack.prepare(picture, noise=noise) for picture in (first, second)]
        return correlate(*stacks, point, guess, Correlation()).covariance[0, 0, 0]

    honest = variance(SIGMA)
    # variance of a variance from 441 differences: 7 %; the noise of gradients is not taken out: 10 %
    assert variance(SIGMA / 10) == pytest.approx(honest, rel=0.3)
    assert variance(0.0) == pytest.approx(honest, rel=0.3)  # none declared: the residual is all there is
    assert variance(2 * SIGMA) == pytest.approx(4 * honest, rel=0.3)


@pytest.mark.parametrize("prefilter", [0.0, 0.7])
def test_noise_between_pixels_against_many_draws(prefilter):
    rng = np.random.default_rng(2)
    noise = rng.normal(0.0, 1.0, (260, 260))
    smooth = ndimage.gaussian_filter(noise, prefilter, mode="mirror") if prefilter else noise
    spline = ndimage.spline_filter(smooth, order=5, mode="mirror")
    y, x = np.mgrid[10:250, 10:250].astype(float)
    mean, spread, slope = between_pixels(prefilter)

    def read(dx, dy):
        return ndimage.map_coordinates(spline, [y + dy, x + dx], order=5, prefilter=False, mode="mirror")

    for tx, ty in ((0.0, 0.0), (0.25, 0.0), (0.5, 0.5), (0.2, 0.7)):
        even = [np.polyval(spread[::-1], (t - 0.5) ** 2) for t in (tx, ty)]
        odd = (tx - 0.5) * np.polyval(slope[::-1], (tx - 0.5) ** 2)
        gradient = (read(tx + 1e-3, ty) - read(tx - 1e-3, ty)) / 2e-3
        # 58 000 draws, each shared by a few places: 1 % of the variance
        assert even[0] * even[1] == pytest.approx(np.var(read(tx, ty)), rel=0.03)
        assert odd * even[1] == pytest.approx(np.mean(gradient * read(tx, ty)), abs=0.03)
    where = rng.uniform(0.0, 1.0, (2, 12))
    variances = [np.var(read(*t)) for t in where.T]
    gradients = [np.mean(((read(tx + 1e-3, ty) - read(tx - 1e-3, ty)) / 2e-3) ** 2) for tx, ty in where.T]
    # twelve places of a cell, over which the variance goes from 0.7 to 1: 5 % of its mean
    assert mean == pytest.approx(np.mean(variances), rel=0.07)
    assert gradient_noise(prefilter) == pytest.approx(np.mean(gradients), rel=0.12)


@pytest.fixture
def gpu():
    select_device("cpu")
    if not wp.get_cuda_devices():
        pytest.skip("no CUDA device in this machine")
    return "cuda"


@pytest.mark.parametrize("shape", list(Shape))
def test_both_devices_find_the_same(gpu, shape):
    pattern = speckle_pattern((200, 200), seed=8)
    pictures = [
        render(pattern, (200, 200), material=lambda x, s=s: x - s, noise=2.0, seed=k)
        for k, s in enumerate((0.0, np.array([0.3, -0.4])))
    ]
    along = np.arange(5.0, 196.0, 7.5)  # some leave the picture, some are read between pixels
    points = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    mask = np.hypot(*(np.indices((200, 200)) - 100.0)) < 95.0
    reference = np.zeros((len(points), 12))
    reference[:, 2:6] = [0.02, 0.01, -0.01, -0.03]
    found = []
    for device in ("cpu", gpu):
        first, second = (PictureStack.prepare(picture, noise=2.0, device=device) for picture in pictures)
        settings = Correlation(shape=shape, tolerance=1e-5, max_iterations=60)
        found.append(
            correlate(first, second, points, reference, settings, reference_warp=reference, mask=mask)
        )
    cpu, cuda = found
    # a decision at a limit may fall otherwise: sums are in another order
    assert np.mean(cpu.outcome != cuda.outcome) < 0.01
    ok = (cpu.outcome == 0) & (cuda.outcome == 0)
    assert ok.mean() > 0.5
    np.testing.assert_allclose(cuda.warp[ok, :2], cpu.warp[ok, :2], atol=2e-5)  # the tolerance above
    np.testing.assert_allclose(cuda.covariance[ok], cpu.covariance[ok], rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(cuda.zncc[ok], cpu.zncc[ok], atol=1e-5)


@pytest.mark.slow  # a compiler at work: 10 s
def test_it_compiles_for_a_gpu(tmp_path):
    select_device("cpu")
    if 90 not in wp.get_cuda_supported_archs():
        pytest.skip("this build of Warp has no CUDA compiler")
    module = search_kernel(int(Shape.AFFINE)).module
    module.options["block_dim"] = BLOCK
    wp.compile_aot_module(module, arch=[90], module_dir=Path(tmp_path), use_ptx=False)
    assert [path.suffix for path in tmp_path.glob("*.sm90.*")] == [".cubin"]


def test_points_in_parts_and_frames_in_blocks_are_those_of_one(gpu, monkeypatch):
    pattern = speckle_pattern((120, 120), seed=8)
    series = np.stack(
        [
            render(pattern, (120, 120), material=lambda x, k=k: x - 0.3 * k, noise=2.0, seed=k)
            for k in range(6)
        ]
    )
    along = np.arange(20.0, 101.0, 5.0)
    points = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    found = []
    for most, together in ((transfer.PART, 0), (50, 2 * 4 * 120 * 120)):
        parts = partial(transfer.in_parts, most=most)
        monkeypatch.setattr(launch, "in_parts", parts)
        monkeypatch.setattr(tracking, "FramesAhead", partial(inputs.FramesAhead, together=together))
        found.append(track(series, points, noise=2.0, device=gpu))
    for name in ("warp", "covariance", "zncc", "outcome"):
        np.testing.assert_array_equal(getattr(found[1], name), getattr(found[0], name), err_msg=name)
    assert np.mean(found[0].outcome == 0) > 0.9
