"""Constants of a cylinder of a thesis from other programs' forces: `python -m populations.thesis_cylinder`.

The cylinder of 80 mm by 70 mm has C10 = 1404.9 Pa and C20 = 699.4 Pa (Table 3.3). DOLFINx and GetFEM
simulated its compression by 10 mm between plates with f = 0.7 (`tests/reference`, tables I and H). Their
forces are the test data. The constants are identified by inverse finite elements.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.apparatus import Specimen
from kolsky.material.end_friction.correct import fit_specimen
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction
from kolsky.material.uniaxial import CurveBand
from populations.driver import RESULTS, write

ROOT = Path(__file__).resolve().parents[1]
FILE = RESULTS / "thesis_cylinder.json"
PLANTED = {"C10": 1404.9, "C20": 699.4}
TABLES = {"DOLFINx": "I_force.csv", "GetFEM": "H_force.csv"}
"""Table of each program in `tests/reference`."""


def fitted(program: str) -> dict[str, Any]:
    """Identified constants of the law of the thesis with their standard uncertainties."""
    lines = (ROOT / "tests" / "reference" / TABLES[program]).read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines if line.startswith("reduced_polynomial,0.7,")]
    strain, force = np.array([[float(row[2]), float(row[3])] for row in rows]).T
    size = Specimen(diameter=80e-3, length=70e-3, density=0.0)
    stress = force / size.area
    band = CurveBand(strain, stress, np.zeros_like(stress), np.empty((0, stress.size)), ())
    numerics = CorrectionNumerics(poisson=0.495)
    (one,) = fit_specimen(band, size, EndFriction("coulomb", 0.7), ("reduced_polynomial",), numerics=numerics)
    return {"constants": one.constants, "sigma": one.sigma, "misfit": one.misfit}


def main() -> None:
    """Fit both programs' forces, write and print the result."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    found = {program: fitted(program) for program in TABLES}
    write(FILE, found, indent=1)
    for program, one in found.items():
        for name, value in one["constants"].items():
            print(f"{program}: {name} = {value:.5g} ± {2 * one['sigma'][name]:.2g} Pa (k = 2),"
                  f" {100 * (value / PLANTED[name] - 1):+.2f} %")  # fmt: skip


if __name__ == "__main__":
    main()
