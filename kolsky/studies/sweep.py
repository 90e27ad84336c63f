"""A design of experiments over a shot's parameters: every run with outcome and misfit.

No run is repeated.

The design is made here, or read from a table of parameter values with units in its header.
"""

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dic.views import ResultViews
from doe import Box, Design, from_points
from doe.ledger import ExecutorFactory, Ledger, LedgerError, Pace, Run, run_chunks
from explicit import Outcome
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError, refused
from kolsky.base.files import jsonable, missing, remove_empty, source_hash
from kolsky.base.units import UnitError, quantity
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import PARAMETERS, any_slides, checked_value, parameter
from kolsky.inverse.problem import PreparedShot, prepare_shot, provenance
from kolsky.inverse.run_table import SCALE_FORCE, SCALE_SHAPE, DesignTable, terms
from kolsky.inverse.settings import Numerics
from kolsky.readers.table import Column, read_table
from kolsky.readers.text import full_match
from kolsky.results.tables import end_columns
from kolsky.shot.records import Shot

KEPT = ("phi_force", "phi_shape", "chi2_force", "chi2_shape", "end time", "element", "R", "Y")
"""Results of a run in the ledger, in this order, SI. The misfits of a failed run are NaN. For a completed
run, the element is -1 and its position NaN."""
CHUNK = {"cpu": 64, "cuda": 4096}
"""Number of runs between two entries in the ledger, by class of device."""


@dataclass(frozen=True)
class Sweep(ResultViews):
    """Every run of a design."""

    shot: str
    table: DesignTable
    held: dict[str, float]
    """Parameters held at values that differ from the shot's."""
    damaged: tuple[str, ...] = ()
    """Prefixes of the keys of damaged runs in the ledger. These runs were repeated."""


@dataclass(frozen=True)
class ShotRuns:
    """The shot as a function of points, for `doe.ledger.run_chunks`. It can be pickled."""

    prepared: PreparedShot
    names: tuple[str, ...]
    held: Mapping[str, float]
    """Parameters held at values that differ from the shot's."""
    numerics: Numerics

    def __call__(self, points: FloatArray) -> list[Run]:
        """Simulate the points, shape [n, d]. Every run contains the results in `KEPT`."""
        columns = {name: points[:, i] for i, name in enumerate(self.names)}
        response = self.prepared.forward.run({**self.held, **columns}, self.numerics)
        rows = np.flatnonzero(response.completed)
        observations = self.prepared.observations
        prediction = predict(response.select(rows), observations) if len(rows) else None
        place = {int(row): k for k, row in enumerate(rows)}
        runs = []
        for row, ending in enumerate(response.endings):
            misfit = [np.nan] * 4
            if prediction is not None and row in place:
                found = terms(prediction, observations, place[row])
                misfit = [getattr(found, name) for name in KEPT[:4]]
            results = np.array([*misfit, ending.time, ending.element, *ending.place])
            ok = ending.outcome.ok
            runs.append(Run(ok, ending.outcome.name, results, "" if ok else ending.sentence))
        return runs

    def model_hash(self) -> bytes:
        """SHA-256 of all inputs of a run's result except the varied values. The inputs are window, specimen,
        interface, held parameters, names, mesh and other numerical choices, class of device, versions and the
        package's sources. The number of threads is not included, because the result does not depend on it."""
        device = self.numerics.device.partition(":")[0]
        settings = {
            "varied": list(self.names),
            "held": dict(sorted(self.held.items())),
            "numerics": replace(self.numerics, threads=None, device=device),
        }
        sliding = any_slides([*self.names, *self.held])
        said = provenance(self.prepared.forward.shot, settings, self.prepared, sliding=sliding)
        whole = jsonable({**said, "kept": KEPT, "sources": source_hash()}, "model")
        return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).digest()


def sweep(
    shot: Shot,
    design: Design,
    *,
    held: Mapping[str, float] | None = None,
    numerics: Numerics | None = None,
    ledger: Path | None = None,
    merge: tuple[Path, ...] = (),
    retry: bool = False,
    executor: ExecutorFactory | None = None,
    progress: Callable[[Pace], None] | None = None,
) -> Sweep:
    """Run a design over a shot's parameters.

    Parameters
    ----------
    shot
        A loaded shot.
    design
        Points over parameters of `kolsky.inverse.parameters.PARAMETERS`.
    held
        Parameters held at values that differ from the shot's.
    numerics
        As in `kolsky.inverse.forward.Forward.run`.
    ledger
        File that stores each chunk of runs and supplies earlier runs; default: none.
    merge
        Ledgers of other shards. They are first copied into `ledger`.
    retry
        Repeat the runs that are recorded as failed in the ledger.
    executor, progress
        As in `doe.ledger.run_chunks`.

    Raises
    ------
    ValueError
        If a parameter is unknown or outside its range, or if `merge` is given without `ledger`.
    doe.ledger.LedgerError
        If a file is not a ledger, is damaged or is in use.
    OSError
        If the ledger's folder cannot be made.

    Examples
    --------
    >>> import kolsky
    >>> from doe import Box, full_factorial
    >>> design = full_factorial(Box.of({"stiffness_factor": (1.0, 1.2)}), 3)
    >>> shot = kolsky.load_shot("runs/open-05")
    >>> swept = kolsky.sweep(shot, design, numerics=kolsky.Numerics(mesh=(8, 11)))
    >>> swept.to_pandas()["outcome"].tolist()
    ['COMPLETED', 'COMPLETED', 'COMPLETED']
    """
    numerics = numerics or Numerics()
    runs = ShotRuns(prepare_shot(shot), design.box.names, dict(held or {}), numerics)
    chunk = CHUNK["cpu" if numerics.device == "cpu" else "cuda"]

    if merge and ledger is None:
        raise ValueError("ledgers are merged into a ledger; name one")
    with nullcontext() if ledger is None else _merged(ledger, runs.model_hash(), merge) as book:
        done = run_chunks(
            runs, design.points, chunk=chunk, ledger=book, executor=executor, retry=retry, progress=progress
        )
        if ledger is not None:
            _refuse_strangers(ledger, done)
    damaged = () if book is None else tuple(book.damaged)
    return Sweep(shot=shot.name, table=_table(design, done), held=dict(held or {}), damaged=damaged)


@contextmanager
def _merged(path: Path, model: bytes, others: tuple[Path, ...]) -> Iterator[Ledger]:
    """A ledger with others merged into it. If one is rejected, a newly created ledger is removed."""
    fresh, made = not path.exists(), missing(path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with Ledger(path, model) as book:
            try:
                for other in others:
                    book.merge(other)
            except BaseException:
                if fresh:
                    book.close()
                    path.unlink(missing_ok=True)
                raise
            yield book
    except BaseException:
        remove_empty(made)
        raise


def _refuse_strangers(ledger: Path, runs: list[Run]) -> None:
    """Raise LedgerError if a row has a valid key but does not come from a sweep."""
    for run in runs:
        known = run.outcome in Outcome.__members__ and Outcome[run.outcome].ok == run.completed
        if not known or run.results.shape != (len(KEPT),) or not float(run.results[5]).is_integer():
            raise LedgerError(f"{ledger}: holds a run that no sweep has written; remove the file")


def _table(design: Design, runs: list[Run]) -> DesignTable:
    results = np.array([run.results for run in runs])
    column = dict(zip(KEPT, results.T, strict=True))
    return DesignTable(
        names=design.box.names,
        points=np.array(design.points),
        lower=np.array(design.box.lower),
        upper=np.array(design.box.upper),
        outcomes=tuple(run.outcome for run in runs),
        end_times=column["end time"],
        failed_elements=column["element"].astype(np.int64),
        failed_places=results[:, 6:],
        stage=("design",) * len(runs),
        **{name: column[name] for name in KEPT[:4]},
    )


def columns(result: Sweep) -> dict[str, Any]:
    """One row per run: parameters, outcome, Phi_F, Phi_S, Phi and chi-square. A failed run also has the
    reason, time and place of its failure."""
    table = result.table
    made: dict[str, Any] = {"run": np.arange(len(table.outcomes))}
    made |= {f"{name} ({PARAMETERS[name].unit})": table.points[:, i] for i, name in enumerate(table.names)}
    return made | {
        "outcome": table.outcomes,
        "Phi_F (N)": table.phi_force,
        "Phi_S (1)": table.phi_shape,
        "Phi (1)": misfit_sum(table),
        "chi2 force (1)": table.chi2_force,
        "chi2 shape (1)": table.chi2_shape,
        **end_columns(table),
    }


def counts(result: Sweep) -> dict[str, int]:
    """Number of runs, and number of completed runs."""
    table = result.table
    return {"runs": len(table.outcomes), "completed": len(table.outcomes) - len(table.lost)}


def misfit_sum(table: DesignTable) -> FloatArray:
    """Phi of every run, Eq. (M.5) [-]; NaN without an outline, shape [n_runs]."""
    return np.asarray(table.phi_force / SCALE_FORCE + table.phi_shape / SCALE_SHAPE)


def costs(table: DesignTable) -> FloatArray:
    """Phi of every run, Eq. (M.5) [-]. Without an outline, its force term. NaN if a run did not complete,
    shape [n_runs]."""
    phi = misfit_sum(table)
    return phi if np.isfinite(phi).any() else table.phi_force / SCALE_FORCE


def least_run(table: DesignTable) -> int | None:
    """The run with the smallest cost; None if no run completed."""
    cost = costs(table)
    return int(np.nanargmin(cost)) if np.isfinite(cost).any() else None


def least_misfit(result: Sweep) -> dict[str, Any]:
    """The completed run with the smallest Phi (without an outline, Phi_F), and its parameters in SI. Values
    are None if no run completed."""
    table = result.table
    phi = misfit_sum(table)
    seen, best = bool(np.isfinite(phi).any()), least_run(table)
    return {
        "smallest_phi": float(phi[best]) if best is not None and seen else None,
        **({} if seen or best is None else {"smallest_phi_force": float(table.phi_force[best])}),
        "at": None if best is None else dict(zip(table.names, table.points[best].tolist(), strict=True)),
    }


MOST_RUNS = 1_000_000
"""Maximum number of runs in a sweep. Their histories must fit into memory."""
HEADER = re.compile(r"\s*([a-z_]+)\s*(?:\(\s*([^()]+?)\s*\))?\s*")


def read_design(path: Path) -> Design:
    """Read a design from a table with the header "stiffness_factor (1), damping (us)", one point per row. A
    name without a unit is in SI. The design's box covers the values of each column. Raises InputError if the
    file cannot be read, or if a column is no parameter or has a value that is not allowed."""
    table = read_table(path)
    columns: dict[str, Column] = {}
    for cell in table.names:
        match = full_match(HEADER, cell)
        cure = 'write NAME (UNIT), e.g. "damping (us)"; the names are those of --vary'
        if match is None:
            raise InputError(path, f"{cell[:60]!r} is no column", line=table.header_line, cure=cure)
        name, unit = match[1], match[2]
        with refused(path, line=table.header_line, cure=cure, errors=(ValueError, UnitError)):
            si = parameter(name).unit
            factor = 1.0 if unit is None or unit == si else quantity(f"1 {unit}", si)
        if name in columns:
            raise InputError(
                path, f"{name} stands twice", line=table.header_line, cure="keep one of the columns"
            )
        columns[name] = Column(cell, factor)
    count = len(table.rows)
    if not 2 <= count <= MOST_RUNS:
        raise InputError(path, f"holds {count} points", allowed=f"2 to {MOST_RUNS}", cure="a point a line")
    values = np.column_stack([table.values(column) for column in columns.values()])
    for name, column in zip(columns, values.T, strict=True):
        for row, value in enumerate(column.tolist()):
            with refused(path, line=table.first_line + row, cure="correct the value or its unit"):
                checked_value(name, value)
        if column.min() == column.max():
            raise InputError(
                path, f"{name} has one value only", cure=f"leave it out and hold it with -p {name}="
            )
    return from_points(Box(tuple(columns), tuple(values.min(axis=0)), tuple(values.max(axis=0))), values)
