"""VTK's XML files of one mesh or surface, and the listing of a series; written without VTK.

The format is that of the chapter "VTK XML Formats" of the VTK User's Guide: arrays in base64, each behind its
length in bytes. VTK itself weighs more than everything else together, and a file needs none of it.
"""

import base64
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dic.files import replacing
from kolsky.base.arrays import FloatArray

QUAD, TRIANGLE = 9, 5
"""Numbers of two cell types in VTK."""
NAMES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}
"""Types of VTK by those of NumPy, byte order left out."""


def write_grid(
    path: Path, points: FloatArray, cells: np.ndarray, kind: int, fields: Mapping[str, np.ndarray]
) -> None:
    """Write an unstructured grid (VTU) whose cells are all of one type.

    Parameters
    ----------
    path
        File to write, complete or not at all.
    points
        Coordinates, shape [n, 3].
    cells
        Points of each cell in VTK's order, shape [m, k]; m may be 0.
    kind
        Number of the cell type in VTK.
    fields
        Values at the points by name, shape [n] or [n, components].

    Raises
    ------
    ValueError
        If a field or the points do not have one row per point, or a cell names a point that is not there.
    """
    _check(points, cells, fields)
    piece = {"NumberOfPoints": str(len(points)), "NumberOfCells": str(len(cells))}
    kinds = np.full(len(cells), kind, dtype=np.uint8)
    _write(path, "UnstructuredGrid", piece, points, fields, {"Cells": (cells, kinds)})


def write_surface(
    path: Path, points: FloatArray, faces: np.ndarray, fields: Mapping[str, np.ndarray]
) -> None:
    """Write a surface (VTP): points, each a vertex where there are no faces, and polygons of one size.

    Parameters
    ----------
    path, points, fields
        As of `write_grid`.
    faces
        Points of each polygon, shape [m, k]; m may be 0.

    Raises
    ------
    ValueError
        As of `write_grid`.
    """
    _check(points, faces, fields)
    vertices = np.zeros((0, 1), dtype=np.int64) if len(faces) else np.arange(len(points))[:, None]
    piece = {
        "NumberOfPoints": str(len(points)),
        "NumberOfVerts": str(len(vertices)),
        "NumberOfLines": "0",
        "NumberOfStrips": "0",
        "NumberOfPolys": str(len(faces)),
    }
    _write(path, "PolyData", piece, points, fields, {"Verts": (vertices, None), "Polys": (faces, None)})


def write_series(path: Path, times: Sequence[float], files: Sequence[Path]) -> None:
    """Write the listing (PVD) of files in the same folder, with the time [s] of each."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    series = ElementTree.SubElement(root, "Collection")
    for time, file in zip(times, files, strict=True):
        ElementTree.SubElement(series, "DataSet", timestep=repr(float(time)), part="0", file=file.name)
    with replacing(path) as partial:
        ElementTree.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def _check(points: FloatArray, cells: np.ndarray, fields: Mapping[str, np.ndarray]) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must have shape [n, 3], got {points.shape}")
    if cells.size and not (cells.min() >= 0 and cells.max() < len(points)):
        raise ValueError(f"cells must name points 0 to {len(points) - 1}, got {cells.min()} to {cells.max()}")
    for name, values in fields.items():
        if len(values) != len(points):
            raise ValueError(f"field {name!r} must have one row per point, {len(points)}, got {len(values)}")


def _write(
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
        _array(data, name, np.asarray(values))
    _array(ElementTree.SubElement(inside, "Points"), "Points", points)
    for group, (table, kinds) in cells.items():
        parent = ElementTree.SubElement(inside, group)
        _array(parent, "connectivity", table.ravel().astype(np.int64))
        _array(parent, "offsets", table.shape[1] * np.arange(1, len(table) + 1, dtype=np.int64))
        if kinds is not None:
            _array(parent, "types", kinds)
    with replacing(path) as partial:
        ElementTree.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def _array(parent: Any, name: str, values: np.ndarray) -> None:
    """One array: its length in bytes and its bytes, little-endian, in base64."""
    code = "u1" if values.dtype == np.uint8 else "i8" if values.dtype.kind in "iub" else "f8"
    content = np.ascontiguousarray(values, dtype=f"<{code}").tobytes()
    attributes = {"type": NAMES[code], "Name": name, "format": "binary"}
    if values.ndim == 2:
        attributes["NumberOfComponents"] = str(values.shape[1])
    array = ElementTree.SubElement(parent, "DataArray", attributes)
    array.text = base64.b64encode(len(content).to_bytes(8, "little") + content).decode()
