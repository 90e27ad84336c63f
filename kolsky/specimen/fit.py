"""Constants fitted to whole specimens: one test or several together, with intervals and checks.

The tests share one set of constants (Schumacher and others 2020, Sec. III); `errors_in_variables` is the
search, `intervals` what the data say of each constant, `debonding` whether a bond peels.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import qmc
from scipy.stats import t as student

from kolsky.base.arrays import FloatArray
from kolsky.specimen.constants import Constants
from kolsky.specimen.debonding import Debonding, debonding
from kolsky.specimen.equilibrium import SpecimenModel
from kolsky.specimen.errors_in_variables import Found, Linearised, Samples, reduce, search
from kolsky.specimen.intervals import LEVEL, Intervals, intervals
from kolsky.specimen.quasi_newton import search_by_quasi_newton

DECADES = 1.0
"""Decades to each side of the declared start over which further starts of a modulus are drawn."""
SAME = 1e-3
"""Largest difference of two starts' ends, in standard deviations, that counts as one minimum."""


@dataclass(frozen=True)
class SlowTest:
    """A specimen and what was measured on it."""

    model: SpecimenModel
    """The specimen."""
    samples: Samples
    """Displacements and forces of its ends, with their noise."""

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.model.name


@dataclass(frozen=True)
class TestFit:
    """A test beside its simulation with the fitted constants."""

    test: SlowTest
    """The test."""
    displacement: FloatArray
    """Displacements of the simulation: the measured ones within their noise [m], shape [n, ends]."""
    force: FloatArray
    """Simulated force at the measured displacements, to first order [N], shape [n, ends]."""
    band: FloatArray
    """Half width of its interval from the constants [N], shape [n, ends]."""
    fitted: bool
    """Whether the test took part in the fit; else it is predicted."""
    debonding: tuple[Debonding | None, ...] = ()
    """Strongest sign of a peeling bond at each end; empty if it was not looked for."""

    @property
    def rmse(self) -> float:
        """Root mean square of simulated less measured force [N]."""
        return float(np.sqrt(np.mean((self.force - self.test.samples.force) ** 2)))


Method = Literal["gauss_newton", "quasi_newton"]
"""How a fit is searched for."""
SEARCHES = {"gauss_newton": search, "quasi_newton": search_by_quasi_newton}


@dataclass(frozen=True)
class SpecimenFit:
    """One set of constants for some tests."""

    name: str
    """Name of the group of tests."""
    constants: Constants
    """The law with the fitted values in place."""
    intervals: Intervals
    """Of the free constants."""
    tests: tuple[TestFit, ...]
    """Fitted tests, then predicted ones."""
    found: Found
    """The search."""
    starts: tuple[FloatArray, ...]
    """Where the other starts ended, best first, each of shape [p]."""

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the tests that were fitted."""
        return tuple(one.test.name for one in self.tests if one.fitted)

    @property
    def warnings(self) -> list[str]:
        """What to know before using the constants."""
        said = []
        if not self.found.converged:
            said.append(f"{self.name}: the search did not come to rest: {self.found.ended}")
        said += [
            f"{self.name}: {one.sentence}"
            for one in self.intervals.estimates
            if one.verdict.value != "identified"
        ]
        if not self.intervals.explained:
            said.append(
                f"{self.name}: the law does not explain the forces within their declared noise (probability "
                f"{self.intervals.probability:.2g}): its misfit is {np.sqrt(self.intervals.scale):.3g} "
                "times as large, and the intervals are widened by that; try another law, or check sigma_force"
            )
        for one in self.tests:
            for end, peel in zip("xy", one.debonding, strict=False):
                if peel is not None and peel.suspected:
                    at = 1e3 * one.test.samples.displacement[peel.sample, "xy".index(end)]
                    said.append(
                        f"{self.name}: a bond of {one.test.name} seems to peel from {at:.3g} mm on (as if it "
                        f"were {1e3 * peel.length:.2g} ± {2e3 * peel.sigma:.2g} mm shorter): look at the "
                        "specimen, or end the data before it"
                    )
        return said


def fit(
    name: str,
    tests: Sequence[SlowTest],
    constants: Constants,
    *,
    predicted: Sequence[SlowTest] = (),
    starts: int = 1,
    seed: int = 1,
    bonds: bool = True,
    method: Method = "gauss_newton",
) -> SpecimenFit:
    """Fit one set of constants to tests.

    Parameters
    ----------
    name
        Of the fit.
    tests
        The tests.
    constants
        The law, its constants at the start, and which are free.
    predicted
        Tests that are simulated with the result for comparison.
    starts, seed
        Number of starts, the first as declared and the others drawn around it, and the seed of the draws.
    bonds
        Look for peeling bonds: one more simulation a test.
    method
        "gauss_newton" (with Levenberg and Marquardt's damping) or "quasi_newton" (L-BFGS-B), which needs more
        simulations.

    Raises
    ------
    ValueError
        If the simulation at the start fails, or there are not more samples than constants.
    """

    def respond(values: FloatArray, at: tuple[FloatArray, ...]) -> tuple[Linearised, ...] | str:
        answers = []
        for test, x in zip(tests, at, strict=True):
            answer = test.model.linearised(constants, values, x)
            if isinstance(answer, str):
                return answer
            answers.append(answer)
        return tuple(answers)

    samples = tuple(test.samples for test in tests)
    ends, refused, limits = [], "", constants.bounds
    for start in remote_starts(constants, starts, seed):
        try:
            ends.append(SEARCHES[method](respond, samples, start, bounds=limits, scales=constants.scales))
        except ValueError as error:
            refused = str(error)
    if not ends:
        raise ValueError(refused)
    ends.sort(key=lambda one: one.chi2)
    best = ends[0]
    series: list[FloatArray] = []
    for own, x, there in zip(samples, best.displacements, best.linearised, strict=True):
        series += list(reduce(own, x, there).residual.reshape(x.shape).T)
    said = intervals(
        constants.free,
        best.constants,
        best.reduced,
        tuple(series),
        at_bound=best.at_bound,
        bounds=constants.bounds,
    )
    values = Constants(constants.law, constants.all(best.constants), constants.free)
    beside = []
    for test, x, there in zip(tests, best.displacements, best.linearised, strict=True):
        one = _beside(test, x, there, said, fitted=True)
        beside.append(_with_bonds(one, values, there, said) if bonds else one)
    for test in predicted:
        answer = test.model.linearised(constants, best.constants, test.samples.displacement)
        if isinstance(answer, str):
            raise ValueError(f"the prediction failed: {answer}")
        beside.append(_beside(test, test.samples.displacement, answer, said, fitted=False))
    others = tuple(one.constants for one in ends)
    return SpecimenFit(name, values, said, tuple(beside), best, others)


def remote_starts(constants: Constants, count: int, seed: int) -> list[FloatArray]:
    """The declared start, and others within `DECADES` of it for moduli, anywhere in the bounds for
    numbers."""
    first = constants.start
    if count == 1:
        return [first]
    cube = qmc.LatinHypercube(len(first), rng=np.random.default_rng(seed)).random(count - 1)
    low, high = constants.bounds
    units = np.array([spec.unit == "Pa" for spec in constants.free_specs])
    size = np.maximum(np.abs(first), 0.05 * constants.scales)
    drawn = np.where(
        units,
        size * 10.0 ** (DECADES * (2.0 * cube - 1.0)),
        low + (np.where(np.isfinite(high), high, first + 1.0) - low) * cube,
    )
    return [first, *np.clip(drawn, low, high)]


def _beside(test: SlowTest, x: FloatArray, there: Linearised, said: Intervals, *, fitted: bool) -> TestFit:
    moved = x - test.samples.displacement
    force = there.force - np.einsum("nij,nj->ni", there.by_displacement, moved)
    slopes = there.by_constants
    variance = np.einsum("nip,pq,niq->ni", slopes, np.nan_to_num(said.covariance), slopes)
    factor = float(student.ppf(0.5 + 0.5 * LEVEL, said.degrees))
    return TestFit(test, x, force, factor * np.sqrt(np.maximum(variance, 0.0)), fitted)


def _with_bonds(one: TestFit, constants: Constants, there: Linearised, said: Intervals) -> TestFit:
    """The test with its bonds looked at; as it is where the bond cannot be shortened or that fails."""
    test = one.test
    try:
        shorter = test.model.shortened()
    except ValueError:
        return one
    answer = shorter.linearised(constants, constants.start, one.displacement)
    if isinstance(answer, str):
        return one
    amount = test.model.shape.size[0] / test.model.shape.elements[0]
    sigma = test.samples.sigma_force
    found = tuple(
        debonding(
            (test.samples.force[:, end] - one.force[:, end]) / sigma,
            there.by_constants[:, end] / sigma,
            (answer.force[:, end] - there.force[:, end]) / sigma,
            amount=amount,
            scale=said.scale,
        )
        for end in range(test.model.shape.ends)
    )
    return TestFit(test, one.displacement, one.force, one.band, one.fitted, found)
