"""Bring the healthy-skin data of Sutula and others (2020) into the form of a SPEC.toml with a [field].

Usage: python runs/specimen/skin_healthy.py FOLDER OUT [MESH]

FOLDER contains `datafiles_unprocessed` and the meshes of their repository (github.com/danassutula/
model_parameter_inference, MIT). MESH is the number in a mesh's name (4528). The script writes points.csv,
pad.csv, the mesh, and two SPEC files, plane strain and plane stress, into OUT. It follows the steps of their
preparation. It removes the named spurious points, takes running means, and takes the scale from the width of
the extensometer. All displacements are relative to the fixed pad; force and displacement have one origin.
"""

import csv
import shutil
import sys
from pathlib import Path

import numpy as np

WIDTH = 24.0
"""Distance of the two marks on each pad [mm]. It gives the scale."""
PAD = (32.0, 20.0)
"""Point of the mesh to which the moving pad's mark belongs [mm]."""
SPURIOUS_POINTS = (2, 8, 19, 26, 54, 109, 142)
"""Points that the authors removed by hand."""
SPURIOUS_FORCES = (0, 9, 98, 181, 182, 188, 247, 302, 338, 362, 371, 501, 510, 522, 553, 737, 865)
"""Force samples that the authors removed by hand."""
ORIGIN = 0.275
"""Pad displacement where their curve begins [mm]."""
LARGEST = 2.0
"""Largest pad displacement that is fitted [mm]."""
STEPS = 10
"""Fitted frames: every second frame, counted from the last."""

SPEC = """# {title}
[material]
law = "neo_hookean_coupled"
free = ["E", "poisson"]
poisson = 0.2
constants = {{ E = "25 kPa" }}

[field]
mesh = "mesh.msh"
mesh_unit = "mm"
thickness = "1 mm"
kinematics = "{kinematics}"
moving = "moving_pad"
fixed = "fixed_pad"
frames = {frames}
sigma_force = "1 mN"

[field.points]
file = "points.csv"
x = {{ column = "x (mm)", unit = "mm" }}
y = {{ column = "y (mm)", unit = "mm" }}
ux = {{ column = "ux (mm)", unit = "mm" }}
uy = {{ column = "uy (mm)", unit = "mm" }}
{gate}
[field.pad]
file = "pad.csv"
displacement = {{ column = "pad (mm)", unit = "mm" }}
force = {{ column = "force (N)", unit = "N" }}
"""


def running_mean(values: np.ndarray, width: int, times: int) -> np.ndarray:
    """Means over `width` samples, repeated `times` times. The ends are unchanged."""
    half = (width - 1) // 2
    for _ in range(times):
        inner = [values[i - half : i + half + 1].mean(axis=0) for i in range(half, len(values) - half)]
        values = np.concatenate([values[:half], inner, values[len(values) - half :]])
    return values


def positions(folder: Path, name: str) -> np.ndarray:
    """Positions in every picture [px], shape [frames, points, 2]."""
    axes = []
    for axis in "xy":
        first, later = (np.loadtxt(folder / f"{axis}{when}{name}.dat", ndmin=2) for when in "0t")
        axes.append(np.concatenate([first, later], axis=1))
    return np.stack(axes, axis=-1).swapaxes(0, 1)


def field(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points [mm], their displacements, and those of the moving pad, relative to the fixed one."""
    points, moving, fixed = (positions(folder, name) for name in ("", "_ref_1", "_ref_2"))
    points = np.delete(points, SPURIOUS_POINTS, axis=1)
    for width in (5, 3):
        points, moving, fixed = (running_mean(one, width, 10) for one in (points, moving, fixed))
    marks = 0.5 * sum(one[0, 1, 1] - one[0, 0, 1] for one in (moving, fixed))
    points, moving, fixed = (WIDTH / marks * one for one in (points, moving, fixed))
    rest = fixed.mean(axis=1)
    points, pad = points - rest[:, None], moving.mean(axis=1) - rest
    return points[0] - pad[0] + PAD, points - points[0], pad[:, 0] - pad[0, 0]


def force(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Pad displacement [mm] and force [N] from their origin, negative along the pull."""
    both = np.stack([np.loadtxt(folder / f"{name}_moving_pad.dat") for name in "uf"], axis=-1)
    both = np.delete(both, SPURIOUS_FORCES, axis=0)
    for width in (33, 17, 9, 5, 3):
        both = running_mean(both, width, 5)
    both = both[both[:, 0] > ORIGIN]
    both = both[0] - both
    return both[:, 0], both[:, 1]


def write(path: Path, header: list[str], rows: list[list[float]]) -> None:
    """Write a table."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def main(source: Path, out: Path, number: str) -> None:
    """Write everything into `out`."""
    out.mkdir(parents=True, exist_ok=True)
    x, u, pad = field(source / "datafiles_unprocessed" / "displacement")
    where, newtons = force(source / "datafiles_unprocessed" / "reactionforce")
    last = int(np.flatnonzero(np.abs(pad) > LARGEST)[0]) - 1
    frames = list(range(last, 0, -((last - 1) // (STEPS - 1))))[:STEPS][::-1]
    order = np.argsort(where)
    at_pad = np.interp(pad, where[order], newtons[order])
    write(out / "pad.csv", ["frame", "pad (mm)", "force (N)"], [[k, pad[k], at_pad[k]] for k in frames])
    rows = [[k, *x[i], *u[k, i]] for k in frames for i in range(len(x))]
    write(out / "points.csv", ["frame", "x (mm)", "y (mm)", "ux (mm)", "uy (mm)"], rows)
    shutil.copyfile(source / f"mesh_{number}.msh", out / "mesh.msh")
    for kinematics in ("plane_strain", "plane_stress"):
        title = f"Healthy skin: {kinematics.replace('_', ' ')}."
        text = SPEC.format(title=title, kinematics=kinematics, frames=frames, gate="gated = false")
        (out / f"{kinematics}.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else "4528")
