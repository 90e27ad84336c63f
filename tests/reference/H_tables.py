"""Make the tables H from the files of `H_getfem.py`: `python H_tables.py FOLDER`."""

import sys
from pathlib import Path

import numpy as np

RUNS = {
    ("yeoh", "0.3"): ("n16", "n12"), ("mooney_rivlin", "0.3"): ("n16",), ("ogden2", "0.3"): ("n16",),
    ("yeoh", "1000"): ("n12",), ("mooney_rivlin", "1000"): ("n12",), ("ogden2", "1000"): ("n12",),
    ("reduced_polynomial", "0.7"): ("n12",),
}  # fmt: skip
"""Case -> meshes, the one in the tables first; where there are two, half of their difference is printed."""
OUTLINES = (0.1, 0.2, 0.3, 0.4, 0.5)


def main() -> None:
    """Write both tables beside this file."""
    folder, here = Path(sys.argv[1]), Path(__file__).resolve().parent
    forces, outlines = [], []
    for (law, friction), meshes in RUNS.items():
        runs = [np.load(folder / f"{law}_{friction}_{mesh}_g4.npz") for mesh in meshes]
        first = runs[0]["history"]
        if len(runs) > 1:
            apart = np.abs(runs[1]["history"][:, 1] / first[:, 1] - 1.0) / 2.0
            print(law, friction, f"meshes: half difference of the force at most {100.0 * apart.max():.2f} %")
        for k, (strain, force, edge, _, middle) in enumerate(first):
            forces.append(f"{law},{friction},{strain:.6g},{force:.6g},{middle:.7g},{edge:.7g}")
            if np.abs(np.array(OUTLINES) - strain).min() < 1e-9:
                outlines += [f"{law},{friction},{strain:.6g},{z:.6g},{r:.6g}" for r, z in runs[0]["side"][k]]
    head = (
        "# law, friction (1000: no slip), compression [-], force [N], radius at mid-height, of the edge [m]"
    )
    (here / "H_force.csv").write_text("\n".join([head, *forces]) + "\n")
    head = "# law, friction, compression [-], height above mid-height [m], radius of the side [m]"
    (here / "H_outline.csv").write_text("\n".join([head, *outlines]) + "\n")


if __name__ == "__main__":
    main()
