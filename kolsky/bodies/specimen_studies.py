"""Effects of mesh, noise, softening and start on a fit, and expected intervals of a planned test.

Sections VI-C, VI-D and VI-F of Schumacher and others (2020) as functions of tests.

At expected constants, the derivatives of the forces by the constants give the covariance of a fit, C =
(sum_tests J^T J)^-1. J is whitened by the noise of the instruments. No data are needed. Shapes are compared
by the relative deviation of the constants of interest. If all constants are of interest, the criterion is the
determinant of the relative covariance (D-optimality, Kiefer and Wolfowitz 1960).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.information import SingularInformationError, inverse_information
from kolsky.base.arrays import FloatArray
from kolsky.bodies.errors_in_variables import Samples, reduce
from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_fit import SlowTest, SpecimenFit, correlation_of, fit
from kolsky.bodies.specimen_model import SpecimenModel


@dataclass(frozen=True)
class StudyRow:
    """One fit of a study."""

    label: str
    """Description of the variation."""
    values: dict[str, float]
    """All constants, SI."""
    rmse: float
    """Root mean square residual of the force over all tests [N]."""
    unknowns: int
    """Displacement components of the mesh of the first test."""
    simulations: int
    """Number of trial points of the search."""


def study_row(label: str, result: SpecimenFit) -> StudyRow:
    parts = [one for one in result.tests if one.fitted]
    rmse = float(np.sqrt(np.mean([one.rmse**2 for one in parts])))
    unknowns = parts[0].test.model.shape.mesh.points.size
    return StudyRow(label, dict(result.constants.values), rmse, unknowns, result.found.simulations)


def resolution_study(
    test: SlowTest,
    constants: Constants,
    *,
    factors: Sequence[int],
    orders: Sequence[str],
    base: Sequence[int],
) -> list[StudyRow]:
    """Constants for several meshes and element orders (their Fig. 6).

    ``constants``: the law, its start and the free constants. ``factors``: factors of the numbers of elements.
    ``orders``: elements: "hex8" (linear) and "hex27" (quadratic). ``base``: elements along each edge at the
    factor 1, as 20 x 5 x 1. Raises ValueError if a fit fails.
    """
    rows = []
    for element in orders:
        start = constants
        for factor in factors:
            elements = (factor * base[0], factor * base[1], factor * base[2])
            shape = replace(test.model.shape, elements=elements, element=element)
            own = replace(test, model=replace(test.model, shape=shape))
            result = fit(f"{element} {elements}", [own], start, bonds=False)
            label = f"{element} {elements[0]} x {elements[1]} x {elements[2]}"
            rows.append(study_row(label, result))
            start = result.constants  # of the coarser mesh: fewer steps
    return rows


def noise_study(
    test: SlowTest, constants: Constants, *, sigmas: Sequence[float], repeats: int
) -> list[StudyRow]:
    """Constants with increasing noise added to the forces.

    ``sigmas``: standard deviations of the added noise [N]. ``repeats``: number of draws for each.
    """
    rng = np.random.default_rng(1)
    rows = []
    for sigma in sigmas:
        for draw in range(repeats if sigma > 0.0 else 1):
            added = sigma * rng.standard_normal(test.samples.force.shape)
            total = float(np.hypot(test.samples.sigma_force, sigma))
            samples = replace(test.samples, force=test.samples.force + added, sigma_force=total)
            result = fit("noise", [replace(test, samples=samples)], constants, bonds=False)
            rows.append(study_row(f"sigma {sigma:g} N, draw {draw + 1}", result))
    return rows


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
