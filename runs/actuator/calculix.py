"""The bend of an actuator by CalculiX on the same mesh: decks, runs of `ccx`, positions.

Usage: python runs/actuator/calculix.py SPEC OUT [--run] [--ccx ccx]

OUT gets for each direction of gravity in SPEC a deck with 10-node tetrahedra (C3D10, the nodes and cells of
SPEC's own mesh), *HYPERELASTIC, NEO HOOKE with C10 and D1, follower pressure on the cavity's faces and
gravity, in N, mm, MPa, t. With --run `ccx` solves them and OUT/calculix.csv gets the positions of the base's
middle line at each pressure. It knows nothing of `implicit` but the mesh.
"""

import argparse
import subprocess
from pathlib import Path

import numpy as np

from kolsky.actuator.reading import read_actuator
from kolsky.base.files import write_table

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
"""Corners of the faces of a tetrahedron in the order of the manual's faces P1 to P4."""

CONTROLS = (
    # its own limit of the residual, 0.5 % of the mean force, leaves some percent of the bend open
    "*CONTROLS, PARAMETERS=FIELD",
    "1e-6, 1e-4, , , 1e-6",
    "*CONTROLS, PARAMETERS=TIME INCREMENTATION",
    "10, 40, 50, 80, 20, 4",
)


def deck(mesh, cavity, *, c10, d1, density, gravity, pressures) -> str:
    """The text of a deck; moduli in MPa, D1 in 1/MPa, density in t/mm^3, gravity in mm/s^2."""
    # CalculiX has the middle nodes 12 23 13 14 24 34, VTK 12 23 31 14 24 34: the same
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{n}, {x:.12g}, {y:.12g}, {z:.12g}" for n, (x, y, z) in enumerate(1e3 * mesh.points, start=1)]
    lines.append("*ELEMENT, TYPE=C3D10, ELSET=BODY")
    lines += [f"{n}, " + ", ".join(str(k + 1) for k in cell) for n, cell in enumerate(mesh.cells, start=1)]
    for name, where in (("CLAMP", "clamp"), ("MIRROR", "mirror"), ("LINE", "line")):
        if where in mesh.sets:
            lines += [f"*NSET, NSET={name}", *(f"{k + 1}," for k in mesh.sets[where])]
    lines += ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", f"{c10:.9g}, {d1:.9g}"]
    lines += ["*DENSITY", f"{density:.9g}", "*SOLID SECTION, ELSET=BODY, MATERIAL=RUBBER"]
    lines += ["*BOUNDARY", "CLAMP, 1, 3"] + (["MIRROR, 2, 2"] if "mirror" in mesh.sets else [])
    member = np.zeros(len(mesh.points), dtype=bool)
    member[mesh.sets[cavity]] = True
    corners = np.sort(np.concatenate([mesh.cells[:, list(face)] for face in FACES]), axis=1)
    _, inverse, counts = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
    outer = (counts[inverse.ravel()] == 1).reshape(4, -1)
    pressed = []
    middles = {(0, 1): 4, (1, 2): 5, (0, 2): 6, (0, 3): 7, (1, 3): 8, (2, 3): 9}
    for number, face in enumerate(FACES):
        own = list(face)
        edges = ((own[0], own[1]), (own[1], own[2]), (own[0], own[2]))
        own += [middles[tuple(sorted(pair))] for pair in edges]
        for cell in np.flatnonzero(member[mesh.cells[:, own]].all(axis=1) & outer[number]):
            pressed.append((cell + 1, number + 1))
    size = float(np.linalg.norm(gravity))
    direction = np.asarray(gravity) / size
    heavy = f"BODY, GRAV, {size:.9g}, " + ", ".join(f"{c:.9g}" for c in direction)
    for pressure in [0.0, *pressures]:
        lines += ["*STEP, NLGEOM, INC=200", "*STATIC", "0.25, 1., 1e-4, 1.", *CONTROLS, "*DLOAD", heavy]
        if pressure:
            lines += [f"{cell}, P{face}, {1e-6 * pressure:.9g}" for cell, face in pressed]
        lines += ["*NODE PRINT, NSET=LINE, FREQUENCY=1000000", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def positions(path: Path, mesh) -> dict[float, np.ndarray]:
    """Positions of the nodes of the line [mm] at the whole times of a .dat file."""
    found: dict[float, dict[int, list[float]]] = {}
    time = 0.0
    for line in path.read_text().splitlines():
        words = line.split()
        if "displacements" in line:
            time = float(words[-1])
            found[time] = {}
        elif len(words) == 4 and words[0].isdigit():
            found[time][int(words[0]) - 1] = [float(word) for word in words[1:]]
    line = mesh.sets["line"]
    return {time: 1e3 * mesh.points[line] + np.array([rows[n] for n in line]) for time, rows in found.items()}


def main() -> None:
    """Write, run, collect."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("spec", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--run", action="store_true")
    parser.add_argument("--ccx", default="ccx")
    said = parser.parse_args()
    read = read_actuator(said.spec)
    mesh = read.actuator.mesh
    if mesh.kind != "tet10":
        raise SystemExit('the mesh must be of 10-node tetrahedra: [geometry] element = "tet10"')
    mu, bulk = read.actuator.solid.parameters()
    said.out.mkdir(parents=True, exist_ok=True)
    columns: dict[str, list] = {
        name: [] for name in ("gravity", "pressure (Pa)", "node", "x (mm)", "y (mm)", "z (mm)")
    }
    for name, gravity in read.gravities.items():
        path = said.out / f"{name}.inp"
        text = deck(
            mesh,
            read.actuator.cavities[0],
            c10=0.5e-6 * mu,
            d1=2e6 / bulk,
            density=1e-12 * read.actuator.density,
            gravity=1e3 * np.asarray(gravity),
            pressures=read.pressures,
        )
        path.write_text(text)
        if not said.run:
            continue
        subprocess.run([said.ccx, path.stem], cwd=said.out, check=True, stdout=subprocess.DEVNULL)
        for time, where in sorted(positions(path.with_suffix(".dat"), mesh).items()):
            step = round(time)
            pressure = [0.0, *read.pressures][step - 1]
            for node, (x, y, z) in zip(mesh.sets["line"], where, strict=True):
                row = (name, pressure, int(node), float(x), float(y), float(z))
                for column, value in zip(columns.values(), row, strict=True):
                    column.append(value)
    if said.run:
        write_table(said.out / "calculix.csv", columns)


if __name__ == "__main__":
    main()
