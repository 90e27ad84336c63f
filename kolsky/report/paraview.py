"""Series of files for ParaView: simulated meshes (VTU) and measured surfaces (VTP), written without VTK."""

import base64
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.files import replacing
from dic.result import Body, FullField
from dic.surfaces.surface_history import SurfaceHistory
from explicit import Response
from explicit.mesh import Mesh, deformation_gradient
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.report.scene.scene_data import FIELDS, Solid, at_nodes

QUAD, TRIANGLE = 9, 5
"""Numbers of two cell types in VTK."""
_TYPE_NAMES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}
"""Types of VTK by those of NumPy without byte order."""


def write_grid(
    path: Path, points: FloatArray, cells: np.ndarray, kind: int, fields: Mapping[str, np.ndarray]
) -> None:
    """Write an unstructured grid (VTU) with cells of one type.

    ``path``: file to write; it is never incomplete. ``points``: coordinates, shape [n, 3]. ``cells``: points
    of each cell in VTK's order, shape [m, k]; m may be 0. ``kind``: number of the cell type in VTK.
    ``fields``: values at the points by name, shape [n] or [n, components].
    """
    _check_arrays(points, cells, fields)
    piece = {"NumberOfPoints": str(len(points)), "NumberOfCells": str(len(cells))}
    kinds = np.full(len(cells), kind, dtype=np.uint8)
    _write_vtk(path, "UnstructuredGrid", piece, points, fields, {"Cells": (cells, kinds)})


def write_surface(
    path: Path, points: FloatArray, faces: np.ndarray, fields: Mapping[str, np.ndarray]
) -> None:
    """Write a surface (VTP): points and polygons of one size. Without faces, each point is a vertex."""
    _check_arrays(points, faces, fields)
    vertices = np.zeros((0, 1), dtype=np.int64) if len(faces) else np.arange(len(points))[:, None]
    piece = {
        "NumberOfPoints": str(len(points)),
        "NumberOfVerts": str(len(vertices)),
        "NumberOfLines": "0",
        "NumberOfStrips": "0",
        "NumberOfPolys": str(len(faces)),
    }
    _write_vtk(path, "PolyData", piece, points, fields, {"Verts": (vertices, None), "Polys": (faces, None)})


def write_series(path: Path, times: Sequence[float], files: Sequence[Path]) -> None:
    """Write the listing (PVD) of files in the same folder, with the time [s] of each."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    series = ElementTree.SubElement(root, "Collection")
    for time, file in zip(times, files, strict=True):
        ElementTree.SubElement(series, "DataSet", timestep=repr(float(time)), part="0", file=file.name)
    with replacing(path) as partial:
        ElementTree.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def _check_arrays(points: FloatArray, cells: np.ndarray, fields: Mapping[str, np.ndarray]) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must have shape [n, 3], got {points.shape}")
    if cells.size and not (cells.min() >= 0 and cells.max() < len(points)):
        raise ValueError(f"cells must name points 0 to {len(points) - 1}, got {cells.min()} to {cells.max()}")
    for name, values in fields.items():
        if len(values) != len(points):
            raise ValueError(f"field {name!r} must have one row per point, {len(points)}, got {len(values)}")


def _write_vtk(
    path: Path,
    kind: str,
    piece: dict[str, str],
    points: FloatArray,
    fields: Mapping[str, np.ndarray],
    cells: Mapping[str, tuple[np.ndarray, np.ndarray | None]],
) -> None:
    root = ElementTree.Element(
        "VTKFile", type=kind, version="1.0", byte_order="LittleEndian", header_type="UInt64"
    )
    inside = ElementTree.SubElement(ElementTree.SubElement(root, kind), "Piece", piece)
    data = ElementTree.SubElement(inside, "PointData")
    for name, values in fields.items():
        _array_element(data, name, np.asarray(values))
    _array_element(ElementTree.SubElement(inside, "Points"), "Points", points)
    for group, (table, kinds) in cells.items():
        parent = ElementTree.SubElement(inside, group)
        _array_element(parent, "connectivity", table.ravel().astype(np.int64))
        _array_element(parent, "offsets", table.shape[1] * np.arange(1, len(table) + 1, dtype=np.int64))
        if kinds is not None:
            _array_element(parent, "types", kinds)
    with replacing(path) as partial:
        ElementTree.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def _array_element(parent: Any, name: str, values: np.ndarray) -> None:
    """One array: its length in bytes and its bytes, little-endian, in base64."""
    code = "u1" if values.dtype == np.uint8 else "i8" if values.dtype.kind in "iub" else "f8"
    content = np.ascontiguousarray(values, dtype=f"<{code}").tobytes()
    attributes = {"type": _TYPE_NAMES[code], "Name": name, "format": "binary"}
    if values.ndim == 2:
        attributes["NumberOfComponents"] = str(values.shape[1])
    array = ElementTree.SubElement(parent, "DataArray", attributes)
    array.text = base64.b64encode(len(content).to_bytes(8, "little") + content).decode()


def write_vtu(
    folder: Path, response: Response, mesh: Mesh, solid: Solid | None, *, every: int = 1
) -> list[Path]:
    """Write the mesh of one simulation at its surface times.

    `mesh.pvd` lists the series with its times. ``response``: a batch with nodes. ``mesh``: its undeformed
    mesh. ``solid``: the material; without it no pressure, stress and energy are written. ``every``: write
    every n-th surface time, starting with the first. Returns: the VTU files written, then `mesh.pvd`. Points
    are (r, y, 0) [m] with the displacement [m] from the first surface time and the `FIELDS` of films. The
    series ends where the simulation ended. Raises ValueError if the response has no nodes, if `every` is
    below 1, or if the mesh has other nodes.
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


def write_vtp(folder: Path, body: Body, name: str = "specimen") -> list[Path]:
    """Write the valid points of every frame, joined to triangles over their grid.

    `<name>.pvd` lists the series with its times. A triangle with a lost corner is left out. Returns: the VTP
    files written, then the listing. Points are (x, y, Z) [m]. Their data are displacement and sigma [m],
    epipolar distance and standard deviation of a match [px], correlation, and point number.
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

    return _write_frames(Path(folder), name, ".vtp", surface, triangles, fields)


def _write_frames(
    folder: Path,
    name: str,
    suffix: str,
    surface: SurfaceHistory,
    triangles: NDArray[np.int64],
    fields: Callable[[int, BoolArray], dict[str, np.ndarray]],
) -> list[Path]:
    """Write one file per frame, and the listing. A triangle is written if all its corners are valid."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}_{frame:05d}{suffix}" for frame in range(surface.n_frames)]
    for frame, path in enumerate(files):
        valid = surface.valid[frame]
        points, data = surface.position[frame, valid], fields(frame, valid) | {"point": np.flatnonzero(valid)}
        faces = (np.cumsum(valid) - 1)[triangles[valid[triangles].all(axis=1)]]
        if suffix == ".vtp":
            write_surface(path, points, faces, data)
        else:
            write_grid(path, points, faces, TRIANGLE, data)
    listing = folder / f"{name}.pvd"
    write_series(listing, list(surface.t), files)
    return [*files, listing]


def write_full_field_vtu(folder: Path, result: FullField) -> list[Path]:
    """Write the valid points of every frame of a full-field result, joined to triangles over their grid.

    ``folder``: folder; created if absent. `field.pvd` lists the series with its times. ``result``: the
    result. A triangle with a lost corner is left out. Returns: the VTU files written, then the listing.
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

    return _write_frames(Path(folder), "field", ".vtu", surface, triangles, fields)


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
