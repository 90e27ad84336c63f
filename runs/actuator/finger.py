"""A finger of 976 hexahedra from the mesh file of another program, and its SPEC with a closed loop at 20 Hz.

Usage: python runs/actuator/finger.py OUT

The finger is a bar of 60 x 12 x 12 mm with a closed cavity above its middle line. meshio writes
OUT/finger.vtu.
"""

import sys
from pathlib import Path

import meshio
import numpy as np

CELL = 2.0
"""Edge of a hexahedron [mm]."""
CELLS = (30, 6, 6)
"""Hexahedra along each axis."""
CAVITY = (slice(2, 28), slice(2, 4), slice(3, 5))
"""Hexahedra that are left out."""
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
"""Corners of a hexahedron in the order of VTK."""

SPEC = """pressures = ["0.4 bar", "0.8 bar"]

[geometry]
mesh = "finger.vtu"
mesh_unit = "mm"

[material]
law = "neo_hookean"
constants = { mu = "218 kPa" }
poisson = 0.44
density = "1.02 g/cm^3"

[gravity]
down = [0.0, 0.0, -9.81]

[control]
angles = ["2.3 deg", "3.5 deg", "2.8 deg"]
hold = "20 s"
rate = 20.0
real_time = true
most = "0.8 bar"
gain = 0.3
plant_stiffness = 0.85
noise = "0.05 deg"
"""


def main(out: Path) -> None:
    """Write both files into `out`."""
    out.mkdir(parents=True, exist_ok=True)
    number = np.arange(np.prod(np.add(CELLS, 1))).reshape(np.add(CELLS, 1))
    points = CELL * np.argwhere(number >= 0)
    kept = np.ones(CELLS, dtype=bool)
    kept[CAVITY] = False
    cells, hole = (
        np.stack([number[tuple((np.argwhere(which) + one).T)] for one in CORNERS], axis=1)
        for which in (kept, ~kept)
    )
    x, y, z = points.T
    line = (z == 0.0) & (y == 6.0)
    sets = {
        "clamp": x == 0.0,
        "cavity": np.isin(number.ravel(), np.intersect1d(hole, cells)),
        "origin": line & (x == 0.0),
        "tip": line & (x == x.max()),
        "line": line,
    }
    data = {f"set:{name}": mask.astype(int) for name, mask in sets.items()}
    meshio.Mesh(points, [("hexahedron", cells)], data).write(out / "finger.vtu")
    (out / "finger.toml").write_text(SPEC, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
