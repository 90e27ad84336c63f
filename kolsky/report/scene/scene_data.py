"""Scene of a film or still: deforming mesh, a field of its elements, measured outline.

A new field is one function and one line of `FIELDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine

if TYPE_CHECKING:
    import explicit
    from explicit.materials.volumetric import VolumetricLaw
    from kolsky.base.records import MaterialCurve
    from kolsky.inverse.result import Identification


@dataclass(frozen=True)
class Solid:
    """Material of the specimen, needed for stresses and energies."""

    law: Any
    """`explicit.materials.MaterialLaw`, unscaled."""
    volume: VolumetricLaw
    """Volumetric law, unscaled."""
    stiffness_factor: float


def solid_of(curve: MaterialCurve, values: Mapping[str, float]) -> Solid:
    """Return the material of a simulation; ``values`` have "stiffness_factor" and "poisson"."""
    from explicit.materials.volumetric import VolumetricLaw, bulk_modulus
    from kolsky.inverse.forward import material_law

    law = material_law(curve)
    return Solid(
        law=law,
        volume=VolumetricLaw(float(bulk_modulus(law.initial_shear_modulus, values["poisson"]))),
        stiffness_factor=values["stiffness_factor"],
    )


@dataclass(frozen=True)
class FieldKind:
    """Scalar field with one value per element."""

    label: str
    """Quantity with its unit, as on an axis."""
    values: Callable[[FloatArray, Solid | None], FloatArray]
    """From deformation gradients, shape [..., 3, 3] in (r, y, hoop), and the solid; shape [...]."""
    colours: str
    """Name of a Matplotlib colour map."""
    needs_solid: bool = False
    """True if the material must be known."""


def smallest_stretch(F: FloatArray, solid: Solid | None = None) -> FloatArray:
    """Smallest principal stretch [-]: of the hoop, or the root of an eigenvalue of F^T F in the meridian."""
    r, y = F[..., :2, 0], F[..., :2, 1]
    # Sums of two, written out. A loop over this short axis takes ten times as long, with the same bits.
    (r0, r1), (y0, y1) = np.moveaxis(r, -1, 0), np.moveaxis(y, -1, 0)
    rr, yy, ry = r0**2 + r1**2, y0**2 + y1**2, r0 * y0 + r1 * y1
    in_plane = 0.5 * (rr + yy) - np.hypot(0.5 * (rr - yy), ry)
    # It is below zero only by round-off, if an element is flattened.
    return np.asarray(np.minimum(np.sqrt(np.maximum(in_plane, 0.0)), np.abs(F[..., 2, 2])))


def pressure(F: FloatArray, solid: Solid | None) -> FloatArray:
    """Minus the mean Cauchy stress [MPa]."""
    assert solid is not None  # checked by `needs_solid`
    return np.asarray(-1e-6 * solid.stiffness_factor * solid.volume.pressure(np.linalg.det(F)))


def strain_energy(F: FloatArray, solid: Solid | None) -> FloatArray:
    """Stored energy per undeformed volume [MJ/m^3]."""
    assert solid is not None  # checked by `needs_solid`
    J, b_bar = _isochoric(F)
    return np.asarray(1e-6 * solid.stiffness_factor * (solid.law.energy(b_bar) + solid.volume.energy(J)))


def mises_stress(F: FloatArray, solid: Solid | None) -> FloatArray:
    """Equivalent stress of von Mises, sqrt(3/2 s : s) of the elastic Cauchy stress [MPa]."""
    assert solid is not None  # checked by `needs_solid`
    J, b_bar = _isochoric(F)
    rr, yy, ry, tt = np.moveaxis(solid.law.stress(b_bar), -1, 0)
    return np.asarray(
        1e-6 * solid.stiffness_factor * np.sqrt(1.5 * (rr**2 + yy**2 + tt**2) + 3.0 * ry**2) / J
    )


def _isochoric(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Volume ratio J, and J^(-2/3) F F^T as (rr, yy, ry, tt)."""
    J = np.linalg.det(F)
    b = np.einsum("...ij,...kj->...ik", F, F)
    components = np.stack([b[..., 0, 0], b[..., 1, 1], b[..., 0, 1], b[..., 2, 2]], axis=-1)
    return J, J[..., None] ** (-2.0 / 3.0) * components


FIELDS: dict[str, FieldKind] = {
    "stretch": FieldKind("Smallest stretch (1)", smallest_stretch, "viridis"),
    "pressure": FieldKind("Pressure (MPa)", pressure, "cividis", needs_solid=True),
    "stress": FieldKind("Von Mises stress (MPa)", mises_stress, "cividis", needs_solid=True),
    "energy": FieldKind("Strain energy (MJ/m³)", strain_energy, "viridis", needs_solid=True),
}
"""Fields by name."""


_FIELD_RANGE = (1.0, 99.0)
"""Percentiles of a field over all times, used as limits of the colour scale. Corners then have no effect."""


AT_ONCE = 8
"""Number of pictures whose deformation gradients are computed together."""


class SceneDataMissing(ValueError):
    """A result lacks data for the pictures."""


@dataclass(frozen=True)
class Scene:
    """One simulation with measured data, ready to be drawn."""

    times: FloatArray
    """Times of the pictures [s], shape [n_times]."""
    nodes: FloatArray
    """Positions (r, y) of the nodes [m], shape [n_times, n_axial + 1, n_radial + 1, 2]."""
    values: FloatArray
    """The field of the elements, shape [n_times, n_axial, n_radial]."""
    field: str
    """Name in `kolsky.report.scene.scene_data.FIELDS`."""
    limits: tuple[float, float]
    """Field values at the ends of the colour scale."""
    measured_outline: CentreLine
    """Measured outline; empty if none was measured."""

    def outline_at(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Measured heights and radii [m] in the frame nearest to picture k; empty without an outline."""
        line = self.measured_outline
        if not line.time.size:
            return np.zeros(0), np.zeros(0)
        near = line.time == line.time[np.argmin(np.abs(line.time - self.times[k]))]
        order = np.argsort(line.y[near])
        return line.y[near][order], line.Z[near][order]


def has_scene(result: Identification) -> bool:
    """Return True if a result contains the data of a scene."""
    try:
        _simulated_frames(result)
    except SceneDataMissing:
        return False
    return True


def scene_of(
    result: Identification,
    *,
    field: str = "stretch",
    solid: Solid | None = None,
    chosen: Callable[[int], Sequence[int]] = range,
) -> Scene:
    """Return the scene of an identification's simulation at the optimum.

    ``field``: one of `FIELDS`. ``solid``: material; required by stresses and energies. ``chosen``: gives the
    indices of the pictures for the number of times; default: all. The colour scale is that of all pictures.
    Raises SceneDataMissing if the response has no nodes or the provenance no size of the specimen, and
    ValueError if the field is unknown or if it needs a missing solid.
    """
    from explicit.mesh import deformation_gradient

    if field not in FIELDS:
        raise ValueError(f"there is no field {field!r}; choose from {', '.join(FIELDS)}")
    kind, response = FIELDS[field], result.response
    if kind.needs_solid and solid is None:
        raise ValueError(f"the field {field!r} needs the material")
    mesh, whole = _simulated_frames(result)
    assert response.nodes is not None  # checked by `_simulated`
    nodes = response.nodes[0][whole]
    # Some pictures at a time, because the gradients of all pictures would exceed the caches.
    parts = np.array_split(nodes, range(AT_ONCE, len(nodes), AT_ONCE))
    elements = np.concatenate([kind.values(deformation_gradient(mesh, x), solid) for x in parts])
    low, high = np.percentile(elements, _FIELD_RANGE)
    shown = np.asarray(chosen(len(nodes)))
    across, along = result.refined_mesh
    return Scene(
        times=response.surface_times[whole][shown],
        nodes=nodes[shown].reshape(-1, along + 1, across + 1, 2),
        values=elements[shown].reshape(-1, along, across),
        field=field,
        limits=(float(low), float(high) if high > low else float(low) + 1.0),
        measured_outline=result.comparison.centre_line,
    )


def _simulated_frames(result: Identification) -> tuple[explicit.Mesh, NDArray[np.bool_]]:
    """The mesh of the check run, and a mask of the times that it reached."""
    if result.response.nodes is None:
        raise SceneDataMissing("the result kept no nodes of its check run")
    mesh = mesh_of(result)
    whole = np.isfinite(result.response.nodes[0]).all(axis=(1, 2))
    if not whole.any():
        raise SceneDataMissing("the check run reached none of its times")
    return mesh, whole


def mesh_of(result: Identification) -> explicit.Mesh:
    """Rebuild the mesh of the simulation from the provenance of the result."""
    import explicit

    said = result.provenance
    try:
        specimen, grading = said["specimen"], float(said["refined_grading"])
        radius, length = 0.5 * float(specimen["diameter"]), float(specimen["length"])
    except (KeyError, TypeError, ValueError):
        raise SceneDataMissing(
            "the result's provenance does not hold the size of the specimen and the grading of its mesh: "
            "identify the shot again"
        ) from None
    n_radial, n_axial = result.refined_mesh
    mesh = explicit.cylinder(radius, length, n_radial=n_radial, n_axial=n_axial, grading=grading)
    assert result.response.nodes is not None  # checked by `_simulated`
    if result.response.nodes.shape[2] != mesh.n_nodes:
        raise SceneDataMissing(
            f"the result holds {result.response.nodes.shape[2]} nodes, its mesh has {mesh.n_nodes}"
        )
    return mesh


def at_nodes(mesh: explicit.Mesh, elements: FloatArray) -> FloatArray:
    """Mean over the elements around each node, shape [n_times, n_nodes]."""
    corner = mesh.quads.ravel()
    count = np.bincount(corner, minlength=mesh.n_nodes)
    spread = np.repeat(elements, 4, axis=1)
    return np.array([np.bincount(corner, row, mesh.n_nodes) for row in spread]) / count


def grid_triangles(cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return two triangles for every square of four neighbouring points of a grid."""
    if len(cell) == 0:
        return np.empty((0, 3), dtype=np.int64)
    low = cell.min(axis=0)
    table = np.full(tuple(cell.max(axis=0) - low + 2), -1, dtype=np.int64)
    table[tuple((cell - low).T)] = np.arange(len(cell))
    a, b, c, d = table[:-1, :-1], table[1:, :-1], table[1:, 1:], table[:-1, 1:]
    whole = (a >= 0) & (b >= 0) & (c >= 0) & (d >= 0)
    a, b, c, d = (corner[whole] for corner in (a, b, c, d))
    # Rows count downward in a picture. The order a, d, c is therefore counter-clockwise.
    return np.concatenate([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
