"""Unstructured meshes in VTK's files (VTU, VTK), as PyVista reads them."""

import hashlib
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.readers.text import read_bytes

SIZE_LIMIT = 500_000_000
"""Largest file that is read [bytes]."""


def read_vtu(path: Path) -> tuple[Any, str]:
    """Read a file: PyVista's unstructured grid, and the SHA-256 of the file, hex.

    Raises
    ------
    InputError
        If it cannot be read or holds no unstructured grid.
    """
    import pyvista  # heavy

    sha256 = hashlib.sha256(read_bytes(path, limit=SIZE_LIMIT)).hexdigest()
    try:
        grid = pyvista.read(path)
    except (ValueError, OSError, RuntimeError, ImportError) as error:
        raise InputError(path, f"cannot be read: {error}", cure="save a VTU file, or MSH of Gmsh") from None
    if not isinstance(grid, pyvista.UnstructuredGrid):
        raise InputError(path, "holds no unstructured grid", cure="save cells, not a surface")
    return grid, sha256
