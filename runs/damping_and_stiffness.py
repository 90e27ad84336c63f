"""What an assumed damping does to m, by each misfit: `python runs/damping_and_stiffness.py [SHOT]`.

Runs of a shot over the stiffness at its own damping and at four times that. The optimum of the paper's Phi
(Eq. M.5), of its two parts, and of the force's squares in the whole window and in its thirds.
"""

import sys
from pathlib import Path

import numpy as np

import kolsky
from doe import Box, CostSurrogate, nelder_mead
from kolsky.inverse.forward import Numerics
from kolsky.inverse.misfit import terms
from kolsky.inverse.observations import predict
from kolsky.inverse.prepared_shot import prepare_shot

shot = kolsky.load_shot(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "open-01")
prepared = prepare_shot(shot)
seen = prepared.observations
m = np.linspace(0.6, 1.3, 36)
bins = seen.bins
third = np.searchsorted(bins.edges[1:], np.linspace(*shot.window, 4)[1:3])


def least(cost: np.ndarray) -> float:
    """The minimum of a cost over the runs: a parabola through nine of them about the lowest."""
    k = int(np.clip(np.argmin(cost), 4, len(m) - 5))
    a, b, _ = np.polyfit(m[k - 4 : k + 5], cost[k - 4 : k + 5], 2)
    return float(-b / (2.0 * a))


def of_levels(cost: np.ndarray) -> float:
    """The minimum of radial basis functions through eight of the runs, as a coarse factorial has them."""
    levels = Box.of({"stiffness_factor": (m[0], m[-1])})
    surrogate = CostSurrogate.fit(levels, m[::5, None], cost[::5])
    return float(nelder_mead(surrogate.cost, levels, start=m[[5 * int(np.argmin(cost[::5]))]]).x[0])


optima = []
for beta in (shot.model.damping, 4.0 * shot.model.damping):
    response = prepared.forward.run(
        {"stiffness_factor": m, "damping": np.full(len(m), beta)}, Numerics(mesh=(16, 22))
    )
    prediction = predict(response, seen)
    found = [terms(prediction, seen, i) for i in range(len(m))]
    square = (prediction.force_bins - bins.mean) ** 2
    costs = {
        "Phi, Eq. (M.5)": np.array([t.phi for t in found]),
        "Phi_F, the force alone": np.array([t.phi_force for t in found]),
        "Phi_S, the outline alone": np.array([t.phi_shape for t in found]),
        "squares of the force": square.sum(axis=1),
        "the same, first third": square[:, : third[0]].sum(axis=1),
        "the same, second third": square[:, third[0] : third[1]].sum(axis=1),
        "the same, last third": square[:, third[1] :].sum(axis=1),
    }
    own = {name: least(cost) for name, cost in costs.items()}
    for name in list(costs)[:3]:
        own[f"{name}, through eight levels"] = of_levels(costs[name])
    optima.append(own)
for name, own in optima[0].items():
    more = optima[1][name]
    print(
        f"{name}: m = {own:.3f} at {1e6 * shot.model.damping:g} us, {more:.3f} at four times that,"
        f" {100.0 * (more / own - 1.0):+.1f} %"
    )
