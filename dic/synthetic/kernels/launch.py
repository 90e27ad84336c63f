"""Launches of the renderer: upload of bodies and cameras, threads on a CPU, batches on a GPU."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.camera import Camera
from dic.synthetic.kernels.rays import Bodies, Painted, Placed, View, across, cast_board, cast_bodies, down
from dic.synthetic.scene import Instants, Lamp, Lens, RevolvedBody

BATCH = 2**26
"""Rays of a batch on a GPU."""

Rays = Callable[[int, Any, Any], None]
"""Function that computes light and depth of the frames from a given frame on."""


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
    """Rays on a flat board, one pose per frame."""

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
    """Light on the pixels in blocks of a few frames, shape [n, rows, columns].

    ``weights``: weights of the lenses, the standard deviation of the first lens and the step to the next one
    [px]. ``shape``: rows and columns [px]. ``device``, ``threads``: Warp device; threads on a CPU.
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
    for kernel in (cast_bodies, across):  # before the threads start, because each thread would compile it
        wp.load_module(kernel.module, device=device, block_dim=1)
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(some, firsts)


def _threads(array: Any, device: Any) -> tuple[int, int, int]:
    """Shape of a launch: one thread per element on a GPU, one per row on a CPU."""
    n, rows, columns = array.shape
    return (n, rows, columns) if device.is_cuda else (n, rows, 1)


def _run(array: Any, device: Any) -> int:
    """Number of elements of a row for each thread."""
    return 1 if device.is_cuda else int(array.shape[2])


BINS = 64
"""Number of layers of a body; each layer stores the range of its segments."""


def upload_view(
    camera: Camera,
    shape: tuple[int, int],
    pad: int,
    lens: Lens,
    lamp: Lamp,
    background: float,
    haze: NDArray[np.float32] | None,
    haze_pitch: float,
    device: Any,
) -> Any:
    """A camera with its rays on a device.

    ``camera``, ``shape``: the camera, and rows and columns of its pictures [px]. ``haze``, ``haze_pitch``:
    displacements of the picture [px] and the distance between their nodes [px].
    """
    x, y = (np.arange(-pad - 1, n + pad + 2, dtype=np.float64) for n in (shape[1], shape[0]))
    view = View()
    view.rays = wp.array(
        camera.undistort(np.stack(np.meshgrid(x, y), axis=-1)), dtype=wp.vec2d, device=device
    )
    view.pad, view.fine = pad, lens.rays
    view.turn, view.centre = wp.mat33d(*camera.rotation.reshape(-1)), wp.vec3d(*camera.centre)
    field = np.zeros((0, 2, 2, 2), dtype=np.float32) if haze is None else haze
    view.haze, view.haze_pitch = wp.array(field, dtype=wp.vec2f, device=device), haze_pitch
    toward = np.asarray(lamp.direction) / np.linalg.norm(lamp.direction)
    view.lamp = wp.vec3f(*toward.astype(np.float32))
    view.ambient, view.gloss, view.background = lamp.ambient, lamp.gloss, background
    view.focus, view.coc = lens.focus, camera.fx * lens.aperture
    return view


def upload_bodies(bodies: tuple[RevolvedBody, ...], n: int, camera: Camera, device: Any) -> Any:
    """All bodies at all `n` instants, with the camera's centre in their frames."""

    def every(array: FloatArray) -> FloatArray:
        return np.broadcast_to(array, (n, *array.shape[1:]))

    def upload(array: Any, kind: Any) -> Any:
        return wp.array(np.ascontiguousarray(array), dtype=kind, device=device)

    nodes = [every(np.stack([body.y, body.r, body.slope], axis=-1)) for body in bodies]
    counts = np.array([len(body.along) for body in bodies])
    starts = np.cumsum(counts) - counts
    textures = [body.texture for body in bodies]
    sizes = np.array([texture.grey.size for texture in textures], dtype=np.int64)
    placed = np.zeros((n, len(bodies)), dtype=Placed.numpy_dtype())
    painted = np.zeros(len(bodies), dtype=Painted.numpy_dtype())
    bins = np.zeros((n, len(bodies), BINS, 2), dtype=np.int32)
    for b, body in enumerate(bodies):
        turn = np.broadcast_to(body.turn, (n, 3, 3))
        placed["turn"][:, b] = turn
        placed["eye"][:, b] = np.einsum("nij,nj->ni", turn, camera.centre - every(body.place))
        placed["widest"][:, b] = body.r.max(axis=1)
        placed["low"][:, b], placed["high"][:, b] = body.y.min(axis=1), body.y.max(axis=1)
        placed["slip"][:, b] = body.slip
        bins[:, b] = _bins(body.y) + starts[b]
        rows, columns = body.texture.grey.shape
        for name, value in (
            ("first", starts[b]), ("radius", body.radius), ("texels", (np.cumsum(sizes) - sizes)[b]),
            ("rows", rows), ("columns", columns), ("pitch", body.texture.pitch),
            ("origin", body.texture.origin), ("patch", body.patch), ("shine", body.shine),
        ):  # fmt: skip
            painted[name][b] = value
    data = Bodies()
    data.nodes = upload(np.concatenate(nodes, axis=1), wp.vec3d)
    data.along = upload(np.concatenate([body.along for body in bodies]), wp.float64)
    data.placed, data.painted = upload(placed, Placed), upload(painted, Painted)
    data.bins = upload(bins, wp.vec2i)
    data.texels = upload(np.concatenate([texture.grey.reshape(-1) for texture in textures]), wp.float32)
    return data


def _bins(y: FloatArray) -> NDArray[np.int64]:
    """First and last segment that intersects each of `BINS` equal layers of a body, shape [n, BINS, 2]."""
    span = np.stack([y.min(axis=1), y.max(axis=1)], axis=1)
    low, high = np.minimum(y[:, :-1], y[:, 1:]), np.maximum(y[:, :-1], y[:, 1:])
    edge = span[:, :1] + (span[:, 1:] - span[:, :1]) * np.linspace(0.0, 1.0, BINS + 1)
    slack = 1e-9 * (span[:, 1:] - span[:, :1])[..., None]
    reaches = (low[:, None] <= edge[:, 1:, None] + slack) & (high[:, None] >= edge[:, :-1, None] - slack)
    first = np.argmax(reaches, axis=2)
    last = reaches.shape[2] - 1 - np.argmax(reaches[..., ::-1], axis=2)
    return np.stack([first, last], axis=-1)
