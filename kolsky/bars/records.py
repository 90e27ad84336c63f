"""Records of bar signals, from the recording to the result.

Values are SI, float64, compression positive, on the shot's clock.

A `Signal` has a uniform clock. `WavesResult` is the result of `kolsky waves`, `FlyerResult` that of the flyer
test.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dic.basics import check_interval, check_shape
from dic.views import ResultViews
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.records import Recording

ANALYSES = ("one wave", "two waves", "three waves")
"""Keys of the mappings of a `Reduction`."""
_SHARED_HISTORIES = ("front_force", "back_force", "front_velocity", "back_velocity")
"""Histories of a `Reduction` that all analyses share."""


@dataclass(frozen=True)
class Signal:
    """A uniformly sampled quantity. Sample i belongs to the time ``start + i * interval``.

    Raises ValueError if the interval is not positive, or if a number is not finite.
    """

    start: float
    """Time of the first sample on the shot's clock [s]."""
    interval: float
    """Time from sample to sample [s]."""
    value: FloatArray
    """Samples in `unit`, shape [n]."""
    sigma: float
    """Standard deviation of one sample's noise, in `unit`."""
    unit: str
    """Unit of `value`: "1" for strain, "N", "m/s", "V"."""
    name: str = ""
    """Its name, e.g. "incident gauge"."""
    memory: float = 1.0
    """Samples per independent one [-]: 1 for white noise, more for correlated noise."""

    def __post_init__(self) -> None:
        name = self.name or "the signal"
        check_interval("(0, inf) s", **{f"interval of {name}": self.interval})
        check_interval("[0, inf)", **{f"sigma of {name}": self.sigma, f"memory of {name}": self.memory})
        check_shape((self.value.size,), **{name: self.value})

    @property
    def time(self) -> FloatArray:
        """Sample times on the shot's clock [s], shape [n]."""
        return np.asarray(self.start + self.interval * np.arange(self.value.size), dtype=np.float64)

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.start + self.interval * (self.value.size - 1)


@dataclass(frozen=True)
class BarSignal:
    """Strain at a gauge station, compression positive. It is the mean of its gauges, without bending."""

    strain: Signal
    """Axial strain at the station, compression positive [-]."""
    bar: Bar
    position: float
    """Distance of the station from the bar's specimen end [m], > 0."""
    side: str
    """"incident" or "transmission"."""
    bending: FloatArray | None = None
    """Half the difference of opposed gauges [-], shape [n]; None with a single gauge."""


@dataclass(frozen=True)
class Windows:
    """Time windows of the three pulses at the gauges: first and last time on the shot's clock [s]."""

    incident: tuple[float, float]
    """At the incident gauge."""
    reflected: tuple[float, float]
    """At the incident gauge."""
    transmitted: tuple[float, float]
    """At the transmission gauge."""
    source: str
    """Their source: "arrival", "travel times" or "shot file"."""


@dataclass(frozen=True)
class FaceWaves:
    """The waves at the bars' faces on the specimen, on one clock: strains, compression positive.

    Raises ValueError if shapes differ, a value is not finite, times do not increase, or a sigma is negative.
    """

    time: FloatArray
    """Times at the specimen's faces, from the arrival of the incident wave [s], shape [n], uniform."""
    incident: FloatArray
    """Incident wave in the incident bar, toward the specimen [-], shape [n]."""
    reflected: FloatArray
    """Reflected wave in the incident bar, from the specimen [-], shape [n]. A tensile pulse is negative."""
    transmitted: FloatArray
    """Transmitted wave in the transmission bar, from the specimen [-], shape [n]."""
    sigma: Mapping[str, float]
    """Standard deviation of a sample's noise of "incident", "reflected", "transmitted" [-]."""
    incident_bar: Bar
    transmission_bar: Bar
    origin: float = 0.0
    """Time 0 of `time` on the shot's clock [s]. At this time the incident wave arrives at the specimen."""
    white: Mapping[str, float] | None = None
    """Sigma of white noise with the level of each wave's noise at low frequencies [-]. It determines the
    noise of integrals and means. None if the noise is white with `sigma`."""
    band: float = float("inf")
    """Frequency above which the waves were filtered out [Hz]."""

    def __post_init__(self) -> None:
        waves = {name: getattr(self, name) for name in ("incident", "reflected", "transmitted")}
        check_shape((self.time.size,), time=self.time, **waves)
        check_interval("(0, inf) s", **{"step of the time": np.diff(self.time)})
        check_interval("[0, inf)", **{f"sigma of {name}": sigma for name, sigma in self.sigma.items()})


@dataclass(frozen=True)
class History:
    """One quantity over the times of a reduction, with its uncertainty."""

    value: FloatArray
    """Its values, shape [n]."""
    sigma: FloatArray
    """Standard uncertainty (k = 1) of each value, with noise and systematic parts, shape [n]."""
    unit: str


@dataclass(frozen=True)
class Reduction:
    """Strain, rate and stress of a specimen by one-, two- and three-wave analysis.

    Keys of the mappings are "one wave", "two waves" and "three waves". All quantities are nominal,
    compression positive.
    """

    time: FloatArray
    """Times at the specimen [s], shape [n]."""
    strain: Mapping[str, History]
    """Nominal strain [-]."""
    rate: Mapping[str, History]
    """Nominal strain rate [1/s]."""
    stress: Mapping[str, History]
    """Nominal stress [Pa]."""
    front_force: History
    """Force of the incident bar on the specimen [N]."""
    back_force: History
    """Force of the specimen on the transmission bar [N]."""
    front_velocity: History
    """Velocity of the incident bar's face toward the specimen [m/s]."""
    back_velocity: History
    """Velocity of the transmission bar's face, in the same direction [m/s]."""
    imbalance: FloatArray
    """Equilibrium R(t) = 2 (F1 - F2) / (F1 + F2) [-], shape [n]; inf if the forces are within their noise."""
    balanced: tuple[float, float] | None
    """Longest time span in which R stays within its allowance [s]; None if there is none."""


@dataclass(frozen=True)
class Correction:
    """One entry of the audit log: the change made to a signal, and its size."""

    name: str
    """Its name, e.g. "dispersion, incident wave". Its switch in shot.toml is `key`."""
    key: str
    applied: bool
    """True if the correction was applied. One that was not applied is also listed with its size."""
    size: float
    """Largest change over the pulse, in `unit`."""
    rms: float
    """Root mean square of the change over the pulse, in `unit`."""
    unit: str
    """Unit of the sizes."""
    reason: str
    """Reason why it was applied or not, with the values used, in one sentence."""


@dataclass(frozen=True)
class Quantity:
    """An input of the uncertainty budget (GUM 4.1).

    Raises ValueError if a number is impossible or the kind is unknown.
    """

    name: str
    """Its name, e.g. "incident bar, Young's modulus"."""
    value: float
    """Best estimate, SI."""
    sigma: float
    """Standard uncertainty (k = 1), SI."""
    unit: str
    kind: str
    """"A" for repeated observations, "B" for a certificate, a resolution or a judgement."""
    freedom: float = float("inf")
    """Degrees of freedom of the standard uncertainty."""

    def __post_init__(self) -> None:
        check_interval("(-inf, inf)", **{self.name: self.value})
        check_interval("[0, inf)", **{f"{self.name}: sigma": self.sigma})
        check_interval("[1, inf]", **{f"{self.name}: freedom": self.freedom})
        if self.kind not in ("A", "B"):
            raise ValueError(f"{self.name}: kind must be 'A' or 'B', got {self.kind!r}")


def histories(reduction: Reduction) -> dict[str, History]:
    """All histories of a reduction by name, e.g. "stress, three waves"."""
    by_analysis = {
        f"{name}, {analysis}": kind[analysis]
        for name, kind in (
            ("strain", reduction.strain),
            ("rate", reduction.rate),
            ("stress", reduction.stress),
        )
        for analysis in ANALYSES
    }
    return by_analysis | {name: getattr(reduction, name) for name in _SHARED_HISTORIES}


def map_histories(reduction: Reduction, change: Callable[[str, History], History]) -> Reduction:
    """The reduction with `change` applied to each history and its name, as in `histories`."""

    def changed(kind: str) -> dict[str, History]:
        return {key: change(f"{kind}, {key}", history) for key, history in getattr(reduction, kind).items()}

    shared: dict[str, Any] = {name: change(name, getattr(reduction, name)) for name in _SHARED_HISTORIES}
    return replace(
        reduction, strain=changed("strain"), rate=changed("rate"), stress=changed("stress"), **shared
    )


def with_opposite_sign(reduction: Reduction) -> Reduction:
    """The reduction with the opposite sign of all histories.

    Tension is then positive instead of compression.
    """
    return map_histories(
        reduction, lambda name, history: History(-history.value, history.sigma, history.unit)
    )


@dataclass(frozen=True)
class Contribution:
    """Share of one input of the budget in the variance of the results."""

    quantity: Quantity
    shares: Mapping[str, float]
    """Its share of the variance of each result, by the result's name [-]."""
    sensitivity: Mapping[str, float] = field(default_factory=dict)
    """Change of each result per unit of the input, with its sign, by the result's name. Its unit is that of
    the result over that of the input. An exact input is not varied and has none."""


@dataclass(frozen=True)
class BudgetTable:
    """The uncertainty budget of the reported results."""

    results: Mapping[str, tuple[float, float, str]]
    """Result by name: value, standard uncertainty (k = 1), unit."""
    contributions: tuple[Contribution, ...]
    """One row for each input, noise last."""


@dataclass(frozen=True, kw_only=True)
class ReducedTest(ResultViews):
    """A reduced test of any method, with the data and settings behind its results."""

    name: str
    specimen: Specimen
    load: str
    """"compression" or "tension"."""
    reduction: Reduction
    """Strain, rate, stress and forces, with bands."""
    corrections: tuple[Correction, ...]
    """The audit log."""
    budget: BudgetTable
    facts: Mapping[str, tuple[float, str]]
    """Numbers of the record and its reduction: value and unit by name."""
    remarks: tuple[str, ...]
    """Conditions that limit the use of the results, each with its remedy."""
    inputs: Mapping[str, str]
    """SHA-256 of every file that was read, by name."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """Declared settings, and the versions."""
    extra: Mapping[str, FloatArray] = field(default_factory=dict)
    """Further histories on the reduction's times, "name (unit)" to values, shape [n]."""
    valid: tuple[float, float] | None = None
    """Time span in which imbalance and inertia stay within a share of the stress, and the classical
    stress-strain curve is valid [s]; None if there is none."""
    validity: str = ""
    """The time span in words, with the allowed share."""


@dataclass(frozen=True, kw_only=True)
class WavesResult(ReducedTest):
    """A test between bars, reduced from their gauges."""

    incident: BarSignal
    """Strain at the incident gauge."""
    transmission: BarSignal
    """Strain at the transmission gauge."""
    windows: Windows
    faces: FaceWaves
    analysis: str = "three waves"


@dataclass(frozen=True, kw_only=True)
class FlyerResult(ReducedTest):
    """A test with a flyer, reduced from its transducers and its motion."""

    signals: tuple[Signal, ...]
    """Forces at the transducers over the whole record [N]."""
    events: tuple[tuple[str, float | None, float | None, str], ...]
    """Name, time [s], sigma [s] and detection method of every event in the search."""
    synchronisation: str | None
    """Verdict of the cross-check of cameras and transducers; None without an incident transducer."""
    inertia: Mapping[str, FloatArray]
    """Shares of the mean stress: "imbalance" and "inertia" at "time" [s], shape [n_intervals]."""


LARGEST_JITTER = 0.01
"""Largest deviation of a sample time from uniform spacing, as a share of the interval."""


def uniform_clock(recording: Recording) -> tuple[float, float]:
    """First time and interval of a recording [s]. The recording must be uniform.

    Raises ValueError if lengths differ, if a value is not finite, or if a time deviates from uniform spacing
    by 1 % of the interval.
    """
    time, value, name = recording.time, recording.value, recording.channel
    if time.shape != value.shape or time.ndim != 1 or time.size < 2:
        raise ValueError(
            f"{name}: time and value need one length of 2 or more, got {time.shape}, {value.shape}"
        )
    bad = np.flatnonzero(~(np.isfinite(time) & np.isfinite(value)))
    if bad.size:
        raise ValueError(
            f"{name}: sample {bad[0]} is ({time[bad[0]]} s, {value[bad[0]]}); every sample must be finite"
        )
    interval = float(time[-1] - time[0]) / (time.size - 1)
    if not interval > 0.0:
        raise ValueError(f"{name}: times must increase, got {time[0]:.9g} to {time[-1]:.9g} s")
    off = np.abs(time - time[0] - interval * np.arange(time.size))
    worst = int(np.argmax(off))
    if off[worst] > LARGEST_JITTER * interval:
        raise ValueError(
            f"{name}: sample {worst} is {off[worst] / interval:.3g} intervals off an even division, allowed"
            f" is {LARGEST_JITTER:g}; a rounded time column must be replaced by a stated start and interval"
        )
    return float(time[0]), interval
