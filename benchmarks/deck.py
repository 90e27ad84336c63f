"""The benchmark's bonded problem as an input deck of CalculiX.

Units are mm, t, s, N and MPa. In metres CalculiX 2.20 gives much too low forces for such a small specimen,
without a message. Example: 0.15 N instead of 0.84 N in mm (static, 10 %, nu = 0.495). Elements are CAX4R,
one-point quadrilaterals as in the solver; CAX4 locks (10 % too stiff in that case). The implicit procedure
has no material damping. Its side surface penetrates the platens; in the solver it rolls onto them. Compare
undamped runs, at times before the side touches the platens.
"""

import numpy as np

from benchmarks.problem import DENSITY, stroke, yeoh
from explicit.mesh import Mesh

TO_MM, TO_MPA, TO_TONNE_PER_MM3 = 1e3, 1e-6, 1e-12
WEDGE = 180.0
"""Number of wedges in a full turn. CalculiX solves an axisymmetric model as a wedge of 2 degrees and prints
the forces on this wedge."""


def deck(mesh: Mesh, *, end: float, step: float) -> str:
    """The input of the bonded problem up to time `end` with the fixed step of ``*DYNAMIC`` [s]. CalculiX then
    prints the forces on the lower face at every step."""
    return "\n".join([*_mesh(mesh), *_material(), *_history(end, step)]) + "\n"


def _mesh(mesh: Mesh) -> list[str]:
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i}, {r:.12g}, {y:.12g}, 0." for i, (r, y) in enumerate(mesh.nodes * TO_MM, start=1)]
    lines += ["*ELEMENT, TYPE=CAX4R, ELSET=SPECIMEN"]
    lines += [f"{e}, " + ", ".join(map(str, quad)) for e, quad in enumerate(mesh.quads + 1, start=1)]
    for name, nodes in (
        ("LOWER", mesh.lower_face),
        ("UPPER", mesh.upper_face),
        ("AXIS", np.flatnonzero(mesh.on_axis)),
    ):
        lines += [f"*NSET, NSET={name}", *(f"{node + 1}," for node in nodes)]
    return lines


def _material() -> list[str]:
    c10, c20, c30, d1 = yeoh()
    constants = (c10 * TO_MPA, c20 * TO_MPA, c30 * TO_MPA, d1 / TO_MPA, 0.0, 0.0)
    return [
        "*MATERIAL, NAME=ELASTOMER",
        "*HYPERELASTIC, YEOH",
        ", ".join(f"{value:.12g}" for value in constants),
        "*DENSITY",
        f"{DENSITY * TO_TONNE_PER_MM3:.12g}",
        "*SOLID SECTION, ELSET=SPECIMEN, MATERIAL=ELASTOMER",
        "1.",
    ]


def _history(end: float, step: float) -> list[str]:
    times = step * np.arange(round(end / step) + 1, dtype=np.float64)
    return [
        "*BOUNDARY",
        "LOWER, 1, 2, 0.",
        "UPPER, 1, 1, 0.",
        "AXIS, 1, 1, 0.",
        "*AMPLITUDE, NAME=STROKE",
        *(f"{t:.12g}, {u:.12g}" for t, u in zip(times, stroke(times) * TO_MM, strict=True)),
        "*STEP, NLGEOM, INC=1000000",
        "*DYNAMIC, DIRECT",
        f"{step:.12g}, {end:.12g}",
        "*BOUNDARY, AMPLITUDE=STROKE",
        "UPPER, 2, 2, -1.",
        "*NODE PRINT, NSET=LOWER, TOTALS=ONLY",
        "RF",
        "*END STEP",
    ]
