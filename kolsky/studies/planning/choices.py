"""A laboratory's choices, judged by what the data would tell: window, frames, heights, rate."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from doe.sensitivity import Placement, best_groups, best_window
from doe.sensitivity.placement import Criterion, UndecidedError, costs
from kolsky.base.arrays import FloatArray
from kolsky.studies.planning.information import Expected, Information

CRITERIA: tuple[Criterion, ...] = ("D", "A")
SHARES = (0.25, 0.5, 0.75)
"""Lengths of the cameras' recording over the window that are compared."""


@dataclass(frozen=True)
class Choice:
    """The best of its kind, and what it would tell."""

    criterion: Criterion
    """ "D": smallest volume of the joint interval; "A": smallest mean variance of parameters over scale."""
    places: FloatArray
    """Heights [m], or first and last time [s]."""
    deviations: FloatArray
    """Standard deviations, all parameters estimated together, shape [d]."""


@dataclass(frozen=True)
class Rate:
    """The same test at another speed of the flyer."""

    factor: float
    """Speed over the shot's own [-]."""
    peak_force: float
    """Largest mean force of a bin [N]."""
    mean_rate: float
    """Mean nominal strain rate over the window [1/s]."""
    discrepancy: tuple[float, float]
    """What the model is taken to leave out [N], [m]."""
    expected: Expected
    """What the data would tell."""
    cost: Mapping[str, float]
    """-ln det H ("D") and trace of H^-1 ("A"), parameters over their scale."""


def window_ends(found: Information, shares: FloatArray) -> tuple[FloatArray, list[Expected]]:
    """Expected deviations from the data up to some time, for shares of the window in (0, 1].

    Returns
    -------
    times
        Ends [s], shape [n].
    expected
        Length n.
    """
    edges = found.sensitivity.grid.edges
    times = edges[0] + shares * (edges[-1] - edges[0])
    return times, [Expected.of(found.data.select(found.time <= t)) for t in times]


def camera_windows(found: Information, share: float) -> list[Choice]:
    """When the cameras should record if their memory holds only a share of the window; the force is recorded
    throughout. One choice a criterion; none without cameras, or if no choice decides all parameters."""
    frames = found.sensitivity.grid.frames
    count = max(1, round(share * len(frames)))
    chosen = _chosen(found, found.by_frame(), count, best_window)
    return [
        Choice(c, frames[[p.chosen[0], p.chosen[-1]]], _deviations(p.information, found)) for c, p in chosen
    ]


def camera_heights(found: Information, count: int) -> list[Choice]:
    """The few heights at which an outline would tell most, together with the force; none without cameras, or
    if no choice decides all parameters.

    Raises
    ------
    ValueError
        If there are fewer heights on the map.
    """
    heights = found.sensitivity.grid.heights
    if not 1 <= count <= len(heights):
        raise ValueError(
            f"of the {len(heights)} heights of the map 1 or more can be chosen, asked was {count}"
        )
    chosen = _chosen(found, found.by_height(), count, best_groups)
    return [Choice(c, heights[list(p.chosen)], _deviations(p.information, found)) for c, p in chosen]


def rate_of(
    found: Information, factor: float, *, length: float, travel: float, discrepancy: tuple[float, float]
) -> Rate:
    """The test at another speed of the flyer, from its information.

    Parameters
    ----------
    found
        Information at that rate.
    factor
        Speed over the shot's own.
    length, travel
        The specimen's length and the flyer's displacement over the window [m].
    discrepancy
        As in `kolsky.studies.planning.information.information`.
    """
    edges = found.sensitivity.grid.edges
    return Rate(
        factor=factor,
        peak_force=float(found.sensitivity.force.max()),
        mean_rate=travel / length / float(edges[-1] - edges[0]),
        discrepancy=discrepancy,
        expected=Expected.of(found.data),
        cost={c: float(costs(found.data.information, c)) for c in CRITERIA},
    )


def best_rate(rates: Sequence[Rate], criterion: Criterion) -> Rate:
    """The rate whose data leave least undecided."""
    return min(rates, key=lambda rate: rate.cost[criterion])


def _chosen(
    found: Information, groups: FloatArray, count: int, choose: Callable[..., Placement]
) -> list[tuple[Criterion, Placement]]:
    if not groups.any():
        return []
    chosen = []
    for criterion in CRITERIA:
        try:
            chosen.append((criterion, choose(groups, count, base=found.of_force, criterion=criterion)))
        except UndecidedError:
            continue  # what is not seen is said with the expected deviations
    return chosen


def _deviations(information: FloatArray, found: Information) -> FloatArray:
    return found.data.scale * np.sqrt(np.diag(np.linalg.inv(information)))
