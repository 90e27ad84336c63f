"""A laboratory's per-shot script: `python runs/per_shot.py [SHOT [MESH REFINED_MESH]]`, meshes as 24x32."""

import sys
from dataclasses import replace
from pathlib import Path

from kolsky.cli.work.options import mesh
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.settings import Settings
from kolsky.report.pages.identification import write_report
from kolsky.results.hdf5 import write_identification
from kolsky.results.tables import write_csv
from kolsky.shot.load import load_shot

shot = load_shot(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "open-01")
settings = Settings(free={"stiffness_factor": (0.75, 1.5)})
if len(sys.argv) > 3:
    coarse, refined = (mesh("a mesh", word) for word in sys.argv[2:4])
    settings = replace(settings, numerics=Numerics(mesh=coarse), refined_mesh=refined)
result = identify(shot, settings)
folder = shot.folder / "results"
folder.mkdir(exist_ok=True)
write_identification(folder / "identification.h5", result)
write_csv(folder, result)
write_report(folder / "report.html", result)
m = result.estimates["stiffness_factor"]
print(f"{result.shot}: m = {m.value:.4f} ± {2 * m.sigma:.4f} (k = 2): {m.outcome}")
print(*(f"warning: {warning}" for warning in result.warnings), sep="\n", file=sys.stderr)
