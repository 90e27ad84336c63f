"""A classical test as it is declared and recorded, ready to be reduced."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from kolsky.bars.audit import Switches
from kolsky.bars.guides.waveguide import PronyModulus
from kolsky.bars.records import Windows
from kolsky.bars.reduction.validity import ALLOWANCE, VALIDITY_SHARE
from kolsky.bars.reduction.validity import PLATEAU_SHARE as PLATEAU
from kolsky.bars.signals.bridge import Calibration
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.records import Recording

SIDES = ("incident", "transmission")
FAR = "incident far"
"""Key of the incident bar's second station."""
NO_PART: Mapping[str, str] = MappingProxyType(
    {
        "droop": "a strain gauge does not discharge; droop is of piezoelectric transducers",
        "mass": "nothing lies between a bar's face and the specimen: the wave is carried to the face with "
        "the bar's own inertia; an insert or a cap there is not modelled",
    }
)
"""Corrections that have no part in a test between bars, and why."""


@dataclass(frozen=True)
class StationInput:
    """Recordings and calibration of one gauge station."""

    recordings: tuple[Recording, ...]
    """One channel, or two of opposed gauges."""
    calibration: Calibration
    """Recorded values to strain."""
    position: float
    """Distance from the bar's specimen end [m]."""
    baseline: tuple[float, float]
    """Span of rest on the shot's clock [s]."""
    clock_offset: float
    """Shot's clock minus recorder's clock [s]."""
    compression: int | tuple[int, ...]
    """+1 if compression gives positive values, -1 otherwise; one for all channels, or one each."""
    full_scale: float | None = None
    """Largest magnitude that the recorder shows; None if it is not known."""


@dataclass(frozen=True)
class WavesInput:
    """A classical test, ready to be reduced (SI)."""

    name: str
    specimen: Specimen
    """The specimen before the test."""
    bars: Mapping[str, Bar]
    """Bars by side, "incident" and "transmission"."""
    stations: Mapping[str, StationInput]
    """Gauge stations by side; "incident far" is a second one on the incident bar, for overlapping pulses."""
    load: str = "compression"
    """"compression" or "tension"."""
    polymers: Mapping[str, PronyModulus] = field(default_factory=dict)
    """Complex moduli of the bars that are not elastic, by side."""
    windows: Windows | None = None
    """Windows given by hand; None to have the pulses found."""
    analysis: str = "three waves"
    """The analysis whose values are quoted: "one wave", "two waves" or "three waves"."""
    allowance: float = ALLOWANCE
    """|R| up to which the forces count as balanced [-]."""
    plateau: float = PLATEAU
    """Least balanced length of a plateau as a share of the incident pulse's [-]."""
    share: float = VALIDITY_SHARE
    """Share of the stress that inertia, or the forces' difference, may have where a curve is valid [-]."""
    switches: Switches = field(default_factory=Switches)
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainties (k = 1) by the keys of [uncertainty]; relative but for lengths and Poisson's
    ratio."""
    alike: bool = False
    """True if the bars' errors of one property are the same, as of bars cut from one rod."""
    inputs: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of every file, by name."""
    notes: tuple[str, ...] = ()
    """Sentences about the files with their cures: units that contradict, samples that were interpolated."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """Declared settings, and the versions."""
