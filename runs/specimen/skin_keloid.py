"""Bring the keloid data of Sutula and others (2020) into the form of a SPEC.toml with a [field].

Usage: python runs/specimen/skin_keloid.py FOLDER OUT [MESH]

FOLDER contains their bi-material test (`dic_2`, `reactionforce`, `mesh`; github.com/danassutula/
model_parameter_inference, MIT). MESH is the number of nodes in a mesh's name (4543). The script writes
points.csv, pad.csv, the mesh, and three SPEC files into OUT. In two files the skin is fixed, and the keloid
is in plane strain or plane stress. In the third both regions are free.

The files of the pads' marks in `dic_2` are identical to those of the healthy test. They have 50 pictures and
another scale, but the keloid's field has 105 pictures. The marks are therefore not used:

- scale: 24 mm is 660 px. The distance of the pads is then 1120 px = 40.727 mm, as in `main_v2.py`;
- position: the middle of the points is between the pads;
- pad: every fourth of the 422 samples of displacement and force belongs to one of the 105 pictures;
- the motion of the camera relative to the fixed pad is free (`relative_to = "camera"`).
"""

import shutil
import sys
from pathlib import Path

import numpy as np
from skin_healthy import LARGEST, STEPS, running_mean, write

SCALE = 24.0 / 660.0
"""[mm/px]."""
MIDDLE = (50.0, 20.0)
"""Point of the mesh between the pads [mm]."""
SAMPLES = 4
"""Samples of the force for each picture."""

SPEC = """# Keloid: {title}.
[material]
law = "neo_hookean_coupled"
free = ["E", "poisson"]
poisson = 0.4
constants = {{ E = "50 kPa" }}

[field]
mesh = "mesh.msh"
mesh_unit = "mm"
thickness = "1 mm"
kinematics = "{kinematics}"
moving = ["moving_pad_keloid", "moving_pad_skin"]
fixed = ["fixed_pad_keloid", "fixed_pad_skin"]
relative_to = "camera"
frames = {frames}
sigma_force = "1 mN"
region = "keloid"

[field.regions.skin]
constants = {{ E = "28.33093 kPa" }}
poisson = 0.1952619
free = {free}

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


def field(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Points on the mesh and their displacements [mm], shapes [n, 2] and [pictures, n, 2]."""
    axes = []
    for axis in "xy":
        first, later = (np.loadtxt(folder / name, ndmin=2) for name in (f"{axis}0.dat", f"{axis}t.dat.gz"))
        axes.append(np.concatenate([first, later], axis=1))
    places = SCALE * running_mean(np.stack(axes, axis=-1).swapaxes(0, 1), 5, 10)
    return places[0] - 0.5 * (places[0].min(axis=0) + places[0].max(axis=0)) + MIDDLE, places - places[0]


def pad(folder: Path, pictures: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the moving pad [mm] and force on it [N] for every picture, negative along the pull."""
    both = np.stack([np.loadtxt(folder / f"{name}_moving_pad.dat") for name in "uf"], axis=-1)
    both[:, 0] -= both[:, 0].min()
    for width in (33, 17, 9, 5, 3):
        both = running_mean(both, width, 5)
    rows = np.minimum(SAMPLES * np.arange(pictures), len(both) - 1)
    return -both[rows, 0], -both[rows, 1]


def main(source: Path, out: Path, number: str) -> None:
    """Write everything into `out`."""
    out.mkdir(parents=True, exist_ok=True)
    x, u = field(source / "dic_2")
    moved, newtons = pad(source / "reactionforce", len(u))
    last = int(np.flatnonzero(np.abs(moved) > LARGEST)[0]) - 1
    frames = list(range(last, 0, -((last - 1) // (STEPS - 1))))[:STEPS][::-1]
    write(out / "pad.csv", ["frame", "pad (mm)", "force (N)"], [[k, moved[k], newtons[k]] for k in frames])
    rows = [[k, *x[i], *u[k, i]] for k in frames for i in range(len(x))]
    write(out / "points.csv", ["frame", "x (mm)", "y (mm)", "ux (mm)", "uy (mm)"], rows)
    shutil.copyfile(source / "mesh" / f"{number}.msh", out / "mesh.msh")
    for name, kinematics, free in (
        ("plane_strain", "plane_strain", []),
        ("plane_stress", "plane_stress", []),
        ("both_free", "plane_strain", ["E", "poisson"]),
    ):
        title = f"{kinematics.replace('_', ' ')}, {'both regions free' if free else 'skin held'}"
        spelled = "[" + ", ".join(f'"{one}"' for one in free) + "]"
        text = SPEC.format(title=title, kinematics=kinematics, frames=frames, free=spelled)
        (out / f"{name}.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else "4543")
