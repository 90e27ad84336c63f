"""Meshes of bodies of Gmsh, format 2.2 in text: points, tetrahedra or hexahedra, and named surfaces."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.readers.gmsh_mesh import SIZE_LIMIT, blocks_of, group_of, names_of, points_and_elements
from kolsky.readers.text import decode, read_bytes

VOLUMES = {4: ("tet4", (0, 1, 2, 3)), 5: ("hex8", tuple(range(8))), 11: ("tet10", (*range(8), 9, 8))}
"""Element and order of its points in VTK's, by Gmsh's number."""
SURFACES = (2, 3, 9)
"""Gmsh's numbers of the surface elements that name points."""


@dataclass(frozen=True)
class GmshVolume:
    """A mesh of a body as the file has it."""

    points: FloatArray
    """In the file's unit, shape [n, 3]."""
    cells: IntArray
    """Points of each cell in the order of VTK, shape [m, k]."""
    kind: str
    """tet4, tet10 or hex8."""
    groups: dict[str, IntArray]
    """Points on each named group of surfaces or points."""
    sha256: str
    """SHA-256 of the file, hex."""


def read_gmsh_volume(path: Path) -> GmshVolume:
    """Read a mesh of a body.

    Raises
    ------
    InputError
        If the file cannot be read, is of another format, or has no volume elements or several kinds of them.
    """
    raw = read_bytes(path, limit=SIZE_LIMIT)
    blocks = blocks_of(path, decode(path, raw).splitlines())
    names = names_of(path, blocks)
    rows, place, elements = points_and_elements(path, blocks)
    volumes = [row for row in elements if row[1] in VOLUMES]
    kinds = {row[1] for row in volumes}
    if len(kinds) != 1:
        raise InputError(
            path,
            f"has {len(kinds)} kinds of volume elements; one is needed",
            allowed="tetrahedra with 4 or 10 points, or hexahedra with 8",
            cure="mesh it in 3-D with one kind",
        )
    kind, order = VOLUMES[kinds.pop()]
    cells = np.array([[place[n] for n in row[3 + row[2] :]] for row in volumes], dtype=np.int64)
    found: dict[str, set[int]] = {}
    for row in elements:
        if row[1] in SURFACES or row[1] == 15:
            dimension = 0 if row[1] == 15 else 2
            group = group_of(row)
            named = names.get((dimension, group), str(group))
            found.setdefault(named, set()).update(place[n] for n in row[3 + row[2] :])
    groups = {name: np.array(sorted(points), dtype=np.int64) for name, points in found.items()}
    return GmshVolume(rows[:, 1:4], cells[:, list(order)], kind, groups, hashlib.sha256(raw).hexdigest())
