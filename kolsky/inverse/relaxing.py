"""What relaxes in the runs of a batch: constants by name turned into the solver's series and networks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kolsky.base.arrays import FloatArray
from kolsky.base.relaxation import (
    NETWORK,
    NETWORK_DEFAULTS,
    NETWORK_FREE,
    Kind,
    Relaxation,
    prony_names,
)
from kolsky.inverse.parameters import PARAMETERS, Fields

if TYPE_CHECKING:
    from explicit.relaxation.base import RateDependence
    from kolsky.shot.records import Shot

START_STRENGTH = 0.2
"""Strength of a branch, or ratio of a network, that a search without a declared one starts from [-]."""
START_SHARES = {1: (0.25,), 2: (0.08, 0.6), 3: (0.04, 0.2, 1.0)}
"""Relaxation times that a search starts from, over the duration of the window [-], by number of branches."""
START_STRESS = 0.5
"""Resistance of a network that a search starts from, over the curve's largest stress [-]."""


def what_relaxes(fields: Fields, relaxation: Relaxation | None) -> tuple[Fields, tuple[RateDependence, ...]]:
    """Take the constants of what relaxes out of the samples' fields, and put a choice among materials in.

    Parameters
    ----------
    fields
        Fields of `explicit.Samples`, and a value, scalar or [n_samples], of every constant of `relaxation`.
    relaxation
        Of the shot; None leaves the fields as they are.

    Returns
    -------
    fields, relaxing
        With the field "relaxation", an index a sample, and what it chooses from: `explicit.Model.relaxation`,
        each once.
    """
    if relaxation is None:
        return fields, ()
    from explicit.relaxation import BergstromBoyce, PronySeries

    prony = relaxation.kind == "prony"
    names = prony_names(relaxation.branches) if prony else NETWORK
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(fields[name], dtype=float)) for name in names))
    rows, index = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    n = relaxation.branches
    made: list[RateDependence] = [
        PronySeries(tuple(row[:n].tolist()), tuple(row[n:].tolist()))
        if prony
        else BergstromBoyce(*row.tolist())
        for row in rows
    ]
    rest = {name: value for name, value in fields.items() if name not in names}
    choice = index.ravel() if len(index) > 1 else int(index.ravel()[0])
    return {**rest, "relaxation": choice}, tuple(made)


def with_relaxation(shot: Shot, kind: Kind, branches: int = 1) -> Shot:
    """The shot with what relaxes free, whatever it declares: starting values from its window and curve.

    Parameters
    ----------
    shot
        The shot.
    kind
        Prony series or network.
    branches
        Of a series, 1 to `kolsky.base.relaxation.MOST_BRANCHES`.

    Raises
    ------
    ValueError
        If there can be no such number of branches.
    """
    if kind == "bergstrom_boyce":
        largest = float(np.abs(shot.curve.stress).max())
        values = {
            "creep_ratio": START_STRENGTH,
            "creep_resistance": START_STRESS * largest,
            **NETWORK_DEFAULTS,
        }
        return replace(shot, relaxation=Relaxation(kind, values, free=True))
    if branches not in START_SHARES:
        raise ValueError(f"a Prony series needs 1 to {max(START_SHARES)} branches, got {branches}")
    span = shot.window[1] - shot.window[0]
    times = [share * span for share in START_SHARES[branches]]
    constants = (*[START_STRENGTH] * branches, *times)
    values = dict(zip(prony_names(branches), constants, strict=True))
    return replace(shot, relaxation=Relaxation(kind, values, free=True))


def same_bulk(poisson: ArrayLike, stiffer: ArrayLike) -> FloatArray:
    """Poisson's ratio that leaves the bulk modulus where the instantaneous stiffness is a factor larger [-].

    The bulk modulus goes with m (1 + c) / (1 - 2 nu), of all strengths c, and sets the pace of the ringing: a
    branch that moved it by a percent would be out of step within the shot, which is no effect of a branch
    where Poisson's ratio is free to follow.

    Parameters
    ----------
    poisson
        Poisson's ratio [-].
    stiffer
        The instantaneous stiffness over what it was [-].
    """
    return np.asarray(0.5 - (0.5 - np.asarray(poisson)) * np.asarray(stiffer), dtype=np.float64)


def reference_words(names: Iterable[str]) -> str:
    """The curve that m refers to, by the names of a result's parameters; empty where nothing relaxes.

    Parameters
    ----------
    names
        Of all parameters of the result, free or held.
    """
    there = {name for name in names if name in PARAMETERS and PARAMETERS[name].relaxes}
    if not there:
        return ""
    what = "Bergström and Boyce's network creeps" if there & set(NETWORK_FREE) else "a Prony series relaxes"
    return f"the long-term curve, beside which {what}: at high rate the specimen is stiffer than m says"


def parsed_kind(text: str) -> tuple[Kind, int]:
    """A kind as a command line writes it: "prony", "prony:2", "bergstrom_boyce".

    Raises
    ------
    ValueError
        If it is none of these.
    """
    kind, _, number = text.partition(":")
    if kind == "prony" and (number or "1") in ("1", "2", "3"):
        return "prony", int(number or 1)
    if text == "bergstrom_boyce":
        return "bergstrom_boyce", 1
    raise ValueError(f'must be prony, prony:2, prony:3 or bergstrom_boyce, got "{text}"')
