"""What a fit depends on: the mesh and its order, the noise, the pull of a softening material, the start.

Sections VI-C, VI-D and VI-F of Schumacher and others (2020) as functions of tests.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.specimen.constants import Constants
from kolsky.specimen.fit import SlowTest, SpecimenFit, fit


@dataclass(frozen=True)
class StudyRow:
    """One fit of a study."""

    label: str
    """What was varied, in words."""
    values: dict[str, float]
    """All constants, SI."""
    rmse: float
    """Of the force over all tests [N]."""
    unknowns: int
    """Displacement components of the mesh of the first test."""
    simulations: int
    """Trial points of the search."""


def _row(label: str, found: SpecimenFit) -> StudyRow:
    parts = [one for one in found.tests if one.fitted]
    rmse = float(np.sqrt(np.mean([one.rmse**2 for one in parts])))
    unknowns = parts[0].test.model.shape.mesh.points.size
    return StudyRow(label, dict(found.constants.values), rmse, unknowns, found.found.simulations)


def resolution_study(
    test: SlowTest,
    constants: Constants,
    *,
    factors: Sequence[int],
    orders: Sequence[str],
    base: Sequence[int],
) -> list[StudyRow]:
    """Constants over the mesh and the order of its elements (their Fig. 6).

    Parameters
    ----------
    test
        One test.
    constants
        The law, its start and what is free.
    factors
        Factors of the numbers of elements.
    orders
        Elements: "hex8" (linear) and "hex27" (quadratic).
    base
        Elements along each edge at the factor 1, as 20 x 5 x 1.

    Raises
    ------
    ValueError
        If a fit fails.
    """
    rows = []
    for element in orders:
        start = constants
        for factor in factors:
            elements = (factor * base[0], factor * base[1], factor * base[2])
            shape = replace(test.model.shape, elements=elements, element=element)
            own = replace(test, model=replace(test.model, shape=shape))
            found = fit(f"{element} {elements}", [own], start, bonds=False)
            label = f"{element} {elements[0]} x {elements[1]} x {elements[2]}"
            rows.append(_row(label, found))
            start = found.constants  # of the coarser mesh: fewer steps
    return rows


def noise_study(
    test: SlowTest, constants: Constants, *, sigmas: Sequence[float], repeats: int, seed: int = 1
) -> list[StudyRow]:
    """Constants with noise of rising size added to the forces (their Fig. 9).

    Parameters
    ----------
    test, constants
        As in `resolution_study`.
    sigmas
        Standard deviations of what is added [N].
    repeats
        Draws of each.
    seed
        Of the draws.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for sigma in sigmas:
        for draw in range(repeats if sigma > 0.0 else 1):
            added = sigma * rng.standard_normal(test.samples.force.shape)
            total = float(np.hypot(test.samples.sigma_force, sigma))
            samples = replace(test.samples, force=test.samples.force + added, sigma_force=total)
            found = fit("noise", [replace(test, samples=samples)], constants, bonds=False)
            rows.append(_row(f"sigma {sigma:g} N, draw {draw + 1}", found))
    return rows


def pulls_study(pulls: Mapping[str, SlowTest], laws: Sequence[Constants]) -> list[StudyRow]:
    """Several laws fitted to each pull of a softening material (their Fig. 7, the Mullins effect).

    The first pull is the stiffest the material will ever be, the last pull to the largest strain bounds it
    from below: a design takes both.
    """
    rows = []
    for name, test in pulls.items():
        for constants in laws:
            found = fit(name, [test], constants, bonds=False)
            rows.append(_row(f"{name}, {constants.law}", found))
    return rows


def cross_table(fits: Sequence[SpecimenFit], tests: Sequence[str]) -> FloatArray:
    """RMSE of each test (column) with the constants of each fit (row) [N], shape [fits, tests]."""
    table = np.full((len(fits), len(tests)), np.nan)
    for row, found in enumerate(fits):
        for one in found.tests:
            if one.test.name in tests:
                table[row, list(tests).index(one.test.name)] = one.rmse
    return table
