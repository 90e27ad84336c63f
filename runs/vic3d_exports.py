"""Exports like VIC-3D's, to try `[surface]` with: `python runs/vic3d_exports.py FOLDER [SHOT]`.

Each frame has one file with nine points on the centre line. They move with the outline of the shot (default
open-01). Y of their frame points down and begins 2 mm above the transmission platen's face. A point outside
the measured part of the outline is lost; it has a negative sigma, as in VIC-3D. All other files of the shot
are copied.
"""

import csv
import shutil
import sys
from pathlib import Path

import numpy as np

import kolsky

if len(sys.argv) < 2:
    sys.exit("give a folder for the shot with exports")
folder = Path(sys.argv[1])
source = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).resolve().parent / "open-01"
length = 1e3 * kolsky.load_shot(source).specimen.length
(folder / "dic").mkdir(parents=True)
for name in ("scope.csv", "frames.csv", "flyer.csv", "quasi_static.csv", "shot.toml"):
    shutil.copy(source / name, folder)
with (source / "centreline.csv").open(encoding="utf-8") as file:
    outline = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])
with (source / "flyer.csv").open(encoding="utf-8") as file:
    travel = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])[:, 2]
share = np.linspace(0.12, 0.88, 9)
rest = None
for frame, way in enumerate(travel):
    _, _, y, Z, _ = outline[outline[:, 0] == frame].T
    height = share * (length - way)
    seen = np.column_stack([np.zeros(9), 2.0 - height, np.interp(height, y, Z)])
    rest = seen if rest is None else rest
    sigma = np.where((height >= y.min()) & (height <= y.max()), 0.004, -1.0)
    lines = ['"X", "Y", "Z", "U", "V", "W", "sigma", "x", "y"']
    for place, moved, s, row in zip(rest, seen - rest, sigma, range(9), strict=True):
        lines.append(", ".join(f"{v:.5f}" for v in (*place, *moved, s, 64.0, 10.0 + 12.0 * row)))
    (folder / "dic" / f"specimen_{frame:04d}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
print(f"{folder}: {travel.size} exports of 9 points, and the files of {source.name}")
