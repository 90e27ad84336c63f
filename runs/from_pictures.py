"""A laboratory's script for a shot from pictures: `python runs/from_pictures.py SHOT`.

Surfaces first, so that a look at them costs no simulation; then the stiffness, from the same surfaces.
Regions that shot.toml leaves out are found in the pictures.
"""

import sys
from pathlib import Path

from kolsky.bars.flyer import flight_report
from kolsky.identification import identify
from kolsky.inverse.settings import Settings
from kolsky.report.pages.identification import write_report
from kolsky.report.pages.surfaces import write_page
from kolsky.report.surface_view import read_surface_view
from kolsky.results.hdf5 import write_identification
from kolsky.shot import dic_summary
from kolsky.shot.load import load_pictures, load_shot
from kolsky.shot.optical_data import measured, surfaces

if len(sys.argv) < 2:
    sys.exit("give the folder of a shot with pictures")
pictured = load_pictures(sys.argv[1])
folder = Path(sys.argv[2]) if len(sys.argv) > 2 else pictured.folder / "results"
folder.mkdir(exist_ok=True)
found = surfaces(pictured.pictures, folder)
write_page(
    folder / "dic.html",
    read_surface_view(pictured.name, found.result, pictured.pictures.series, found.flight),
    pictured.inputs,
)
for name, value in {**dic_summary.printed(found.result), **flight_report.printed(found.flight)}.items():
    print(f"{name:24} {value}")

shot = load_shot(sys.argv[1], measure=lambda seen: measured(seen, folder))
result = identify(shot, Settings(free={"stiffness_factor": (0.75, 1.5)}))
write_identification(folder / "identification.h5", result)
write_report(folder / "report.html", result)
m = result.estimates["stiffness_factor"]
print(f"{result.shot}: m = {m.value:.4f} ± {2 * m.sigma:.4f} (k = 2): {m.outcome}")
warnings = (*dic_summary.warnings(found.result), *result.warnings)
print(*(f"warning: {warning}" for warning in warnings), sep="\n", file=sys.stderr)
