"""A laboratory's per-shot script: `python runs/per_shot.py [SHOT [MESH REFINED_MESH]]`, meshes as 24x32."""

import sys

import kolsky

shot = kolsky.load_shot(sys.argv[1] if len(sys.argv) > 1 else f"{sys.path[0]}/open-01")
coarse, refined = (tuple(map(int, word.split("x"))) for word in (sys.argv[2:] or ["24x32", "64x86"]))
numerics = kolsky.Numerics(mesh=coarse)
settings = kolsky.Settings(free={"stiffness_factor": (0.75, 1.5)}, numerics=numerics, refined_mesh=refined)
result = kolsky.identify(shot, settings)
kolsky.write_identify_results(shot.folder / "results", result, shot)
m = result.estimates["stiffness_factor"]
print(f"{result.shot}: m = {m.value:.4f} ± {2 * m.sigma:.4f} (k = 2): {m.outcome}")
print(*(f"warning: {warning}" for warning in result.warnings), sep="\n", file=sys.stderr)
