"""Valleys of the misfit along Poisson's ratio: scan, floors, the likeliest one, coordinates.

The force rings at the period of the pressure waves, some ten to sixty times in a test. Poisson's ratio sets
that period through K / G = 2 (1 + nu) / (3 (1 - 2 nu)). The misfit has a valley wherever the model's
oscillations are in phase with the measured ones, or shifted by whole oscillations. Valleys are equally spaced
in the number of oscillations, N = T c / (2 L), with the window T, the length L and the wave speed c^2 = (K +
4 G / 3) / rho. The scan takes equal steps of N.

On a coarse mesh the outline's error is a smooth field, many times its noise. The points of a frame therefore
count as one value when valleys are compared. The search continues from the likeliest floor. Its coordinate of
Poisson's ratio is log(1 - 2 nu). A valley is a few percent of 1 - 2 nu wide.
"""

from __future__ import annotations

from math import ceil

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import MOVED, PARAMETERS
from kolsky.inverse.problem import InverseProblem, PreparedShot

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


LEAST_MARGIN = 25.0
"""Smallest rise of -2 ln L at the next valley of Poisson's ratio [-]. If the ringing is weak, the error of a
coarse mesh can be as large. Of 200 synthetic tests, the two with a wrong valley have 3 and 24.5, the others
have 168 to 1040 (docs/validation/coverage.md)."""
OTHER_VALLEY = 2.0
"""A floor farther than this from the likeliest one belongs to another valley [oscillations]."""


def margin(values: FloatArray, apart: FloatArray) -> float:
    """Margin of the likeliest floor relative to the likeliest other valley [-]; infinite without one.

    ``values``: -2 ln of likelihood and prior, the likeliest floor's first, [n]. ``apart``: from it, [n].
    """
    others = values[apart > OTHER_VALLEY]
    return float(np.min(others, initial=np.inf) - values[0])


def oscillations_apart(problem: InverseProblem, floors: FloatArray) -> FloatArray:
    """Distance of floors from the first one, [n, d] -> [n], in oscillations at its stiffness."""
    box = problem.box
    i = box.names.index(VALLEY)
    factor = float(floors[0, box.names.index(MOVED)]) if MOVED in box.names else 1.0
    table, number = oscillation_table(problem.prepared, factor, (box.lower[i], box.upper[i]))
    at = np.interp(floors[:, i], table, number)
    return np.asarray(np.abs(at - at[0]))


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
