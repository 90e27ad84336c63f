"""The match on a GPU: the same as on the CPU where there is one, and compiled for one anywhere."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from speckle_pictures import render, speckle_pattern

from dic import tracking
from dic.correlation import Correlation, PictureStack, Shape, correlate
from dic.correlation.kernels import launch
from dic.correlation.kernels import launch as transfer
from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.launch import search_kernel
from dic.correlation.kernels.search import BLOCK
from dic.tracking import inputs, track


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
