"""Does m trade against damping, friction and Poisson's ratio? `python runs/ridges.py [SHOT] [PARAMETER ...]`.

The script identifies the stiffness factor together with each of the parameters in turn. It writes the map of
the likelihood with both profiles to SHOT/results/ridges and prints the verdicts.
"""

import sys
from pathlib import Path

import kolsky

shot = kolsky.load_shot(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "open-01")
folder = shot.folder / "results" / "ridges"
for other in sys.argv[2:] or ("damping", "friction", "poisson"):
    settings = kolsky.Settings(free={"stiffness_factor": None, other: None}, replicates=0)
    found = kolsky.identify(shot, settings)
    pictures = {name: kolsky.figures_of(found)[name] for name in ("likelihood", "ridge")}
    kolsky.save_figures(folder / other, found, formats=("png", "pdf"), registry=pictures)
    print(f"m and {other}:")
    for profile in found.profiles:
        print(f"  {profile.text}")
        print(f"  95 % interval {profile.interval}, with the other known {profile.alone}")
    print(*(f"  warning: {warning}" for warning in found.warnings), sep="\n", file=sys.stderr)
