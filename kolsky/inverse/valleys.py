"""Valleys of the misfit along Poisson's ratio: where to look, which to search, and which is the right one.

The force rings at the period of the pressure waves, some ten to sixty times in a test. Poisson's ratio sets
that period through K / G = 2 (1 + nu) / (3 (1 - 2 nu)), so that the misfit has a valley wherever the model's
oscillations match the measured ones in step, or one whole oscillation off. Valleys are equally far apart in
the number of oscillations, N = T c / (2 L) with the window T, the length L and the wave's speed
c^2 = (K + 4 G / 3) / rho: the scan takes equal steps of N.

On a coarse mesh the outline's error is a smooth field, many times its noise where there are thousands of
points, and it bends with Poisson's ratio; by number its points would outvote the force, which alone sees the
oscillations. So the points of a frame count once when valleys are compared. And a record of the flyer that is
uncertain at its onset makes a right model ring too much: at each valley's floor some runs under other motions
tell how, and what they explain does not speak against it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.front_noise import data_change, front_modes, noise_of
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.staged_runs import StagedRuns

VALLEY = "poisson"
"""The parameter whose misfit has many valleys."""
PHASE = 0.4
"""Step of the scan, in oscillations over the whole test: a run in step is at most half of it away."""
MOST_LEVELS = 240
"""Most values of Poisson's ratio in a scan."""
SMALL_STRAIN = 0.05
"""Strain up to which a curve's slope is its small-strain modulus [-]."""
LIKELY = {"balanced": 3, "force": 1, "joint": 2}
"""Local minima of each misfit of the scan that are searched, the deepest first: by a frame's points as one
entry, by the force alone, by all entries. The one nearest to the declared value is searched too."""
MOTIONS = 24
"""Other motions of the flyer at the floor of each valley that was searched."""


def small_strain_modulus(curve: MaterialCurve) -> float:
    """Slope of a curve's stress by its nominal strain through the origin, up to `SMALL_STRAIN` [Pa].

    At least the three points next to the origin are used.
    """
    strain = curve.stretch - 1.0
    order = np.argsort(np.abs(strain))
    order = order[strain[order] != 0.0]
    near = order[: max(3, int((np.abs(strain[order]) <= SMALL_STRAIN).sum()))]
    return float((strain[near] * curve.stress[near]).sum() / (strain[near] ** 2).sum())


def oscillations(
    poisson: FloatArray, *, modulus: float, density: float, length: float, window: float
) -> FloatArray:
    """Number of passages of a pressure wave there and back, T c / (2 L) [-], shape of `poisson`.

    Parameters
    ----------
    poisson
        Poisson's ratio [-], < 1/2.
    modulus
        Young's modulus of the incompressible material [Pa]: G is a third of it.
    density, length, window
        Of the specimen [kg/m^3], [m]; duration of the test [s].
    """
    shear = modulus / 3.0
    bulk = shear * 2.0 * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))
    return np.asarray(window * np.sqrt((bulk + 4.0 * shear / 3.0) / density) / (2.0 * length))


def valley_levels(stages: StagedRuns, factor: float, bounds: tuple[float, float]) -> FloatArray:
    """Values of Poisson's ratio between two bounds, both among them, a share of an oscillation apart.

    Parameters
    ----------
    stages
        The simulations: the shot's curve, density, length and window.
    factor
        Stiffness factor [-].
    bounds
        Of Poisson's ratio.
    """
    return equal_steps(*oscillation_table(stages, factor, bounds))


def oscillation_table(
    stages: StagedRuns, factor: float, bounds: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Poisson's ratio between two bounds [-] and its number of oscillations [-], both rising, shape [n].

    Parameters
    ----------
    stages, factor, bounds
        As of `valley_levels`.
    """
    shot, edges = stages.prepared.forward.shot, stages.observations.bins.edges
    table = 0.5 * (1.0 - np.geomspace(1.0 - 2.0 * bounds[0], 1.0 - 2.0 * bounds[1], 2000))
    number = oscillations(
        table,
        modulus=factor * small_strain_modulus(shot.curve),
        density=shot.specimen.density,
        length=shot.specimen.length,
        window=float(edges[-1] - edges[0]),
    )
    return table, number


def equal_steps(values: FloatArray, number: FloatArray) -> FloatArray:
    """Values at equal steps, at most `PHASE`, of an increasing function of them given in a table, both ends
    among them; fewer than that where they would be more than `MOST_LEVELS`."""
    n = min(max(ceil((number[-1] - number[0]) / PHASE) + 1, 2), MOST_LEVELS)
    return np.asarray(np.interp(np.linspace(number[0], number[-1], n), number, values))


def local_minima(values: FloatArray) -> list[int]:
    """Places of the values that are below both neighbours, the lowest first; NaN is no minimum."""
    padded = np.concatenate([[np.inf], np.where(np.isnan(values), np.inf, values), [np.inf]])
    found = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
    return sorted(found.tolist(), key=lambda i: float(values[i]))


def likely_valleys(objective: Objective, vectors: FloatArray, distance: FloatArray) -> list[int]:
    """Rows of a scan that lie on the floor of a valley and deserve a search, the likeliest first.

    Parameters
    ----------
    objective
        Over the outline points that every run reaches.
    vectors
        Predicted data along the scan, shape [n, k].
    distance
        Of each run from the declared value, in any unit, shape [n].
    """
    misfits = {
        "balanced": objective.balanced_deviance(vectors),
        "force": objective.deviance(vectors, "force"),
        "joint": objective.deviance(vectors),
    }
    found = [row for name, most in LIKELY.items() for row in local_minima(misfits[name])[:most]]
    floors = local_minima(misfits["joint"]) + local_minima(misfits["balanced"])
    if floors:
        found.append(min(floors, key=lambda row: float(distance[row])))
    return list(dict.fromkeys(found))


def judged(
    stages: StagedRuns, points: FloatArray, runs: Sequence[Prediction | None], inside: BoolArray
) -> FloatArray:
    """-2 ln of likelihood and prior at points, each with the noise of the flyer's motion there, shape [n].

    Up to a constant, a frame's points as one entry; infinite where the run did not complete.

    Parameters
    ----------
    stages
        The identification's simulations.
    points
        In parameter units, shape [n, d].
    runs
        Of each point under other motions, see `StagedRuns.under_other_motions`.
    inside
        Outline points that count, shape [n_points].
    """
    found = np.full(len(points), np.inf)
    # The same outline points for all of them: likelihoods of different data do not compare.
    counted = inside & np.all([run.inside[0] for run in runs if run is not None], axis=0)
    for row, prediction in enumerate(runs):
        if prediction is not None:
            seen = replace(stages.observations, front_noise=patterns_of(stages, prediction))
            objective = Objective(seen, counted, prior=stages.prior)
            vector = objective.vectors(prediction)[:1]
            found[row] = objective.balanced_deviance(vector)[0] + objective.prior_chi2(points[row])
    return found


def patterns_of(stages: StagedRuns, prediction: Prediction) -> FloatArray:
    """Patterns of the flyer's noise from runs under other motions, shape [q, n_bins + n_points]."""
    return front_modes(data_change(prediction)[1:], noise_of(stages.observations))
