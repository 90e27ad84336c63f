"""Result of `kolsky waves`: signals, windows, waves, reduction, its corrections and its budget."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from kolsky.bars.records import BarSignal, Correction, FaceWaves, Quantity, Reduction, Signal, Windows
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Contribution:
    """Share of one input of the budget in the variance of the results."""

    quantity: Quantity
    """The input."""
    shares: Mapping[str, float]
    """Its share of the variance of each result, by the result's name [-]."""
    sensitivity: Mapping[str, float] = field(default_factory=dict)
    """Change of each result per unit of the input, with its sign, by the result's name, in the result's unit
    over the input's. An input that counts as exact is not varied and has none."""


@dataclass(frozen=True)
class BudgetTable:
    """The uncertainty budget at the numbers that are quoted."""

    results: Mapping[str, tuple[float, float, str]]
    """Quoted number by name: value, standard uncertainty (k = 1), unit."""
    contributions: tuple[Contribution, ...]
    """One row an input, noise last."""


@dataclass(frozen=True, kw_only=True)
class ReducedTest:
    """A reduced test, however it was measured, with everything that its numbers rest on."""

    name: str
    """Name of the shot."""
    specimen: Specimen
    """The specimen before the test."""
    load: str
    """"compression" or "tension"."""
    reduction: Reduction
    """Strain, rate, stress and forces, with bands."""
    corrections: tuple[Correction, ...]
    """The audit log."""
    budget: BudgetTable
    """The uncertainty budget."""
    facts: Mapping[str, tuple[float, str]]
    """Numbers of the record and its reduction: value and unit by name."""
    remarks: tuple[str, ...]
    """Conditions that limit the use of the values, each with its cure."""
    inputs: Mapping[str, str]
    """SHA-256 of every file that was read, by name."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """Declared settings, and the versions."""
    extra: Mapping[str, FloatArray] = field(default_factory=dict)
    """Further histories on the reduction's times, "name (unit)" to values, shape [n]."""


@dataclass(frozen=True, kw_only=True)
class WavesResult(ReducedTest):
    """A test between bars, reduced from their gauges."""

    incident: BarSignal
    """Strain at the incident gauge."""
    transmission: BarSignal
    """Strain at the transmission gauge."""
    windows: Windows
    """Time windows of the pulses."""
    faces: FaceWaves
    """The waves at the specimen."""
    analysis: str = "three waves"
    """The analysis whose values are quoted."""
    valid: tuple[float, float] | None = None
    """Span in which imbalance and inertia stay within a share of the stress [s]; None if there is none."""
    validity: str = ""
    """The same in words, with the share that was allowed."""


@dataclass(frozen=True, kw_only=True)
class FlyerResult(ReducedTest):
    """A test with a flyer, reduced from its transducers and its motion."""

    signals: tuple[Signal, ...]
    """Forces at the transducers over the whole record [N]."""
    events: tuple[tuple[str, float | None, float | None, str], ...]
    """Name, time [s], sigma [s] and how it was found, of every event that was looked for."""
    valid: tuple[float, float] | None
    """Span in which a classical curve may be read [s]; None if there is none."""
    validity: str
    """The same in words, with the share that was allowed."""
    synchronisation: str | None
    """Verdict of the cross-check of cameras and transducers; None without an incident transducer."""
    inertia: Mapping[str, FloatArray]
    """Shares of the mean stress: "imbalance" and "inertia" at "time" [s], shape [n_intervals]."""
