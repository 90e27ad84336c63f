"""Friction correction of specimens simulated by another program: errors, band, its coverage over noisy draws.

    python -m populations.baseline_specimens [--only yeoh/0.3/DOLFINx] [--draws 1000] [--workers 2]

Each specimen and program (`tests/reference`, tables A and I) gives one row of
`populations/results/baseline_specimens.json`. A row is written when it is finished; existing rows are not
rerun. A draw is five specimens of one material with a scatter of 2 % in stiffness and 0.5 % in each sample.
The derivative of the correction propagates this scatter. The errors of a draw's curve have a common part. The
coverage of 100 draws therefore has a standard uncertainty of 2 %, that of 1000 draws 0.7 %.
"""

import json
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from explicit.materials import LAWS, AnyLaw
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.end_friction.correct import correct_friction
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction
from kolsky.material.fits.homogeneous import Mode, incompressible_stress
from kolsky.material.uniaxial import CurveBand, mean_of_repeats
from populations.driver import RESULTS, command, results, write

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = ROOT / "tests" / "reference"
FILE = RESULTS / "baseline_specimens.json"
POISSON = 0.495
SHOWN = (0.1, 0.2, 0.3, 0.4, 0.5)
"""Compressions in the tables."""
SPECIMENS, SCATTER, NOISE = 5, 0.02, 0.005
"""Number of specimens of a draw, relative scatter of their stiffness and of a sample [-]."""
SAMPLE = "sample"
"""Name of the modes of 1 of ln S at one strain; the corrected modes are the derivative of the correction."""
MATERIALS: dict[str, tuple[float, float, dict[str, float]]] = {
    "neo_hookean": (9.5e-3, 6.5e-3, {"mu": 80e3 / 2.99}),
    "yeoh": (9.5e-3, 6.5e-3, {"C10": 14e3, "C20": 2e3, "C30": 500.0}),
    "ogden2": (10e-3, 8e-3, {"mu1": 18e3, "alpha1": 3.5, "mu2": 8e3, "alpha2": -2.0}),
    "mooney_rivlin": (9.5e-3, 6.5e-3, {"C10": 9e3, "C01": 5e3}),
    "yeoh_b": (12e-3, 7e-3, {"C10": 20e3, "C20": -1.5e3, "C30": 800.0}),
    "ogden2_b": (8e-3, 6e-3, {"mu1": 24e3, "alpha1": 2.4, "mu2": 6e3, "alpha2": -3.0}),
    "mooney_rivlin_b": (10e-3, 6e-3, {"C10": 8e3, "C01": 2e3}),
    "yeoh_c": (11e-3, 9e-3, {"C10": 10e3, "C20": 4e3, "C30": 200.0}),
    "ogden2_c": (12.7e-3, 6.35e-3, {"mu1": 12e3, "alpha1": 5.0, "mu2": 10e3, "alpha2": -1.0}),
    "mooney_rivlin_c": (9e-3, 9e-3, {"C10": 4e3, "C01": 6e3}),
}
"""Diameter, length and constants [SI] of `tests/reference/I_specimens.py` by specimen. The law is the name
without "_b" or "_c"."""
CHOSEN_ON = ("neo_hookean", "yeoh", "ogden2", "mooney_rivlin", "mooney_rivlin_c/0.3")
"""Choices of the correction were made on these specimens. The others test it."""
ENDS = ("bonded", "0.3")
CASES = [
    ("neo_hookean", "bonded", "FElupe, DOLFINx"),
    ("neo_hookean", "0.3", "DOLFINx"),
    *((name, ends, "DOLFINx") for name in list(MATERIALS)[1:] for ends in ENDS),
]
"""Specimen, ends and program. GetFEM's forces (tables G and H) are not included. Their errors exceed the
allowed errors of a correction (`docs/validation/baseline.md`)."""


def law_of(name: str) -> AnyLaw:
    """Material law of a specimen."""
    constants, kind = MATERIALS[name][2], LAWS[name.removesuffix("_b").removesuffix("_c")]
    return kind.of([constants.get(spec.name, 0.0) for spec in kind.PARAMETERS])


def measured(name: str, ends: str) -> tuple[FloatArray, FloatArray]:
    """Compression and force [N] of a case."""
    if name == "neo_hookean" and ends == "bonded":
        rows = np.loadtxt(REFERENCE / "A_force_radius.csv", delimiter=",")
        return rows[:, 0], rows[:, 1]
    lines = [line.split(",") for line in (REFERENCE / "I_force.csv").read_text().splitlines()[1:]]
    kept = np.array([[float(x) for x in row[2:4]] for row in lines if row[0] == name and row[1] == ends])
    if not kept.size:
        raise ValueError(f"tests/reference/I_force.csv holds no {name} with {ends} ends")
    return kept[:, 0], kept[:, 1]


def available(name: str, ends: str) -> bool:
    """True if the table of the case exists; otherwise prints a line."""
    try:
        measured(name, ends)
    except ValueError as error:
        print(error, flush=True)
        return False
    return True


def case(name: str, ends: str, program: str, draws: int) -> dict[str, Any]:
    """Correct one specimen; its errors, band, laws and coverage."""
    diameter, length, _ = MATERIALS[name]
    size = Specimen(diameter=diameter, length=length, density=0.0)
    strain, force = measured(name, ends)
    stress = force / size.area
    true = -incompressible_stress(law_of(name), Mode.UNIAXIAL, 1.0 - strain)
    band = CurveBand(strain, stress, np.zeros_like(stress), np.diag(stress), (SAMPLE,) * strain.size)
    held = EndFriction("bonded") if ends == "bonded" else EndFriction("coulomb", float(ends))
    started = process_time()
    found = correct_friction(band, size, held, numerics=CorrectionNumerics(poisson=POISSON))
    relative, samples = found.band.modes / found.band.stress, np.array(found.band.names) == SAMPLE
    response, own = relative[samples].T, relative[~samples]
    ratio = found.band.stress / true
    error, twice = ratio - 1.0, 2.0 * ratio * np.sqrt((own**2).sum(axis=0))
    inside = strain <= 0.5 + 1e-9
    return {
        "specimen": name,
        "ends": ends,
        "program": program,
        "strain": strain.tolist(),
        "error": error.tolist(),
        "k2": twice.tolist(),
        "worst_to_half": float(np.abs(error[inside]).max()),
        "within_band": bool((np.abs(error) <= twice)[inside].all()),
        "misfit": found.misfit,
        "ratio": [float(found.ratio.min()), float(found.ratio.max())],
        "laws": [[m.name, m.weight, m.misfit, m.reason] for m in found.models],
        "coverage": coverage(ratio, response, own, band, draws),
        "draws": draws,
        "seconds": process_time() - started,
    }


def coverage(
    ratio: FloatArray, response: FloatArray, own: FloatArray, band: CurveBand, draws: int, seed: int = 23
) -> float:
    """Share of strains (up to 50 %) and draws at which the k = 2 band contains the true value.

    ``ratio``: corrected stress over the true one. ``response``: change of its logarithm by that of the
    stress at each strain, shape [n, n]. ``own``: relative modes of the correction, shape [n_modes, n].
    """
    rng = np.random.default_rng(seed)
    inside = band.strain <= 0.5 + 1e-9
    held = []
    for _ in range(draws):
        factor = (1.0 + SCATTER * rng.standard_normal((SPECIMENS, 1))) * (
            1.0 + NOISE * rng.standard_normal((SPECIMENS, band.strain.size))
        )
        drawn = mean_of_repeats(band.strain, band.stress * factor)
        off = ratio * np.exp(response @ np.log(drawn.stress / band.stress)) - 1.0
        modes = np.vstack([own, drawn.modes / drawn.stress @ response.T])
        held.append(np.abs(off)[inside] <= 2.0 * np.sqrt((modes**2).sum(axis=0))[inside])
    return float(np.mean(held))


def main() -> None:
    """Run the missing rows one by one."""
    parser = command(__doc__, out=False)
    parser.add_argument("--only", help="SPECIMEN/ENDS/PROGRAM, e.g. yeoh/0.3/DOLFINx")
    parser.add_argument("--draws", type=int, default=1000)
    given = parser.parse_args()
    done = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    wanted = [
        (*c, given.draws)
        for c in CASES
        if "/".join(c) not in done and given.only in (None, "/".join(c)) and available(*c[:2])
    ]
    for row in results(case, wanted, given.workers):
        name = "/".join(row[key] for key in ("specimen", "ends", "program"))
        done[name] = row
        write(FILE, {key: done[key] for key in map("/".join, CASES) if key in done}, indent=1)
        print(f"{name} worst {100 * row['worst_to_half']:.2f} %, in band {row['within_band']}, "
              f"coverage {100 * row['coverage']:.1f} %, {row['seconds']:.0f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
