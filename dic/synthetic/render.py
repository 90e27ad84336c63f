"""Pictures of a scene by ray casting: light on the pixels, before the sensor's noise."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import Camera
from dic.correlation.kernels.device import select_device
from dic.synthetic.kernels.cast import View, cast_board, cast_bodies, gather
from dic.synthetic.kernels.hit import Bodies
from dic.synthetic.lens import Lens, table
from dic.synthetic.scene import Lamp, RevolvedBody, Scene

Light = NDArray[np.float32]
"""Light on the pixels; 1 is white paint under the whole light, shape [n_frames, rows, columns]."""

BATCH = 2**26
"""Rays of a batch on a GPU."""
BINS = 64
"""Layers of a body, each of which knows its segments."""


def picture_series(
    scene: Scene,
    camera: Camera,
    shape: tuple[int, int],
    *,
    lens: Lens | None = None,
    haze: NDArray[np.float32] | None = None,
    haze_pitch: float = 1.0,
    device: str = "cpu",
    threads: int = 1,
) -> Iterator[Light]:
    """Light on the pixels of one camera, some frames at a time.

    Every ray is undone through the lens and cut with each body's generator, a polyline turned about its axis,
    in closed form; the nearest place is read in the body's texture at its material coordinates. A pixel is
    the
    integral over its square of the rays, smeared by the lens.

    Parameters
    ----------
    scene
        Bodies at the instants of the frames.
    camera
        The camera, cropped to the pictures.
    shape
        Rows and columns [px].
    lens
        Point spread and rays a pixel; default `Lens()`.
    haze
        Displacements of the picture by the air [px], as `dic.synthetic.lens.haze` makes them; None: none.
    haze_pitch
        Distance of its nodes [px].
    device
        "cpu" or a GPU, "cuda:0".
    threads
        Threads on a CPU.

    Yields
    ------
    Light
        The next frames, in their order.

    Raises
    ------
    ValueError
        An unknown device; a lens distortion that cannot be undone.
    """
    start = select_device(device)
    bodies = _bodies(scene.bodies, len(scene.instants.time), start)
    job = _job(camera, shape, lens or Lens(), scene, haze, haze_pitch, start)
    begin = wp.array(scene.instants.begin.astype(np.int32), dtype=wp.int32, device=start)
    weight = wp.array(scene.instants.weight.astype(np.float32), dtype=wp.float32, device=start)

    def rays(first: int, grey: Any, depth: Any) -> None:
        inputs = [job.view, bodies, begin, weight, first, _run(grey, start)]
        wp.launch(cast_bodies, dim=_threads(grey, start), inputs=inputs, outputs=[grey, depth], device=start)

    yield from _frames(job, rays, scene.instants.n_frames, start, threads)


def board_series(
    board: RevolvedBody,
    poses: list[tuple[FloatArray, FloatArray]],
    camera: Camera,
    shape: tuple[int, int],
    *,
    lens: Lens | None = None,
    background: float = 0.04,
    device: str = "cpu",
    threads: int = 1,
) -> Iterator[Light]:
    """Light on the pixels of one camera of a flat board, one pose a frame; see `picture_series`.

    Parameters
    ----------
    board
        Its texture, by x (around) and y (along) of the board's frame; of the rest nothing is used.
    poses
        R and t of each frame, from the board's frame to the rig's, `X = R x + t`.
    background
        Light beside the board.
    """
    start = select_device(device)
    bodies = _bodies((board,), len(poses), start)
    turn = np.stack([R.T for R, _ in poses])[:, None]
    place = np.stack([t for _, t in poses])[:, None]
    bodies.turn = wp.array(turn, dtype=wp.mat33d, device=start)
    bodies.place = wp.array(place, dtype=wp.vec3d, device=start)
    scene = Scene(instants=None, bodies=(), lamp=Lamp(), background=background)  # type: ignore[arg-type]
    job = _job(camera, shape, lens or Lens(), scene, None, 1.0, start)

    def rays(first: int, grey: Any, depth: Any) -> None:
        inputs = [job.view, bodies, first, _run(grey, start)]
        wp.launch(cast_board, dim=_threads(grey, start), inputs=inputs, outputs=[grey, depth], device=start)

    yield from _frames(job, rays, len(poses), start, threads)


class _Job:
    """A camera on a device, and the weights of its lens."""

    def __init__(self, view: Any, weights: Any, sharpest: float, step: float, shape: tuple[int, int]) -> None:
        self.view, self.weights, self.sharpest, self.step, self.shape = view, weights, sharpest, step, shape


def _frames(job: _Job, rays: Any, n_frames: int, device: Any, threads: int) -> Iterator[Light]:
    rows, columns = job.shape
    fine, pad = job.view.fine, job.view.pad
    wide, high = columns + 2 * pad, rows + 2 * pad
    batch = max(1, BATCH // (wide * high * fine * fine)) if device.is_cuda else 1

    def frames(first: int) -> Light:
        n = min(batch, n_frames - first)
        grey = wp.empty((n, high * fine, wide * fine), dtype=wp.float32, device=device)
        depth = wp.empty((n, high, wide), dtype=wp.float32, device=device)
        picture = wp.empty((n, rows, columns), dtype=wp.float32, device=device)
        rays(first, grey, depth)
        inputs = [job.view, job.weights, job.sharpest, job.step, grey, depth, _run(picture, device)]
        wp.launch(gather, dim=_threads(picture, device), inputs=inputs, outputs=[picture], device=device)
        return np.asarray(picture.numpy())

    firsts = range(0, n_frames, batch)
    if device.is_cuda or threads == 1:
        yield from map(frames, firsts)
        return
    wp.load_module(cast_bodies.module, device=device, block_dim=1)
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(frames, firsts)


def _threads(array: Any, device: Any) -> tuple[int, int, int]:
    """Workers: on a GPU one an element, on a CPU one a row."""
    n, rows, columns = array.shape
    return (n, rows, columns) if device.is_cuda else (n, rows, 1)


def _run(array: Any, device: Any) -> int:
    """Elements of a row that a worker does."""
    return 1 if device.is_cuda else int(array.shape[2])


def _job(
    camera: Camera,
    shape: tuple[int, int],
    lens: Lens,
    scene: Scene,
    haze: NDArray[np.float32] | None,
    haze_pitch: float,
    device: Any,
) -> _Job:
    sharpest, widest = lens.spread, lens.spread
    if lens.aperture > 0.0:
        near, far = _depths(scene, camera)
        widest = float(np.max(lens.total(camera.fx, np.array([near, far]))))
    weights, step, pad = table(sharpest, widest, lens.rays)
    if pad > 40:
        raise ValueError(
            f"the lens smears a point over {widest:.1f} px: allowed is up to 10 px; take a smaller aperture "
            f"or "
            "bring its focus nearer to the scene"
        )
    x, y = (np.arange(-pad - 1, n + pad + 2, dtype=np.float64) for n in (shape[1], shape[0]))
    ideal = camera.undistort(np.stack(np.meshgrid(x, y), axis=-1))
    view = View()
    view.rays = wp.array(ideal, dtype=wp.vec2d, device=device)
    view.pad, view.fine = pad, lens.rays
    view.turn, view.centre = wp.mat33d(*camera.rotation.reshape(-1)), wp.vec3d(*camera.centre)
    field = np.zeros((0, 2, 2, 2), dtype=np.float32) if haze is None else haze
    view.haze, view.haze_pitch = wp.array(field, dtype=wp.vec2f, device=device), haze_pitch
    toward = np.asarray(scene.lamp.direction) / np.linalg.norm(scene.lamp.direction)
    view.lamp = wp.vec3f(*toward.astype(np.float32))
    view.ambient, view.gloss = scene.lamp.ambient, scene.lamp.gloss
    view.background = scene.background
    view.focus, view.coc = lens.focus, camera.fx * lens.aperture
    return _Job(view, wp.array(weights, dtype=wp.float32, device=device), sharpest, step, shape)


def _depths(scene: Scene, camera: Camera) -> tuple[float, float]:
    """Least and largest distance of the bodies' nodes along the view [m]."""
    found = []
    for body in scene.bodies:
        widest = float(body.r.max())
        corners = [
            (x, y, z)
            for x in (-widest, widest)
            for y in (body.y.min(), body.y.max())
            for z in (-widest, widest)
        ]
        for place in (body.place.min(axis=0), body.place.max(axis=0)):
            X = np.array(corners) @ body.turn.reshape(-1, 3, 3)[0] + place
            found += camera.in_camera(X)[:, 2].tolist()
    return max(min(found), 1e-3), max(*found, 1e-3)


def _bodies(bodies: tuple[RevolvedBody, ...], n: int, device: Any) -> Any:
    """Arrays of all bodies on a device, each at all instants."""

    def every(array: FloatArray) -> FloatArray:
        return np.broadcast_to(array, (n, *array.shape[1:]))

    def put(array: Any, kind: Any) -> Any:
        return wp.array(np.ascontiguousarray(array), dtype=kind, device=device)

    data = Bodies()
    for name in ("y", "r", "slope"):
        parts = np.concatenate([every(getattr(body, name)) for body in bodies], axis=1)
        setattr(data, name, put(parts.astype(np.float64), wp.float64))
    counts = np.array([len(body.along) for body in bodies])
    data.along = put(np.concatenate([body.along for body in bodies]), wp.float64)
    data.first = put((np.cumsum(counts) - counts).astype(np.int32), wp.int32)
    data.count = put(counts.astype(np.int32), wp.int32)
    spans = [np.stack([body.y.min(axis=1), body.y.max(axis=1)], axis=1) for body in bodies]
    data.span = put(np.stack([every(span) for span in spans], axis=1), wp.vec2d)
    starts = np.cumsum(counts) - counts
    found = [
        every(_bins(body.y, span) + start) for body, span, start in zip(bodies, spans, starts, strict=True)
    ]
    data.bins = put(np.stack(found, axis=1).astype(np.int32), wp.vec2i)
    widest = [every(body.r.max(axis=1)[:, None]) for body in bodies]
    data.widest = put(np.concatenate(widest, axis=1), wp.float64)
    data.turn = put(np.stack([np.broadcast_to(body.turn, (n, 3, 3)) for body in bodies], axis=1), wp.mat33d)
    data.place = put(np.stack([every(body.place) for body in bodies], axis=1), wp.vec3d)
    data.radius = put(np.array([body.radius for body in bodies]), wp.float64)
    textures = [body.texture for body in bodies]
    sizes = np.array([texture.grey.size for texture in textures], dtype=np.int64)
    data.texels = put(np.concatenate([texture.grey.reshape(-1) for texture in textures]), wp.float32)
    data.texel_first = put(np.cumsum(sizes) - sizes, wp.int64)
    data.texel_shape = put(np.array([texture.grey.shape for texture in textures], dtype=np.int32), wp.vec2i)
    data.texel_pitch = put(np.array([texture.pitch for texture in textures]), wp.float64)
    data.texel_origin = put(np.array([texture.origin for texture in textures]), wp.vec2d)
    data.slip = put(np.stack([every(body.slip) for body in bodies], axis=1), wp.vec2d)
    data.patch = put(np.array([body.patch for body in bodies]), wp.vec3d)
    data.shine = put(np.array([body.shine for body in bodies], dtype=np.float32), wp.float32)
    return data


def _bins(y: FloatArray, span: FloatArray) -> NDArray[np.int64]:
    """First and last segment that reaches into each of `BINS` even layers of a body, shape [n, BINS, 2].

    Segments between the two that do not reach into the layer cost time and nothing else.
    """
    low, high = np.minimum(y[:, :-1], y[:, 1:]), np.maximum(y[:, :-1], y[:, 1:])
    edge = span[:, :1] + (span[:, 1:] - span[:, :1]) * np.linspace(0.0, 1.0, BINS + 1)
    slack = 1e-9 * (span[:, 1:] - span[:, :1])[..., None]
    reaches = (low[:, None] <= edge[:, 1:, None] + slack) & (high[:, None] >= edge[:, :-1, None] - slack)
    first = np.argmax(reaches, axis=2)
    last = reaches.shape[2] - 1 - np.argmax(reaches[..., ::-1], axis=2)
    return np.stack([first, last], axis=-1)
