"""Duration over which mesh errors have one sign: `python -m populations.mesh_windows --out FOLDER`.

The folder is that of `populations.truth_meshes`, with its noise-free tests on several meshes. Missing tests
are simulated. One fixed linear map gives the error of m, nu and beta on the default refined mesh. The error
is corrected like an answer and divided by the estimate of `kolsky.uncertainty.mesh_error`. The sign of the
elements' difference is assumed constant over the whole test, over half of it, over a quarter and so on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.uncertainty.mesh_error import MeshChange
from populations.coverage_problem import GROUP, drawn, middle, template
from populations.driver import markdown, write
from populations.mesh_order import DISCREPANCY, MESHES, STEPS, data_vector, kept_vectors, slope_of
from populations.truth_meshes import TRUTH, Variant, keep, options, read

COARSE, REFINED = MESHES[0], MESHES[3]
"""The default meshes of an identification."""
PARTS = (1, 2, 4, 6, 8, 12, 16, 24)
"""Numbers of windows."""


@dataclass(frozen=True)
class Case:
    """One test without noise."""

    gain: FloatArray
    """Linear map of the data to m, nu and beta, shape [3, k]."""
    error: FloatArray
    """Error of the three on the refined mesh, shape [3]."""
    change: MeshChange
    """The change between meshes that an identification observes."""
    share: FloatArray
    """Relative time of each entry in the test, 0 to 1, shape [k]."""


def main() -> None:
    """Simulate the missing tests, compare and print."""
    given = options(__doc__).parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    cases = []
    for group in given.groups:
        numbers = [GROUP * group + i for i in range(given.each)]
        for variant in (*TRUTH, Variant(REFINED, "one_point")):
            keep(variant, numbers, given.seed, given.out, given.device)
        cases += cases_of(numbers, given.seed, given.out)
    said = compared(cases)
    write(given.out / "windows.json", said, indent=1)
    rows = said["error over distance, root mean squares"].items()
    print(markdown(("windows", *STEPS), ([key, *(f"{row[n]:.2f}" for n in STEPS)] for key, row in rows)))


def cases_of(numbers: list[int], seed: int, folder: Path) -> list[Case]:
    """The tests of a group."""
    pairs = [drawn(number, seed) for number in numbers]
    setup, truths = pairs[0][0], [truth for _, truth in pairs]
    head = folder / f"{seed}-{numbers[0] // GROUP}"
    point, fbar = (kept_vectors(setup, truths, COARSE, e, head, "cpu") for e in ("one_point", "fbar"))
    found = []
    for i, (number, truth) in enumerate(zip(numbers, truths, strict=True)):
        slope = slope_of(setup, truth, head, i, "cpu")
        seen = template(setup, truth)
        sigma = np.concatenate([np.hypot(seen.bins.sigma, DISCREPANCY), seen.centre_line.sigma])
        weighted = slope.T * sigma**-2
        gain = np.linalg.solve(weighted @ slope, weighted)
        exact = data_vector(setup, truth, *middle(*(read(folder, number, one) for one in TRUTH)))
        fine = data_vector(setup, truth, *read(folder, number, Variant(REFINED, "one_point")))
        times = np.concatenate([0.5 * (seen.bins.edges[1:] + seen.bins.edges[:-1]), seen.centre_line.time])
        change = MeshChange(point[i] - fine, fbar[i] - point[i], REFINED[0] / COARSE[0])
        share = (times - times.min()) / (times.max() - times.min())
        found.append(Case(gain, -gain @ (fine - exact), change, share))
    return found


def compared(cases: list[Case]) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Root mean squares of the corrected errors over those of the elements' difference, by number of
    windows."""
    left = np.array([case.error + case.change.correction(case.gain) for case in cases])
    table = {}
    for parts in PARTS:
        said = []
        for case in cases:
            windows = np.minimum((parts * case.share).astype(int), parts - 1)
            alone = replace(case.change, coarser=np.zeros_like(case.share), windows=windows)
            said.append(alone.sigma(case.gain))
        over = np.sqrt((left**2).mean(axis=0) / (np.array(said) ** 2).mean(axis=0))
        table[str(parts)] = dict(zip(STEPS, over.tolist(), strict=True))
    correction = np.array([case.change.correction(case.gain) for case in cases])
    over = np.sqrt((left**2).mean(axis=0) / (correction**2).mean(axis=0))
    return {
        "error over distance, root mean squares": table,
        "error over correction, root mean squares": {"": dict(zip(STEPS, over.tolist(), strict=True))},
    }


if __name__ == "__main__":
    main()
