"""Deformed specimens in three dimensions, rendered by PyVista."""

from pathlib import Path
from typing import Any

import numpy as np

from implicit.integration.geometry import geometry
from implicit.solution import Solution
from kolsky.base.arrays import FloatArray
from kolsky.report.scene.drawing import offscreen_pyvista

SIZE = (1200, 700)
"""Width and height of a still [px]."""
TITLE = "largest stretch of the element"


def largest_stretches(solution: Solution) -> FloatArray:
    """Largest principal stretch of each element's mean deformation at the last step reached, shape [m]."""
    model = solution.model
    of = geometry(model.mesh, kinematics=model.kinematics, thickness=model.thickness, gauss=model.gauss)
    d, u = model.dimension, solution.displacements[solution.reached - 1][model.mesh.cells]
    share = of.volumes / of.volumes.sum(axis=1, keepdims=True)
    F = np.eye(d) + np.einsum("mg,mgkj,mki->mij", share, of.E[..., :d], u, optimize=True)
    return np.asarray(np.linalg.svd(F, compute_uv=False)[:, 0], dtype=np.float64)


def write_still(path: Path, solution: Solution) -> None:
    """Write the specimen at the last step reached, deformed, coloured by the largest stretch, as PNG.

    Raises
    ------
    kolsky.report.scene.drawing.CannotRender
        If PyVista is not installed, or VTK cannot render on this machine.
    """
    pyvista, mesh = offscreen_pyvista(), solution.model.mesh
    moved = mesh.points + solution.displacements[solution.reached - 1]
    points = np.pad(moved, ((0, 0), (0, 3 - moved.shape[1])))
    grid = pyvista.UnstructuredGrid({mesh.element.vtk: mesh.cells}, 1e3 * points)
    grid.cell_data[TITLE] = largest_stretches(solution)
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(SIZE))
    try:
        plotter.set_background("white")
        bar: dict[str, Any] = {"title": f"{TITLE}\n", "position_x": 0.25, "width": 0.5}
        bar |= {"color": "black", "fmt": "%.2f", "n_labels": 5}
        plotter.add_mesh(grid, scalars=TITLE, cmap="viridis", scalar_bar_args=bar)
        extents = " x ".join(f"{edge:.3g}" for edge in 1e3 * np.ptp(moved, axis=0))
        plotter.add_text(
            f"simulated part, deformed: {extents} mm", position="upper_left", color="black", font_size=12
        )
        if mesh.dimension == 2:
            plotter.view_xy()
        else:
            plotter.view_isometric()
        plotter.enable_parallel_projection()
        plotter.camera.zoom(1.3)
        plotter.screenshot(str(path))
    finally:
        plotter.close()
