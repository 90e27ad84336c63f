"""Stills of the scene in a report, drawn by Matplotlib, and the cut through the specimen as SVG.

They need neither VTK nor a screen. Parts are drawn one over the other in the order in which the eye, above
the specimen, meets them: the lower platen, the specimen, the upper platen; within a part, the face that is
farther from the eye comes first. The cut has the colours of the scale; on the skin they are shaded.
"""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_rgb

from kolsky.base.arrays import FloatArray
from kolsky.report.scene.drawing import evenly_spaced
from kolsky.report.scene.scene_data import (
    EYE,
    FIELDS,
    RIGHT,
    SIDE_DISTANCE,
    Scene,
    Surface,
    lifted,
    measured_body,
    platens,
    scene_of,
    simulated,
)

if TYPE_CHECKING:
    from kolsky.inverse.result import Identification


COUNT = 3
"""Number of still pictures in a report."""
STEEL, MEASURED, POINT = "#9AA0A6", "#D9D9D9", "#D55E00"
THROUGH = 0.65
"""Opacity of a platen."""
AMBIENT = 0.45
"""Brightness of a face that is seen edge-on; one that faces the light has 1."""

UP = np.cross(EYE, RIGHT)
"""Unit vector of the picture upward."""
LIGHT = (EYE + 0.35 * UP - 0.35 * RIGHT) / np.linalg.norm(EYE + 0.35 * UP - 0.35 * RIGHT)
"""Unit vector toward the light, from above the left shoulder."""


def scene_of_stills(result: Identification) -> Scene:
    """Scene at the times of the stills."""
    return scene_of(result, chosen=lambda n: evenly_spaced(n, COUNT))


def draw_still(ax: Axes, scene: Scene, k: int) -> None:
    """Draw the scene at one of its times into axes, lengths in the picture [m]."""
    kind = FIELDS[scene.field]
    radius = float(scene.nodes[..., 0].max())
    lower, upper = platens(radius, float(scene.nodes[k][scene.mesh.upper_face, 1].mean()))
    body, beside = simulated(scene, k), measured_body(scene, k)
    assert body.values is not None
    colours = matplotlib.colormaps[kind.colours](
        Normalize(*scene.limits, clip=True)(body.values[body.faces].mean(axis=1))
    )[:, :3]
    on_cut = (body.points[body.faces][..., 0] == 0.0).all(axis=1)
    _draw(ax, lower, np.array(to_rgb(STEEL)), opacity=THROUGH)
    _draw(ax, body, colours, unshaded=on_cut)
    if beside is not None:
        _draw(ax, beside, np.array(to_rgb(MEASURED)))
        dots = lifted(scene.points_at(k), 0.004 * radius)
        for shift in (0.0, -SIDE_DISTANCE * radius):
            x, y = in_picture(dots + np.array([shift, 0.0, 0.0])).T
            ax.plot(x, y, "o", color=POINT, ms=1.1, mew=0.0, rasterized=True)
    _draw(ax, upper, np.array(to_rgb(STEEL)), opacity=THROUGH)
    ax.set_aspect("equal")
    low, high = extent(scene)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])


def extent(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner of what is drawn at any time of the scene [m]: one scale for all."""
    radius, top = float(scene.nodes[..., 0].max()), float(scene.nodes[..., 1].max())
    parts = [*platens(radius, top)]
    parts += [beside for k in range(len(scene.times)) if (beside := measured_body(scene, k)) is not None]
    shown = np.vstack([in_picture(part.points) for part in parts])
    return shown.min(axis=0), shown.max(axis=0)


def in_picture(points: FloatArray) -> FloatArray:
    """Places to the right and up in the picture [m], shape [n, 2]."""
    return points @ np.column_stack([RIGHT, UP])


def brightness(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Brightness of each face in [`AMBIENT`, 1], Lambert's law, and its distance toward the eye [m]."""
    corners = surface.points[surface.faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    size = np.linalg.norm(normal, axis=1)
    normal /= np.where(size > 0.0, size, 1.0)[:, None]
    normal *= np.where(normal @ EYE < 0.0, -1.0, 1.0)[:, None]  # the side that is seen
    return AMBIENT + (1.0 - AMBIENT) * np.clip(normal @ LIGHT, 0.0, 1.0), corners.mean(axis=1) @ EYE


def _draw(
    ax: Axes, surface: Surface, colours: FloatArray, *, opacity: float = 1.0, unshaded: Any = False
) -> None:
    """Draw one part, colours of shape [3] or [n_faces, 3]; its opacity is that of the whole part."""
    bright, toward = brightness(surface)
    bright = np.where(unshaded, 1.0, bright)
    order = np.argsort(toward)
    flat = in_picture(surface.points)[surface.faces]
    shown = (np.broadcast_to(colours, (len(bright), 3)) * bright[:, None])[order]
    faces: Any = flat[order]  # of an array Matplotlib makes all paths at once; its types know lists only
    part = PolyCollection(faces, facecolors=shown, edgecolors="none", antialiased=False, rasterized=True)
    if opacity < 1.0:  # of faces one by one, those behind would shine through and edges show twice

        def seen_through(image: Any, dpi: float) -> Any:
            return np.asarray(image) * np.array([1.0, 1.0, 1.0, opacity]), 0, 0

        part.set_agg_filter(seen_through)
    ax.add_collection(part, autolim=False)  # limits are set for the whole scene


WIDTH, HEIGHT = 480, 300
"""Of the drawing [px]."""
INK = "#1a1a1a"


def cut_svg(scene: Scene, k: int) -> str:
    """The cut through the specimen at a time, coloured by its field, with the measured outline as dots."""
    nodes, values = 1e3 * scene.nodes[k], scene.values[k]
    low, high = scene.limits
    kind = FIELDS[scene.field]
    shade = colormaps[kind.colours]
    widest, tallest = 1e3 * scene.nodes[..., 0].max(), 1e3 * scene.nodes[..., 1].max()
    scale = min((WIDTH - 20) / (2.3 * widest), (HEIGHT - 78) / (1.16 * tallest))
    middle, floor = WIDTH / 2, HEIGHT - 58

    def at(r: float, y: float) -> str:
        return f"{middle + scale * r:.1f},{floor - scale * y:.1f}"

    parts = []
    for quad in scene.mesh.quads:
        share = (float(values[quad].mean()) - low) / (high - low)
        colour = _hex(shade(min(max(share, 0.0), 1.0), bytes=True))
        for side in (1.0, -1.0):
            corners = " ".join(at(side * r, y) for r, y in nodes[quad])
            parts.append(f'<polygon points="{corners}" fill="{colour}" stroke="{colour}" stroke-width=".6"/>')
    top, half = nodes[:, 1].max(), 1.15 * widest
    for y, thick in ((0.0, -0.05), (top, 0.05)):
        corners = " ".join(
            at(r, h)
            for r, h in ((-half, y), (half, y), (half, y + thick * tallest), (-half, y + thick * tallest))
        )
        parts.append(f'<polygon points="{corners}" fill="#8a8a8a"/>')
    y, Z = scene.outline_at(k)
    for one, radius in zip(1e3 * y, 1e3 * Z, strict=True):
        x, height = at(radius, one).split(",")
        parts.append(f'<circle cx="{x}" cy="{height}" r="2.2" fill="#fff" stroke="{INK}"/>')
    bar = "".join(
        f'<rect x="{WIDTH / 2 - 100 + 4 * i}" y="{HEIGHT - 34}" width="4.3" height="9" '
        f'fill="{_hex(shade(i / 49.0, bytes=True))}"/>'
        for i in range(50)
    )
    text = f'font-size="12" fill="{INK}" text-anchor="middle"'
    ends = (
        f'<text x="{WIDTH / 2 - 100}" y="{HEIGHT - 12}" {text}>{low:.3g}</text>'
        f'<text x="{WIDTH / 2 + 100}" y="{HEIGHT - 12}" {text}>{high:.3g}</text>'
        f'<text x="{WIDTH / 2}" y="{HEIGHT - 12}" {text}>{escape(kind.label)}</text>'
    )
    words = f"Cut through the specimen, coloured by: {kind.label}; dots: measured outline"
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" aria-label="{escape(words)}">'
        + "".join(parts) + bar + ends + "</svg>"
    )  # fmt: skip


def _hex(colour: tuple[float, ...]) -> str:
    return "#" + "".join(f"{int(part):02x}" for part in colour[:3])
