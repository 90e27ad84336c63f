"""Valleys of the misfit along Poisson's ratio: scan, floors, the likeliest one, coordinates.

The force rings at the period of the pressure waves, some ten to sixty times in a test. Poisson's ratio sets
that period through K / G = 2 (1 + nu) / (3 (1 - 2 nu)). The misfit has a valley wherever the model's
oscillations are in phase with the measured ones, or shifted by whole oscillations. Valleys are equally spaced
in the number of oscillations, N = T c / (2 L), with the window T, the length L and the wave speed c^2 = (K +
4 G / 3) / rho. The scan takes equal steps of N.

On a coarse mesh the outline's error is a smooth field, many times its noise. The points of a frame therefore
count as one value when valleys are compared. At the floor of each valley, some runs with other motions of the
flyer are made, because noise of the motion may explain ringing. The search continues from the likeliest
floor. Its coordinate of Poisson's ratio is log(1 - 2 nu). A valley is a few percent of 1 - 2 nu wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from doe import Box
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.objective import FrontNoise, Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.parameters import MOVED, PARAMETERS
from kolsky.inverse.path_noise import PathModes, data_change, noise_of
from kolsky.inverse.problem import InverseProblem, PreparedShot
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics

VALLEY = "poisson"
"""The parameter that causes many valleys of the misfit."""
PHASE = 0.4
"""Step of the scan, in oscillations over the whole test. A run in phase is then at most half a step away."""
MOST_LEVELS = 240
"""Maximum number of values of Poisson's ratio in a scan."""
SMALL_STRAIN = 0.05
"""Strain up to which a curve's slope is its small-strain modulus [-]."""
LIKELY = {"balanced": 3, "force": 1}
"""Number of local minima to search for each misfit of the scan, deepest first: with a frame's points as one
entry, by the force only. The one nearest to the declared value is searched too."""


def small_strain_modulus(curve: MaterialCurve) -> float:
    """Slope of a curve through the origin, up to `SMALL_STRAIN` or its three nearest points [Pa]."""
    strain = curve.stretch - 1.0
    order = np.argsort(np.abs(strain))
    order = order[strain[order] != 0.0]
    near = order[: max(3, int((np.abs(strain[order]) <= SMALL_STRAIN).sum()))]
    return float((strain[near] * curve.stress[near]).sum() / (strain[near] ** 2).sum())


def oscillations(
    poisson: FloatArray, *, modulus: float, density: float, length: float, window: float
) -> FloatArray:
    """Number of round trips of a pressure wave, T c / (2 L) [-], shape of `poisson`.

    ``modulus``: Young's modulus of the incompressible material [Pa]; G is a third of it. ``density``,
    ``length``: of the specimen [kg/m^3, m]. ``window``: duration of the test [s].
    """
    shear = modulus / 3.0
    bulk = shear * 2.0 * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))
    return np.asarray(window * np.sqrt((bulk + 4.0 * shear / 3.0) / density) / (2.0 * length))


def valley_levels(prepared: PreparedShot, factor: float, bounds: tuple[float, float]) -> FloatArray:
    """Values of Poisson's ratio between two bounds, both included, at equal steps of oscillations."""
    return equal_steps(*oscillation_table(prepared, factor, bounds))


def oscillation_table(
    prepared: PreparedShot, factor: float, bounds: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Poisson's ratio between two bounds, and its number of oscillations at a stiffness factor [-], [n]."""
    shot, edges = prepared.forward.shot, prepared.observations.bins.edges
    table = 0.5 * (1.0 - np.geomspace(1.0 - 2.0 * bounds[0], 1.0 - 2.0 * bounds[1], 2000))
    modulus = factor * small_strain_modulus(shot.curve)
    window = float(edges[-1] - edges[0])
    number = oscillations(
        table, modulus=modulus, density=shot.specimen.density, length=shot.specimen.length, window=window
    )
    return table, number


def equal_steps(values: FloatArray, number: FloatArray) -> FloatArray:
    """Values at equal steps, at most `PHASE`, of the increasing function `number`, at most `MOST_LEVELS`."""
    n = min(max(ceil((number[-1] - number[0]) / PHASE) + 1, 2), MOST_LEVELS)
    return np.asarray(np.interp(np.linspace(number[0], number[-1], n), number, values))


def local_minima(values: FloatArray) -> list[int]:
    """Indices of the values that are lower than both neighbours, the lowest first. NaN is no minimum."""
    padded = np.concatenate([[np.inf], np.where(np.isnan(values), np.inf, values), [np.inf]])
    found = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
    return sorted(found.tolist(), key=lambda i: float(values[i]))


def likely_valleys(objective: Objective, vectors: FloatArray, distance: FloatArray) -> list[int]:
    """Rows of a scan at valley floors, used as starts, the likeliest first.

    ``objective``: over the outline points that every run reaches. ``vectors``: data along the scan, [n, k].
    ``distance``: from the declared value, in any unit, [n].
    """
    misfits = {
        "balanced": objective.balanced_deviance(vectors),
        "force": objective.deviance(vectors, "force"),
    }
    found = [row for name, most in LIKELY.items() for row in local_minima(misfits[name])[:most]]
    floors = local_minima(misfits["balanced"])
    if floors:
        found.append(min(floors, key=lambda row: float(distance[row])))
    return list(dict.fromkeys(found))


def deviance_with_path_noise(
    runner: Runner, points: FloatArray, runs: Sequence[Prediction | None], inside: BoolArray
) -> FloatArray:
    """-2 ln of likelihood and prior at points, [n], with flyer's noise and balanced frames; inf if lost."""
    found = np.full(len(points), np.inf)
    # All points use the same outline points, because likelihoods of different data cannot be compared.
    counted = inside & np.all([run.inside[0] for run in runs if run is not None], axis=0)
    for row, prediction in enumerate(runs):
        if prediction is not None:
            front = FrontNoise(patterns_of(runner.problem, prediction))
            objective = replace(runner.objective(counted), front=front)
            vector = objective.vectors(prediction)[:1]
            found[row] = objective.balanced_deviance(vector)[0] + objective.prior_chi2(points[row])
    return found


def patterns_of(problem: InverseProblem, prediction: Prediction) -> FloatArray:
    """Patterns of the flyer's noise from runs with other motions, shape [q, n_bins + n_points]."""
    change = data_change(prediction)[1:]
    return PathModes.of(change, noise_of(problem.observations), change).patterns


LEAST_MARGIN = 25.0
"""Smallest rise of -2 ln L at the next valley of Poisson's ratio [-]. If the ringing is weak, the error of a
coarse mesh can be as large. Of 18 synthetic tests, the one with a wrong valley has 18, the others have 61 to
690 (docs/validation/coverage.md)."""
OTHER_VALLEY = 2.0
"""A floor farther than this from the likeliest one belongs to another valley [oscillations]."""


@dataclass(frozen=True)
class Floor:
    """The floor of the likeliest valley."""

    x: FloatArray
    """Point in parameter units, shape [d]."""
    patterns: FloatArray
    """Patterns of the flyer's noise there, one standard deviation each, shape [q, n_bins + n_points]."""
    margin: float
    """-2 ln of likelihood and prior at the next valley's floor minus that here [-]; infinite without one."""


def likeliest_floor(runner: Runner, floors: FloatArray, numerics: Numerics, inside: BoolArray) -> Floor:
    """The floor of the likeliest valley.

    ``floors``: in parameter units, shape [n, d]. ``inside``: outline points that every run reaches. Raises
    ValueError if no run at a floor completes.
    """
    runs = runner.under_other_motions(floors, runner.front_jerks, numerics)
    values = deviance_with_path_noise(runner, floors, runs, inside)
    first = int(np.argmin(values))
    found = runs[first]
    if found is None:
        raise ValueError("no run at a floor of the valleys of Poisson's ratio completed")
    order = np.r_[first, np.delete(np.arange(len(floors)), first)]
    apart = np.abs(_oscillations_at(runner, floors[order]) - _oscillations_at(runner, floors[[first]]))
    return Floor(floors[first], patterns_of(runner.problem, found), margin(values[order], apart))


def margin(values: FloatArray, apart: FloatArray) -> float:
    """Margin of the likeliest floor relative to the likeliest other valley [-].

    ``values``: -2 ln of likelihood and prior, the likeliest floor's first, [n]. ``apart``: from it, [n].
    """
    others = values[apart > OTHER_VALLEY]
    return float(np.min(others, initial=np.inf) - values[0])


def _oscillations_at(runner: Runner, points: FloatArray) -> FloatArray:
    """Oscillations over the whole test at points, [n, d] -> [n], with the stiffness of the first point."""
    box = runner.problem.box
    i = box.names.index(VALLEY)
    factor = float(points[0, box.names.index(MOVED)]) if MOVED in box.names else 1.0
    table, number = oscillation_table(runner.problem.prepared, factor, (box.lower[i], box.upper[i]))
    return np.asarray(np.interp(points[:, i], table, number))


def search_box(box: Box) -> Box:
    """The box of the search, with the logarithm of 1 - 2 nu and of parameters that span decades."""
    bounds = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))
    decades = [name for name in box.names if name in PARAMETERS and PARAMETERS[name].logarithmic]
    if VALLEY in bounds:
        low, high = bounds[VALLEY]
        bounds[VALLEY] = 1.0 - 2.0 * high, 1.0 - 2.0 * low
        decades.append(VALLEY)
    return Box.of(bounds, logarithmic=decades) if decades else box


def to_search(box: Box, points: FloatArray) -> FloatArray:
    """Points in the coordinates of the search, shape [..., d]."""
    x = np.array(points, dtype=np.float64)
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        x[..., i] = 1.0 - 2.0 * x[..., i]
    return x


def from_search(box: Box, points: FloatArray) -> FloatArray:
    """The inverse of `to_search`."""
    x = np.array(points, dtype=np.float64)
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        x[..., i] = 0.5 * (1.0 - x[..., i])
    return x
