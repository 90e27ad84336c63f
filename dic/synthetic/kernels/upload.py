"""Bodies and cameras as the kernels read them."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import Camera
from dic.synthetic.kernels.cast import View
from dic.synthetic.kernels.hit import Bodies
from dic.synthetic.lens import Lens
from dic.synthetic.scene import Lamp, RevolvedBody

BINS = 64
"""Layers of a body, each of which knows its segments."""


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

    Parameters
    ----------
    camera, shape
        The camera, and rows and columns of its pictures [px].
    pad
        Pixels around the picture whose rays are needed.
    lens, lamp, background
        Of the scene.
    haze, haze_pitch
        Displacements of the picture [px] and the distance of their nodes [px].
    device
        Warp's device.
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


def upload_poses(bodies: Any, poses: list[tuple[FloatArray, FloatArray]], device: Any) -> None:
    """Give the one body of `bodies` a pose R, t a frame, from its own frame to the scene's."""
    turn = np.stack([R.T for R, _ in poses])[:, None]
    place = np.stack([t for _, t in poses])[:, None]
    bodies.turn = wp.array(turn, dtype=wp.mat33d, device=device)
    bodies.place = wp.array(place, dtype=wp.vec3d, device=device)


def upload_bodies(bodies: tuple[RevolvedBody, ...], n: int, device: Any) -> Any:
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
