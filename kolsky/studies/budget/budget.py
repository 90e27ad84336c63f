"""The error budget: each source alone, all together, and the share of each in the answer's uncertainty.

Each factor is set to the nodes of a Gauss-Hermite rule of three points, Eq. (E.8), which gives mean and
variance of a quadratic response exactly; the noise and all factors together are drawn, Eq. (E.9).
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2, norm, qmc

from doe.executors import ExecutorFactory, Pace, run_chunks
from doe.ledger import Ledger, Run
from kolsky.base.arrays import FloatArray
from kolsky.inverse.settings import Settings
from kolsky.studies.budget.factors import NOISE, Factor
from kolsky.studies.budget.realisation import Realisations, names_of
from kolsky.virtual.schema import Specification

NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Gauss-Hermite rule of three points for a standard normal variable: exact for polynomials up to degree 5."""
FEWEST = 4
"""Fewest realisations that a standard deviation is taken from."""


@dataclass(frozen=True)
class Source:
    """What one factor alone does to the answer."""

    factor: Factor
    """The factor."""
    bias: float
    """Mean of the answer less that without the error, in the answer's unit; NaN for the noise."""
    u: float
    """Standard uncertainty that it gives the answer, in the answer's unit; NaN if realisations failed."""
    slope: float
    """Change of the answer per unit of the factor's value; NaN for the noise."""
    refused: tuple[str, ...]
    """Why realisations gave no answer, a sentence each."""


@dataclass(frozen=True)
class Budget:
    """What each source of error does to one parameter, alone and together with the others."""

    name: str
    """Of the test."""
    parameter: str
    """The parameter."""
    truth: float
    """Its true value; NaN if it is none of a specification's."""
    reference: float
    """Its estimate without errors, with the instruments' noise of the first draw."""
    sources: tuple[Source, ...]
    """Each factor alone."""
    together: FloatArray
    """Estimates with all errors at once, shape [n]; those that gave an answer."""
    refused: tuple[str, ...]
    """Why realisations with all errors at once gave no answer."""

    @property
    def u_sum(self) -> float:
        """Root of the sum of the squares of the sources: Eq. (E.10)."""
        return float(np.sqrt(np.nansum([source.u**2 for source in self.sources])))

    @property
    def u_together(self) -> float:
        """Standard deviation with all errors at once; NaN below `FEWEST` answers."""
        return float(self.together.std(ddof=1)) if len(self.together) >= FEWEST else float("nan")

    @property
    def u_together_interval(self) -> tuple[float, float]:
        """95 % interval of that standard deviation, as of normal values; NaN below `FEWEST` answers."""
        n, u = len(self.together), self.u_together
        if n < FEWEST:
            return float("nan"), float("nan")
        low, high = np.sqrt((n - 1) / chi2.ppf([0.975, 0.025], n - 1))
        return float(u * low), float(u * high)

    @property
    def adds_up(self) -> bool | None:
        """Whether the sources, added in quadrature, explain what all together do; None if nobody knows."""
        low, high = self.u_together_interval
        return None if np.isnan(low) else bool(low <= self.u_sum <= high)

    def share(self, source: Source) -> float:
        """Share of a source in the sum of the squares [-]."""
        return source.u**2 / self.u_sum**2 if self.u_sum > 0.0 else 0.0


def budget(
    quantities: Specification,
    factors: tuple[Factor, ...],
    *,
    settings: Settings,
    folder: Path = Path(),
    draws: int = 16,
    together: int = 32,
    ledger: Path | None = None,
    retry: bool = False,
    executor: ExecutorFactory | None = None,
    progress: Callable[[Pace], None] | None = None,
) -> tuple[Budget, ...]:
    """Repeat a test with errors and say what each does to the answer; a budget for each free parameter.

    Parameters
    ----------
    quantities
        The test. Its outline and flyer come from exports; pictures are not made.
    factors
        Sources of error.
    settings
        How each realisation is identified.
    folder
        Where files are that the test names.
    draws
        Draws of the noise alone.
    together
        Draws of all factors together.
    ledger
        File that keeps every realisation as it is made, and where those made before are found.
    retry
        Make again what gave no answer before.
    executor, progress
        As in `doe.executors.run_chunks`.

    Raises
    ------
    ValueError
        If the test without errors gives no answer.
    doe.ledger.LedgerError
        If a ledger is none, is damaged or in use.
    """
    bare = quantities.model_copy(
        update={
            "cameras": quantities.cameras.model_copy(update={"write": False}),
            "exports": quantities.exports.model_copy(update={"write": True}),
        }
    )
    realisations = Realisations(bare, folder, factors, settings)
    points = design(factors, draws=draws, together=together, seed=quantities.seed)

    def all_runs(book: Ledger | None) -> list[Run]:
        return run_chunks(
            realisations, points, chunk=1, ledger=book, executor=executor, retry=retry, progress=progress
        )

    if ledger is None:
        runs = all_runs(None)
    else:
        ledger.parent.mkdir(parents=True, exist_ok=True)
        with Ledger(ledger, realisations.model_hash()) as book:
            runs = all_runs(book)
    if not runs[0].completed:
        raise ValueError(f"the test without errors gives no answer: {runs[0].reason}")
    truths = {
        "stiffness_factor": quantities.material.stiffness_factor,
        "poisson": quantities.material.poisson,
        "damping": quantities.material.damping,
    }
    return tuple(
        analysed(quantities.name, name, truths.get(name, float("nan")), factors, runs, column, draws)
        for column, name in enumerate(names_of(settings))
    )


def design(factors: tuple[Factor, ...], *, draws: int, together: int, seed: int) -> FloatArray:
    """Errors of every realisation in standard uncertainties, shape [n, k].

    Row 0 has none; then two nodes of each factor but the noise; then draws of the noise alone, numbered from
    1; then all together, a Latin hypercube of normal values with noises of their own.
    """
    k = len(factors)
    noise = [i for i, factor in enumerate(factors) if factor.key == NOISE]
    rows = [np.zeros(k)]
    for i in range(k):
        if i not in noise:
            for node in NODES[[0, 2]]:
                row = np.zeros(k)
                row[i] = node
                rows.append(row)
    for number in range(1, draws + 1) if noise else ():
        row = np.zeros(k)
        row[noise] = number
        rows.append(row)
    if together:
        normal = norm.ppf(qmc.LatinHypercube(k, seed=seed).random(together))
        normal[:, noise] = draws + 1.0 + np.arange(together)[:, None]
        rows.extend(normal)
    return np.array(rows)


def analysed(
    name: str,
    parameter: str,
    truth: float,
    factors: tuple[Factor, ...],
    runs: list[Run],
    column: int,
    draws: int,
) -> Budget:
    """The budget of one parameter from the runs of `design`, of which `column` holds its estimates."""
    values = np.array([run.results[column] for run in runs])
    why = [run.reason for run in runs]
    reference, at, sources = float(values[0]), 1, []
    for factor in factors:
        if factor.key == NOISE:
            continue
        low, high = values[at], values[at + 1]
        refused = tuple(text for text in why[at : at + 2] if text)
        shift = np.array([low - reference, 0.0, high - reference])
        bias = float(WEIGHTS @ shift)
        u = float(np.sqrt(max(float(WEIGHTS @ shift**2) - bias**2, 0.0)))  # Eq. (E.8)
        slope = float((high - low) / (NODES[2] - NODES[0]) / factor.sigma)
        if refused:
            bias = u = slope = float("nan")
        sources.append(Source(factor, bias, u, slope, refused))
        at += 2
    for factor in factors:
        if factor.key == NOISE:
            drawn, refused = values[at : at + draws], tuple(text for text in why[at : at + draws] if text)
            known = drawn[np.isfinite(drawn)]
            u = float(known.std(ddof=1)) if len(known) >= FEWEST else float("nan")
            sources.insert(0, Source(factor, float("nan"), u, float("nan"), refused))
            at += draws
    rest = values[at:]
    return Budget(
        name=name,
        parameter=parameter,
        truth=truth,
        reference=reference,
        sources=tuple(sources),
        together=rest[np.isfinite(rest)],
        refused=tuple(text for text in why[at:] if text),
    )
