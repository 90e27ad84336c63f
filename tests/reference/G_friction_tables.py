"""Write the three tables `G_friction_*.csv` from runs of `G_friction_getfem.py`.

    python3 G_friction_tables.py FOLDER

FOLDER contains the files of --out, named f{friction}_n{elements}_g{grading}.npz. The value is the median over
the runs of a coefficient. The uncertainty is the largest difference of a run from the median.
"""

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
RUNS = {  # the first gives the outline and the face
    "0.05": ("n32_g1", "n16_g4", "n16_g1"),
    "0.1": ("n36_g1_st", "n20_g2_st", "n32_g1"),
    "0.2": ("n28_g1_st", "n16_g2_st", "n20_g1_st", "n32_g1", "n16_g4"),
    "0.3": ("n20_g2_st", "n24_g4", "n16_g4"),
    "0.5": ("n20_g2_st", "n24_g4", "n16_g4"),
    "1000": ("n24_g4", "n16_g4", "n16_g1"),
}
LAST = {"0.05": 0.3}  # compression up to which the meshes agree; 0.6 for the others
BRANCHES = ("0.05", "0.1", "0.2")  # a snap leads to another branch: a run counts up to its first one
PLACES = np.linspace(0.0, 4.75e-3, 25)  # on the face, before loading


def at_tenths(run):
    """Force, radii of edge, contact and middle at each tenth of compression, shape [n, 4]."""
    rows = run["history"]
    tenths = 0.1 * np.arange(1, len(run["face"]) + 1)
    return np.array([rows[np.abs(rows[:, 0] - e).argmin(), 1:5] for e in tenths])


def before_snap(run, values, branches):
    """Values up to the first snap, NaN past it, where snaps lead to another branch."""
    if branches and len(run["snaps"]):
        values[0.1 * np.arange(1, len(values) + 1) >= run["snaps"][0]] = np.nan
    return values


def main(folder):
    """Collect the runs and write the tables."""
    scalars, outlines, faces = [], [], []
    for friction, names in RUNS.items():
        runs = [np.load(folder / f"f{friction}_{name}.npz") for name in names]
        n = round(10 * LAST.get(friction, 0.6))
        values = np.array([before_snap(run, at_tenths(run)[:n], friction in BRANCHES) for run in runs])
        middle_of_all = np.nanmedian(values, axis=0)
        spread = np.nanmax(np.abs(values - middle_of_all), axis=0)
        best = runs[0]
        corners = slice(None, None, 2)  # of the elements; the nodes between them are left out
        for k in range(n):
            e = round(0.1 * (k + 1), 1)
            force, edge, contact, middle = zip(middle_of_all[k], spread[k], strict=True)
            scalars.append([float(friction), e, *force, *edge, *middle, *contact])
            for z0, (r, z) in zip(best["side_z0"][corners], best["side"][k][corners], strict=True):
                outlines.append([float(friction), e, z0, z, r])
            now = np.interp(PLACES, best["face_r0"], best["face"][k][:, 0]).clip(min=0.0)
            faces += [[float(friction), e, before, after] for before, after in zip(PLACES, now, strict=True)]
        for name, value in zip(names, values, strict=True):
            percent = 100 * (value[:, 0] / middle_of_all[:, 0] - 1)
            print(friction, name, *(f"{p:+.2f}" for p in percent))
    written = (
        (
            "force",
            scalars,
            ("%g", "%g", "%.4f", "%.4f", *(["%.4e", "%.1e"] * 3)),
            "friction [-], compression [-], force [N], +-, radius of the face's edge [m], +-, "
            "radius at mid-height [m], +-, radius of the contact area [m], +-",
        ),
        (
            "outline",
            outlines,
            ("%g", "%g", "%.5e", "%.5e", "%.5e"),
            "side surface, z = 0 at mid-height: friction [-], compression [-], "
            "z before loading [m], z [m], r [m]",
        ),
        (
            "face",
            faces,
            ("%g", "%g", "%.4e", "%.5e"),
            "face: friction [-], compression [-], radius before loading [m], radius [m]",
        ),
    )
    for name, table, formats, header in written:
        np.savetxt(HERE / f"G_friction_{name}.csv", table, fmt=formats, delimiter=",", header=header)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
