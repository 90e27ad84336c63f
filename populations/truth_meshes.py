"""Mesh convergence of the coverage study's truth: `python -m populations.truth_meshes --out FOLDER`.

Experiments of `populations.coverage_problem` are simulated without noise on meshes with both elements, some
with stronger grading toward the faces' edges. The table gives the difference of each outline from that of the
truth. Least squares over all its points convert it to m, nu and beta: first m only, then the three together.
All must converge to the same limit. The folder stores one file for each run, so an interrupted study can be
continued.
"""

import argparse
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from populations import coverage_problem as problem
from populations.driver import command, markdown, write

STEPS = {"stiffness_factor": 0.01, "poisson": 2e-5, "damping": 1e-6}
"""Steps of the central differences by the parameters, to either side, in SI."""
COARSE = (16, 22)
"""Mesh of the derivatives."""


@dataclass(frozen=True)
class Variant:
    """Mesh, element and grading of a truth."""

    mesh: tuple[int, int]
    element: str
    grading: float = 2.0

    @property
    def name(self) -> str:
        """Name in file names: elements across the radius, element, grading."""
        return f"{self.mesh[0]}-{self.element}-{self.grading:g}"


TRUTH = tuple(Variant((128, 172), element, problem.TRUTH_GRADING) for element in problem.TRUTH_ELEMENTS)
"""The study's truth is the mean of these variants."""
VARIANTS = (
    *(Variant(mesh, e) for e in problem.TRUTH_ELEMENTS for mesh in ((64, 86), (128, 172), (192, 258))),
    *TRUTH,
)


def main() -> None:
    """Simulate the missing tests, compare and print."""
    parser = options(__doc__)
    parser.add_argument("--only-kept", action="store_true", help="simulate nothing, compare what is there")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for group in given.groups:
        numbers = [problem.GROUP * group + i for i in range(given.each)]
        if not given.only_kept:
            for variant in VARIANTS:
                keep(variant, numbers, given.seed, given.out, given.device)
        rows += _compared(group, numbers, given.seed, given.out)
    write(given.out / "compared.json", rows, indent=1)
    heads = ("flyer (m/s)", "mesh", "element", "grading", "$m$ alone", "$m$", "$\\nu$", "$\\beta$ (µs)")
    formats = {"speed": ".1f", "mesh": "", "element": "", "grading": "g", "m_alone": "+.5f"}
    formats |= {"stiffness_factor": "+.5f", "poisson": "+.1g", "damping_us": "+.1g", "rms_um": ".2f"}
    rows = [{**row, "mesh": f"{row['mesh'][0]} × {row['mesh'][1]}"} for row in rows]
    cells = ([format(row[name], how) for name, how in formats.items()] for row in rows)
    print(markdown((*heads, "rms (µm)"), cells))


def options(description: str | None) -> argparse.ArgumentParser:
    """Options of a study of these truths: experiments, device and folder."""
    parser = command(description, seed=31)
    parser.add_argument("--groups", type=int, nargs="+", default=[1, 3, 7, 8], help="specimens and rates")
    parser.add_argument("--each", type=int, default=5, help="materials and flyers of each")
    return parser


def keep(variant: Variant, numbers: list[int], seed: int, folder: Path, device: str) -> None:
    """Simulate a group in one batch, unless its file exists."""
    if all(_place(folder, number, variant).exists() for number in numbers):
        return
    pairs = [problem.drawn(number, seed) for number in numbers]
    seen = problem.simulate(
        pairs[0][0],
        [truth for _, truth in pairs],
        mesh=variant.mesh,
        device=device,
        element=variant.element,
        grading=variant.grading,
    )
    for number, (force, Z) in zip(numbers, seen, strict=True):
        np.savez_compressed(_place(folder, number, variant), force=force, Z=Z)
    print(f"group {numbers[0] // problem.GROUP}: {variant.name}", flush=True)


def _compared(group: int, numbers: list[int], seed: int, folder: Path) -> list[dict[str, Any]]:
    """Differences of each variant's outline, averaged over a group."""
    slopes = _slopes(numbers, seed)
    found = []
    for variant in VARIANTS:
        if not all(_place(folder, number, variant).exists() for number in numbers):
            continue
        shifts = []
        for number, slope in zip(numbers, slopes, strict=True):
            truth = problem.middle(*(read(folder, number, one) for one in TRUTH))[1]
            apart = (read(folder, number, variant)[1] - truth).ravel()
            alone = np.linalg.lstsq(slope[:, :1], apart, rcond=None)[0]
            together = np.linalg.lstsq(slope, apart, rcond=None)[0]
            shifts.append([*alone, *together, np.sqrt(np.mean(apart**2))])
        m_alone, m, poisson, damping, rms = np.mean(shifts, axis=0).tolist()
        found.append(
            {
                "group": group,
                "speed": float(np.mean([problem.drawn(number, seed)[1].speed for number in numbers])),
                **asdict(variant),
                "m_alone": m_alone,
                "stiffness_factor": m,
                "poisson": poisson,
                "damping_us": 1e6 * damping,
                "rms_um": 1e6 * rms,
            }
        )
    return found


def _slopes(numbers: list[int], seed: int) -> list[FloatArray]:
    """Derivatives of the outline by the parameters on a coarse mesh, each of shape [points, 3]."""
    truths = [one for number in numbers for one in problem.moved(problem.drawn(number, seed)[1], STEPS)]
    setup, n = problem.drawn(numbers[0], seed)[0], 2 * len(STEPS)
    radii = [
        Z.ravel() for _, Z in problem.simulate(setup, truths, mesh=COARSE, device="cpu", element="one_point")
    ]
    return [problem.differences(radii[i : i + n], STEPS) for i in range(0, len(radii), n)]


def _place(folder: Path, number: int, variant: Variant) -> Path:
    return folder / f"t-{number}-{variant.name}.npz"


def read(folder: Path, number: int, variant: Variant) -> tuple[FloatArray, FloatArray]:
    with np.load(_place(folder, number, variant)) as stored:
        return stored["force"], stored["Z"]


if __name__ == "__main__":
    main()
