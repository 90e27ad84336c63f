"""What held a specimen at its ends in a quasi-static test, and the curve that is left without it."""

from dataclasses import dataclass
from typing import Literal

from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import CurveBand
from kolsky.material.end_friction.slow_test import SlowTests

LARGEST_FRICTION = 5.0
"""Above, nothing slips any more: choose "bonded" or "rough"."""


@dataclass(frozen=True)
class EndFriction:
    """How the specimen held to the platens in the quasi-static test."""

    law: Literal["bonded", "rough", "coulomb"]
    """Contact law of faces and side: bonded also carries tension, rough does not."""
    coefficient: float | None = 0.0
    """Coulomb's coefficient [-]; None finds it from the radius at mid-height. Only for "coulomb"."""
    sigma: float = 0.0
    """Its standard uncertainty, where it is declared [-]."""

    def __post_init__(self) -> None:
        f = self.coefficient
        if self.law not in ("bonded", "rough", "coulomb"):
            raise ValueError(f"the ends are 'bonded', 'rough' or 'coulomb', got {self.law!r}")
        if f is not None and not 0.0 <= f <= LARGEST_FRICTION:
            raise ValueError(f"friction must be in [0, {LARGEST_FRICTION:g}], got {f}; above, choose 'rough'")
        if not 0.0 <= self.sigma < float("inf") or (f is not None and self.sigma > f):
            raise ValueError(f"the friction's sigma must be in [0, friction], got {self.sigma} with {f}")


@dataclass(frozen=True)
class FrictionCorrection:
    """The material's curve, and how it was found."""

    band: CurveBand
    """Corrected curve, with the modes "friction" and "mesh" added where they are known."""
    ratio: FloatArray
    """Apparent over true nominal stress [-], shape [n]."""
    coefficient: float | None
    """Coulomb's coefficient that was used or found [-]; None for "bonded" and "rough"."""
    sigma: float
    """Its standard uncertainty [-]."""
    misfit: float
    """Root mean square of the fitted law's simulated over the measured stress, less 1 [-]."""
    closure: float
    """The same for a test simulated on the refined mesh with the corrected curve itself [-]."""
    evaluations: int
    """Batches of simulations that the fit took."""
    slow: SlowTests
    """That test: kinetic energy, face forces, share past the data."""
