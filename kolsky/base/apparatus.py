"""Declared data of a test: bar, platens, transducers, specimen, and the specimen's viscoelastic model
(SI).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, pi, sqrt
from typing import Literal

HOLDING_LAW = "bonded"
"""Contact law of faces that neither slide nor separate."""
LIFTING_LAW = "rough"
"""Contact law of faces that do not slide but can separate."""
SLIDING_LAW = "coulomb"
"""Contact law of faces that slide."""
LARGEST_POISSON = 0.49999
"""Largest Poisson's ratio of a shot. The stable step is proportional to the root of 1 - 2 nu."""
INCOMPRESSIBLE = 0.49998
"""Poisson's ratio used for an incompressible specimen. The outline of open-01 differs by 0.07 um from that of
`LARGEST_POISSON`, less than all its points together resolve. With 0.4999 it differs by 0.6 um."""
INCOMPRESSIBLE_WORD = "incompressible"
"""Its name in shot.toml and on the command line."""


def check_interval(allowed: str, **values: float) -> None:
    """`dic.basics.check_interval`, imported when called: `--help` needs no NumPy."""
    from dic import basics

    basics.check_interval(allowed, **values)


@dataclass(frozen=True)
class Specimen:
    """A right circular cylinder. Raises ValueError if a value is negative or not finite."""

    diameter: float
    """Diameter [m]."""
    length: float
    """Length along the compression axis [m]."""
    density: float
    """Mass density [kg/m^3]."""

    def __post_init__(self) -> None:
        check_interval("[0, inf)", diameter=self.diameter, length=self.length, density=self.density)

    @property
    def radius(self) -> float:
        """Radius [m]."""
        return 0.5 * self.diameter

    @property
    def area(self) -> float:
        """Cross-section [m^2]."""
        return pi * self.radius**2


@dataclass(frozen=True)
class Bar:
    """A linear elastic bar, described by its one-dimensional waves.

    Raises ValueError if a value is outside its range.
    """

    diameter: float
    """Diameter [m]."""
    length: float
    """Length [m]."""
    youngs_modulus: float
    """Young's modulus [Pa]."""
    density: float
    """Mass density [kg/m^3]."""
    poisson: float = 0.29
    """Poisson's ratio [-]."""
    yield_strength: float | None = None
    """Elastic limit [Pa]; None if unknown."""

    def __post_init__(self) -> None:
        check_interval("(0, inf) m", diameter=self.diameter, length=self.length)
        check_interval("(0, inf)", youngs_modulus=self.youngs_modulus, density=self.density)
        check_interval("[0, 0.5)", poisson=self.poisson)

    @property
    def wave_speed(self) -> float:
        """Bar wave speed c0 = sqrt(E / rho) [m/s]."""
        return sqrt(self.youngs_modulus / self.density)

    @property
    def impedance(self) -> float:
        """Force divided by particle velocity, Z = rho c0 A [N s/m]."""
        return self.density * self.wave_speed * pi * self.diameter**2 / 4.0

    @property
    def round_trip(self) -> float:
        """Time of a wave to the far end and back, 2 L / c0 [s]."""
        return 2.0 * self.length / self.wave_speed


@dataclass(frozen=True)
class ElasticBody:
    """Elastic parts on one side of the specimen, bonded in series, starting at the specimen."""

    model: str
    """"bar", one-dimensional waves, or "mesh", an axisymmetric mesh."""
    parts: tuple[Bar, ...]
    """Platen, transducer, bar."""
    element_size: float = 0.0
    """Largest side of an element, for "mesh" [m]."""
    transducer_depth: float = 0.0
    """Distance of the force transducer's section behind the face [m]. 0 is the face."""
    seen_at: float = 0.0
    """For a flyer: distance of the point of measured displacement behind the face [m]."""

    @property
    def length(self) -> float:
        """Length of all parts [m]."""
        return sum(part.length for part in self.parts)


@dataclass(frozen=True)
class Transducer:
    """A force transducer on a scope channel. Raises ValueError if a value is outside its range."""

    sensitivity: float
    """Output per force, positive [V/N]."""
    compression_sign: int
    """+1 if compression gives positive volts, -1 otherwise."""
    full_scale: float
    """Largest |voltage| that the recorder can measure [V]."""
    time_constant: float = inf
    """Time in which the output of a constant force falls to 1/e [s]; inf without droop."""

    def __post_init__(self) -> None:
        check_interval("(0, inf) V/N", sensitivity=self.sensitivity)
        check_interval("(0, inf]", full_scale=self.full_scale, time_constant=self.time_constant)
        if self.compression_sign not in (1, -1):
            raise ValueError(f"compression_sign must be +1 or -1, got {self.compression_sign}")


@dataclass(frozen=True)
class Interface:
    """Contact of the specimen with the platens. Each law is one of `explicit.contact.CONTACT_LAWS`."""

    faces: str
    """Law of the end faces."""
    side: str
    """Law of the side surface at places where it rolls onto a platen."""
    friction: float = 0.0
    """Coulomb coefficient, for laws that use it [-]."""
    release_stress: float = 0.0
    """Tensile stress at which a node is released, for laws that use it [Pa]."""
    contact_stiffness: float = 1e13
    """Stiffness of the contact springs divided by the undeformed area, for laws that use it [Pa/m]."""


RelaxationKind = Literal["prony", "bergstrom_boyce"]

MOST_BRANCHES = 3
"""Largest number of branches of a Prony series with individual parameters. A few strain rates do not
constrain more."""
NETWORK_CONSTANTS = (
    "creep_ratio",
    "creep_resistance",
    "creep_exponent",
    "creep_chain_exponent",
    "creep_first",
)
"""Parameters of Bergstrom and Boyce's network, in the order of `explicit.relaxation.BergstromBoyce`."""
NETWORK_DEFAULTS = {"creep_exponent": 4.0, "creep_chain_exponent": -1.0, "creep_first": 0.01}
"""Constants that need not be declared. Their defaults are those of `explicit.relaxation.BergstromBoyce`."""
NETWORK_FREE = ("creep_ratio", "creep_resistance")
"""Constants of the network that are free by default, if the shot declares relaxation without details."""


def prony_names(branches: int) -> tuple[str, ...]:
    """Parameters of a Prony series, branch by branch. The strengths come first, then the times."""
    numbers = range(1, branches + 1)
    return (*(f"prony_strength_{k}" for k in numbers), *(f"prony_time_{k}" for k in numbers))


@dataclass(frozen=True)
class Relaxation:
    """[relaxation] of a shot: viscoelastic branches added to the long-term law.

    The long-term law is the quasi-static curve times m.
    """

    kind: RelaxationKind
    """Prony series, or the network of Bergstrom and Boyce."""
    values: Mapping[str, float]
    """Parameter name -> declared constant in SI. The names are `prony_names`, or `NETWORK`."""
    sigmas: Mapping[str, float] = field(default_factory=dict)
    """Parameter name -> declared standard uncertainty in SI. A missing name has no declared uncertainty."""
    free: bool = False
    """True if an identification estimates its constants by default."""

    def __post_init__(self) -> None:
        expected = prony_names(self.branches) if self.kind == "prony" else NETWORK_CONSTANTS
        if set(self.values) != set(expected):
            raise ValueError(
                f"{self.kind} has the constants {', '.join(expected)}, got {', '.join(self.values)}"
            )
        if stray := sorted(set(self.sigmas) - set(expected)):
            raise ValueError(f"{stray[0]} has an uncertainty and no value")

    @property
    def branches(self) -> int:
        """Number of branches of the series; 1 for the network."""
        return len(self.values) // 2 if self.kind == "prony" else 1

    @property
    def free_names(self) -> tuple[str, ...]:
        """Parameters that are free by default. None are free if the constants are fixed."""
        if not self.free:
            return ()
        return prony_names(self.branches) if self.kind == "prony" else NETWORK_FREE

    @property
    def words(self) -> str:
        """The model in words."""
        if self.kind == "bergstrom_boyce":
            return "a network of Bergström and Boyce that creeps"
        return "a Prony series of " + ("1 branch" if self.branches == 1 else f"{self.branches} branches")
