"""Figures of the simulation at the optimum: energies, deformed meshes, stills.

They show the check run alone, so that they can be drawn as soon as it is known.
"""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from kolsky.inverse.check_run import ShowsCheckRun
from kolsky.inverse.result import worst_imbalance
from kolsky.report.figures.base import (
    COLUMN,
    GREY,
    MEASURED,
    MJ,
    MM,
    MODEL,
    MS,
    PAGE,
    FigureKind,
    Panels,
    largest,
    note_empty,
    smooth_bar,
)
from kolsky.report.numbers import percent
from kolsky.report.scene.fields import FIELDS
from kolsky.report.scene.scene_data import has_scene
from kolsky.report.scene.stills import COUNT as STILLS
from kolsky.report.scene.stills import draw_still, scene_of_stills

PARTS = {
    "elastic": "#0072B2",
    "kinetic": "#56B4E9",
    "damping": "#E69F00",
    "viscous": "#999999",
    "friction": "#CC79A7",
    "hourglass": "#F0E442",
    "hourglass_damping": "#D55E00",
    "impact": "#009E73",
}


def caption_energy(result: ShowsCheckRun) -> str:
    """Return the caption."""
    worst = percent(worst_imbalance(result.response))
    return (
        "Energy ledger of the check run: the work of both platens (line) and what it became (areas, "
        "stacked), and the share that is not accounted for, over the largest work; "
        f"its largest size is {worst}. The legend gives each part’s largest share of that work."
    )


def draw_energy(result: ShowsCheckRun, panels: Panels) -> None:
    """Draw the stacked ledger above its residual."""
    ledger, time = result.response.energy, MS * result.response.surface_times
    top, low = panels["ledger"], panels["residual"]
    scale = largest(ledger.external[0])
    # nothing relaxes in most tests, and a part that is nowhere needs no place in the legend
    parts = [name for name in PARTS if name != "viscous" or (np.abs(ledger.viscous[0]) > 0.0).any()]
    shares = [largest(getattr(ledger, name)[0], default=0.0) / scale for name in parts]
    labels = [
        f"{name.replace('_', ' ')}, {percent(share)}" for name, share in zip(parts, shares, strict=True)
    ]
    stack = [MJ * getattr(ledger, name)[0] for name in parts]
    ended = np.isfinite(ledger.external[0])
    if not ended.any():
        note_empty(top, "no simulation completed")
    colours = [PARTS[name] for name in parts]
    top.stackplot(time[ended], [part[ended] for part in stack], labels=labels, colors=colours, lw=0.0)
    top.plot(time, MJ * ledger.external[0], color=MEASURED, lw=0.8, label="work of the platens")
    top.set_ylabel("Energy $W$ (mJ)")
    top.tick_params(labelbottom=False)
    if ended.any():
        top.legend(loc="upper left", reverse=True)
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, 100.0 * ledger.residual[0] / scale, color=MEASURED, lw=0.8)
    low.set_xlabel("Time $t$ (ms)")
    low.set_ylabel("Residual (%)")
    if time.size:
        low.set_xlim(time[0], time[-1])
    low.margins(y=0.2)


MESHES = 4
"""Panels of the figure of meshes."""
LINES = 16
"""Lines of the mesh drawn in each direction, about; more would print as a grey area."""


def caption_meshes(result: ShowsCheckRun) -> str:
    """Return the caption."""
    size = f"{result.refined_mesh[0]} × {result.refined_mesh[1]} elements"
    thinned = "" if max(result.refined_mesh) < 2 * LINES else ", some of its lines"
    return (
        f"Deformed mesh of the check run ({size}{thinned}) in the half-plane r ≥ 0, and the mirrored "
        "silhouette with the measured points, nearest frame, on the other side."
    )


def kept_nodes(result: ShowsCheckRun) -> bool:
    """Return True if the result holds the nodes of the simulation at the optimum."""
    nodes = result.response.nodes
    return nodes is not None and bool(np.isfinite(nodes).any())


def _panel_size(result: ShowsCheckRun) -> tuple[float, float]:
    """Half-width and height of a panel [mm of the specimen], the same for all."""
    assert result.response.nodes is not None  # checked by `applies`
    r, y = np.moveaxis(result.response.nodes[0], -1, 0)
    return 1.08 * MM * largest(r), 1.25 * MM * largest(y)


def _meshes_height(result: ShowsCheckRun) -> float:
    """Height of the figure [mm]: panels of equal scale, room for the labels."""
    width, height = _panel_size(result)
    return 11.0 + (PAGE - 14.0) / MESHES * height / (2.0 * width)


def _thinned(elements: int) -> list[int]:
    """Numbers of the mesh lines to draw, both ends among them."""
    return sorted({*range(0, elements + 1, max(1, elements // LINES)), elements})


def draw_meshes(result: ShowsCheckRun, panels: Panels) -> None:
    """Draw the lines of the mesh; nodes run along the radius first, as `explicit.mesh.cylinder` numbers them.

    Raises
    ------
    ValueError
        If the outermost nodes of such a mesh are not the response's side surface.
    """
    response, line = result.response, result.comparison.centre_line
    assert response.nodes is not None  # checked by `applies`
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
    shown = reached[np.round(np.linspace(0, reached.size - 1, MESHES)).astype(int)]
    width, height = _panel_size(result)
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


def caption_scene(result: ShowsCheckRun) -> str:
    """Return the caption."""
    return (
        "The check run, its half behind a cut along the axis, between the platens (cut too), coloured by the "
        "smallest principal stretch; beside it the measured outline, nearest frame, revolved about the axis. "
        "Points: as measured."
    )


def can_show_stills(result: ShowsCheckRun) -> bool:
    """Return True if the result holds the scene."""
    return has_scene(result)


def draw_scene(result: ShowsCheckRun, panels: Panels) -> None:
    """Set the pictures side by side."""
    stage = scene_of_stills(result)
    axes = [panels[f"scene {column}"] for column in range(STILLS)]
    for ax in axes:
        ax.set_axis_off()
    for ax, (k, time) in zip(axes, enumerate(stage.times), strict=False):
        draw_still(ax, stage, k)
        ax.text(0.5, 1.02, f"{MS * time:.2f} ms", transform=ax.transAxes, ha="center", va="bottom")
    kind = FIELDS[stage.field]
    colours = ScalarMappable(Normalize(*stage.limits), kind.colours)
    bar = axes[0].figure.colorbar(  # type: ignore[union-attr]
        colours, ax=axes, location="bottom", label=kind.label, aspect=50, shrink=0.5
    )
    smooth_bar(bar)


FIGURES: tuple[FigureKind[ShowsCheckRun], ...] = (
    FigureKind(
        name="energy",
        width=COLUMN,
        height=lambda result: 78.0,
        caption=caption_energy,
        panels=lambda result: [["ledger"], ["residual"]],
        draw=draw_energy,
        mosaic={"sharex": True, "height_ratios": [2.8, 1.0]},
    ),
    FigureKind(
        name="meshes",
        width=PAGE,
        height=_meshes_height,
        caption=caption_meshes,
        panels=lambda result: [[f"mesh {column}" for column in range(MESHES)]],
        draw=draw_meshes,
        mosaic={"sharey": True},
        applies=kept_nodes,
    ),
    FigureKind(
        name="scene",
        width=PAGE,
        height=lambda result: 45.0,
        caption=caption_scene,
        panels=lambda result: [[f"scene {column}" for column in range(STILLS)]],
        draw=draw_scene,
        applies=can_show_stills,
    ),
)
