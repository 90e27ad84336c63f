"""Figures like Figs. 7 to 10 of Mates et al. (2012): `python -m contributed.paper_figures SHOT [FOLDER]`.

The figures show shape misfit and cost against Poisson's ratio, the force for several dampings, and misfits
over friction and stiffness. The last one shows runs and surrogates along the stiffness. The command writes
pictures into FOLDER (default: SHOT/results/paper) and prints numbers on the terminal.
"""

import sys
from pathlib import Path

import kolsky
from contributed.paper_figures.figures import TRENDS
from contributed.paper_figures.trends import trends

STIFFNESS = 1.12  # the known answer of open-01; in the paper's Fig. 8 it is 1, the value of its specimen

shot = kolsky.load_shot(sys.argv[1])
folder = Path(sys.argv[2]) if len(sys.argv) > 2 else shot.folder / "results" / "paper"
found = trends(shot, stiffness=STIFFNESS)
kolsky.save_figures(folder, found, formats=("png",), registry=TRENDS)
for kind in TRENDS.values():
    print(f"{kind.name}: {kind.caption(found)}")

nu = found.poisson
for x, phi, steps in zip(nu.x, nu.phi_shape, nu.steps, strict=True):
    print(
        f"nu = {x:.4f}: Phi_S = {phi:.5f}, {steps} steps, {steps / nu.steps[0]:.2f} of those at {nu.x[0]:g}"
    )
forces = found.damping
for beta, force in zip(forces.damping, forces.simulated, strict=True):
    rms = float(((force - forces.measured) ** 2).mean() ** 0.5)
    print(f"beta = {1e6 * beta:g} us: peak force {force.max():.2f} N, rms difference {rms:.2f} N")
for f in (0.2, 0.4, 0.6):
    force, shape = found.plane.left_beyond(f)
    print(f"friction from {f:g} on: {100 * force:.0f} % of the range of Phi_F, {100 * shape:.0f} % of Phi_S")
m = found.surrogates
for name, curves in (("misfit", m.by_cost), ("response", m.by_response)):
    least = [float(m.x[curve.argmin()]) for curve in curves]
    worst = m.errors()["cost" if name == "misfit" else name]
    print(f"surrogate of the {name}: minima at m = {least[0]:.4f} (Phi_F), {least[1]:.4f} (Phi_S); largest")
    print(f"  error at unseen runs {100 * worst[0]:.0f} % (Phi_F), {100 * worst[1]:.1f} % (Phi_S)")
