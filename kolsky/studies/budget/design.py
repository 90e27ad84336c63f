"""The realisations of an error budget: errors in standard uncertainties, and what they say of slopes."""

import numpy as np
from scipy.stats import norm, qmc

from doe.ledger_rows import Run
from kolsky.base.arrays import FloatArray
from kolsky.studies.budget.factors import NOISE, Factor

NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Gauss-Hermite rule of three points for a standard normal variable: exact for polynomials up to degree 5."""


def slopes_of(factors: tuple[Factor, ...], alone: list[Run], columns: int) -> FloatArray:
    """Changes of the re-fits by one standard uncertainty of each source, shape [k, c].

    Zero for the noise, and where a node gave no answer.

    Parameters
    ----------
    factors
        Sources of error, length k.
    alone
        Runs of `design` from row 1 on.
    columns
        Number c of the parameters in a record.
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
