"""A sensitivity sweep with a ledger: `python runs/sweep.py [SHOT [FOLDER [RUNS [DEVICE]]]]`.

Friction has no part in a bonded shot, so stiffness and damping are varied here. RUNS of a Sobol' design, a
power of two, are 64 if not given. Stopped and started again it goes on where it was.
"""

import sys
from pathlib import Path

from doe import Box
from doe.designs.space_filling import sobol
from kolsky.inverse.forward import Numerics
from kolsky.report.canvas import save_figures
from kolsky.report.figures import SWEEPS
from kolsky.report.pages.sweep import write_page
from kolsky.shot.load import load_shot
from kolsky.studies.sweep import sweep, write_sweep
from kolsky.studies.sweep_analysis import analyse_sweep

BOX = Box.of({"stiffness_factor": (1.0, 1.25), "damping": (1e-5, 5e-5)})

given = dict(enumerate(sys.argv))
shot = load_shot(given.get(1, Path(__file__).parent / "open-01"))
folder = Path(given.get(2, shot.folder / "results"))
folder.mkdir(exist_ok=True)
design = sobol(BOX, int(given.get(3, "64")), rng=1)
numerics = Numerics(mesh=(16, 22), device=given.get(4, "cpu"))
result = sweep(shot, design, numerics=numerics, ledger=folder / "sweep.sqlite")
looked_at = analyse_sweep(result.shot, BOX, result.table)
write_sweep(folder / "sweep.csv", result)
write_page(folder / "sweep.html", looked_at)
save_figures(folder / "figures", looked_at, formats=("pdf",), registry=SWEEPS)

print(f"{result.shot}: {len(result.table.outcomes)} runs, {len(result.table.lost)} of them lost")
for name, output in looked_at.outputs.items():
    print(f"  {name}: {output.refused or f'interpolant off by {output.error:.1%} of the scatter'}")
if looked_at.indices is not None:
    s = looked_at.indices
    for i, name in enumerate(s.outputs):
        for j, parameter in enumerate(s.names):
            print(f"  {name:6} {parameter:16} {s.first[i, j]:5.2f} first, {s.total[i, j]:5.2f} total")
