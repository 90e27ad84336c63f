"""Effect of an assumed damping on m for each misfit: `python -m benchmarks.damping_and_stiffness [SHOT]`.

A shot is run over a range of stiffness, at its damping and at four times its damping. The table gives one
optimum for each misfit: the paper's Phi (Eq. M.5), its two parts, and the sum of squares of the force. This
sum is taken over the whole window and over its thirds. The table also gives the optimum of surrogates through
eight of the runs.
"""

import argparse
from pathlib import Path

import numpy as np

from doe import Box, CostSurrogate, nelder_mead
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import predict
from kolsky.inverse.problem import PreparedShot, prepare_shot
from kolsky.inverse.run_table import terms
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot

FACTORS = np.linspace(0.6, 1.3, 36)
"""Stiffness factors of the runs."""
NEAR, EVERY = 4, 5
"""A parabola uses this number of runs on either side of the minimum. The second number is the interval of the
runs in a coarse design."""
OPEN_01 = Path(__file__).parents[1] / "runs" / "open-01"


def least(cost: FloatArray) -> float:
    """The minimum of a cost over the runs: a parabola through nine runs around the lowest one."""
    k = int(np.clip(np.argmin(cost), NEAR, len(FACTORS) - NEAR - 1))
    near = slice(k - NEAR, k + NEAR + 1)
    a, b, _ = np.polyfit(FACTORS[near], cost[near], 2)
    return float(-b / (2.0 * a))


def of_levels(cost: FloatArray) -> float:
    """The minimum of radial basis functions through eight of the runs, as in a coarse factorial design."""
    box = Box.of({"stiffness_factor": (float(FACTORS[0]), float(FACTORS[-1]))})
    few, start = cost[::EVERY], FACTORS[::EVERY]
    surrogate = CostSurrogate.fit(box, start[:, None], few)
    return float(nelder_mead(surrogate.cost, box, start=start[[int(np.argmin(few))]]).x[0])


def optima(prepared: PreparedShot, beta: float) -> dict[str, float]:
    """The best stiffness factor at a damping [s] for each measure."""
    shot, seen = prepared.forward.shot, prepared.observations
    points = {"stiffness_factor": FACTORS, "damping": np.full(len(FACTORS), beta)}
    prediction = predict(prepared.forward.run(points, Numerics(mesh=(16, 22))), seen)
    found = [terms(prediction, seen, i) for i in range(len(FACTORS))]
    square = (prediction.force_bins - seen.bins.mean) ** 2
    first, second = np.searchsorted(seen.bins.edges[1:], np.linspace(*shot.window, 4)[1:3])
    costs = {
        "Phi, Eq. (M.5)": np.array([t.phi for t in found]),
        "Phi_F, the force alone": np.array([t.phi_force for t in found]),
        "Phi_S, the outline alone": np.array([t.phi_shape for t in found]),
        "squares of the force": square.sum(axis=1),
        "the same, first third": square[:, :first].sum(axis=1),
        "the same, second third": square[:, first:second].sum(axis=1),
        "the same, last third": square[:, second:].sum(axis=1),
    }
    levels = {f"{name}, through eight levels": of_levels(costs[name]) for name in list(costs)[:3]}
    return {**{name: least(cost) for name, cost in costs.items()}, **levels}


def main() -> None:
    """Print one line for each measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("shot", nargs="?", default=OPEN_01, metavar="SHOT")
    shot = load_shot(parser.parse_args().shot)
    prepared, beta = prepare_shot(shot), shot.model.damping
    own, more = optima(prepared, beta), optima(prepared, 4.0 * beta)
    for name, m in own.items():
        change = 100.0 * (more[name] / m - 1.0)
        print(
            f"{name}: m = {m:.3f} at {1e6 * beta:g} us, {more[name]:.3f} at four times that, {change:+.1f} %"
        )


if __name__ == "__main__":
    main()
