"""Launches: frame by frame on the threads of a CPU, many frames at once on a GPU."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.synthetic.kernels.cast import cast_board, cast_bodies
from dic.synthetic.kernels.gather import across, down
from dic.synthetic.scene import Instants

BATCH = 2**26
"""Rays of a batch on a GPU."""

Rays = Callable[[int, Any, Any], None]
"""Fills grey values and depths of the frames from a first one on."""


def rays_of_bodies(view: Any, bodies: Any, instants: Instants, device: Any) -> Rays:
    """Rays on bodies of revolution."""
    begin: Any = wp.array(instants.begin.astype(np.int32), dtype=wp.int32, device=device)
    weight: Any = wp.array(instants.weight.astype(np.float32), dtype=wp.float32, device=device)

    def rays(first: int, grey: Any, depth: Any) -> None:
        inputs = [view, bodies, begin, weight, first, _run(grey, device)]
        wp.launch(
            cast_bodies, dim=_threads(grey, device), inputs=inputs, outputs=[grey, depth], device=device
        )

    return rays


def rays_of_board(view: Any, bodies: Any, device: Any) -> Rays:
    """Rays on a flat board, one pose a frame."""

    def rays(first: int, grey: Any, depth: Any) -> None:
        inputs = [view, bodies, first, _run(grey, device)]
        wp.launch(cast_board, dim=_threads(grey, device), inputs=inputs, outputs=[grey, depth], device=device)

    return rays


def frames(
    rays: Rays,
    view: Any,
    weights: tuple[NDArray[np.float32], float, float],
    shape: tuple[int, int],
    n_frames: int,
    device: Any,
    threads: int,
) -> Iterator[NDArray[np.float32]]:
    """Light on the pixels, some frames at a time, shape [n, rows, columns].

    Parameters
    ----------
    rays
        What fills the rays.
    view
        The camera on the device.
    weights
        Weights of lenses, the standard deviation of the first and the step to the next [px].
    shape
        Rows and columns [px].
    n_frames
        Number of frames.
    device, threads
        Warp's device; threads on a CPU.
    """
    rows, columns = shape
    fine, pad = view.fine, view.pad
    wide, high = columns + 2 * pad, rows + 2 * pad
    batch = max(1, BATCH // (wide * high * fine * fine)) if device.is_cuda else 1
    levels: Any = wp.array(weights[0], dtype=wp.float32, device=device)

    def some(first: int) -> NDArray[np.float32]:
        n = min(batch, n_frames - first)
        grey = wp.empty((n, high * fine, wide * fine), dtype=wp.float32, device=device)
        depth = wp.empty((n, high, wide), dtype=wp.float32, device=device)
        lines = wp.empty((n, high * fine, columns), dtype=wp.float32, device=device)
        picture = wp.empty((n, rows, columns), dtype=wp.float32, device=device)
        rays(first, grey, depth)
        for kernel, read, written in ((across, grey, lines), (down, lines, picture)):
            inputs = [view, levels, weights[1], weights[2], read, depth, _run(written, device)]
            dim = _threads(written, device)
            wp.launch(kernel, dim=dim, inputs=inputs, outputs=[written], device=device)
        return np.asarray(picture.numpy())

    firsts = range(0, n_frames, batch)
    if device.is_cuda or threads == 1:
        yield from map(some, firsts)
        return
    for kernel in (cast_bodies, across):  # before the threads, which would each compile it
        wp.load_module(kernel.module, device=device, block_dim=1)
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(some, firsts)


def _threads(array: Any, device: Any) -> tuple[int, int, int]:
    """Workers: on a GPU one an element, on a CPU one a row."""
    n, rows, columns = array.shape
    return (n, rows, columns) if device.is_cuda else (n, rows, 1)


def _run(array: Any, device: Any) -> int:
    """Elements of a row that a worker does."""
    return 1 if device.is_cuda else int(array.shape[2])
