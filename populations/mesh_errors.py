"""Effect of the mesh on an answer: `python -m populations.mesh_errors --truths FOLDER --out FOLDER`.

Experiments of `populations.coverage_problem` without noise are identified with the default meshes and free m,
nu and beta. The answers are compared with the truths of a coverage study. The errors come from the mesh and
from the interpolation of the flyer's path between frames. For one, two and three free parameters the study
stores the error on the refined mesh and the shift by each additional run. It prints the remaining error after
extrapolation with several orders, over the estimate of `kolsky.uncertainty.mesh_error`.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.search import search_shot
from kolsky.inverse.work import Work
from kolsky.uncertainty.mesh_error import ELEMENT_ORDER, MeshChange, mesh_change
from populations.coverage import Study, truth_file
from populations.coverage_problem import drawn, experiment
from populations.driver import answers, command, markdown, mesh, numbers, settings, write

NAMES = ("stiffness_factor", "poisson", "damping")
SETS = ((0,), (0, 2), (0, 1, 2))
"""Sets of free parameters, by index."""
ORDERS = (1.5, 2.0, 2.5, 3.0)
SHARES = (0.0, 0.3, 0.4, 0.5)


class Silent(np.random.Generator):
    """A generator that draws zeros."""

    def standard_normal(self, size: Any = None, *args: Any, **kwargs: Any) -> Any:
        """Zeros of a shape."""
        return np.zeros(size)


def errors(study: Study, folder: Path, number: int) -> dict[str, Any]:
    """Error of one experiment's answer, and the shifts that the additional runs cause."""
    setup, truth = drawn(number, study.seed)
    with np.load(truth_file(study, folder, number)) as stored:
        seen = stored["force"], stored["Z"]
    shot = experiment(number, setup, truth, seen, study.interface, Silent(np.random.PCG64(0)))
    asked = settings(study, free=dict.fromkeys(NAMES), seed=study.seed + number)
    found = search_shot(InverseProblem.of(shot, asked), Work())
    true = np.array([float(getattr(truth, name)) for name in found.problem.box.names])
    change = mesh_change(found.runner, found.fine)
    order = [found.problem.box.names.index(name) for name in NAMES]
    return {
        "number": number,
        "ratio": change.ratio,
        "graded_ratio": None if change.graded is None else change.graded.ratio,
        "sets": [_moved(found.fine, change, true, [order[i] for i in free]) for free in SETS],
    }


def _moved(fine: RefinedOptimum, change: MeshChange, true: FloatArray, free: list[int]) -> dict[str, Any]:
    """Error of the free parameters, and their shift by each change of the mesh. One linear map gives both."""
    objective, slope = fine.objective, fine.jacobian
    gain = objective.gain(slope[:, free])
    at_truth = fine.model(fine.x)[0] + slope @ (true - fine.x)
    noise = objective.covariance(slope[:, free], fine.model(fine.x)[0])
    said: dict[str, Any] = {
        "error": gain @ (objective.data - at_truth),
        "noise": np.sqrt(np.diag(noise)),
        "before": replace(change, graded=None).correction(gain),
    }
    if change.graded is not None:
        said["graded"] = -gain @ change.graded.graded
        said["coarser"] = gain @ change.graded.coarser
        said["coarser_in_windows"] = change.in_windows(gain, change.graded.coarser)
    if change.element is not None:
        said["element_in_windows"] = change.in_windows(gain, change.element)
    return {name: np.asarray(value).tolist() for name, value in said.items()}


def table(rows: list[dict[str, Any]]) -> str:
    """Mean and scatter of the remaining error, and its root mean square over the estimate, as Markdown."""
    lines: list[tuple[str, ...]] = []
    said = {share: [] for share in SHARES}  # type: dict[float, list[float]]
    for k, free in enumerate(SETS):
        sets = [
            row["sets"][k]
            for row in rows
            if "graded" in row["sets"][k] and "element_in_windows" in row["sets"][k]
        ]
        part = {name: np.array([one[name] for one in sets]) for name in sets[0]}
        ratio, mesh = rows[0]["graded_ratio"], rows[0]["ratio"]
        apart = part["element_in_windows"] / mesh**ELEMENT_ORDER
        names = ", ".join(("m", "ν", "β")[i] for i in free)

        left_over = {"none": part["error"], "from the surrogate's mesh": part["error"] + part["before"]}
        for order in ORDERS:
            share = 1.0 / (ratio**order - 1.0)
            left = part["error"] + part["graded"] + share * part["coarser"]
            left_over[f"graded, order {order:g}"] = left
            if order == 2.0:
                for one in SHARES:
                    over = left / np.hypot(share * part["coarser_in_windows"], one * apart)
                    said[one] += np.sqrt((over**2).mean(axis=0)).tolist()
        for what, left in left_over.items():
            z = left / part["noise"]
            mean, scatter = (", ".join(f"{v:+.2f}" for v in row) for row in (z.mean(axis=0), z.std(axis=0)))
            lines.append((names, what, mean, scatter.replace("+", "")))
    shares = [
        (f"{one:g}", f"{', '.join(f'{v:.2f}' for v in each)}; in all {np.sqrt(np.mean(np.square(each))):.2f}")
        for one, each in said.items()
    ]
    heads = ("share of the elements' distance", "error over what is said, rms")
    whole = markdown(("free", "correction", "mean error / u", "scatter / u"), lines)
    return f"{whole}\n\n{markdown(heads, shares)}"


def main() -> None:
    """Run the missing identifications and print the table."""
    parser = command(__doc__, seed=50923)
    parser.add_argument("--truths", type=Path, required=True, help="the --out folder of a study of coverage")
    parser.add_argument("--truth-mesh", type=mesh, default=(96, 129), metavar="96x129")
    parser.add_argument("--rows", type=numbers, default="0:200:2", help="FIRST:STOP:STEP of the experiments")
    given = parser.parse_args()
    study = Study.of(given, free=NAMES)
    jobs = {given.out / f"errors-{n:04d}.json": (study, given.truths, n) for n in given.rows}
    rows = answers(errors, jobs, workers=given.workers)
    write(given.out / "mesh_errors.json", {"seed": given.seed, "each": rows})
    print(table(rows))


if __name__ == "__main__":
    main()
