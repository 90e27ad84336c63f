"""Pictures of a scene by ray casting: light on the pixels, before the sensor's noise."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import Camera
from dic.correlation.kernels.device import select_device
from dic.synthetic.kernels.launch import frames, rays_of_board, rays_of_bodies
from dic.synthetic.kernels.upload import upload_bodies, upload_view
from dic.synthetic.lens import Lens, weight_table
from dic.synthetic.scene import Lamp, RevolvedBody, Scene

Light = NDArray[np.float32]
"""Light on the pixels; 1 is white paint under the whole light, shape [n_frames, rows, columns]."""

WIDEST = 10.0
"""Largest standard deviation of a lens out of focus [px]."""


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
    lens = lens or Lens()
    start = select_device(device)
    bodies = upload_bodies(scene.bodies, len(scene.instants.time), camera, start)
    weights, pad = _weights(camera, lens, _depths(scene, camera))
    view = upload_view(camera, shape, pad, lens, scene.lamp, scene.background, haze, haze_pitch, start)
    rays = rays_of_bodies(view, bodies, scene.instants, start)
    yield from frames(rays, view, weights, shape, scene.instants.n_frames, start, threads)


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
    lens = lens or Lens()
    start = select_device(device)
    posed = replace(board, turn=np.stack([R.T for R, _ in poses]), place=np.stack([t for _, t in poses]))
    bodies = upload_bodies((posed,), len(poses), camera, start)
    reach = float(np.hypot(*board.texture.grey.shape)) * board.texture.pitch
    depths = [float(camera.in_camera(t[None])[0, 2]) for _, t in poses]
    weights, pad = _weights(camera, lens, (max(min(depths) - reach, 1e-3), max(depths) + reach))
    view = upload_view(camera, shape, pad, lens, Lamp(), background, None, 1.0, start)
    yield from frames(rays_of_board(view, bodies, start), view, weights, shape, len(poses), start, threads)


def _weights(
    camera: Camera, lens: Lens, depths: tuple[float, float]
) -> tuple[tuple[NDArray[np.float32], float, float], int]:
    """Weights of the lens at all distances of a scene, the first spread, the step [px]; pixels they reach."""
    widest = float(max(np.max(lens.total(camera.fx, np.array(depths))), lens.spread))
    if widest > WIDEST:
        raise ValueError(
            f"the lens smears a point over {widest:.1f} px: allowed is up to {WIDEST:g} px; take a smaller "
            "aperture or bring its focus nearer to the scene"
        )
    table, step, reach = weight_table(lens.spread, widest, lens.rays)
    return (table, lens.spread, step), reach


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
