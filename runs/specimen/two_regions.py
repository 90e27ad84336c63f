"""Made data of a sheet of two materials, both fitted: the mesh of others, the field and the force by FElupe.

Usage: python runs/specimen/two_regions.py MESH OUT, then kolsky specimen fit OUT/both_free.toml

MESH is a keloid mesh of Sutula and others (2020), such as skin_keloid/mesh/12125.msh. FElupe (in the extra
"test") solves plane strain with quadratic triangles, `kolsky` with the linear ones of the file.
"""

import shutil
import sys
from pathlib import Path

import felupe
import meshio
import numpy as np

from kolsky.bodies.sheet import project

TRUE = {"keloid": (80e-3, 0.4), "skin": (30e-3, 0.25)}
"""E [N/mm2] and Poisson's ratio of each group."""
PAD = (-0.7, -1.4, -2.1)
"""Displacements of the moving pad along x [mm]."""
NOISE, FORCE_NOISE = 5e-3, 0.5e-3
"""Standard deviations of a displacement [mm] and of the force [N]."""
SPEC = """# Two materials, both fitted; made by runs/specimen/two_regions.py.
[material]
law = "neo_hookean_coupled"
free = ["E", "poisson"]
poisson = 0.3
constants = { E = "50 kPa" }

[field]
mesh = "mesh.msh"
mesh_unit = "mm"
thickness = "1 mm"
kinematics = "plane_strain"
moving = ["moving_pad_keloid", "moving_pad_skin"]
fixed = ["fixed_pad_keloid", "fixed_pad_skin"]
frames = [1, 2, 3]
sigma_displacement = "5 um"
sigma_force = "0.5 mN"
region = "keloid"

[field.regions.skin]
constants = { E = "50 kPa" }
poisson = 0.3
free = ["E", "poisson"]

[field.points]
file = "points.csv"
x = { column = "x (mm)", unit = "mm" }
y = { column = "y (mm)", unit = "mm" }
ux = { column = "ux (mm)", unit = "mm" }
uy = { column = "uy (mm)", unit = "mm" }

[field.pad]
file = "pad.csv"
displacement = { column = "pad (mm)", unit = "mm" }
force = { column = "force (N)", unit = "N" }
"""


def simulated(path: Path) -> tuple[np.ndarray, list[np.ndarray], list[float]]:
    """Points of the quadratic triangles [mm], their displacements [mm] and the force on the pad [N]."""
    read = meshio.read(path)
    marks = {kind: read.cell_data_dict["gmsh:physical"][kind] for kind in ("line", "triangle")}
    cells = read.cells_dict["triangle"]
    mesh = felupe.mesh.add_midpoints_edges(felupe.Mesh(read.points[:, :2], cells, "triangle"))
    middle = {}
    for k, (a, b) in enumerate(((0, 1), (1, 2), (2, 0)), start=3):
        middle |= {frozenset(cell[[a, b]].tolist()): cell[k] for cell in mesh.cells}

    def on(pad: str) -> np.ndarray:
        """Mask of the points of both groups of a pad."""
        tags = [read.field_data[f"{pad}_pad_{name}"][0] for name in TRUE]
        lines = read.cells_dict["line"][np.isin(marks["line"], tags)]
        mask = np.zeros(mesh.npoints, dtype=bool)
        mask[lines] = True
        mask[[middle[frozenset(line.tolist())] for line in lines]] = True
        return mask

    def field_of(cells: np.ndarray) -> felupe.FieldContainer:
        part = felupe.Mesh(mesh.points, cells, mesh.cell_type)
        return felupe.FieldContainer([felupe.FieldPlaneStrain(felupe.RegionQuadraticTriangle(part), dim=2)])

    field, bodies = field_of(mesh.cells), []
    for name, (young, nu) in TRUE.items():
        own = field_of(mesh.cells[marks["triangle"] == read.field_data[name][0]])
        lam = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        bodies.append(felupe.SolidBody(felupe.NeoHookeCompressible(young / (2.0 * (1.0 + nu)), lam), own))
    sides = {
        "fixed": felupe.Boundary(field[0], mask=on("fixed")),
        "moving": felupe.Boundary(field[0], mask=on("moving"), skip=(1, 0)),
        "move": felupe.Boundary(field[0], mask=on("moving"), skip=(0, 1)),
    }
    displacements, forces = [], []
    step = felupe.Step(items=bodies, ramp={sides["move"]: np.array(PAD)}, boundaries=sides)
    for one in step.generate(x0=field, tol=1e-9, verbose=0):
        displacements.append(one.x[0].values.copy())
        forces.append(float(felupe.tools.force(one.x, one.fun, sides["moving"])[0]))
    return mesh.points, displacements, forces


def main(path: Path, out: Path) -> None:
    """Write the mesh, points.csv, pad.csv and both_free.toml."""
    points, displacements, forces = simulated(path)
    rng = np.random.default_rng(11)
    x, y = np.meshgrid(np.arange(32.0, 68.1, 0.9), np.arange(8.0, 32.1, 0.9), indexing="ij")
    grid = np.stack([x.ravel(), y.ravel()], axis=-1)
    rows = []
    for frame, u in enumerate(displacements, start=1):
        seen = project(points, u, grid) + NOISE * rng.standard_normal(grid.shape)
        rows.append(np.column_stack([np.full(len(grid), frame), grid, seen]))
    force = np.array(forces) + FORCE_NOISE * rng.standard_normal(len(forces))
    pad = np.column_stack([np.arange(1, len(PAD) + 1), PAD, force])
    out.mkdir(parents=True, exist_ok=True)
    for name, table, head in (
        ("points.csv", np.concatenate(rows), "frame,x (mm),y (mm),ux (mm),uy (mm)"),
        ("pad.csv", pad, "frame,pad (mm),force (N)"),
    ):
        np.savetxt(out / name, table, fmt="%.9g", delimiter=",", header=head, comments="")
    shutil.copyfile(path, out / "mesh.msh")
    (out / "both_free.toml").write_text(SPEC, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
