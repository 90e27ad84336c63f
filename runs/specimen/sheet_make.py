"""Make the data of sheet.toml: a sheet of 60 x 30 mm between two pads, noise of 2 um and 0.2 mN.

Usage: python runs/specimen/sheet_make.py FOLDER
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from kolsky.base.files import write_table
from kolsky.bodies.sheet import Sheet, project
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.meshes import Mesh, rectangle

TRUE = {"E": 30e3, "poisson": 0.3}
PAD = -np.array([1e-3, 2e-3, 3e-3])
"""Displacements of the moving pad [m]."""


def meshed(cells: tuple[int, int]) -> Mesh:
    """The sheet with its pads at the middle 14 mm of its ends."""
    mesh = rectangle((0.06, 0.03), cells, kind="tri3")
    near = np.abs(mesh.points[:, 1] - 0.015) < 7.1e-3
    mesh = mesh.with_set("moving_pad", np.flatnonzero(near & (mesh.points[:, 0] < 1e-9)))
    return mesh.with_set("fixed_pad", np.flatnonzero(near & (mesh.points[:, 0] > 0.06 - 1e-9)))


def write_gmsh(path: Path, mesh: Mesh) -> None:
    """Write the mesh as Gmsh's format 2.2, in mm."""
    rows = []
    for tag, name in enumerate(("moving_pad", "fixed_pad"), start=1):
        nodes = mesh.nodes(name)
        chain = nodes[np.argsort(mesh.points[nodes, 1])]
        rows += [f"1 2 {tag} 0 {a + 1} {b + 1}" for a, b in pairwise(chain)]
    rows += [f"2 2 1 0 {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.cells]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "3"]
    lines += ['1 1 "moving_pad"', '1 2 "fixed_pad"', '2 1 "sheet"', "$EndPhysicalNames", "$Nodes"]
    lines += [str(len(mesh.points))]
    lines += [f"{k} {1e3 * x:.9g} {1e3 * y:.9g} 0" for k, (x, y) in enumerate(mesh.points, start=1)]
    lines += ["$EndNodes", "$Elements", str(len(rows))]
    lines += [f"{k} {row}" for k, row in enumerate(rows, start=1)] + ["$EndElements"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main(folder: Path) -> None:
    """Write mesh.msh, points.csv and pad.csv."""
    mesh = meshed((30, 15))
    law = Constants("neo_hookean_coupled", TRUE, ("E", "poisson"))
    sheet = Sheet(mesh, "plane_stress", 1e-3, "moving_pad", "fixed_pad")
    solution = sheet.simulate(law.solid(law.start), pad=PAD)
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(8e-3, 52.1e-3, 2e-3), np.arange(3e-3, 27.1e-3, 2e-3), indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=-1)
    columns: dict[str, list[float]] = {n: [] for n in ("frame", "x (mm)", "y (mm)", "ux (mm)", "uy (mm)")}
    for frame, u in enumerate(solution.displacements, start=1):
        seen = project(mesh.points, u, points) + 2e-6 * rng.standard_normal(points.shape)
        table = (np.full(len(points), frame), *(1e3 * points.T), *np.round(1e3 * seen.T, 6))
        for name, values in zip(columns, table, strict=True):
            columns[name] += values.tolist()
    write_table(folder / "points.csv", columns)
    force = sheet.force(solution) + 0.2e-3 * rng.standard_normal(len(PAD))
    pad = {"frame": [1, 2, 3], "pad (mm)": (1e3 * PAD).tolist(), "force (mN)": (1e3 * force).tolist()}
    write_table(folder / "pad.csv", pad)
    write_gmsh(folder / "mesh.msh", mesh)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    main(Path(sys.argv[1]))
