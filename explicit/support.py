"""What stands behind the transmission platen: nothing that moves, or a bar by its characteristics.

The bar is one-dimensional and elastic. With the velocity away from the specimen v = g + h and the
compressive force F = Z (g - h) at its front, g travels away and h comes back; the far end is free, so
h(t) = g(t - 2 L / c). The front's velocity is v = F / Z + 2 h, which costs no elements and no step. The
solver knows F one step late and solves for v together with the mass of the nodes on the platen, which is
stable for a bar of any impedance.
"""

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class CharacteristicBar:
    """A uniform bar with a free far end."""

    impedance: float
    """Force per velocity Z = rho c A [N s/m]; infinity is a rigid support."""
    round_trip: float
    """Time of a wave to the far end and back [s]; infinity is a bar without end."""

    def __post_init__(self) -> None:
        if not self.impedance > 0.0:
            raise ValueError(f"impedance must be > 0 N s/m, got {self.impedance}")
        if not self.round_trip > 0.0:
            raise ValueError(f"round_trip must be > 0 s, got {self.round_trip}")


RIGID = CharacteristicBar(impedance=inf, round_trip=inf)
"""A support that does not move."""
