"""The constants of what relaxes, as parameters: Prony branches, and the network of Bergstrom and Boyce."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from kolsky.base.relaxation import MOST_BRANCHES
from kolsky.inverse.parameter import Parameter

if TYPE_CHECKING:
    from kolsky.shot.records import Shot


def _declared_constant(name: str) -> Callable[[Shot], float]:
    """The declared value of a constant of what relaxes; NaN for a shot that has no such constant."""
    return lambda shot: (
        float("nan") if shot.relaxation is None else shot.relaxation.values.get(name, float("nan"))
    )


def _branch(k: int) -> tuple[Parameter, Parameter]:
    """Strength and relaxation time of the k-th branch of a Prony series."""
    return (
        Parameter(
            name=f"prony_strength_{k}",
            words=f"strength of the Prony branch {k}, its modulus over the long-term one",
            symbol=f"c_{k}",
            written=f"c_{k}",
            tex=f"c_{k}",
            lower=0.0,
            upper=2.0,
            allowed=(0.0, 1e3),
            held=_declared_constant(f"prony_strength_{k}"),
            scale=lambda value: max(value, 0.1),
            relaxes=True,
        ),
        Parameter(
            name=f"prony_time_{k}",
            words=f"relaxation time of the Prony branch {k}",
            symbol=f"tau_{k}",
            written=f"τ_{k}",
            tex=rf"\tau_{k}",
            unit="s",
            shown_unit="µs",
            shown_factor=1e6,
            lower=2e-5,
            upper=5e-3,
            allowed=(1e-7, 1e6),
            held=_declared_constant(f"prony_time_{k}"),
            logarithmic=True,
            relaxes=True,
        ),
    )


def _creep(name: str, words: str, symbol: str, *, least: float, most: float) -> Parameter:
    """A constant of Bergstrom and Boyce's network that is a plain number."""
    lower, upper, tex = _NETWORK[name]
    return Parameter(
        name=name,
        words=words,
        symbol=symbol,
        written=symbol,
        tex=tex,
        lower=lower,
        upper=upper,
        allowed=(least, most),
        held=_declared_constant(name),
        relaxes=True,
    )


_NETWORK = {
    "creep_ratio": (0.0, 2.0, "s"),
    "creep_exponent": (1.0, 10.0, "n"),
    "creep_chain_exponent": (-1.0, 0.0, "C"),
    "creep_first": (1e-3, 0.1, r"\xi"),
}
"""Bounds of the default design and symbol in formulas of the network's plain numbers."""

RELAXING: tuple[Parameter, ...] = (
    *(one for k in range(1, MOST_BRANCHES + 1) for one in _branch(k)),
    _creep(
        "creep_ratio", "stiffness of the creeping network over the long-term law", "s", least=0.0, most=1e3
    ),
    Parameter(
        name="creep_resistance",
        words="stress at which the creeping network flows",
        symbol="tau_hat",
        written="τ̂",
        tex=r"\hat\tau",
        unit="Pa",
        shown_unit="kPa",
        shown_factor=1e-3,
        lower=5e2,
        upper=1e5,
        allowed=(1e-3, 1e12),
        held=_declared_constant("creep_resistance"),
        logarithmic=True,
        relaxes=True,
    ),
    _creep("creep_exponent", "exponent of the creeping network’s stress", "n", least=1.0, most=50.0),
    _creep("creep_chain_exponent", "exponent of the creep that has been", "C", least=-1.0, most=0.0),
    _creep("creep_first", "stretch that keeps the first creep finite", "xi", least=1e-9, most=1.0),
)
"""Constants of what relaxes; a shot has those of its own [relaxation]."""
