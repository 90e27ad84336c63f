"""Scene: the deforming mesh, a field at its nodes and the measured points, as needed to draw them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine
from kolsky.report.scene.fields import FIELDS, Solid

if TYPE_CHECKING:
    import explicit
    from dic import SurfaceHistory
    from kolsky.inverse.check_run import ShowsCheckRun


RANGE = (1.0, 99.0)
"""Percentiles of a field over all times at the ends of the colour scale, so that no corner sets it."""


class SceneDataMissing(ValueError):
    """A result lacks data that the pictures need."""


@dataclass(frozen=True)
class Mesh:
    """Connectivity of the mesh: elements, faces and side surface."""

    quads: NDArray[np.int64]
    """Corners of the elements, shape [n_elements, 4]."""
    lower_face: NDArray[np.int64]
    """Nodes on the flyer's platen, from the axis outward."""
    side: NDArray[np.int64]
    """Nodes of the side surface from the transmission end, both edges included."""
    upper_face: NDArray[np.int64]
    """Nodes on the other platen, from the axis outward."""


@dataclass(frozen=True)
class Scene:
    """One simulation with measured data, ready to be drawn."""

    mesh: Mesh
    """The mesh."""
    times: FloatArray
    """Times of the pictures [s], shape [n_times]."""
    nodes: FloatArray
    """Positions (r, y) of the nodes [m], shape [n_times, n_nodes, 2]."""
    values: FloatArray
    """The field at the nodes, shape [n_times, n_nodes]."""
    field: str
    """Name in `kolsky.report.scene.fields.FIELDS`."""
    limits: tuple[float, float]
    """Field values at the ends of the colour scale."""
    measured_outline: CentreLine
    """Measured outline; empty if none was measured."""
    surface: SurfaceHistory | None = None
    """Measured points of the whole visible surface, if known."""

    def outline_at(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Measured heights and radii [m] in the frame nearest to the time of picture k; empty if none."""
        line = self.measured_outline
        if not line.time.size:
            return np.zeros(0), np.zeros(0)
        near = line.time == line.time[np.argmin(np.abs(line.time - self.times[k]))]
        order = np.argsort(line.y[near])
        return line.y[near][order], line.Z[near][order]

    def points_at(self, k: int) -> FloatArray:
        """Measured points (x, y, Z) [m] nearest in time to picture k, shape [n, 3].

        Those of the whole surface if it is known, else of the outline at x = 0.
        """
        if self.surface is None:
            y, Z = self.outline_at(k)
            return np.column_stack([np.zeros(y.size), y, Z])
        frame = int(np.argmin(np.abs(self.surface.t - self.times[k])))
        return self.surface.position[frame, self.surface.valid[frame]]


def has_scene(result: ShowsCheckRun) -> bool:
    """Return True if a result holds the data of a scene."""
    try:
        _simulated(result)
    except SceneDataMissing:
        return False
    return True


def scene_of(
    result: ShowsCheckRun,
    *,
    field: str = "stretch",
    solid: Solid | None = None,
    surface: SurfaceHistory | None = None,
    chosen: Callable[[int], Sequence[int]] = range,
) -> Scene:
    """Return the scene of an identification's simulation at the optimum.

    Parameters
    ----------
    result
        Its response must hold the nodes, its provenance the specimen's size.
    field
        One of `kolsky.report.scene.fields.FIELDS`.
    solid
        Material; required by fields that are stresses or energies.
    surface
        Measured points of the whole surface, beside the outline.
    chosen
        Gives the indices of the pictures among so many times; default all. The colour scale is that of all.

    Raises
    ------
    ValueError
        If the field is unknown or lacks the solid.
    SceneDataMissing
        If the result lacks the nodes or the specimen's size.
    """
    from explicit.deformation import deformation_gradient

    if field not in FIELDS:
        raise ValueError(f"there is no field {field!r}; choose from {', '.join(FIELDS)}")
    kind, response = FIELDS[field], result.response
    if kind.needs_solid and solid is None:
        raise ValueError(f"the field {field!r} needs the material")
    mesh, whole = _simulated(result)
    assert response.nodes is not None  # checked by `_simulated`
    nodes = response.nodes[0][whole]
    # Picture by picture: the gradients of all of them would outgrow the caches.
    elements = np.array([kind.values(deformation_gradient(mesh, x), solid) for x in nodes])
    low, high = np.percentile(elements, RANGE)
    shown = np.asarray(chosen(len(nodes)))
    return Scene(
        mesh=Mesh(mesh.quads, mesh.lower_face, mesh.side, mesh.upper_face),
        times=response.surface_times[whole][shown],
        nodes=nodes[shown],
        values=_at_nodes(mesh, elements[shown]),
        field=field,
        limits=(float(low), float(high) if high > low else float(low) + 1.0),
        measured_outline=result.comparison.centre_line,
        surface=surface,
    )


def _simulated(result: ShowsCheckRun) -> tuple[explicit.Mesh, NDArray[np.bool_]]:
    """The mesh of the check run, and which of its times it reached.

    Raises
    ------
    SceneDataMissing
        If the result lacks the nodes or the specimen's size.
    """
    if result.response.nodes is None:
        raise SceneDataMissing("the result kept no nodes of its check run")
    mesh = _mesh(result)
    whole = np.isfinite(result.response.nodes[0]).all(axis=(1, 2))
    if not whole.any():
        raise SceneDataMissing("the check run reached none of its times")
    return mesh, whole


def _mesh(result: ShowsCheckRun) -> explicit.Mesh:
    """Rebuild the mesh of the simulation from the provenance of the result."""
    import explicit

    said = result.provenance
    try:
        specimen, grading = said["specimen"], said["settings"]["numerics"]["grading"]
        radius, length = 0.5 * float(specimen["diameter"]), float(specimen["length"])
    except (KeyError, TypeError, ValueError):
        raise SceneDataMissing("the result's provenance does not say how large the specimen was") from None
    n_radial, n_axial = result.refined_mesh
    mesh = explicit.cylinder(radius, length, n_radial=n_radial, n_axial=n_axial, grading=float(grading))
    assert result.response.nodes is not None  # checked by `_simulated`
    if result.response.nodes.shape[2] != mesh.n_nodes:
        raise SceneDataMissing(
            f"the result holds {result.response.nodes.shape[2]} nodes, its mesh has {mesh.n_nodes}"
        )
    return mesh


def _at_nodes(mesh: explicit.Mesh, elements: FloatArray) -> FloatArray:
    """Mean over the elements around each node, shape [n_times, n_nodes]."""
    corner = mesh.quads.ravel()
    count = np.bincount(corner, minlength=mesh.n_nodes)
    spread = np.repeat(elements, 4, axis=1)
    return np.array([np.bincount(corner, row, mesh.n_nodes) for row in spread]) / count
