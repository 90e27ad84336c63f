"""The sources of error of a budget, their standard uncertainties, and the realisations that are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.stats import norm, qmc

from doe.ledger import Run
from kolsky.base.arrays import FloatArray
from kolsky.shot.input_records import Input
from kolsky.shot.inputs import INPUTS
from kolsky.virtual.schema import Specification

NOISE = "noise"
"""The factor that no key holds: the streams of all instruments, drawn anew."""


def _in_laboratory(key: str) -> Input | None:
    """The input in which a virtual laboratory errs by a key of its specification."""
    return next((one for one in INPUTS.values() if one.laboratory and one.laboratory.key == key), None)


def usual_sizes() -> dict[str, str | float]:
    """Standard uncertainties of a careful laboratory, taken where a specification has no [budget]."""
    sources = [one.laboratory for one in INPUTS.values() if one.laboratory is not None]
    return {one.key: one.usual for one in sorted(sources, key=lambda one: one.order) if one.usual is not None}


@dataclass(frozen=True)
class Factor:
    """One source of error."""

    key: str
    """Dotted key of the specification, or `NOISE`."""
    sigma: float
    """Standard uncertainty of its value, SI; 1 for the noise."""

    @property
    def words(self) -> str:
        """What it is; an unknown key is its own."""
        if self.key == NOISE:
            return "noise of all instruments"
        one = _in_laboratory(self.key)
        return self.key if one is None or one.laboratory is None else one.laboratory.words or one.words

    @property
    def shared(self) -> bool:
        """Whether one error is common to all shots of a campaign; else it is drawn anew for each."""
        one = _in_laboratory(self.key)
        return one is not None and one.shared != "" and not (one.laboratory and one.laboratory.anew)


def factors_of(sizes: Mapping[str, Any]) -> tuple[Factor, ...]:
    """Factors from their keys and written-out standard uncertainties, the noise first.

    ``sizes``: dotted key -> what the specification would have there: a text with a unit, or a plain number.
    """
    found = [Factor(NOISE, 1.0)]
    for key, written in sizes.items():
        table, _, name = key.partition(".")
        try:
            made = Specification.model_validate({table: {name: written}})
        except ValidationError as error:
            said = error.errors()[0]
            raise ValueError(f"{key} = {written!r}: {said['msg']}") from None
        value = getattr(getattr(made, table), name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
            raise ValueError(f"{key} = {written!r} is no standard uncertainty; it must be a number above 0")
        found.append(Factor(key, float(value)))
    return tuple(found)


def shifted(quantities: Specification, errors: Mapping[str, float]) -> Specification:
    """The specification with errors added to some of its values, SI."""
    for key, error in errors.items():
        table, _, name = key.partition(".")
        section = getattr(quantities, table)
        section = section.model_copy(update={name: getattr(section, name) + error})
        quantities = quantities.model_copy(update={table: section})
    return quantities


NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Gauss-Hermite rule of three points for a standard normal variable: exact for polynomials up to degree 5."""


def slopes_of(factors: tuple[Factor, ...], alone: list[Run], columns: int) -> FloatArray:
    """Changes of the re-fits by one standard uncertainty of each source, shape [k, c].

    Zero for the noise, and where a node gave no answer.

    ``factors``: sources of error, length k. ``alone``: runs of `design` from row 1 on. ``columns``: number c
    of the parameters in a record.
    """
    found, at = np.zeros((len(factors), columns)), 1
    for i, factor in enumerate(factors):
        if factor.key != NOISE:
            low, high = alone[at : at + 2]
            change = (high.results[:columns] - low.results[:columns]) / (NODES[2] - NODES[0])
            found[i] = np.nan_to_num(change) if low.completed and high.completed else 0.0
            at += 2
    return found


def design(factors: tuple[Factor, ...], *, draws: int, together: int, seed: int) -> FloatArray:
    """Errors of every realisation in standard uncertainties and whether it is searched whole, [n, k + 1].

    Rows 0 and 1 have none, the first searched whole; then two nodes of each factor but the noise; then draws
    of the noise alone, numbered from 1; then all together, a Latin hypercube of normal values with noises of
    their own, searched whole.
    """
    k = len(factors)
    noise = [i for i, factor in enumerate(factors) if factor.key == NOISE]
    rows = [np.eye(k + 1)[k], np.zeros(k + 1)]
    for i in range(k):
        if i not in noise:
            for node in NODES[[0, 2]]:
                row = np.zeros(k + 1)
                row[i] = node
                rows.append(row)
    for number in range(1, draws + 1) if noise else ():
        row = np.zeros(k + 1)
        row[noise] = number
        rows.append(row)
    if together:
        normal = norm.ppf(qmc.LatinHypercube(k, seed=seed).random(together))
        normal[:, noise] = draws + 1.0 + np.arange(together)[:, None]
        rows.extend(np.column_stack([normal, np.ones(together)]))
    return np.array(rows)
