"""The sources of error of a budget, their standard uncertainties, and the realisations that are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.stats import norm, qmc

from doe.ledger import Run
from kolsky.base.arrays import FloatArray
from kolsky.virtual.schema import Specification

NOISE = "noise"
"""The factor that no key holds: the streams of all instruments, drawn anew."""
WORDS = {
    NOISE: "noise of all instruments",
    "imperfections.length": "specimen’s length",
    "imperfections.diameter": "specimen’s diameter",
    "imperfections.density": "specimen’s density",
    "imperfections.sensitivity": "force transducer’s sensitivity",
    "imperfections.gain": "gain of the force’s amplifier",
    "imperfections.curve": "scale of the quasi-static curve",
    "imperfections.poisson": "Poisson’s ratio",
    "imperfections.damping": "damping",
    "imperfections.trigger": "cameras’ clock against the recorder’s",
    "imperfections.y_offset": "height of the outline",
    "imperfections.Z_offset": "axis of the outline",
    "imperfections.baseline": "step of the force’s baseline",
    "imperfections.tilt": "pitch of the flyer",
    "imperfections.off_centre": "specimen off centre",
    "transmitted.delay": "delay of the force’s cable",
    "transmitted.drift": "drift of the force’s baseline",
}
"""Known factors in words; another key is its own."""
SHARED = {
    "imperfections.density",
    "imperfections.sensitivity",
    "imperfections.gain",
    "imperfections.curve",
    "imperfections.poisson",
    "imperfections.damping",
    "transmitted.delay",
}
"""Factors that are the same in all shots of a campaign; the others are drawn anew for each."""
USUAL: dict[str, str | float] = {
    "imperfections.length": "0.5 %",
    "imperfections.diameter": "0.3 %",
    "imperfections.density": "0.5 %",
    "imperfections.sensitivity": "1 %",
    "imperfections.curve": "1 %",
    "imperfections.poisson": 0.0003,
    "imperfections.damping": "5 us",
    "imperfections.trigger": "1 us",
    "imperfections.y_offset": "20 um",
    "imperfections.Z_offset": "10 um",
    "imperfections.baseline": "1 mV",
    "imperfections.tilt": "0.3 deg",
    "imperfections.off_centre": "0.1 mm",
}
"""Standard uncertainties of a careful laboratory, taken where a specification has no [budget]."""


@dataclass(frozen=True)
class Factor:
    """One source of error."""

    key: str
    """Dotted key of the specification, or `NOISE`."""
    sigma: float
    """Standard uncertainty of its value, SI; 1 for the noise."""

    @property
    def words(self) -> str:
        """What it is."""
        return WORDS.get(self.key, self.key)

    @property
    def shared(self) -> bool:
        """Whether one error is common to all shots of a campaign."""
        return self.key in SHARED


def factors_of(sizes: Mapping[str, Any]) -> tuple[Factor, ...]:
    """Factors from their keys and written-out standard uncertainties, the noise first.

    ``sizes``: dotted key -> what the specification would have there: a text with a unit, or a plain number.
    Raises ValueError if a key is none of the specification's, or a size is none of its dimension, or not
    above 0.
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
