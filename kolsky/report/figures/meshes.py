"""The deformed mesh of the check run at a few times, with the measured outline on its other side."""

import numpy as np
from matplotlib.collections import LineCollection

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import MEASURED, MM, MODEL, MS, PAGE, FigureKind, Panels, largest

COUNT = 4
LINES = 16
"""Lines of the mesh drawn in each direction, about; more would print as a grey area."""


def caption(result: Identification) -> str:
    """What is seen."""
    size = f"{result.refined_mesh[0]} × {result.refined_mesh[1]} elements"
    thinned = "" if max(result.refined_mesh) < 2 * LINES else ", some of its lines"
    return (
        f"Deformed mesh of the check run ({size}{thinned}) in the half-plane r ≥ 0, and the mirrored "
        "silhouette with the measured points, nearest frame, on the other side."
    )


def applies(result: Identification) -> bool:
    """Whether the check run kept its nodes."""
    nodes = result.response.nodes
    return nodes is not None and bool(np.isfinite(nodes).any())


def _box(result: Identification) -> tuple[float, float]:
    """Half-width and height of a panel [mm of the specimen], the same for all."""
    assert result.response.nodes is not None  # `applies` says so
    r, y = np.moveaxis(result.response.nodes[0], -1, 0)
    return 1.08 * MM * largest(r), 1.25 * MM * largest(y)


def _height(result: Identification) -> float:
    """Height of the figure [mm]: panels of equal scale, room for the labels."""
    width, height = _box(result)
    return 11.0 + (PAGE - 14.0) / COUNT * height / (2.0 * width)


def _thinned(elements: int) -> list[int]:
    """Numbers of the mesh lines to draw, both ends among them."""
    return sorted({*range(0, elements + 1, max(1, elements // LINES)), elements})


def draw(result: Identification, panels: Panels) -> None:
    """Draw the lines of the mesh; nodes run along the radius first, as `explicit.mesh.cylinder` numbers them.

    Raises
    ------
    ValueError
        If the outermost nodes of such a mesh are not the response's side surface.
    """
    response, line = result.response, result.comparison.centre_line
    assert response.nodes is not None  # `applies` says so
    n_radial, n_axial = result.refined_mesh
    times = response.surface_times
    expected = (n_radial + 1) * (n_axial + 1)
    if response.nodes.shape[2] != expected:
        raise ValueError(f"response.nodes holds {response.nodes.shape[2]} nodes, the mesh has {expected}")
    grid = response.nodes[0].reshape(times.size, n_axial + 1, n_radial + 1, 2)
    side = np.stack([response.surface_r[0], response.surface_y[0]], axis=-1)
    if not np.array_equal(grid[:, :, -1], side, equal_nan=True):
        raise ValueError("the last node of each row of the mesh is not on the side; was it renumbered?")

    reached = np.flatnonzero(np.isfinite(grid).all(axis=(1, 2, 3)))
    shown = reached[np.round(np.linspace(0, reached.size - 1, COUNT)).astype(int)]
    width, height = _box(result)
    for column, k in enumerate(shown):
        ax = panels[f"mesh {column}"]
        rows = [MM * grid[k, j] for j in _thinned(n_axial)] + [MM * grid[k, :, i] for i in _thinned(n_radial)]
        ax.add_collection(LineCollection(rows, colors=MODEL, linewidths=0.3))
        ax.fill_betweenx(MM * side[k, :, 1], -MM * side[k, :, 0], 0.0, color=MODEL, alpha=0.15, lw=0.0)
        if line.time.size:
            near = line.time == line.time[np.argmin(np.abs(line.time - times[k]))]
            ax.plot(-MM * line.Z[near], MM * line.y[near], "o", color=MEASURED, ms=1.6, mew=0.0)
        ax.text(0.5, 0.97, f"{MS * times[k]:.2f} ms", transform=ax.transAxes, ha="center", va="top")
        ax.set_aspect("equal")
        ax.set_xlim(-width, width)
        ax.set_ylim(0.0, height)
        ax.set_xlabel("Radius $r$ (mm)")
        if column == 0:
            ax.set_ylabel("Height $y$ (mm)")
        else:
            ax.tick_params(labelleft=False)


KIND = FigureKind(
    name="meshes",
    width=PAGE,
    height=_height,
    caption=caption,
    panels=lambda result: [[f"mesh {column}" for column in range(COUNT)]],
    draw=draw,
    mosaic={"sharey": True},
    applies=applies,
)
