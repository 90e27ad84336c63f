"""The error budget: each source separately, all together, and shares of the uncertainty.

Each factor is set to the nodes of a Gauss-Hermite rule of three points, Eq. (E.8). The rule gives mean and
variance of a quadratic response exactly. The noise and all factors together are drawn, Eq. (E.9). Every
realisation is re-fitted from the optimum of the test without errors. Those of all factors together are also
identified by the complete search (`kolsky.studies.budget.realisation`).
"""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from doe.ledger import ExecutorFactory, Ledger, Pace, Run, run_chunks
from explicit.contact import contact_law
from kolsky.base.arrays import FloatArray
from kolsky.inverse.parameters import any_slides
from kolsky.inverse.settings import Settings
from kolsky.studies.budget.realisation import (
    NODES,
    WEIGHTS,
    Factor,
    RealisationOutcome,
    Realisations,
    columns_of,
    design,
    names_of,
    slopes_of,
)
from kolsky.studies.budget.records import FEWEST, Budget, Source, shares_of_squares
from kolsky.virtual.schema import Specification


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
    """Repeat a test with errors and find their effect on the answer.

    There is one budget per free parameter.

    ``quantities``: the test. Its outline and flyer come from exports, and pictures are not made.
    ``settings``: settings of the identification of each realisation. ``draws``, ``together``: number of draws
    of the noise alone, and of all factors together. ``ledger``: file that stores every realisation and
    supplies earlier ones. ``retry``: True to repeat realisations without an answer. Raises ValueError if the
    test without errors gives no answer. Raises doe.ledger.LedgerError if a file is not a ledger, is damaged
    or is in use.
    """
    bare = quantities.model_copy(
        update={
            "cameras": quantities.cameras.model_copy(update={"write": False}),
            "exports": quantities.exports.model_copy(update={"write": True}),
        }
    )
    realisations = Realisations(bare, folder, factors, settings)
    points = design(factors, draws=draws, together=together, seed=quantities.seed)

    if ledger is not None:
        ledger.parent.mkdir(parents=True, exist_ok=True)
    with nullcontext() if ledger is None else Ledger(ledger, realisations.model_hash()) as book:
        run = partial(run_chunks, chunk=1, ledger=book, executor=executor, retry=retry, progress=progress)
        first = run(realisations, points[:1])
        if not first[0].completed:
            raise ValueError(f"the test without errors gives no answer: {first[0].reason}")
        later = replace(realisations, start=_start(bare, settings, first[0]))
        alone = run(later, points[1 : len(points) - together])
        if not alone[0].completed:
            raise ValueError(f"the test without errors is not found again by a re-fit: {alone[0].reason}")
        later = replace(later, slopes=slopes_of(factors, alone, len(columns_of(settings))))
        runs = [*first, *alone, *(run(later, points[-together:]) if together else [])]
    material = quantities.material
    return tuple(
        analysed(quantities.name, name, getattr(material, name, float("nan")), factors, runs, column, draws)
        for column, name in enumerate(names_of(settings))
    )


def _start(quantities: Specification, settings: Settings, first: Run) -> dict[str, float] | None:
    """Start of the re-fits. None if the response is too rough because a surface slides or lets go."""
    interface = quantities.interface
    laws = {contact_law(interface.faces), contact_law(interface.side)}
    named = [*(settings.free or ()), *settings.held]
    if any(law.needs_friction or law.needs_release_stress for law in laws) or any_slides(named):
        return None
    names = columns_of(settings)
    values = dict(zip(names, first.results[len(names) :].tolist(), strict=True))
    return {name: value for name, value in values.items() if np.isfinite(value)}


def analysed(
    name: str,
    parameter: str,
    truth: float,
    factors: tuple[Factor, ...],
    runs: list[Run],
    column: int,
    draws: int,
) -> Budget:
    """The budget of one parameter."""
    near, whole = np.array([run.results.reshape(2, -1)[:, column] for run in runs]).T
    counted = np.array([run.completed for run in runs])
    values = np.where(counted, np.where(np.isfinite(near), near, whole), np.nan)
    why = [f"{run.outcome}: {run.reason}" if not run.completed else "" for run in runs]
    reference, at = float(values[1]), 2 * len(factors)
    drawn, refused = values[at : at + draws], tuple(text for text in why[at : at + draws] if text)
    known = drawn[np.isfinite(drawn)]
    enough = len(known) >= FEWEST
    u = float(known.std(ddof=1)) if enough else float("nan")
    sources = [Source(factors[0], float("nan"), u, float("nan"), refused)] + [
        _alone(factor, reference, values[2 * i : 2 * i + 2], why[2 * i : 2 * i + 2])
        for i, factor in enumerate(factors[1:], start=1)
    ]
    if enough:
        intervals = shares_of_squares(np.array([source.u for source in sources]), 0, known)
        sources = [
            replace(source, share_interval=(float(low), float(high)))
            for source, (low, high) in zip(sources, intervals, strict=True)
        ]
    at += draws
    rest = values[at:]
    use = np.isfinite(rest)
    outcomes = tuple(RealisationOutcome(run.outcome) for run in runs)
    jumped = [outcome is RealisationOutcome.OTHER_VALLEY for outcome in outcomes[at:]]
    return Budget(
        name=name, parameter=parameter, truth=truth, reference=reference, closure=float(values[1] - whole[0]),
        sources=tuple(sources), together=rest[use], refused=tuple(text for text in why[at:] if text),
        elsewhere=whole[at:][np.array(jumped, dtype=bool)], searched=int(np.isfinite(whole[at:]).sum()),
        outcomes=outcomes,
    )  # fmt: skip


def _alone(factor: Factor, reference: float, nodes: FloatArray, why: list[str]) -> Source:
    """A source, from the answers at its two nodes and the reference."""
    low, high = nodes
    refused = tuple(text for text in why if text)
    shift = np.array([low - reference, 0.0, high - reference])
    bias = float(WEIGHTS @ shift)
    u = float(np.sqrt(max(float(WEIGHTS @ shift**2) - bias**2, 0.0)))  # Eq. (E.8)
    slope = float((high - low) / (NODES[2] - NODES[0]) / factor.sigma)
    if refused:
        bias = u = slope = float("nan")
    return Source(factor, bias, u, slope, refused)
