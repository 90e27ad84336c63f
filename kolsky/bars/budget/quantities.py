"""Inputs of a budget: checks, duplicates, correlations."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components

from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray


def merge_quantities(quantities: Iterable[Quantity]) -> list[Quantity]:
    """Quantities with those that were listed more than once, such as a bar's Poisson's ratio, listed once.

    Where only one of them has an uncertainty, that one is taken.

    Raises
    ------
    ValueError
        If two have the same name and different values or uncertainties.
    """
    found: dict[str, Quantity] = {}
    for q in quantities:
        known = found.setdefault(q.name, q)
        if known == q or (q.sigma == 0.0 and (q.value, q.unit) == (known.value, known.unit)):
            continue
        if known.sigma > 0.0 or (q.value, q.unit) != (known.value, known.unit):
            raise ValueError(f"quantity '{q.name}' is stated twice: {known} and {q}")
        found[q.name] = q
    return list(found.values())


def check_quantities(quantities: Sequence[Quantity]) -> None:
    """Refuse impossible quantities and names that occur twice.

    Raises
    ------
    ValueError
        With the quantity's name.
    """
    seen: set[str] = set()
    for q in quantities:
        if q.name in seen:
            raise ValueError(f"quantity '{q.name}' occurs twice; see `merged`")
        seen.add(q.name)
        if not (np.isfinite(q.value) and np.isfinite(q.sigma) and q.sigma >= 0.0):
            raise ValueError(
                f"{q.name}: value must be finite and sigma finite and >= 0, got {q.value}, {q.sigma}"
            )
        if q.kind not in ("A", "B"):
            raise ValueError(f"{q.name}: kind must be 'A' or 'B', got {q.kind!r}")
        if not q.freedom >= 1.0:
            raise ValueError(f"{q.name}: degrees of freedom must be >= 1, got {q.freedom}")


def correlation_matrix(
    quantities: Sequence[Quantity], correlations: Mapping[tuple[str, str], float]
) -> FloatArray:
    """Coefficients by pairs of names as a matrix, shape [n, n].

    Raises
    ------
    ValueError
        If a name is unknown, a coefficient is outside [-1, 1], or they contradict each other.
    """
    place = {q.name: i for i, q in enumerate(quantities)}
    R = np.eye(len(place))
    for (one, other), r in correlations.items():
        for name in (one, other):
            if name not in place:
                raise ValueError(f"correlation of {name!r}: no quantity has this name")
        if one == other or not -1.0 <= r <= 1.0:
            raise ValueError(f"correlation of '{one}' and '{other}' must be of two, in [-1, 1], got {r}")
        R[place[one], place[other]] = R[place[other], place[one]] = r
    lowest = float(np.linalg.eigvalsh(R)[0]) if R.size else 0.0
    if lowest < -1e-9:  # round-off
        raise ValueError(
            f"the correlations contradict each other: their matrix has the eigenvalue {lowest:.3g}, all must"
            " be >= 0; if they were rounded, state more digits"
        )
    return R


def correlated_groups(correlation: FloatArray) -> list[list[int]]:
    """Groups of correlated quantities: for each group the list of their indices."""
    if not correlation.size:
        return []
    n, label = connected_components(correlation != 0.0, directed=False)
    return [np.flatnonzero(label == k).tolist() for k in range(n)]
