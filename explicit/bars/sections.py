"""A uniform piece of a bar, a transducer or a platen: geometry and linear elastic material."""

from dataclasses import dataclass
from math import isfinite, pi, sqrt


@dataclass(frozen=True)
class Section:
    """A round section with one radius and one material."""

    length: float
    """Length along the axis [m]."""
    radius: float
    """Radius [m]."""
    youngs_modulus: float
    """Young's modulus E [Pa]."""
    density: float
    """Mass density rho [kg/m^3]."""
    poisson: float = 0.29
    """Poisson's ratio [-]; one-dimensional waves do not see it."""

    def __post_init__(self) -> None:
        for name in ("length", "radius", "youngs_modulus", "density"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"{name} of a section must be > 0 and finite, got {value}")
        if not -1.0 < self.poisson < 0.5:
            raise ValueError(f"poisson of a section must be in (-1, 0.5), got {self.poisson}")

    @property
    def area(self) -> float:
        """Cross-section A [m^2]."""
        return pi * self.radius**2

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.density * self.area * self.length

    @property
    def wave_speed(self) -> float:
        """Bar wave speed c0 = sqrt(E / rho) [m/s]."""
        return sqrt(self.youngs_modulus / self.density)

    @property
    def impedance(self) -> float:
        """Force per particle velocity Z = rho c0 A [N s/m]."""
        return self.density * self.wave_speed * self.area

    @property
    def travel_time(self) -> float:
        """Time of a wave from one end to the other, L / c0 [s]."""
        return self.length / self.wave_speed
