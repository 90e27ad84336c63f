"""Scene of a film or still: deforming mesh, a field at its nodes, measured points and surfaces.

A new field is one function and one line of `FIELDS`. The surfaces show the specimen cut in half between
its platens, with the measured body next to it.
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


class SceneDataMissing(ValueError):
    """A result lacks data for the pictures."""


@dataclass(frozen=True)
class SceneMesh:
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

    mesh: SceneMesh
    times: FloatArray
    """Times of the pictures [s], shape [n_times]."""
    nodes: FloatArray
    """Positions (r, y) of the nodes [m], shape [n_times, n_nodes, 2]."""
    values: FloatArray
    """The field at the nodes, shape [n_times, n_nodes]."""
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

    def points_at(self, k: int) -> FloatArray:
        """Points (x, y, Z) [m] of the measured outline, x = 0, nearest in time to picture k, shape [n, 3]."""
        y, Z = self.outline_at(k)
        return np.column_stack([np.zeros(y.size), y, Z])


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
    # One picture at a time, because the gradients of all pictures would exceed the caches.
    elements = np.array([kind.values(deformation_gradient(mesh, x), solid) for x in nodes])
    low, high = np.percentile(elements, _FIELD_RANGE)
    shown = np.asarray(chosen(len(nodes)))
    return Scene(
        mesh=SceneMesh(mesh.quads, mesh.lower_face, mesh.side, mesh.upper_face),
        times=response.surface_times[whole][shown],
        nodes=nodes[shown],
        values=at_nodes(mesh, elements[shown]),
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
        specimen, grading = said["specimen"], said["settings"]["numerics"]["grading"]
        radius, length = 0.5 * float(specimen["diameter"]), float(specimen["length"])
    except (KeyError, TypeError, ValueError):
        raise SceneDataMissing("the result's provenance does not hold the size of the specimen") from None
    n_radial, n_axial = result.refined_mesh
    mesh = explicit.cylinder(radius, length, n_radial=n_radial, n_axial=n_axial, grading=float(grading))
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


_TURNS = 61
"""Angular divisions of half a revolution, with both ends."""
PLATEN, _PLATEN_THICKNESS = 1.15, 0.07
"""Radius of a platen divided by the specimen's largest radius, and thickness of the platen divided by the
same radius."""
SIDE_DISTANCE = 2.9
"""Distance of the measured body from the simulated one, divided by the largest radius."""
_AZIMUTH, _ELEVATION = np.radians(40.0), np.radians(18.0)
"""Direction from the specimen to the eye: rotation from Z toward x, and elevation above the plane of Z and
x."""
EYE = np.array(
    [np.sin(_AZIMUTH) * np.cos(_ELEVATION), np.sin(_ELEVATION), np.cos(_AZIMUTH) * np.cos(_ELEVATION)]
)
"""Unit vector toward the eye."""
RIGHT = np.array([np.cos(_AZIMUTH), 0.0, -np.sin(_AZIMUTH)])
"""Unit vector of the picture to the right."""


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
        """Both surfaces as one. Both have values, or neither."""
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
    shell = _revolved(nodes[skin], np.linspace(0.0, np.pi, _TURNS), values[skin])
    return front.with_(behind).with_(shell)


def measured_body(scene: Scene, k: int) -> Surface | None:
    """The measured outline nearest to time k, revolved and moved aside. None if no outline was measured."""
    y, Z = scene.outline_at(k)
    if y.size < 2:
        return None
    body = _revolved(np.column_stack([Z, y]), np.linspace(0.0, 2.0 * np.pi, 2 * _TURNS - 1))
    shift = np.array([-SIDE_DISTANCE * float(scene.nodes[..., 0].max()), 0.0, 0.0])
    return Surface(body.points + shift, body.faces)


def platens(radius: float, top: float) -> tuple[Surface, Surface]:
    """Halves behind the cut of the lower and upper platen of a specimen of this radius and height [m]."""
    thick, R = _PLATEN_THICKNESS * radius, PLATEN * radius
    wall = np.arange(8).reshape(2, 4)
    halves = []
    for low in (-thick, top):
        line = np.array([[0.0, low], [R, low], [R, low + thick], [0.0, low + thick]])
        cut = np.array([[0.0, y, sign * r] for sign in (1.0, -1.0) for r, y in line])
        halves.append(Surface(cut, wall).with_(_revolved(line, np.linspace(0.0, np.pi, _TURNS))))
    return halves[0], halves[1]


def _revolved(line: FloatArray, angles: FloatArray, values: FloatArray | None = None) -> Surface:
    """Surface of revolution of a line (r, y) [m], shape [n, 2]; angle 0 is toward the cameras, then x < 0."""
    n = len(line)
    r, y = line.T
    x, Z = -np.sin(angles)[:, None] * r, np.cos(angles)[:, None] * r
    points = np.stack([x, np.broadcast_to(y, x.shape), Z], axis=-1).reshape(-1, 3)
    first = (n * np.arange(len(angles) - 1)[:, None] + np.arange(n - 1)).ravel()
    faces = np.column_stack([first, first + 1, first + n + 1, first + n])
    return Surface(points, faces, None if values is None else np.tile(values, len(angles)))


def lifted(points: FloatArray, by: float) -> FloatArray:
    """Points moved outward by ``by`` [m], because the surface would otherwise hide them."""
    across = np.hypot(points[:, 0], points[:, 2])
    factor = 1.0 + by / np.where(across > 0.0, across, np.inf)
    return np.column_stack([factor * points[:, 0], points[:, 1], factor * points[:, 2]])


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
