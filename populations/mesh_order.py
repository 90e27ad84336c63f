"""The order of the mesh error in the answer: `python -m populations.mesh_order --out FOLDER`.

Experiments of `populations.coverage_problem` are simulated without noise, at their true parameters, on a
series of meshes with both elements. One fixed linear map converts differences of the data vectors to
differences of the parameters. Weights and searches therefore do not affect the order. `--judge` does not fit
the order. It prints the remaining errors with the order of `kolsky.uncertainty.mesh_error`. The folder stores
one file for each mesh, so an interrupted series can be continued.
"""

import json
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from kolsky.base.arrays import FloatArray
from kolsky.uncertainty.mesh_error import MeshChange
from populations import coverage_problem as problem
from populations.driver import command, write

MESHES = ((24, 32), (32, 43), (48, 64), (64, 86), (96, 129), (128, 172))
"""The default meshes of an identification are the first and the fourth."""
ELEMENTS = ("one_point", "fbar")
STEPS = {"stiffness_factor": 0.01, "poisson": 5e-5, "damping": 2e-6}
"""Steps of the central differences by the parameters, to either side, in SI."""
DISCREPANCY = 0.15
"""Standard deviation of the force in the weights, in addition to its noise [N]. It is about the effect of the
flyer's noise."""

LIMIT_ORDER = 1.2
"""Assumed order of convergence of the outline of F-bar elements in the test. This program prints 1.7 for seed
1 and 0.7 for twelve tests of seed 2. The order is 1.2 in slow tests and up to 2.8 in fast ones. The limit of
F-bar elements therefore has an error of up to 0.0015 of m. The mean, which is the truth, has half of this
error (`populations.truth_meshes`)."""

Series = dict[tuple[int, str], FloatArray]
"""Optimum minus the optimum on the finest mesh of F-bar elements, by element and number of elements across
the radius."""


def main() -> None:
    """Run the series, fit or test the orders, and print the result."""
    parser = command(__doc__)
    parser.add_argument(
        "--seed", type=int, nargs="+", default=[1], help="1 for the fit, another one to judge it"
    )
    parser.add_argument("--setups", type=int, default=4)
    parser.add_argument("--each", type=int, default=4, help="materials and flyers of each setup")
    parser.add_argument("--judge", action="store_true", help="judge the orders instead of fitting them")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    series = []
    for seed, group in product(given.seed, range(given.setups)):
        pairs = [problem.drawn(problem.GROUP * group + i, seed) for i in range(given.each)]
        setup, truths = pairs[0][0], [truth for _, truth in pairs]
        head = given.out / f"{seed}-{group}"
        slopes = np.array([slope_of(setup, truth, head, i, given.device) for i, truth in enumerate(truths)])
        data = {
            (mesh[0], element): kept_vectors(setup, truths, mesh, element, head, given.device)
            for mesh in MESHES
            for element in ELEMENTS
        }
        for i, truth in enumerate(truths):
            gain = _gain(slopes[i], setup, truth)
            finest = data[MESHES[-1][0], "fbar"][i]
            series.append({key: -gain @ (vectors[i] - finest) for key, vectors in data.items()})
            series[-1][0, "gain"] = gain  # for the test
            series[-1][0, "outline"] = _gain(slopes[i], setup, truth, outline_alone=True)
            series[-1] |= {(-key[0], key[1]): vectors[i] for key, vectors in data.items()}
    said = judged(series) if given.judge else fitted(series)
    print(json.dumps(said, indent=2))
    name = "judged" if given.judge else "fitted"
    write(given.out / f"{name}-{'-'.join(map(str, given.seed))}.json", said, indent=1)


def fitted(series: list[Series]) -> dict[str, Any]:
    """The order of the error of m with one limit for both elements, and the order of the difference of the
    elements."""
    sizes = np.array([1.0 / mesh[0] for mesh in MESHES])
    errors = np.array([[[one[m[0], e][0] for m in MESHES] for e in ELEMENTS] for one in series])

    def left_over(order: float, rows: FloatArray = errors) -> float:
        power = (sizes / sizes[0]) ** order
        zero = np.zeros_like(power)
        columns = np.stack([np.ones(2 * len(sizes)), np.r_[power, zero], np.r_[zero, power]], axis=1)
        flat = rows.reshape(len(rows), -1).T
        return float(((flat - columns @ np.linalg.lstsq(columns, flat, rcond=None)[0]) ** 2).sum())

    order = minimize_scalar(left_over, bounds=(0.5, 5.0), method="bounded").x
    drawn_again = np.random.default_rng(1).integers(len(series), size=(200, len(series)))
    scatter = [
        minimize_scalar(left_over, bounds=(0.5, 5.0), method="bounded", args=(errors[rows],)).x
        for rows in drawn_again
    ]
    apart = np.abs(errors[:, 1] - errors[:, 0])
    coarse, fine = 0, 3  # of the default meshes
    share = float(np.sqrt((apart[:, fine] ** 2).sum() / (apart[:, coarse] ** 2).sum()))
    changes = {
        step: np.mean(
            [-one[0, "outline"][0] @ (one[-step, "fbar"] - one[-2 * step, "fbar"]) for one in series]
        )
        for step in (32, 64)
    }
    return {
        "experiments": len(series),
        "order": float(order),
        "its standard error, by experiments drawn again": float(np.std(scatter)),
        "order of the elements' distance": float(np.log(share) / np.log(sizes[fine] / sizes[coarse])),
        "order of the outline of F-bar elements": float(np.log2(changes[32] / changes[64])),
    }


def judged(series: list[Series]) -> dict[str, Any]:
    """Errors of the corrected answer on the default meshes over their estimates, by parameter.

    F-bar and one-point elements extrapolate to two limits. The mean of both is the truth; half of their
    difference is its uncertainty.
    """
    coarse, fine, finest = MESHES[0][0], MESHES[3][0], MESHES[-1][0]
    share = 1.0 / ((finest / fine) ** LIMIT_ORDER - 1.0)
    rows = []
    for one in series:
        gain = one[0, "gain"]
        fbar, point = (
            -gain @ (one[-finest, e] + share * (one[-finest, e] - one[-fine, e]))
            for e in ("fbar", "one_point")
        )
        change = MeshChange(
            coarser=one[-coarse, "one_point"] - one[-fine, "one_point"],
            element=one[-coarse, "fbar"] - one[-coarse, "one_point"],
            ratio=fine / coarse,
        )
        before = -gain @ one[-fine, "one_point"] - 0.5 * (fbar + point)
        rows.append([before, before + change.correction(gain), 0.5 * (fbar - point), change.sigma(gain)])
    table = np.array(rows).transpose(1, 2, 0)
    return {
        name: {
            "error on the refined mesh, mean": float(before.mean()),
            "corrected, mean": float(after.mean()),
            "limit of F-bar elements minus the middle, mean": float(apart.mean()),
            "said, mean": float(said.mean()),
            "corrected over said, root mean square": float(np.sqrt(((after / said) ** 2).mean())),
            "within twice what is said": float((np.abs(after) <= 2.0 * said).mean()),
        }
        for name, before, after, apart, said in zip(STEPS, *table, strict=True)
    }


def slope_of(setup: problem.Setup, truth: problem.Truth, head: Path, number: int, device: str) -> FloatArray:
    """Jacobian of the data vector by the parameters on the coarsest mesh, shape [k, 3]."""
    place = head.parent / f"{head.name}-slope-{number}"
    vectors = kept_vectors(setup, problem.moved(truth, STEPS), MESHES[0], "one_point", place, device)
    return problem.differences(list(vectors), STEPS)


def _gain(
    slope: FloatArray, setup: problem.Setup, truth: problem.Truth, *, outline_alone: bool = False
) -> FloatArray:
    """Least-squares map to m as the only parameter, then to the other parameters with m free, shape [3,
    k]."""
    seen = problem.template(setup, truth)
    force = np.hypot(seen.bins.sigma, DISCREPANCY)
    weight = np.concatenate([force, seen.centre_line.sigma]) ** -2
    weight[: len(force) if outline_alone else 0] = 0.0
    m = slope[:, :1]
    alone = np.linalg.solve((m.T * weight) @ m, m.T * weight)
    together = np.linalg.solve((slope.T * weight) @ slope, slope.T * weight)
    return np.concatenate([alone, together[1:]])


def kept_vectors(
    setup: problem.Setup,
    truths: list[problem.Truth],
    mesh: tuple[int, int],
    element: str,
    head: Path,
    device: str,
) -> FloatArray:
    """Data vectors on a mesh, read from the folder or simulated, shape [n, k]."""
    place = head.parent / f"{head.name}-{mesh[0]}-{element}.npz"
    if not place.exists():
        started = time.perf_counter()
        seen = problem.simulate(setup, truths, mesh=mesh, device=device, element=element)
        vectors = [data_vector(setup, truth, *one) for truth, one in zip(truths, seen, strict=True)]
        np.savez(place, vectors=np.array(vectors))
        print(f"{place.name}: {time.perf_counter() - started:.1f} s", flush=True)
    with np.load(place) as stored:
        return np.asarray(stored["vectors"])


def data_vector(setup: problem.Setup, truth: problem.Truth, force: FloatArray, Z: FloatArray) -> FloatArray:
    """Bin means of the force [N], followed by the radii [m]."""
    edges, t = problem.template(setup, truth).bins.edges, setup.samples
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(t))])
    return np.concatenate([np.diff(np.interp(edges, t, impulse)) / np.diff(edges), Z])


if __name__ == "__main__":
    main()
