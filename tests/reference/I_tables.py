"""Make the tables I from the files of `I_dolfinx.py`: `python I_tables.py FOLDER`.

A force is the mean of the two finest meshes that completed 50 %. Its uncertainty is half of their difference.
The outline is that of the finest mesh. Rows of specimens without two such runs in FOLDER are kept.
"""

import sys
from pathlib import Path

import numpy as np
from I_specimens import SPECIMENS, strains

OUTLINES = (0.1, 0.2, 0.3, 0.4, 0.5)


def finished(folder: Path, specimen: str, ends: str) -> list[tuple[int, dict[str, np.ndarray]]]:
    """Runs that reached the last strain, the finest mesh first."""
    found = []
    for path in folder.glob(f"{specimen}_{ends}_n*.npz"):
        run = dict(np.load(path))
        if len(run["history"]) == len(strains(specimen)):
            found.append((int(path.stem.rpartition("n")[2]), run))
    return sorted(found, key=lambda one: -one[0])


def standing(path: Path, specimen: str, ends: str) -> list[str]:
    """The rows of a case that a table has."""
    lines = path.read_text().splitlines()[1:] if path.exists() else []
    return [line for line in lines if line.split(",")[:2] == [specimen, ends]]


def main() -> None:
    """Write both tables beside this file."""
    folder, here = Path(sys.argv[1]), Path(__file__).resolve().parent
    forces, outlines = [], []
    for ends in ("bonded", "0.3", "0.7"):
        for specimen in SPECIMENS:
            if (specimen == "reduced_polynomial") != (ends == "0.7"):
                continue
            runs = finished(folder, specimen, ends)[:2]
            if len(runs) < 2:
                old = standing(here / "I_force.csv", specimen, ends)
                print(f"{specimen} {ends}: {len(runs)} meshes went through, two are needed: "
                      f"{f'{len(old)} rows stay' if old else 'left out'}")  # fmt: skip
                forces += old
                outlines += standing(here / "I_outline.csv", specimen, ends)
                continue
            (fine, one), (coarse, other) = runs
            mean = 0.5 * (one["history"] + other["history"])
            apart = 0.5 * np.abs(one["history"][:, 1] - other["history"][:, 1])
            relative = apart / mean[:, 1]
            print(f"{specimen} {ends}: {fine} and {coarse} elements, half difference at most"
                  f" {100 * relative.max():.2f} %, at 50 % {100 * relative[-1]:.2f} %")  # fmt: skip
            for (strain, force, edge, middle), u in zip(mean, apart, strict=True):
                forces.append(
                    f"{specimen},{ends},{strain:.6g},{force:.6g},{u:.2g},{middle:.7g},{edge:.7g},{fine},{coarse}"
                )
            for k, strain in enumerate(one["history"][:, 0]):
                if np.abs(np.array(OUTLINES) - strain).min() < 1e-9:
                    outlines += [f"{specimen},{ends},{strain:.6g},{z:.6g},{r:.6g}" for r, z in one["side"][k]]
    head = (
        "# specimen, ends, compression [-], force [N], its uncertainty [N], radius at mid-height, of the edge"
        " [m], elements across the radius of both meshes"
    )
    (here / "I_force.csv").write_text("\n".join([head, *forces]) + "\n")
    head = "# specimen, ends, compression [-], height above mid-height [m], radius of the side [m]"
    (here / "I_outline.csv").write_text("\n".join([head, *outlines]) + "\n")


if __name__ == "__main__":
    main()
