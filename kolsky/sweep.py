"""A design of experiments over a shot's parameters: every run with its outcome and misfit."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from doe import Design
from kolsky.csvtable import write_table
from kolsky.forward import Numerics
from kolsky.identification import DesignTable
from kolsky.misfit import predict
from kolsky.parameters import PARAMETERS
from kolsky.prepare import prepare
from kolsky.results_text import ends
from kolsky.shots import Shot
from kolsky.table import RunTable


@dataclass(frozen=True)
class Sweep:
    """Every run of a design."""

    shot: str
    """Name of the shot."""
    table: DesignTable
    """Points, outcomes and misfits."""
    held: dict[str, float]
    """Parameters held at another value than the shot's."""


def sweep(
    shot: Shot,
    design: Design,
    *,
    held: Mapping[str, float] | None = None,
    numerics: Numerics | None = None,
    progress: Callable[[int], None] | None = None,
) -> Sweep:
    """Run a design over a shot's parameters.

    Parameters
    ----------
    shot
        A loaded shot.
    design
        Points over parameters of `kolsky.parameters.PARAMETERS`.
    held
        Parameters held at another value than the shot's.
    numerics, progress
        As in `kolsky.forward.Forward.run`.

    Raises
    ------
    ValueError
        If a parameter is unknown or outside its range.
    """
    prepared = prepare(shot)
    names = design.box.names
    columns = {name: design.points[:, i] for i, name in enumerate(names)}
    response = prepared.forward.run({**(held or {}), **columns}, numerics or Numerics(), progress=progress)
    rows = np.flatnonzero(response.completed)
    prediction = predict(response.select(rows), prepared.observations) if len(rows) else None
    table = RunTable(names)
    table.add("design", design.points, response.endings, rows, prediction, prepared.observations)
    return Sweep(shot=shot.name, table=table.build(design.box), held=dict(held or {}))


def write_sweep(path: Path, result: Sweep) -> Path:
    """Write one row a run, atomically: parameters, outcome, Phi_F, Phi_S, Phi and chi-square; and how, when
    and where a run that did not complete ended."""
    table = result.table
    columns: dict[str, Any] = {"run": np.arange(len(table.outcomes))}
    columns |= {f"{name} ({PARAMETERS[name].unit})": table.points[:, i] for i, name in enumerate(table.names)}
    columns |= {
        "outcome": table.outcomes,
        "Phi_F (N)": table.phi_force,
        "Phi_S (1)": table.phi_shape,
        "Phi (1)": table.phi_force / 1000.0 + table.phi_shape / 0.001,
        "chi2 force (1)": table.chi2_force,
        "chi2 shape (1)": table.chi2_shape,
        **ends(table),
    }
    return write_table(path, columns)
