"""A laboratory's per-shot script: `python runs/per_shot.py [SHOT]`."""

import sys
from pathlib import Path

from kolsky.identify import identify
from kolsky.report import write_report
from kolsky.results_text import write_csv
from kolsky.results_write import write_identification
from kolsky.settings import Settings
from kolsky.shots import load_shot

shot = load_shot(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "open-01")
result = identify(shot, Settings(free={"stiffness_factor": (0.75, 1.5)}))
folder = shot.folder / "results"
folder.mkdir(exist_ok=True)
write_identification(folder / "identification.h5", result)
write_csv(folder, result)
write_report(folder / "report.html", result)
m = result.estimates["stiffness_factor"]
print(f"{result.shot}: m = {m.value:.4f} ± {2 * m.sigma:.4f} (k = 2): {m.outcome}")
print(*(f"warning: {warning}" for warning in result.warnings), sep="\n", file=sys.stderr)
