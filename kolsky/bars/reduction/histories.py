"""The histories of a reduction by name, and all of them changed alike."""

from collections.abc import Callable
from dataclasses import replace

from kolsky.bars.records import History, Reduction
from kolsky.bars.reduction.stress_strain import ANALYSES

SINGLE = ("front_force", "back_force", "front_velocity", "back_velocity")
"""Histories of a reduction that every way of analysis shares."""


def histories(reduction: Reduction) -> dict[str, History]:
    """Every history of a reduction by name, e.g. "stress, three waves"."""
    found = {
        f"{name}, {way}": kind[way]
        for name, kind in (
            ("strain", reduction.strain),
            ("rate", reduction.rate),
            ("stress", reduction.stress),
        )
        for way in ANALYSES
    }
    return found | {name: getattr(reduction, name) for name in SINGLE}


def each(reduction: Reduction, change: Callable[[str, History], History]) -> Reduction:
    """The reduction with every history changed; `change` gets its name, as `histories` has it, and itself."""

    def ways(kind: str) -> dict[str, History]:
        return {way: change(f"{kind}, {way}", history) for way, history in getattr(reduction, kind).items()}

    return replace(
        reduction,
        strain=ways("strain"),
        rate=ways("rate"),
        stress=ways("stress"),
        front_force=change("front_force", reduction.front_force),
        back_force=change("back_force", reduction.back_force),
        front_velocity=change("front_velocity", reduction.front_velocity),
        back_velocity=change("back_velocity", reduction.back_velocity),
    )


def turned(reduction: Reduction) -> Reduction:
    """The reduction of a test in tension with tension positive."""
    return each(reduction, lambda name, history: History(-history.value, history.sigma, history.unit))
