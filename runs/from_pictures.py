"""A laboratory's script for a shot from pictures: `python runs/from_pictures.py SHOT [FOLDER]`.

The script first measures the surfaces, so they can be checked without a simulation. Then it identifies the
stiffness from these surfaces. Regions that shot.toml does not declare are found in the pictures.
"""

import sys
from pathlib import Path

import kolsky

if len(sys.argv) < 2:
    sys.exit("give the folder of a shot with pictures")
pictured = kolsky.load_pictures(sys.argv[1])
folder = Path(sys.argv[2]) if len(sys.argv) > 2 else pictured.folder / "results"
found = kolsky.dic(sys.argv[1], results=folder)
kolsky.write_dic_results(folder, pictured, found)
for name, value in found.rows().items():
    print(f"{name:24} {value}")

shot = kolsky.load_shot(sys.argv[1], measure=lambda pictures: kolsky.measured(pictures, folder))
result = kolsky.identify(shot, kolsky.Settings(free={"stiffness_factor": (0.75, 1.5)}))
kolsky.write_identify_results(folder, result, shot)
m = result.estimates["stiffness_factor"]
print(f"{result.shot}: m = {m.value:.4f} ± {2 * m.sigma:.4f} (k = 2): {m.outcome}")
print(*(f"warning: {warning}" for warning in (*found.warnings, *result.warnings)), sep="\n", file=sys.stderr)
