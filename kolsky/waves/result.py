"""What `kolsky waves` finds: signals, windows, waves, reduction, its corrections and its budget."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from kolsky.apparatus import Specimen
from kolsky.waves.records import BarSignal, Correction, FaceWaves, FloatArray, Quantity, Reduction, Windows


@dataclass(frozen=True)
class Contribution:
    """What one input of the budget adds to one result."""

    quantity: Quantity
    """The input."""
    shares: Mapping[str, float]
    """Its share of the variance of each result, by the result's name [-]."""


@dataclass(frozen=True)
class BudgetTable:
    """The uncertainty budget at the numbers that are quoted."""

    results: Mapping[str, tuple[float, float, str]]
    """Quoted number by name: value, standard uncertainty (k = 1), unit."""
    contributions: tuple[Contribution, ...]
    """One row an input, noise last."""


@dataclass(frozen=True)
class WavesResult:
    """A classical reduction of one shot, with everything that it rests on."""

    name: str
    """Name of the shot."""
    specimen: Specimen
    """The specimen before the test."""
    load: str
    """"compression" or "tension"."""
    incident: BarSignal
    """Strain at the incident gauge."""
    transmission: BarSignal
    """Strain at the transmission gauge."""
    windows: Windows
    """Where the pulses lie."""
    faces: FaceWaves
    """The waves at the specimen."""
    reduction: Reduction
    """Strain, rate, stress and forces, with bands."""
    corrections: tuple[Correction, ...]
    """The audit log."""
    budget: BudgetTable
    """The uncertainty budget."""
    facts: Mapping[str, tuple[float, str]]
    """Numbers of the record and its reduction: value and unit by name."""
    remarks: tuple[str, ...]
    """What a user must know before the numbers are used, each with its cure."""
    inputs: Mapping[str, str]
    """SHA-256 of every file that was read, by name."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """What was declared, and the versions."""
    extra: Mapping[str, FloatArray] = field(default_factory=dict)
    """Further histories on the reduction's times, "name (unit)" to values, shape [n]."""
