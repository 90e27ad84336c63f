"""Support behind the transmission platen: nothing that moves, a bar by its characteristics, or anything
whose motion is known.

The bar is one-dimensional and elastic. With the velocity away from the specimen v = g + h and the
compressive force F = Z (g - h) at its front, g travels away and h comes back; the far end is free, so
h(t) = g(t - 2 L / c). The front's velocity is v = F / Z + 2 h, which costs no elements and no step. The
solver knows F one step late and solves for v together with the mass of the nodes on the platen, which is
stable for a bar of any impedance.
"""

from dataclasses import dataclass
from math import inf

from explicit.motion import PlatenMotion


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


@dataclass(frozen=True)
class MovingSupport:
    """A support whose motion is prescribed, one for all samples or one for each.

    The other half of a partitioned coupling: a model of the parts behind the specimen answers a force with
    this motion (`explicit.bars.coupling`).
    """

    motions: tuple[PlatenMotion, ...]
    """Motion of the transmission platen, displacement toward the specimen positive; length 1 or n_samples.
    Start and number of knots are those of the flyer's motions."""

    def __post_init__(self) -> None:
        if not self.motions:
            raise ValueError("a moving support needs a motion for all samples or one for each, got none")


Support = CharacteristicBar | MovingSupport

RIGID = CharacteristicBar(impedance=inf, round_trip=inf)
"""A support that does not move."""
