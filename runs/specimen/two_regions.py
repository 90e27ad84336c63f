"""Synthetic data of a sheet of two materials. The mesh is from the literature; FElupe computes field and
force.

Usage: python runs/specimen/two_regions.py MESH OUT [SEED], then kolsky specimen fit OUT/linear.toml (or
quadratic.toml)

MESH is a keloid mesh of Sutula and others (2020), such as skin_keloid/mesh/12125.msh. FElupe (in the extra
"test") solves plane strain with quadratic triangles. linear.toml fits with the triangles of the file,
quadratic.toml with those of FElupe. SEED is that of the noise (11).
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
constants = {{ E = "50 kPa" }}

[field]
mesh = "{mesh}.msh"
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
constants = {{ E = "50 kPa" }}
poisson = 0.3
free = ["E", "poisson"]

[field.points]
file = "points.csv"
x = {{ column = "x (mm)", unit = "mm" }}
y = {{ column = "y (mm)", unit = "mm" }}
ux = {{ column = "ux (mm)", unit = "mm" }}
uy = {{ column = "uy (mm)", unit = "mm" }}

[field.pad]
file = "pad.csv"
displacement = {{ column = "pad (mm)", unit = "mm" }}
force = {{ column = "force (N)", unit = "N" }}
"""


def quadratic(read: meshio.Mesh) -> tuple[felupe.Mesh, np.ndarray]:
    """The mesh with points in the middle of its edges, and its boundary's lines of three points."""
    mesh = felupe.mesh.add_midpoints_edges(
        felupe.Mesh(read.points[:, :2], read.cells_dict["triangle"], "triangle")
    )
    middle = {}
    for k, (a, b) in enumerate(((0, 1), (1, 2), (2, 0)), start=3):
        middle |= {frozenset(cell[[a, b]].tolist()): cell[k] for cell in mesh.cells}
    lines = read.cells_dict["line"]
    return mesh, np.column_stack([lines, [middle[frozenset(line.tolist())] for line in lines]])


def simulated(
    read: meshio.Mesh, mesh: felupe.Mesh, lines: np.ndarray
) -> tuple[list[np.ndarray], list[float]]:
    """Displacements of the points [mm] and the force on the pad [N] at each of its displacements."""
    marks = read.cell_data_dict["gmsh:physical"]

    def on(pad: str) -> np.ndarray:
        """Mask of the points of both groups of a pad."""
        tags = [read.field_data[f"{pad}_pad_{name}"][0] for name in TRUE]
        return np.isin(np.arange(mesh.npoints), lines[np.isin(marks["line"], tags)])

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
    return displacements, forces


def write_gmsh(path: Path, read: meshio.Mesh, mesh: felupe.Mesh, lines: np.ndarray) -> None:
    """Write the quadratic triangles with the groups of the file, as Gmsh's format 2.2."""
    marks = read.cell_data_dict["gmsh:physical"]
    rows = [
        f"{kind} 2 {mark} {mark} " + " ".join(map(str, points + 1))
        for kind, name, cells in ((8, "line", lines), (9, "triangle", mesh.cells))
        for mark, points in zip(marks[name], cells, strict=True)
    ]
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(read.field_data))]
    text += [f'{dimension} {mark} "{name}"' for name, (mark, dimension) in read.field_data.items()]
    text += ["$EndPhysicalNames", "$Nodes", str(mesh.npoints)]
    text += [f"{k} {x:.12g} {y:.12g} 0" for k, (x, y) in enumerate(mesh.points, start=1)]
    text += ["$EndNodes", "$Elements", str(len(rows))]
    text += [f"{k} {row}" for k, row in enumerate(rows, start=1)] + ["$EndElements"]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")


def main(path: Path, out: Path, seed: int) -> None:
    """Write both meshes, points.csv, pad.csv, linear.toml and quadratic.toml."""
    read = meshio.read(path)
    mesh, lines = quadratic(read)
    displacements, forces = simulated(read, mesh, lines)
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(32.0, 68.1, 0.9), np.arange(8.0, 32.1, 0.9), indexing="ij")
    grid = np.stack([x.ravel(), y.ravel()], axis=-1)
    rows = []
    for frame, u in enumerate(displacements, start=1):
        seen = project(mesh.points, u, grid) + NOISE * rng.standard_normal(grid.shape)
        rows.append(np.column_stack([np.full(len(grid), frame), grid, seen]))
    force = np.array(forces) + FORCE_NOISE * rng.standard_normal(len(forces))
    pad = np.column_stack([np.arange(1, len(PAD) + 1), PAD, force])
    out.mkdir(parents=True, exist_ok=True)
    for name, table, head in (
        ("points.csv", np.concatenate(rows), "frame,x (mm),y (mm),ux (mm),uy (mm)"),
        ("pad.csv", pad, "frame,pad (mm),force (N)"),
    ):
        np.savetxt(out / name, table, fmt="%.9g", delimiter=",", header=head, comments="")
    shutil.copyfile(path, out / "linear.msh")
    write_gmsh(out / "quadratic.msh", read, mesh, lines)
    for name in ("linear", "quadratic"):
        (out / f"{name}.toml").write_text(SPEC.format(mesh=name), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) == 4 else 11)
