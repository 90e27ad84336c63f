"""Equilibria of a stretched strip: time compared with FElupe in the same run, and growth with the size.

    python -m benchmarks.equilibrium                     # 25 515 displacements, 10 steps to 125 %, and a peer
    python -m benchmarks.equilibrium --peer dolfinx --python /usr/bin/python3
    python -m benchmarks.equilibrium --cells 20x5x1 --peer none
    python -m benchmarks.equilibrium --growth 1e4 3e4 1e5 3e5 1e6 --steps 1 --strain 0.125 --peer none \
        --json benchmarks/results/implicit_growth.json --where "name of the machine"
    python -m benchmarks.equilibrium --device cuda             # element kernels on a GPU
    python -m benchmarks.equilibrium --linear amg --growth 1e6 --peer none
    python -m benchmarks.equilibrium --kind tet4 --cells 73x18x8 --peer none   # 63 072 tetrahedra

The strip is that of Schumacher and others (2020): 100 x 25 x 5 mm, bonded at both ends. Its material is a
neo-Hookean rubber with Poisson's ratio 0.45. `--peer felupe` solves the same mesh with the same element, law,
Gauss points and steps. `--peer dolfinx` also does this, with `tests/reference/J_dolfinx.py` and MUMPS. It
needs a Python that has DOLFINx (Debian: python3-dolfinx). All programs use the same number of threads. The
command prints wall time and processor time of both, their ratio and the largest difference of the forces. Set
OMP_NUM_THREADS=1 and run nothing else at the same time; other work has little influence on the ratio of
processor times.
"""

import argparse
import json
import os
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.equilibrium_table import merged
from explicit.arrays import FloatArray
from explicit.materials import LAWS, bulk_modulus
from kolsky.equilibrium.elements import element
from kolsky.equilibrium.meshes import Mesh, box
from kolsky.equilibrium.model import Fixed, Model, Prescribed
from kolsky.equilibrium.sensitivity import direct
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import Newton, solve

SIZE = (0.1, 0.025, 0.005)
"""Size of the strip [m]."""
SHEAR, POISSON = 25e3, 0.45
"""Shear modulus [Pa] and Poisson's ratio."""
STRETCH = 1.25
"""Nominal strain at the last step [-]."""
SETTINGS = ("kind", "device", "linear", "steps", "strain", "where")
"""Options that are stored with a measurement."""
DOLFINX = Path(__file__).resolve().parent.parent / "tests" / "reference" / "J_dolfinx.py"
"""Script of the strip for DOLFINx."""


def strip(cells: tuple[int, ...], kind: str, device: str = "cpu") -> Model:
    """The model."""
    bulk_value = float(bulk_modulus(SHEAR, POISSON))
    solid = Isotropic(LAWS["neo_hookean"].of([SHEAR]), bulk(bulk_value))
    conditions = (Fixed("left"), Fixed("right", (1, 2)), Prescribed("right", 0, "pull"))
    return Model(box(SIZE, cells, kind=kind), solid, conditions, device=device)


def ours(model: Model, pulls: FloatArray, linear: str, *, derivatives: bool) -> dict[str, Any]:
    """Times [s], counts and forces of a solution. The time of its derivatives [s] is 0 without
    derivatives."""
    options = Newton(tolerance=1e-8, linear=linear)
    started, cpu = time.perf_counter(), time.process_time()
    found = solve(model, {"pull": pulls}, newton=options)
    middle, cpu = time.perf_counter(), time.process_time() - cpu
    if derivatives and linear in ("auto", "multifrontal"):
        direct(found)
    ended = time.perf_counter()
    return {
        "displacements": model.n_dofs,
        "outcome": found.outcome.name,
        "seconds": middle - started,
        "processor seconds": cpu,
        "seconds of derivatives": ended - middle,
        "iterations": found.iterations,
        "factorisations": found.factorisations,
        "forces": found.reaction("right")[:, 0].tolist(),
    }


def felupe(mesh: Mesh, pulls: FloatArray) -> dict[str, Any]:
    """The same with FElupe's 27-node hexahedra, law and Newton iteration, as in its manual."""
    import felupe as fem

    name, region_of = {
        "hex27": ("hexahedron27", fem.RegionTriQuadraticHexahedron),
        "hex8": ("hexahedron", fem.RegionHexahedron),
    }[mesh.kind]
    started, cpu = time.perf_counter(), time.process_time()
    region = region_of(fem.Mesh(mesh.points, mesh.cells, cell_type=name))
    field = fem.FieldContainer([fem.Field(region, dim=3)])
    boundaries = {
        "left": fem.Boundary(field[0], fx=0.0),
        "right": fem.Boundary(field[0], fx=SIZE[0], skip=(1, 0, 0)),
        "move": fem.Boundary(field[0], fx=SIZE[0], skip=(0, 1, 1)),
    }
    umat = fem.NeoHooke(mu=SHEAR, bulk=float(bulk_modulus(SHEAR, POISSON)))
    body = fem.SolidBody(umat, field)
    forces = []
    for pull in pulls:
        boundaries["move"].update(pull)
        loadcase = dict(zip(("dof0", "dof1"), fem.dof.partition(field, boundaries), strict=True))
        loadcase["ext0"] = fem.dof.apply(field, boundaries, loadcase["dof0"])
        answer = fem.newtonraphson(items=[body], tol=1e-8, verbose=False, **loadcase)
        inner = body.assemble.vector(answer.x).toarray().reshape(-1, 3)
        forces.append(float(inner[mesh.nodes("right"), 0].sum()))
    return {
        "seconds": time.perf_counter() - started,
        "processor seconds": time.process_time() - cpu,
        "forces": forces,
    }


def dolfinx(cells: tuple[int, ...], kind: str, python: str) -> dict[str, Any]:
    """The same by DOLFINx, possibly in another Python; its forms are compiled before the measurement."""
    order = {"hex27": "2", "hex8": "1"}[kind]
    arguments = [python, str(DOLFINX), "x".join(map(str, cells)), "--order", order]
    started = time.perf_counter()
    said = subprocess.run(arguments, check=True, capture_output=True, text=True).stdout
    return {**json.loads(said.splitlines()[-1]), "seconds": time.perf_counter() - started}


def cells_for(displacements: float, kind: str) -> tuple[int, int, int]:
    """Numbers of cells in the strip's proportions 20 x 5 x 1 for about a given number of displacements."""
    order = int(element(kind).exponents.max())
    best = (20, 5, 1)
    for n in range(1, 80):
        cells = (20 * n, 5 * n, n)
        count = 3 * float(np.prod([order * c + 1 for c in cells]))
        if count > displacements * 1.3:
            break
        best = cells
    return best


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.equilibrium",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--cells", default="40x10x2")
    parser.add_argument("--kind", default="hex27")
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--linear", default="auto", help="see kolsky.equilibrium.linear.solvers")
    parser.add_argument("--peer", choices=("felupe", "dolfinx", "none"), default="felupe")
    parser.add_argument("--python", default="python3", help="a Python that has DOLFINx")
    parser.add_argument("--strain", type=float, default=STRETCH, help="nominal strain at the last step")
    parser.add_argument("--growth", type=float, nargs="*", default=[], help="numbers of displacements")
    parser.add_argument("--plain", action="store_true", help="without the time of derivatives")
    parser.add_argument("--json", type=Path, help="add what was measured to this file")
    parser.add_argument("--where", default="this machine", help="its name in the table of that file")
    given = parser.parse_args(arguments)
    if given.peer == "dolfinx" and (given.strain, given.steps) != (STRETCH, 10):
        parser.error("--peer dolfinx makes ten steps to 1.25")
    pulls = SIZE[0] * given.strain * np.arange(1, given.steps + 1) / given.steps
    small = strip((2, 1, 1), given.kind, given.device)
    direct(solve(small, {"pull": [0.01]}))  # compiles
    sizes: list[tuple[int, ...]] = [cells_for(n, given.kind) for n in given.growth]
    if not sizes:
        sizes = [tuple(int(n) for n in given.cells.split("x"))]
    for cells in sizes:
        model = strip(cells, given.kind, given.device)
        entry: dict[str, Any] = {name: getattr(given, name) for name in SETTINGS}
        entry |= {
            "cells": list(cells),
            "threads": int(os.environ.get("OMP_NUM_THREADS", os.cpu_count() or 1)),
        }
        entry |= ours(model, pulls, given.linear, derivatives=not given.plain)
        line = (
            f"{'x'.join(map(str, cells))} {given.kind}: {entry['displacements']} displacements, "
            f"{entry['outcome']}, {entry['seconds']:.2f} s, of the processor "
            f"{entry['processor seconds']:.2f} s ({entry['factorisations']} factorisations, "
            f"{entry['iterations']} iterations), derivatives {entry['seconds of derivatives']:.2f} s"
        )
        print(line, flush=True)
        if given.peer != "none":
            peer = (
                felupe(model.mesh, pulls)
                if given.peer == "felupe"
                else dolfinx(cells, given.kind, given.python)
            )
            entry[given.peer] = peer
            other = np.array(peer["forces"])
            entry["largest difference"] = float(np.abs(np.array(entry["forces"]) / other - 1.0).max())
            print(
                f"{given.peer}: {peer['seconds']:.2f} s, of the processor {peer['processor seconds']:.2f} s, "
                f"{peer['processor seconds'] / entry['processor seconds']:.1f} times ours; "
                f"forces differ by at most {entry['largest difference']:.2g}",
                flush=True,
            )
        if given.json is not None:
            given.json.write_text(json.dumps(merged(given.json, [entry]), indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
