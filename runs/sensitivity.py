"""Sobol' indices and Morris screening of a shot: `python runs/sensitivity.py [SHOT] [FOLDER] [POINTS]`.

The script uses the box below, the solver, and a checked surrogate. It writes a picture into FOLDER (default:
SHOT/results) and prints a table on the terminal. POINTS is the number of points of each sample, a power of
two (default 512).
"""

import sys
from pathlib import Path

import kolsky
from doe import Box

BOX = Box.of({"stiffness_factor": (1.0, 1.25), "poisson": (0.495, 0.4995), "damping": (1e-5, 1e-4)})
COARSE = kolsky.Numerics(
    mesh=(16, 22)
)  # indices are shares: a mesh with an error of 1 % of the stiffness does not change them

shot = kolsky.load_shot(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "open-01")
folder = Path(sys.argv[2]) if len(sys.argv) > 2 else shot.folder / "results"
n = int(sys.argv[3]) if len(sys.argv) > 3 else 512
found = kolsky.solver_sensitivity(shot, BOX, n=n, numerics=COARSE)
checked = kolsky.global_sensitivity(shot, BOX, runs=128, unseen=32, numerics=COARSE)
kolsky.save_figures(folder, found, formats=("svg",))

for label, result in (("solver", found), ("surrogate", checked)):
    print(f"by the {label}, {result.runs} runs: first and total index with its 95 % interval")
    assert result.scalars is not None
    s = result.scalars
    for i, output in enumerate(s.outputs):
        for j, name in enumerate(s.names):
            low, high = s.total_interval[i, j]
            print(
                f"  {output:10} {name:16} {s.first[i, j]:6.2f} {s.total[i, j]:6.2f} {low:6.2f} to {high:.2f}"
            )
    for kind, history in (("force", result.force), ("outline", result.outline)):
        if history is not None:
            for j, name in enumerate(history.names):
                first, total = history.aggregated_first[j], history.aggregated_total[j]
                low, high = history.aggregated_total_interval[j]
                print(f"  {kind:10} {name:16} {first:6.2f} {total:6.2f} {low:6.2f} to {high:.2f}")
for name, why in checked.refused.items():
    print(f"  {name}: {why}")
outputs, effects = kolsky.screening(shot, BOX, trajectories=20, numerics=COARSE)
print("screening, 80 runs: mean size and scatter of the effects over the box's edges")
for i, output in enumerate(outputs):
    for j, name in enumerate(effects.names):
        print(f"  {output:10} {name:16} {effects.size[i, j]:9.3g} {effects.scatter[i, j]:9.3g}")
