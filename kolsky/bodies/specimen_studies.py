"""Expected intervals of a planned test, and fits compared with other tests.

At expected constants, the derivatives of the forces by the constants give the covariance of a fit, C =
(sum_tests J^T J)^-1. J is whitened by the noise of the instruments. No data are needed. Shapes are compared
by the relative deviation of the constants of interest. If all constants are of interest, the criterion is the
determinant of the relative covariance (D-optimality, Kiefer and Wolfowitz 1960).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from doe.information import SingularInformationError, inverse_information
from kolsky.base.arrays import FloatArray
from kolsky.bodies.errors_in_variables import Samples, reduce
from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_fit import SpecimenFit, correlation_of
from kolsky.bodies.specimen_model import SpecimenModel


def cross_table(fits: Sequence[SpecimenFit], tests: Sequence[str]) -> FloatArray:
    """RMSE of each test (column) with the constants of each fit (row) [N], shape [fits, tests]."""
    table = np.full((len(fits), len(tests)), np.nan)
    for row, result in enumerate(fits):
        for one in result.tests:
            if one.test.name in tests:
                table[row, list(tests).index(one.test.name)] = one.rmse
    return table


_LEAST_COLUMN = 1e-6
"""Smallest slope by a relative constant that is not rounding, as a share of the largest [-]."""


@dataclass(frozen=True)
class Expected:
    """Expected uncertainties from a choice of tests."""

    tests: tuple[str, ...]
    relative: FloatArray
    """Expected standard deviation of each constant divided by its size [-], shape [p]. Infinite if the data
    do not depend on it."""
    correlation: FloatArray
    """Expected correlations [-], shape [p, p]."""
    criterion: float
    """Criterion of the comparison, smaller is better [-]. It is the largest relative deviation of the
    constants of interest. Without such constants it is the geometric mean of all principal deviations."""
    peak_force: float
    """Largest force in the tests [N]."""


def expected(
    tests: Sequence[str],
    whitened: Mapping[str, FloatArray],
    forces: Mapping[str, float],
    constants: Constants,
    wanted: Sequence[str],
) -> Expected:
    """Expected deviations of the constants from tests together.

    ``tests``: their names. ``whitened``: L^-1 df/dp of each test, shape [m, p]. ``forces``: largest force of
    each test [N]. ``constants``: the constants at which the tests are planned. ``wanted``: names of the
    constants of interest. Empty means all.
    """
    sizes = np.maximum(np.abs(constants.start), 1e-3 * constants.scales)
    jacobian = np.concatenate([whitened[name] for name in tests]) * sizes
    peak = max(forces[name] for name in tests)
    p = len(sizes)
    relative, correlation = np.full(p, np.inf), np.eye(p)
    columns = np.sqrt((jacobian**2).sum(axis=0))
    seen = np.flatnonzero(columns > _LEAST_COLUMN * columns.max())
    criterion = np.inf
    try:
        if len(seen) == 0 or len(jacobian) < len(seen):
            raise SingularInformationError("a constant moves nothing")
        scaled = jacobian[:, seen] / columns[seen]
        covariance = inverse_information(scaled) / np.outer(columns[seen], columns[seen])
    except SingularInformationError:
        return Expected(tuple(tests), relative, correlation, criterion, peak)
    relative[seen] = np.sqrt(np.diag(covariance))
    correlation[np.ix_(seen, seen)] = correlation_of(covariance)
    if wanted:
        criterion = float(max(relative[constants.free.index(name)] for name in wanted))
    elif len(seen) == p:
        criterion = float(np.linalg.det(covariance) ** (0.5 / p))
    return Expected(tuple(tests), relative, correlation, criterion, peak)


def slopes(
    models: Mapping[str, SpecimenModel],
    schedules: Mapping[str, FloatArray],
    noise: Mapping[str, tuple[float, float]],
    constants: Constants,
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Simulate every planned test once, for the whitened slopes and the largest force of `plan`.

    ``models``: specimens by name. ``schedules``: displacements of their ends [m], shape [n, ends]. ``noise``:
    sigma of displacement [m] and of force [N]. ``constants``: the constants at which the tests are planned.
    Raises ValueError if a simulation fails.
    """
    whitened, forces = {}, {}
    for name, model in models.items():
        answer = model.linearised(constants, constants.start, schedules[name])
        if isinstance(answer, str):
            raise ValueError(answer)
        samples = Samples(schedules[name], answer.force, *noise[name])
        whitened[name] = reduce(samples, schedules[name], answer).jacobian
        forces[name] = float(np.abs(answer.force).max())
    return whitened, forces


def plan(
    choices: Sequence[Sequence[str]],
    whitened: Mapping[str, FloatArray],
    forces: Mapping[str, float],
    constants: Constants,
    *,
    wanted: Sequence[str] = (),
) -> list[Expected]:
    """Compare choices of tests, the most informative first; see `expected`."""
    expectations = [expected(tests, whitened, forces, constants, wanted) for tests in choices]
    return sorted(expectations, key=lambda one: one.criterion)
