"""Meshes of other programs, by meshio: plane sheets and solid bodies from Gmsh and VTU files."""

import hashlib
import re
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.files import read_bytes
from kolsky.readers.contents import LARGEST_SAMPLE

MESH_SIZE_LIMIT = 500_000_000
"""Largest file that is read [bytes]."""
POINTS = {1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 15: 1, 16: 8}
"""Number of points of an element by Gmsh's number of its kind."""
KINDS = {
    2: {name: name for name in ("triangle", "quad", "triangle6", "quad9", "quad8")},
    3: {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8", "hexahedron27": "hex27"},
}
"""Dimension of a mesh -> its element by meshio's name of a cell."""
CURES = {2: "mesh it in the plane z = 0 with one kind", 3: "mesh it in 3-D with one kind"}


@dataclass(frozen=True)
class MeshFile:
    """A mesh as in the file. Points without cells are left out."""

    points: FloatArray
    """In the file's unit, shape [n, 2] for a sheet, [n, 3] for a body."""
    cells: IntArray
    """Points of each cell in the order of VTK, shape [m, k]."""
    kind: str
    """A value of `KINDS`."""
    groups: dict[str, IntArray]
    """Points on each named group of surfaces, curves or points."""
    cell_groups: dict[str, IntArray]
    """Cells in each named group of cells."""
    numbers: IntArray
    """Number of each cell among all of the file, shape [m]: from 1 in Gmsh files, from 0 in VTU files."""
    sha256: str


def read_mesh(path: Path, *, dimension: int) -> MeshFile:
    """Read a mesh: Gmsh 2 or 4.1 (.msh), or VTK's XML (.vtu).

    Groups are Gmsh's physical groups. In a VTU file, they are masks "set:NAME" in the point data.

    ``dimension``: 2 for a sheet in the plane z = 0, 3 for a body. Raises InputError if the file cannot be
    read, if it has no elements of this dimension or several kinds of them, or if a sheet is not flat.
    """
    import meshio  # heavy

    data = read_bytes(path, limit=MESH_SIZE_LIMIT)
    reader = {".msh": meshio.gmsh.read, ".vtu": meshio.vtu.read}.get(path.suffix.lower())
    if reader is None:
        message = f"ends in {path.suffix!r}"
        raise InputError(path, message, allowed=".msh, .vtu", cure="save it as one of them")
    try:
        _check_elements(data)
        found = reader(str(path))
    except (meshio.ReadError, ValueError, LookupError, TypeError, AttributeError, AssertionError) as error:
        words = " ".join(str(error).split())[:120] or type(error).__name__
        cure = "save it again: MSH of Gmsh 2 or 4.1, or VTU"
        raise InputError(path, f"cannot be read as a mesh: {words}", cure=cure) from None
    except (OSError, EOFError, SyntaxError, struct.error, zlib.error) as error:
        message = f"cannot be read as a mesh: {error}"
        raise InputError(path, message, cure="save it again: is it cut?") from None
    kinds = sorted({block.type for block in found.cells if block.dim == dimension})
    if len(kinds) != 1 or kinds[0] not in KINDS[dimension]:
        raise InputError(
            path,
            f"has {', '.join(kinds) or 'no'} {'surface' if dimension == 2 else 'volume'} elements; one kind "
            "is needed",
            allowed=", ".join(KINDS[dimension].values()),
            cure=CURES[dimension],
        )
    points = np.asarray(found.points, dtype=np.float64)
    if points.shape[1:] != (3,) or not (np.abs(points) <= LARGEST_SAMPLE).all():
        raise InputError(path, "has points that are not three coordinates", cure="save it again")
    if dimension == 2 and np.ptp(points[:, 2]) > 0.0:
        raise InputError(path, "is not flat: its points have several z", cure=CURES[2])
    chosen = [k for k, block in enumerate(found.cells) if block.type == kinds[0]]
    of_kind = np.concatenate([np.full(len(b.data), b.type == kinds[0]) for b in found.cells])
    numbers = np.flatnonzero(of_kind) + (path.suffix.lower() == ".msh")
    used, cells = np.unique(np.concatenate([found.cells[k].data for k in chosen]), return_inverse=True)
    place = np.full(len(points), -1)
    place[used] = np.arange(len(used))
    names = {(int(value[1]), int(value[0])): name for name, value in found.field_data.items()}
    tags = found.cell_data.get("gmsh:physical")
    cell_groups = {}
    if tags is not None:
        of_cell = np.concatenate([tags[k] for k in chosen])
        cell_groups = {
            names.get((dimension, int(tag)), str(tag)): np.flatnonzero(of_cell == tag)
            for tag in np.unique(of_cell)
        }
    return MeshFile(
        points=points[used, :dimension],
        cells=cells.reshape((len(numbers), -1)).astype(np.int64),
        kind=KINDS[dimension][kinds[0]],
        groups={
            name: place[members][place[members] >= 0]
            for name, members in _groups_of(found, names, dimension).items()
            if len(members)
        },
        cell_groups=cell_groups,
        numbers=numbers,
        sha256=hashlib.sha256(data).hexdigest(),
    )


def _check_elements(data: bytes) -> None:
    """Check the words of each element in a text of Gmsh 2; meshio would take a tag for a missing point."""
    if not re.match(rb"\s*\$MeshFormat\s+2\S*\s+0\s", data):
        return
    for line in data.partition(b"$Elements")[2].partition(b"$End")[0].splitlines()[2:]:
        words = [int(word) for word in line.split()]
        points = POINTS.get(words[1])
        if points is not None and len(words) != 3 + words[2] + points:
            raise ValueError(f"its element {words[0]} has {len(words)} words")


def _groups_of(found: Any, names: dict[tuple[int, int], str], dimension: int) -> dict[str, IntArray]:
    """Points of each group of a lower dimension than the mesh."""
    groups: dict[str, list[IntArray]] = {}
    physical = found.cell_data.get("gmsh:physical", [])
    for block, tags in zip(found.cells, physical, strict=False):
        for tag in np.unique(tags) if block.dim < dimension else ():
            if tag > 0:  # 0: of no group
                name = names.get((block.dim, int(tag)), str(tag))
                groups.setdefault(name, []).append(block.data[np.asarray(tags) == tag].ravel())
    for name, values in found.point_data.items():
        if name.startswith("set:"):
            groups.setdefault(name.removeprefix("set:"), []).append(np.flatnonzero(values))
    return {name: np.unique(np.concatenate(parts)) for name, parts in groups.items()}
