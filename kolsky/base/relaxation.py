"""What relaxes beside the quasi-static law, as a shot declares it: a kind, its constants, what is free."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["prony", "bergstrom_boyce"]

MOST_BRANCHES = 3
"""Most branches of a Prony series that have parameters of their own: few rates carry no more."""
NETWORK = ("creep_ratio", "creep_resistance", "creep_exponent", "creep_chain_exponent", "creep_first")
"""Parameters of Bergstrom and Boyce's network, in the order of `explicit.relaxation.BergstromBoyce`."""
NETWORK_DEFAULTS = {"creep_exponent": 4.0, "creep_chain_exponent": -1.0, "creep_first": 0.01}
"""Constants that need not be declared; those of `explicit.relaxation.BergstromBoyce`."""
NETWORK_FREE = ("creep_ratio", "creep_resistance")
"""Constants of the network that are free where the shot says no more than that it relaxes."""


def prony_names(branches: int) -> tuple[str, ...]:
    """Parameters of a Prony series: the strengths, then the times, branch by branch."""
    numbers = range(1, branches + 1)
    return (*(f"prony_strength_{k}" for k in numbers), *(f"prony_time_{k}" for k in numbers))


@dataclass(frozen=True)
class Relaxation:
    """[relaxation] of a shot: the long-term law is the quasi-static curve times m; this is beside it."""

    kind: Kind
    """Prony series, or the network of Bergstrom and Boyce."""
    values: Mapping[str, float]
    """Parameter name -> declared constant in SI: `prony_names`, or `NETWORK`."""
    sigmas: Mapping[str, float] = field(default_factory=dict)
    """Parameter name -> declared standard uncertainty in SI; an absent one was not declared."""
    free: bool = False
    """Whether its constants are free in an identification where nothing else is asked for."""

    def __post_init__(self) -> None:
        expected = prony_names(self.branches) if self.kind == "prony" else NETWORK
        if set(self.values) != set(expected):
            raise ValueError(
                f"{self.kind} has the constants {', '.join(expected)}, got {', '.join(self.values)}"
            )
        if stray := sorted(set(self.sigmas) - set(expected)):
            raise ValueError(f"{stray[0]} has an uncertainty and no value")

    @property
    def branches(self) -> int:
        """Branches of the series; 1 for the network."""
        return len(self.values) // 2 if self.kind == "prony" else 1

    @property
    def free_names(self) -> tuple[str, ...]:
        """Parameters that are free by default: none where the constants are held."""
        if not self.free:
            return ()
        return prony_names(self.branches) if self.kind == "prony" else NETWORK_FREE

    @property
    def words(self) -> str:
        """What relaxes, in words."""
        if self.kind == "bergstrom_boyce":
            return "a network of Bergström and Boyce that creeps"
        return "a Prony series of " + ("1 branch" if self.branches == 1 else f"{self.branches} branches")
