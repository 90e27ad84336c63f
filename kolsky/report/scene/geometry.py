"""Surfaces of the scene: the specimen cut in half between its platens, the measured body beside it.

Axes: x across, y along the axis, Z toward the cameras. The half x <= 0 is drawn, seen from the front right,
so that both the cut and the surface that the cameras saw are in view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.report.scene.scene_data import Scene

TURNS = 61
"""Angular divisions of half a revolution, ends included."""
PLATEN, PLATEN_THICKNESS = 1.15, 0.07
"""Radius of a platen over the specimen's largest, and its thickness over that."""
ASIDE = 2.9
"""Distance of the measured body from the simulated one over the largest radius."""
AZIMUTH, ELEVATION = 40.0, 18.0
"""Direction from the specimen to the eye: turned from Z toward x, and above the plane of both [degrees]."""


@dataclass(frozen=True)
class Surface:
    """Quadrilaterals in space."""

    points: FloatArray
    """Corners (x, y, Z) [m], shape [n, 3]."""
    faces: NDArray[np.int64]
    """Corners of each face, shape [m, 4]."""
    values: FloatArray | None = None
    """A field at the points, shape [n]."""

    def with_(self, other: Surface) -> Surface:
        """Both surfaces as one; both have values or neither."""
        values = None
        if self.values is not None and other.values is not None:
            values = np.concatenate([self.values, other.values])
        return Surface(
            np.vstack([self.points, other.points]),
            np.vstack([self.faces, other.faces + len(self.points)]),
            values,
        )


def simulated(scene: Scene, k: int) -> Surface:
    """Cut plane and outer surface of the half x <= 0 at time k, with the field."""
    mesh, nodes, values = scene.mesh, scene.nodes[k], scene.values[k]
    zero = np.zeros(len(nodes))
    front = Surface(np.column_stack([zero, nodes[:, 1], nodes[:, 0]]), mesh.quads, values)
    behind = Surface(np.column_stack([zero, nodes[:, 1], -nodes[:, 0]]), mesh.quads, values)
    skin = np.concatenate([mesh.lower_face, mesh.side[1:-1], mesh.upper_face[::-1]])
    shell = revolved(nodes[skin], np.linspace(0.0, np.pi, TURNS), values[skin])
    return front.with_(behind).with_(shell)


def measured_body(scene: Scene, k: int) -> Surface | None:
    """The outline measured nearest to time k, revolved and set aside; None if none was measured."""
    y, Z = scene.outline_at(k)
    if y.size < 2:
        return None
    body = revolved(np.column_stack([Z, y]), np.linspace(0.0, 2.0 * np.pi, 2 * TURNS - 1))
    shift = np.array([-ASIDE * float(scene.nodes[..., 0].max()), 0.0, 0.0])
    return Surface(body.points + shift, body.faces)


def platens(radius: float, top: float) -> tuple[Surface, Surface]:
    """Halves behind the cut of the lower and upper platen of a specimen of this radius and height [m]."""
    thick, R = PLATEN_THICKNESS * radius, PLATEN * radius
    wall = np.arange(8).reshape(2, 4)
    halves = []
    for low in (-thick, top):
        line = np.array([[0.0, low], [R, low], [R, low + thick], [0.0, low + thick]])
        cut = np.array([[0.0, y, sign * r] for sign in (1.0, -1.0) for r, y in line])
        halves.append(Surface(cut, wall).with_(revolved(line, np.linspace(0.0, np.pi, TURNS))))
    return halves[0], halves[1]


def revolved(line: FloatArray, angles: FloatArray, values: FloatArray | None = None) -> Surface:
    """Surface of revolution of a line (r, y) [m], shape [n, 2]; angle 0 is toward the cameras, then x < 0.

    Parameters
    ----------
    line
        Radii and heights [m], shape [n, 2].
    angles
        Angles about the axis [rad].
    values
        A field along the line, shape [n], if any.
    """
    n = len(line)
    r, y = line.T
    x, Z = -np.sin(angles)[:, None] * r, np.cos(angles)[:, None] * r
    points = np.stack([x, np.broadcast_to(y, x.shape), Z], axis=-1).reshape(-1, 3)
    first = (n * np.arange(len(angles) - 1)[:, None] + np.arange(n - 1)).ravel()
    faces = np.column_stack([first, first + 1, first + n + 1, first + n])
    return Surface(points, faces, None if values is None else np.tile(values, len(angles)))


def lifted(points: FloatArray, by: float) -> FloatArray:
    """Points moved outward by `by` [m], so that the surface does not hide them."""
    across = np.hypot(points[:, 0], points[:, 2])
    factor = 1.0 + by / np.where(across > 0.0, across, np.inf)
    return np.column_stack([factor * points[:, 0], points[:, 1], factor * points[:, 2]])
