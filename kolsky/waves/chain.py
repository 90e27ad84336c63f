"""The chain: gauges to strain, windows, waves at the faces, reduction, corrections, budget."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kolsky.apparatus import Bar, Specimen
from kolsky.records import Recording
from kolsky.waves import quoted
from kolsky.waves.audit import AuditLog, Switches
from kolsky.waves.bridge import Calibration
from kolsky.waves.budget import Budget, propagate
from kolsky.waves.equilibrium import ALLOWANCE
from kolsky.waves.faces import face_waves
from kolsky.waves.overlap import overlapping_windows, separated
from kolsky.waves.polymer_waveguide import PronyModulus, ViscoelasticWaveguide
from kolsky.waves.punching import correct_punching
from kolsky.waves.quantities import merged
from kolsky.waves.records import BarSignal, Correction, FaceWaves, History, Quantity, Reduction, Windows
from kolsky.waves.reduction import ANALYSES, reduce
from kolsky.waves.result import WavesResult
from kolsky.waves.stations import Station, bar_signal
from kolsky.waves.summary import Summary, summarise
from kolsky.waves.varied import (
    bar_quantities,
    length_quantities,
    varied_bar,
    varied_position,
    varied_specimen,
)
from kolsky.waves.waveguide import ElasticWaveguide, Waveguide
from kolsky.waves.windows import check_windows, find_windows, incident_arrival

SIDES = ("incident", "transmission")
FAR = "incident far"
"""Key of the incident bar's second station."""
LARGEST_BEND = 1.0
"""Disagreement of the budget's two steps that ends the work, in combined standard uncertainties: steep fronts
that a wave speed moves bend more than any straight line; `quoted.remarks` says where it matters."""
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class StationInput:
    """What was recorded at one place of a bar."""

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
    compression: int
    """+1 if compression gives positive values, -1 otherwise."""
    full_scale: float | None = None
    """Largest magnitude that the recorder shows; None if it is not known."""


@dataclass(frozen=True)
class WavesInput:
    """A classical test, ready to be reduced (SI)."""

    name: str
    """Name of the shot."""
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
    allowance: float = ALLOWANCE
    """|R| up to which the forces count as balanced [-]."""
    switches: Switches = field(default_factory=Switches)
    """Which corrections are applied."""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainties (k = 1) by the keys of [uncertainty]; relative but for lengths and Poisson's
    ratio."""
    alike: bool = False
    """Whether the bars' errors of one property are one and the same, as of bars cut from one rod."""
    inputs: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of every file, by name."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """What was declared, and the versions."""


def analyse(given: WavesInput, *, progress: Progress = lambda stage, done, total: None) -> WavesResult:
    """Reduce a classical test, with every correction listed and every uncertainty carried.

    Parameters
    ----------
    given
        The test.
    progress
        Called with "waves", the steps done and the steps there are.

    Raises
    ------
    ValueError
        If the signals hold no such test: see the parts in `kolsky.waves`.
    """
    progress("waves", 0, 3)
    tension = given.load == "tension"
    best = {side: _station(given, side, {}) for side in SIDES}
    incident, transmission = (best[side].signal for side in SIDES)
    arrival = incident_arrival(incident, tension=tension)
    windows = _windows(given, incident, transmission, tension)
    seen = check_windows(incident, transmission, tension=tension)
    progress("waves", 1, 3)

    log = AuditLog(given.switches)
    for side in SIDES:
        log.add(*best[side].corrections)
    state = _State(given, windows, arrival.time)
    plain, carried = state.carried({}, dispersive=False), state.carried({}, dispersive=True)
    _log_dispersion(log, plain, carried, given)
    faces = state.faces({}, log)
    reduction, punching = state.reduced(faces, {})
    log.add(punching)
    summary = summarise(reduction, faces, given.specimen)
    progress("waves", 2, 3)

    budget = _budget(state, best, reduction, summary)
    reduction = _with_bands(reduction, budget)
    progress("waves", 3, 3)
    sign = -1.0 if tension else 1.0
    return WavesResult(
        name=given.name,
        specimen=given.specimen,
        load=given.load,
        incident=incident,
        transmission=transmission,
        windows=windows,
        faces=faces,
        reduction=turned(reduction) if tension else reduction,
        corrections=log.corrections,
        budget=quoted.table(budget, sign),
        facts=quoted.facts(best, arrival, seen, windows, reduction, summary, given.specimen),
        remarks=tuple(quoted.remarks(reduction, budget, seen, given)),
        inputs=given.inputs,
        settings=given.settings,
    )


@dataclass(frozen=True)
class _State:
    """One test whose quantities can be given other values."""

    given: WavesInput
    windows: Windows
    arrival: float

    def guides(self, values: Mapping[str, float]) -> tuple[Waveguide, Waveguide]:
        """Both bars as waveguides."""
        first, second = (self._guide(side, varied_bar(self.given.bars[side], side, values)) for side in SIDES)
        return first, second

    def _guide(self, side: str, bar: Bar) -> Waveguide:
        dispersive = self.given.switches["dispersion"]
        prony = self.given.polymers.get(side)
        if prony is None:
            return ElasticWaveguide(bar, dispersive=dispersive)
        return ViscoelasticWaveguide(bar, prony.scaled(bar.youngs_modulus / prony.instantaneous), dispersive)

    def carried(self, values: Mapping[str, float], *, dispersive: bool) -> FaceWaves:
        """The waves at the specimen by windows, with or without what the bars do to them on the way."""
        incident, transmission = (_station(self.given, side, values).signal for side in SIDES)
        return face_waves(
            incident,
            transmission,
            self.windows,
            guides=self.guides(values) if dispersive or self.given.polymers else None,
            arrival=self.arrival,
        )

    def faces(self, values: Mapping[str, float], log: AuditLog) -> FaceWaves:
        """The waves at the specimen as they are reduced; overlapping ones told apart."""
        found = self.carried(values, dispersive=self.given.switches["dispersion"])
        if FAR not in self.given.stations:
            return found
        near, far = (_station(self.given, key, values).signal for key in ("incident", FAR))
        return separated(found, near, far, self.guides(values)[0], log)

    def reduced(self, faces: FaceWaves, values: Mapping[str, float]) -> tuple[Reduction, Correction]:
        """Reduction with the punching of the faces taken out, if that is on."""
        specimen = varied_specimen(self.given.specimen, values)
        dispersive = self.given.switches["dispersion"] or self.given.polymers
        guides = self.guides(values) if dispersive else None
        return correct_punching(
            reduce(faces, specimen, guides=guides, allowance=self.given.allowance),
            specimen,
            faces.incident_bar,
            faces.transmission_bar,
            apply=self.given.switches["punching"],
        )

    def outputs(self, values: Mapping[str, float], summary: Summary) -> dict[str, np.ndarray]:
        """All histories and quoted numbers, for the budget."""
        faces = self.faces(values, AuditLog(self.given.switches))
        reduction, _ = self.reduced(faces, values)
        return {**histories(reduction), **quoted.numbers(reduction, summary)}


def histories(reduction: Reduction) -> dict[str, np.ndarray]:
    """Every history of a reduction by name, e.g. "stress, three waves"."""
    found = {
        f"{name}, {way}": kind[way].value
        for name, kind in (
            ("strain", reduction.strain),
            ("rate", reduction.rate),
            ("stress", reduction.stress),
        )
        for way in ANALYSES
    }
    return found | {name: getattr(reduction, name).value for name in SINGLE}


SINGLE = ("front_force", "back_force", "front_velocity", "back_velocity")
"""Histories of a reduction that every way of analysis shares."""


def each(reduction: Reduction, change: Callable[[str, History], History]) -> Reduction:
    """The reduction with every history changed; `change` gets its name, as `histories` has it, and itself."""

    def ways(kind: str) -> dict[str, History]:
        return {way: change(f"{kind}, {way}", history) for way, history in getattr(reduction, kind).items()}

    return replace(
        reduction,
        strain=ways("strain"),
        rate=ways("rate"),
        stress=ways("stress"),
        front_force=change("front_force", reduction.front_force),
        back_force=change("back_force", reduction.back_force),
        front_velocity=change("front_velocity", reduction.front_velocity),
        back_velocity=change("back_velocity", reduction.back_velocity),
    )


def turned(reduction: Reduction) -> Reduction:
    """The reduction of a test in tension with tension positive."""
    return each(reduction, lambda name, history: History(-history.value, history.sigma, history.unit))


def _windows(given: WavesInput, incident: BarSignal, transmission: BarSignal, tension: bool) -> Windows:
    """Windows by hand, by dead reckoning or, with two stations on a bar, in spite of an overlap."""
    if given.windows is None and FAR in given.stations and given.switches["separation"]:
        return overlapping_windows(incident, _station(given, FAR, {}).signal, transmission, tension=tension)
    return find_windows(incident, transmission, tension=tension, manual=given.windows)


def station_of(given: WavesInput, side: str) -> Station:
    """The strain at one station as it was declared.

    Raises
    ------
    ValueError
        As `kolsky.waves.stations.bar_signal`.
    """
    return _station(given, side, {})


def _station(given: WavesInput, key: str, values: Mapping[str, float]) -> Station:
    """The strain at one station, its bar and place with other values."""
    station, side = given.stations[key], key.removesuffix(" far")
    return bar_signal(
        station.recordings,
        station.calibration,
        varied_bar(given.bars[side], side, values),
        varied_position(station.position, key, values),
        side,
        baseline=station.baseline,
        clock_offset=station.clock_offset,
        compression=station.compression,
        full_scale=station.full_scale,
        switches=given.switches,
        uncertainty=quoted.calibration_sigma(
            station.calibration, given.uncertainty.get("gauge_calibration", 0.0)
        ),
        values=values,
    )


def _log_dispersion(log: AuditLog, plain: FaceWaves, carried: FaceWaves, given: WavesInput) -> None:
    for wave, side in (("incident", "incident"), ("reflected", "incident"), ("transmitted", "transmission")):
        bar, distance = given.bars[side], given.stations[side].position
        log.choose(
            f"dispersion, {wave} wave",
            "dispersion",
            getattr(plain, wave),
            getattr(carried, wave),
            unit="1",
            reason=(
                f"first mode of a bar of {1e3 * bar.diameter:.4g} mm with nu = {bar.poisson:g} over "
                f"{1e3 * distance:.4g} mm, against a shift at {bar.wave_speed:.1f} m/s"
            ),
        )


def _budget(state: _State, best: Mapping[str, Station], reduction: Reduction, summary: Summary) -> Budget:
    """Uncertainties of all histories and quoted numbers."""
    given = state.given
    quantities: list[Quantity] = []
    for side in SIDES:
        quantities += best[side].quantities
        quantities += bar_quantities(given.bars[side], side, given.uncertainty)
    quantities += length_quantities(
        given.specimen, {key: station.position for key, station in given.stations.items()}, given.uncertainty
    )
    known = merged(quantities)
    noise = {
        **{
            f"{name}, {way}": kind[way].sigma
            for name, kind in (
                ("strain", reduction.strain),
                ("rate", reduction.rate),
                ("stress", reduction.stress),
            )
            for way in ANALYSES
        },
        **{name: getattr(reduction, name).sigma for name in SINGLE},
        **quoted.noise(reduction, summary),
    }
    names = {q.name for q in known}
    pairs = {
        (f"incident bar, {prop}", f"transmission bar, {prop}"): 1.0
        for prop in ("Young's modulus", "wave speed", "density", "diameter", "Poisson's ratio")
        if given.alike and f"incident bar, {prop}" in names and f"transmission bar, {prop}" in names
    }
    return propagate(
        lambda values: state.outputs(values, summary),
        known,
        noise=noise,
        correlations=pairs,
        tolerance=LARGEST_BEND,
    )


def _with_bands(reduction: Reduction, budget: Budget) -> Reduction:
    """The reduction with the combined standard uncertainties."""
    return each(reduction, lambda name, history: budget.history(name, history.unit))
