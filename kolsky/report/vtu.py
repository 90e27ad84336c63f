"""The deforming mesh as a series of VTU files for ParaView."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from explicit import Response
from kolsky.base.files import replacing

VTK_QUAD = 9


def write_vtu(
    folder: Path, response: Response, quads: NDArray[np.integer], *, sample: int = 0, every: int = 1
) -> list[Path]:
    """Write the mesh of one simulation at its surface times.

    Parameters
    ----------
    folder : Path
        Where to; made if absent. `mesh.pvd` lists the series with its times.
    response : Response
        A batch that kept its nodes.
    quads : array
        Corner nodes of each element, shape [n_elements, 4].
    sample : int
        Row of the batch.
    every : int
        Write every so many surface times, the first included.

    Returns
    -------
    list of Path
        The VTU files written, then `mesh.pvd`. Points are (r, y, 0) [m] with the displacement [m] from
        the first surface time. The series ends where the simulation ended.

    Raises
    ------
    ValueError
        If the response kept no nodes, `sample` or `every` is out of range, or `quads` names a node that
        does not exist.
    """
    if response.nodes is None:
        raise ValueError("the response kept no nodes; ask for them when the simulation is run")
    if not 0 <= sample < response.n_samples:
        raise ValueError(f"sample must be in [0, {response.n_samples - 1}], got {sample}")
    if every < 1:
        raise ValueError(f"every must be >= 1, got {every}")
    nodes = response.nodes[sample]
    quads = np.asarray(quads)
    if quads.ndim != 2 or quads.shape[1] != 4 or quads.min() < 0 or quads.max() >= nodes.shape[1]:
        raise ValueError(
            f"quads must have shape [n_elements, 4] and entries in [0, {nodes.shape[1] - 1}], "
            f"got shape {quads.shape} and entries in [{quads.min()}, {quads.max()}]"
        )
    import pyvista  # heavy, and nothing else of the report needs it

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    cells = np.column_stack([np.full(len(quads), 4), quads]).ravel()
    kinds = np.full(len(quads), VTK_QUAD, dtype=np.uint8)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    series = ElementTree.SubElement(root, "Collection")
    written = []
    for k in range(0, len(response.surface_times), every):
        if not np.isfinite(nodes[k]).all():
            break
        grid = pyvista.UnstructuredGrid(cells, kinds, _in_space(nodes[k]))
        grid.point_data["displacement [m]"] = _in_space(nodes[k] - nodes[0])
        path = folder / f"mesh_{k:05d}.vtu"
        with replacing(path) as partial:
            grid.save(partial)
        ElementTree.SubElement(
            series, "DataSet", timestep=repr(float(response.surface_times[k])), part="0", file=path.name
        )
        written.append(path)
    listing = folder / "mesh.pvd"
    with replacing(listing) as partial:
        ElementTree.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)
    return [*written, listing]


def _in_space(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([plane, np.zeros(len(plane))])
