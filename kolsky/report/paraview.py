"""Simulated meshes (VTU) and measured surfaces (VTP) as series of files for ParaView."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.full_field.result import FullField
from dic.result import Body
from explicit import Response
from kolsky.report.vtk_files import QUAD, TRIANGLE, write_grid, write_series, write_surface


def write_vtu(
    folder: Path, response: Response, quads: NDArray[np.integer], *, sample: int = 0, every: int = 1
) -> list[Path]:
    """Write the mesh of one simulation at its surface times.

    Parameters
    ----------
    folder : Path
        Folder; created if absent. `mesh.pvd` lists the series with its times.
    response : Response
        A batch that kept its nodes.
    quads : array
        Corner nodes of each element, shape [n_elements, 4].
    sample : int
        Row of the batch.
    every : int
        Write one surface time in this many, the first included.

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
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written, times = [], []
    for k in range(0, len(response.surface_times), every):
        if not np.isfinite(nodes[k]).all():
            break
        path = folder / f"mesh_{k:05d}.vtu"
        write_grid(
            path, _in_space(nodes[k]), quads, QUAD, {"displacement [m]": _in_space(nodes[k] - nodes[0])}
        )
        written.append(path)
        times.append(response.surface_times[k])
    listing = folder / "mesh.pvd"
    write_series(listing, times, written)
    return [*written, listing]


def _in_space(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([plane, np.zeros(len(plane))])


def write_vtp(folder: Path, body: Body, name: str = "specimen") -> list[Path]:
    """Write the valid points of every frame, joined to triangles over their grid.

    Parameters
    ----------
    folder : Path
        Folder; created if absent. `<name>.pvd` lists the series with its times.
    body : Body
        The points. A triangle with a lost corner is left out.
    name : str
        Beginning of the files' names.

    Returns
    -------
    list of Path
        The VTP files written, then the listing. Points are (x, y, Z) [m]; their data are displacement and
        sigma [m], the epipolar distance and the standard deviation of a match [px], the correlation and the
        point's number.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    surface, triangles = body.surface, grid_triangles(body.cell)
    written = []
    for frame in range(surface.n_frames):
        valid = surface.valid[frame]
        number = np.cumsum(valid) - 1
        kept = triangles[valid[triangles].all(axis=1)]
        fields = {
            "displacement [m]": surface.u[frame, valid],
            "sigma [m]": surface.sigma[frame, valid],
            "epipolar distance [px]": body.epipolar[frame, valid],
            "sigma of the match [px]": np.fmax(*(s[frame, valid] for s in body.match_sigma)),
            "correlation": np.fmin(*(z[frame, valid] for z in body.zncc)),
            "point": np.flatnonzero(valid),
        }
        path = folder / f"{name}_{frame:05d}.vtp"
        write_surface(path, surface.position[frame, valid], number[kept], fields)
        written.append(path)
    listing = folder / f"{name}.pvd"
    write_series(listing, list(surface.t), written)
    return [*written, listing]


def write_full_field_vtu(folder: Path, result: FullField) -> list[Path]:
    """Write the valid points of every frame of a full-field result, joined to triangles over their grid.

    Parameters
    ----------
    folder : Path
        Folder; created if absent. `field.pvd` lists the series with its times.
    result : FullField
        The result. A triangle with a lost corner is left out.

    Returns
    -------
    list of Path
        The VTU files written, then the listing. Points are the current places in the result's unit; their
        data are displacement and sigma in that unit, the strains xx, yy, xy (NaN where there is none), the
        lowest correlation and the point's number.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    surface, triangles = result.surface, grid_triangles(result.cell)
    if result.kind == "plane":  # y runs down there: keep the normals toward the camera
        triangles = triangles[:, ::-1]
    written = []
    for frame in range(surface.n_frames):
        valid = surface.valid[frame]
        number = np.cumsum(valid) - 1
        kept = number[triangles[valid[triangles].all(axis=1)]]
        fields = {
            f"displacement [{result.unit}]": surface.u[frame, valid],
            f"sigma [{result.unit}]": surface.sigma[frame, valid],
            "strain xx, yy, xy": result.strain.value[frame, valid],
            "correlation": result.zncc[:, frame, valid].min(axis=0),
            "point": np.flatnonzero(valid),
        }
        path = folder / f"field_{frame:05d}.vtu"
        write_grid(path, surface.position[frame, valid], kept, TRIANGLE, fields)
        written.append(path)
    listing = folder / "field.pvd"
    write_series(listing, list(surface.t), written)
    return [*written, listing]


def grid_triangles(cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return two triangles for every square of four neighbouring points of a grid.

    Parameters
    ----------
    cell : array of int
        Column and row of each point, shape [n_points, 2].

    Returns
    -------
    array of int
        Points of each triangle, counter-clockwise seen from the cameras, shape [n_triangles, 3].
    """
    if len(cell) == 0:
        return np.empty((0, 3), dtype=np.int64)
    low = cell.min(axis=0)
    table = np.full(tuple(cell.max(axis=0) - low + 2), -1, dtype=np.int64)
    table[tuple((cell - low).T)] = np.arange(len(cell))
    a, b, c, d = table[:-1, :-1], table[1:, :-1], table[1:, 1:], table[:-1, 1:]
    whole = (a >= 0) & (b >= 0) & (c >= 0) & (d >= 0)
    a, b, c, d = (corner[whole] for corner in (a, b, c, d))
    # Rows count downward in a picture, so a, d, c turns counter-clockwise.
    return np.concatenate([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
