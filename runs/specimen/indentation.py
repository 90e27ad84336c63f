"""A sphere on a soft block: writes its mesh, the force of Dimitriadis et al. (2002), and a SPEC to fit it.

python runs/specimen/indentation.py FOLDER
kolsky specimen fit FOLDER/indentation.toml
"""

import sys
from pathlib import Path

import meshio
import numpy as np

from kolsky.equilibrium.meshes import box

ELEMENTS, SIDE, HEIGHT = 10, 20.0, 10.0  # mm
RADIUS, MU, NU = 50.0, 0.01, 0.3  # mm, N/mm2
SPEC = """
[material]
law = "neo_hookean"
free = ["mu"]
poisson = 0.3
constants = { mu = "20 kPa" }

[tests.indent]
shape = "mesh"
mesh = "block.vtu"
mesh_unit = "mm"
moving = "front"
fixed = "back"
axis = "z"
sphere = "50 mm"
file = "indent.csv"
displacement = { column = "travel (mm)", unit = "mm" }
force = { column = "force (N)", unit = "N" }
sigma_force = "0.2 mN"
"""


def layer_force(depth):
    """Force of a sphere on a layer that is bonded to its base [N]."""
    a = -(1.2876 - 1.4678 * NU + 1.3442 * NU**2) / (1.0 - NU)
    b = (0.6387 - 1.0277 * NU + 1.5164 * NU**2) / (1.0 - NU)
    x = np.sqrt(RADIUS * depth) / HEIGHT / np.pi
    hertz = 8.0 / 3.0 * MU / (1.0 - NU) * np.sqrt(RADIUS) * depth**1.5
    third, fourth = a**3 + 4.0 * np.pi**2 / 15.0 * b, a**3 + 3.0 * np.pi**2 / 5.0 * b
    return hertz * (1.0 - 2.0 * a * x + 4.0 * (a * x) ** 2 - 8.0 * third * x**3 + 16.0 * a * fourth * x**4)


folder = Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
mesh = box((2.0, 2.0, 1.0), (ELEMENTS, ELEMENTS, ELEMENTS // 2), kind="hex27")
points = mesh.points - [1.0, 1.0, 1.0]  # the origin is in the middle of the upper face
points = np.sign(points) * np.abs(points) ** 2 * [0.5 * SIDE, 0.5 * SIDE, HEIGHT]
meshio.Mesh(points, [("hexahedron27", mesh.cells)]).write(folder / "block.vtu")
depth = np.linspace(0.03, 0.2, 8)
force = layer_force(depth) + 2e-4 * np.random.default_rng(1).standard_normal(8)
table = np.column_stack([-depth, -force])
np.savetxt(folder / "indent.csv", table, header="travel (mm),force (N)", comments="", delimiter=",")
(folder / "indentation.toml").write_text(SPEC)
