"""A sensitivity sweep with a ledger: `python runs/sweep.py [SHOT [FOLDER [RUNS [DEVICE]]]]`.

Friction has no effect in a bonded shot, so the script varies stiffness and damping. RUNS is the number of
points of a Sobol' design, a power of two (default 64). After a stop, a new start continues the sweep.
"""

import sys
from pathlib import Path

import kolsky
from doe import Box, sobol

BOX = Box.of({"stiffness_factor": (1.0, 1.25), "damping": (1e-5, 5e-5)})

given = dict(enumerate(sys.argv))
shot = kolsky.load_shot(given.get(1, Path(__file__).parent / "open-01"))
folder = Path(given.get(2, shot.folder / "results"))
folder.mkdir(exist_ok=True)  # the ledger exists from the first run on
design = sobol(BOX, int(given.get(3, "64")), rng=1)
numerics = kolsky.Numerics(mesh=(16, 22), device=given.get(4, "cpu"))
result = kolsky.sweep(shot, design, numerics=numerics, ledger=folder / "sweep.sqlite")
analysis = kolsky.analyse_sweep(result.shot, BOX, result.table)
kolsky.write_sweep_results(folder, result, analysis, formats=("pdf",))

print(f"{result.shot}: {len(result.table.outcomes)} runs, {len(result.table.lost)} of them lost")
for name, output in analysis.outputs.items():
    print(f"  {name}: {output.refused or f'interpolant off by {output.error:.1%} of the scatter'}")
if analysis.indices is not None:
    s = analysis.indices
    for i, name in enumerate(s.outputs):
        for j, parameter in enumerate(s.names):
            print(f"  {name:6} {parameter:16} {s.first[i, j]:5.2f} first, {s.total[i, j]:5.2f} total")
