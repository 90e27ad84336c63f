"""The order of the mesh error in the answer: `python -m benchmarks.mesh_order --seed 1 --setups 4`.

Experiments of `benchmarks.coverage_problem` are simulated without noise, at their true parameters, on a
series of meshes with both elements. Differences of the data vectors are carried to the parameters by one
fixed linear map, so that weights and searches play no part: the order is that of the parameters' own error.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks.coverage_problem import GROUP, FloatArray, Setup, Truth, drawn, simulate, template

MESHES = ((16, 22), (24, 32), (32, 43), (48, 64), (64, 86), (96, 129))
ELEMENTS = ("one_point", "fbar")


def main() -> None:
    """Run the series and write the data vectors' moves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--setups", type=int, default=4)
    parser.add_argument("--each", type=int, default=2, help="materials and flyers of each setup")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for group in range(given.setups):
        pairs = [drawn(GROUP * group + i, given.seed) for i in range(given.each)]
        setup, truths = pairs[0][0], [truth for _, truth in pairs]
        for mesh in MESHES:
            for element in ELEMENTS:
                place = given.out / f"{given.seed}-{group}-{mesh[0]}-{element}.npz"
                if place.exists():
                    continue
                started = time.perf_counter()
                seen = simulate(setup, truths, mesh=mesh, device=given.device, element=element)
                vectors = [_vector(setup, truth, one) for truth, one in zip(truths, seen, strict=True)]
                np.savez(place, vectors=np.array(vectors))
                print(place.name, round(time.perf_counter() - started, 1), flush=True)


def _vector(setup: Setup, truth: Truth, seen: tuple[FloatArray, FloatArray]) -> FloatArray:
    force, Z = seen
    bins = template(setup, truth).bins
    t = setup.samples
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(t))])
    return np.concatenate([np.diff(np.interp(bins.edges, t, impulse)) / np.diff(bins.edges), Z])


if __name__ == "__main__":
    main()
