"""Series of files for ParaView: simulated meshes and measured surfaces (VTU)."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from dic.files import replacing
from dic.result import Body, FullField
from dic.surfaces.surface_history import SurfaceHistory
from explicit import Response
from explicit.mesh import Mesh, deformation_gradient
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.report.scene.scene_data import FIELDS, Solid, at_nodes, grid_triangles

CELLS = {
    1: "vertex", 5: "triangle", 9: "quad", 10: "tetra", 12: "hexahedron", 22: "triangle6", 23: "quad8",
    24: "tetra10", 28: "quad9", 29: "hexahedron27",
}  # fmt: skip
"""Number of a cell type in VTK -> its name in meshio."""
VERTEX, TRIANGLE, QUAD = 1, 5, 9


def write_grid(
    path: Path, points: FloatArray, cells: np.ndarray, kind: int, fields: Mapping[str, np.ndarray]
) -> None:
    """Write an unstructured grid (VTU) with cells of one type.

    ``points``: coordinates, shape [n, 3]. ``cells``: points of each cell in VTK's order, shape [m, k]; m may
    be 0. ``kind``: a key of `CELLS`. ``fields``: values at the points by name, shape [n] or [n, components].
    """
    named = {escape(name): np.asarray(values) for name, values in fields.items()}  # meshio does not escape
    mesh = meshio.Mesh(points, [(CELLS[kind], cells)], point_data=named)
    with replacing(path) as partial:
        meshio.vtu.write(partial, mesh)


def write_series(path: Path, times: Sequence[float], files: Sequence[Path]) -> None:
    """Write the listing (PVD) of files in the same folder, with the time [s] of each."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    series = ElementTree.SubElement(root, "Collection")
    for time, file in zip(times, files, strict=True):
        ElementTree.SubElement(series, "DataSet", timestep=repr(float(time)), part="0", file=file.name)
    with replacing(path) as partial:
        ElementTree.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def write_vtu(
    folder: Path, response: Response, mesh: Mesh, solid: Solid | None, *, every: int = 1
) -> list[Path]:
    """Write the mesh of one simulation at every n-th surface time, and their listing `mesh.pvd`.

    ``mesh``: the undeformed mesh. ``solid``: the material; without it no pressure, stress and energy are
    written. Returns: the files written, the listing last. Points are (r, y, 0) [m] with the displacement [m]
    from the first surface time and the `FIELDS` of films. The series ends where the simulation ended. Raises
    ValueError if the response has no nodes, if `every` is below 1, or if the mesh has other nodes.
    """
    if response.nodes is None:
        raise ValueError("the response kept no nodes; request them when the simulation is run")
    if every < 1:
        raise ValueError(f"every must be >= 1, got {every}")
    nodes = response.nodes[0]
    if nodes.shape[1] != mesh.n_nodes:
        raise ValueError(f"the mesh has {mesh.n_nodes} nodes, the response {nodes.shape[1]}")
    kinds = [kind for kind in FIELDS.values() if solid is not None or not kind.needs_solid]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written, times = [], []
    for k in range(0, len(response.surface_times), every):
        if not np.isfinite(nodes[k]).all():
            break
        path = folder / f"mesh_{k:05d}.vtu"
        F = deformation_gradient(mesh, nodes[k])
        fields = {kind.label: at_nodes(mesh, kind.values(F, solid)[None])[0] for kind in kinds}
        displacement = {"displacement [m]": _in_space(nodes[k] - nodes[0])}
        write_grid(path, _in_space(nodes[k]), mesh.quads, QUAD, displacement | fields)
        written.append(path)
        times.append(response.surface_times[k])
    listing = folder / "mesh.pvd"
    write_series(listing, times, written)
    return [*written, listing]


def _in_space(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([plane, np.zeros(len(plane))])


def write_body_vtu(folder: Path, body: Body, name: str = "specimen") -> list[Path]:
    """Write the valid points of every frame, joined to triangles over their grid, and `<name>.pvd`.

    Points are (x, y, Z) [m]. Their data are displacement and sigma [m], epipolar distance and standard
    deviation of a match [px], correlation, and point number. Returns: the files, the listing last.
    """
    surface, triangles = body.surface, grid_triangles(body.cell)

    def fields(frame: int, valid: BoolArray) -> dict[str, np.ndarray]:
        return {
            "displacement [m]": surface.u[frame, valid],
            "sigma [m]": surface.sigma[frame, valid],
            "epipolar distance [px]": body.epipolar[frame, valid],
            "sigma of the match [px]": np.fmax(*(s[frame, valid] for s in body.match_sigma)),
            "correlation": np.fmin(*(z[frame, valid] for z in body.zncc)),
        }

    return _write_frames(Path(folder), name, surface, triangles, fields)


def _write_frames(
    folder: Path,
    name: str,
    surface: SurfaceHistory,
    triangles: NDArray[np.int64],
    fields: Callable[[int, BoolArray], dict[str, np.ndarray]],
) -> list[Path]:
    """Write one file per frame, and the listing. A triangle is written if all its corners are valid.

    A frame without triangles has its points as cells, because ParaView shows no other points.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}_{frame:05d}.vtu" for frame in range(surface.n_frames)]
    for frame, path in enumerate(files):
        valid = surface.valid[frame]
        points, data = surface.position[frame, valid], fields(frame, valid) | {"point": np.flatnonzero(valid)}
        faces = (np.cumsum(valid) - 1)[triangles[valid[triangles].all(axis=1)]]
        if len(faces):
            write_grid(path, points, faces, TRIANGLE, data)
        else:
            write_grid(path, points, np.arange(len(points))[:, None], VERTEX, data)
    listing = folder / f"{name}.pvd"
    write_series(listing, list(surface.t), files)
    return [*files, listing]


def write_full_field_vtu(folder: Path, result: FullField) -> list[Path]:
    """Write the valid points of every frame of a full-field result as `write_body_vtu`, and `field.pvd`.

    Points are the current places in the result's unit. Their data are displacement and sigma in that unit,
    the strains xx, yy, xy (NaN if missing), the lowest correlation, and the point number.
    """
    surface, triangles = result.surface, grid_triangles(result.cell)
    if result.kind == "plane":  # y runs down there: keep the normals toward the camera
        triangles = triangles[:, ::-1]

    def fields(frame: int, valid: BoolArray) -> dict[str, np.ndarray]:
        return {
            f"displacement [{result.unit}]": surface.u[frame, valid],
            f"sigma [{result.unit}]": surface.sigma[frame, valid],
            "strain xx, yy, xy": result.strain.value[frame, valid],
            "correlation": result.zncc[:, frame, valid].min(axis=0),
        }

    return _write_frames(Path(folder), "field", surface, triangles, fields)
