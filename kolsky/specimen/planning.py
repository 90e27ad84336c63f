r"""Which specimen tells most: intervals that tests would give, before they are made.

At constants that one expects, the slopes of the forces by the constants give the covariance of a fit,
C = (sum_tests J^T J)^-1 with J whitened by the noise of the instruments; no data are needed. Shapes are
compared by the relative deviation of what is wanted, or, where all is wanted, by the determinant of the
relative covariance (D-optimality, Kiefer and Wolfowitz 1960).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from doe.uncertainty.covariance import SingularInformationError, inverse_information
from kolsky.base.arrays import FloatArray
from kolsky.specimen.constants import Constants
from kolsky.specimen.equilibrium import SpecimenModel
from kolsky.specimen.errors_in_variables import Linearised, Samples, reduce
from kolsky.specimen.intervals import correlation_of

LEAST_COLUMN = 1e-6
"""Least slope by a relative constant, as a share of the largest, that is not rounding [-]."""


@dataclass(frozen=True)
class Expected:
    """What a choice of tests would tell."""

    tests: tuple[str, ...]
    """The tests."""
    relative: FloatArray
    """Expected standard deviation of each constant over its size [-], shape [p]; infinite if not seen."""
    correlation: FloatArray
    """Expected correlations [-], shape [p, p]."""
    criterion: float
    """What is compared, smaller is better: the largest relative deviation of what is wanted, or with nothing
    wanted in particular the geometric mean of all principal ones [-]."""
    peak_force: float
    """Largest force that the tests need [N]."""


def expected(
    tests: Sequence[str],
    whitened: Mapping[str, FloatArray],
    forces: Mapping[str, float],
    constants: Constants,
    wanted: Sequence[str],
) -> Expected:
    """Expected deviations of the constants from tests together.

    Parameters
    ----------
    tests
        Which.
    whitened
        L^-1 df/dp of each test, shape [m, p].
    forces
        Largest force of each test [N].
    constants
        The constants at which the tests are planned.
    wanted
        Names of those that one wants to know; none: all.
    """
    sizes = np.maximum(np.abs(constants.start), 1e-3 * constants.scales)
    jacobian = np.concatenate([whitened[name] for name in tests]) * sizes
    peak = max(forces[name] for name in tests)
    p = len(sizes)
    relative, correlation = np.full(p, np.inf), np.eye(p)
    columns = np.sqrt((jacobian**2).sum(axis=0))
    seen = np.flatnonzero(columns > LEAST_COLUMN * columns.max())
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
) -> tuple[dict[str, FloatArray], dict[str, float], dict[str, Linearised]]:
    """Simulate every planned test once.

    Parameters
    ----------
    models
        Specimens by name.
    schedules
        Displacements of their ends [m], shape [n, ends].
    noise
        sigma of displacement [m] and of force [N].
    constants
        The constants at which the tests are planned.

    Returns
    -------
    whitened slopes, largest forces [N], and the simulations, each by the name of the test

    Raises
    ------
    ValueError
        If a simulation fails.
    """
    whitened, forces, found = {}, {}, {}
    for name, model in models.items():
        answer = model.linearised(constants, constants.start, schedules[name])
        if isinstance(answer, str):
            raise ValueError(answer)
        samples = Samples(schedules[name], answer.force, *noise[name])
        whitened[name] = reduce(samples, schedules[name], answer).jacobian
        forces[name] = float(np.abs(answer.force).max())
        found[name] = answer
    return whitened, forces, found


def plan(
    choices: Sequence[Sequence[str]],
    whitened: Mapping[str, FloatArray],
    forces: Mapping[str, float],
    constants: Constants,
    *,
    wanted: Sequence[str] = (),
) -> list[Expected]:
    """Compare choices of tests, the one that tells most first; see `expected`."""
    found = [expected(tests, whitened, forces, constants, wanted) for tests in choices]
    return sorted(found, key=lambda one: one.criterion)
