"""Meshes of other programs: plane meshes of Gmsh 2.2 (text), and solid bodies by meshio."""

import hashlib
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.files import decode, read_bytes
from kolsky.readers.contents import LARGEST_SAMPLE

GMSH_SIZE_LIMIT = 500_000_000
"""Largest file that is read [bytes]."""
SURFACES = {2: 3, 3: 4, 9: 6, 10: 9, 16: 8}
"""Number of points of surface elements by Gmsh's element number: triangles, quadrilaterals, and their
quadratic forms."""
CURVES = {1: 2, 8: 3}
"""Number of points of curve elements."""
POINTS = {**SURFACES, **CURVES, 15: 1, 4: 4, 5: 8, 11: 10}
"""Number of points of all supported elements."""
CURE = "save the mesh in Gmsh as Version 2 ASCII (-format msh22)"


@dataclass(frozen=True)
class GmshMesh:
    """A plane mesh as in the file."""

    points: FloatArray
    """In the file's unit, shape [n, 2]."""
    cells: IntArray
    """Points of each cell, shape [m, k]."""
    point_groups: dict[str, IntArray]
    """Points on each named group of curves."""
    cell_groups: dict[str, IntArray]
    """Cells in each named group of surfaces."""
    numbers: IntArray
    """Number of each cell in the file, shape [m]."""
    sha256: str
    """SHA-256 of the file, hex."""


def read_gmsh(path: Path) -> GmshMesh:
    """Read a mesh.

    Raises InputError if the file cannot be read, is of another format or is not flat. The same error is
    raised if it has no surface elements, or several kinds of them.
    """
    raw = read_bytes(path, limit=GMSH_SIZE_LIMIT)
    blocks = blocks_of(path, decode(path, raw).splitlines())
    names = names_of(path, blocks)
    rows, place, elements = _points_and_elements(path, blocks)
    if np.ptp(rows[:, 3]) > 0.0:
        raise InputError(path, "is not flat: its points have several z", cure="mesh it in the plane z = 0")
    surfaces = [row for row in elements if row[1] in SURFACES]
    kinds = {row[1] for row in surfaces}
    if len(kinds) != 1:
        raise InputError(
            path, f"has {len(kinds)} kinds of surface elements; one is needed", cure="mesh with one kind"
        )
    cells, cell_groups = _numbered(surfaces, place, 2, names)
    point_groups = {}
    curves = [row for row in elements if row[1] in CURVES]
    for group in {group_of(row) for row in curves}:
        named = names.get((1, group), str(group))
        found = {place[n] for row in curves if group_of(row) == group for n in row[3 + row[2] :]}
        point_groups[named] = np.array(sorted(found), dtype=np.int64)
    numbers = np.array([row[0] for row in surfaces])
    sha256 = hashlib.sha256(raw).hexdigest()
    return GmshMesh(rows[:, 1:3], cells, point_groups, cell_groups, numbers, sha256)


def blocks_of(path: Path, lines: list[str]) -> dict[str, list[str]]:
    """The lines of each block by its name."""
    blocks: dict[str, list[str]] = {}
    name = ""
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if text.startswith("$End"):
            name = ""
        elif text.startswith("$"):
            name = text[1:]
            blocks[name] = []
        elif name:
            blocks[name].append(text)
        elif text:
            raise InputError(path, f"has a line outside of its blocks: {text[:40]!r}", line=number, cure=CURE)
    return blocks


def names_of(path: Path, blocks: dict[str, list[str]]) -> dict[tuple[int, int], str]:
    """Names of the physical groups by dimension and number. Raises `InputError` for another format."""
    if not (blocks.get("MeshFormat") or [""])[0].startswith("2."):
        raise InputError(path, "is not a Gmsh mesh of format 2", cure=CURE)
    names = {}
    try:
        for line in _counted(path, "PhysicalNames", blocks.get("PhysicalNames", ["0"])):
            dimension, number, name = line.split(maxsplit=2)
            names[int(dimension), int(number)] = name.strip('"')
    except ValueError as error:
        raise InputError(path, f"has a group that cannot be read: {error}", cure=CURE) from None
    return names


def _points_and_elements(
    path: Path, blocks: dict[str, list[str]]
) -> tuple[FloatArray, dict[int, int], list[list[int]]]:
    """Points with their numbers, shape [n, 4], the row of each number, and the lines of the elements."""
    try:
        rows = np.array([line.split() for line in _counted(path, "Nodes", blocks["Nodes"])], dtype=np.float64)
        elements = [
            [int(word) for word in line.split()] for line in _counted(path, "Elements", blocks["Elements"])
        ]
    except (KeyError, ValueError) as error:
        raise InputError(path, f"cannot be read as a Gmsh mesh: {error}", cure=CURE) from None
    if rows.ndim != 2 or rows.shape[1] != 4 or not (np.abs(rows) <= LARGEST_SAMPLE).all():
        raise InputError(path, "has points that are not a number and three coordinates", cure=CURE)
    place = {int(number): k for k, number in enumerate(rows[:, 0])}
    if len(place) < len(rows):
        raise InputError(path, "gives two points one number", cure=CURE)
    for row in elements:
        tags = row[2] if len(row) > 3 else -1
        points = row[3 + tags :]
        if tags < 0 or not points or len(points) != POINTS.get(row[1], len(points)):
            raise InputError(path, f"has the element {row[:12]}, which is invalid", cure=CURE)
        if not all(point in place for point in points):
            raise InputError(path, f"has the element {row[0]} with points that do not exist", cure=CURE)
    return rows, place, elements


def _counted(path: Path, name: str, lines: list[str]) -> list[str]:
    """The lines of a block after the line with their number. The number is checked."""
    said = lines[0] if lines else ""
    if not said.isdecimal() or int(said[:12]) != len(lines) - 1:
        raise InputError(
            path, f"states {said[:20]!r} for the {len(lines) - 1} lines of ${name}: is it cut off?", cure=CURE
        )
    return lines[1:]


def group_of(row: list[int]) -> int:
    """Physical group of an element; 0 if it is in none."""
    return row[3] if row[2] else 0


def _numbered(
    rows: list[list[int]], place: dict[int, int], dimension: int, names: dict[tuple[int, int], str]
) -> tuple[IntArray, dict[str, IntArray]]:
    cells = np.array([[place[n] for n in row[3 + row[2] :]] for row in rows], dtype=np.int64)
    groups = np.array([group_of(row) for row in rows])
    found = {
        names.get((dimension, int(group)), str(group)): np.flatnonzero(groups == group)
        for group in np.unique(groups)
    }
    return cells, found


BODIES = {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8", "hexahedron27": "hex27"}
"""Element by meshio's name of a cell."""


@dataclass(frozen=True)
class BodyMesh:
    """A mesh of a body as in the file."""

    points: FloatArray
    """In the file's unit, shape [n, 3]."""
    cells: IntArray
    """Points of each cell in the order of VTK, shape [m, k]."""
    kind: str
    """tet4, tet10, hex8 or hex27."""
    groups: dict[str, IntArray]
    """Points on each named group."""
    numbers: IntArray
    """Number of each cell in the file, shape [m]. Elements of all kinds are counted in order, as in these
    programs: from 1 in Gmsh files, from 0 in VTU files."""
    sha256: str
    """SHA-256 of the file, hex."""


def read_body(path: Path) -> BodyMesh:
    """Read a mesh of a body: Gmsh 2 or 4.1 (.msh), or VTK's XML (.vtu), by meshio.

    Groups are Gmsh's physical groups of surfaces, curves and points. In a VTU file, they are masks in the
    point data with names that begin with "set:". Points without cells are left out.

    Raises InputError if the file cannot be read, or if it has no volume elements or several kinds of them.
    """
    import meshio  # heavy

    sha256 = hashlib.sha256(read_bytes(path, limit=GMSH_SIZE_LIMIT)).hexdigest()
    reader = {".msh": meshio.gmsh.read, ".vtu": meshio.vtu.read}.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            path, f"ends in {path.suffix!r}", allowed=".msh, .vtu", cure="save it as one of them"
        )
    try:
        found = reader(str(path))
    except (meshio.ReadError, ValueError, LookupError, TypeError, AttributeError, AssertionError) as error:
        words = " ".join(str(error).split())[:120] or type(error).__name__
        cure = "save it again: MSH of Gmsh 2 or 4.1, or VTU"
        raise InputError(path, f"cannot be read as a mesh: {words}", cure=cure) from None
    except (OSError, EOFError, SyntaxError, struct.error, zlib.error) as error:
        raise InputError(
            path, f"cannot be read as a mesh: {error}", cure="save it again: is it cut?"
        ) from None
    kinds = sorted({block.type for block in found.cells if block.dim == 3})
    if len(kinds) != 1 or kinds[0] not in BODIES:
        raise InputError(
            path,
            f"has {', '.join(kinds) or 'no'} volume elements; one kind is needed",
            allowed="tetrahedra with 4 or 10 points, or hexahedra with 8 or 27",
            cure="mesh it in 3-D with one kind",
        )
    points = np.asarray(found.points, dtype=np.float64)
    if points.shape[1:] != (3,) or not (np.abs(points) <= LARGEST_SAMPLE).all():
        raise InputError(path, "has points that are not three coordinates", cure="save it again")
    cells = np.concatenate([block.data for block in found.cells if block.type == kinds[0]])
    of_kind = np.concatenate([np.full(len(block.data), block.type == kinds[0]) for block in found.cells])
    numbers = np.flatnonzero(of_kind) + (path.suffix.lower() == ".msh")
    used, cells = np.unique(cells, return_inverse=True)
    place = np.full(len(points), -1)
    place[used] = np.arange(len(used))
    groups = {
        name: place[members][place[members] >= 0]
        for name, members in _groups_of(found).items()
        if len(members)
    }
    shape = (-1, len(next(b for b in found.cells if b.type == kinds[0]).data[0]))
    cells = cells.reshape(shape).astype(np.int64)
    return BodyMesh(points[used], cells, BODIES[kinds[0]], groups, numbers, sha256)


def _groups_of(found: Any) -> dict[str, IntArray]:
    """Points of each group of a mesh that meshio read."""
    groups: dict[str, list[IntArray]] = {}
    names = {(int(value[1]), int(value[0])): name for name, value in found.field_data.items()}
    physical = found.cell_data.get("gmsh:physical", [])
    for block, tags in zip(found.cells, physical, strict=False):
        for tag in np.unique(tags) if block.dim < 3 else ():
            if tag > 0:  # 0: of no group
                name = names.get((block.dim, int(tag)), str(tag))
                groups.setdefault(name, []).append(block.data[np.asarray(tags) == tag].ravel())
    for name, values in found.point_data.items():
        if name.startswith("set:"):
            groups.setdefault(name.removeprefix("set:"), []).append(np.flatnonzero(values))
    return {name: np.unique(np.concatenate(parts)) for name, parts in groups.items()}
