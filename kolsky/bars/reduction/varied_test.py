"""A classical test with other values of its quantities: the model for the uncertainty budget."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kolsky.bars.audit import AuditLog
from kolsky.bars.budget import merge_quantities
from kolsky.bars.guides.waveguide import ElasticWaveguide, ViscoelasticWaveguide, Waveguide
from kolsky.bars.records import Correction, FaceWaves, Quantity, Reduction, Windows, histories
from kolsky.bars.reduction import summary as quoted
from kolsky.bars.reduction.inertia import correct_inertia
from kolsky.bars.reduction.separation import FreeEnds, face_waves, largest_band, separated
from kolsky.bars.reduction.stress_strain import correct_punching, reduce, true_curve
from kolsky.bars.reduction.summary import Summary
from kolsky.bars.reduction.validity import ENDS, Span, averaging_width, find_span
from kolsky.bars.reduction.windows import FAR, SIDES, Alignment, WavesInput, delays
from kolsky.bars.signals.stations import Station, bar_signal
from kolsky.base.apparatus import Bar, Specimen

BAR_PROPERTIES = ("Young's modulus", "wave speed", "density", "diameter", "Poisson's ratio")
"""Properties of a bar that are quantities of a budget. Either modulus or wave speed is one of them."""


def bar_quantities(bar: Bar, side: str, uncertainty: Mapping[str, float]) -> list[Quantity]:
    """Quantities of a bar: modulus or measured wave speed, density, diameter, Poisson's ratio.

    If the wave speed has an uncertainty, it is the quantity. The modulus follows from it and the density.
    """

    def relative(words: str, value: float, key: str, unit: str) -> Quantity:
        return Quantity(f"{side} bar, {words}", value, value * uncertainty.get(key, 0.0), unit, "B")

    if uncertainty.get("bar_wave_speed", 0.0) > 0.0:
        stiffness = relative("wave speed", bar.wave_speed, "bar_wave_speed", "m/s")
    else:
        stiffness = relative("Young's modulus", bar.youngs_modulus, "bar_modulus", "Pa")
    return [
        stiffness,
        relative("density", bar.density, "bar_density", "kg/m^3"),
        relative("diameter", bar.diameter, "bar_diameter", "m"),
        Quantity(f"{side} bar, Poisson's ratio", bar.poisson, uncertainty.get("bar_poisson", 0.0), "1", "B"),
    ]


def length_quantities(
    specimen: Specimen, positions: Mapping[str, float], uncertainty: Mapping[str, float]
) -> list[Quantity]:
    """The specimen's sizes and the gauges' distances."""
    d, L = specimen.diameter, specimen.length
    return [
        Quantity("specimen, diameter", d, d * uncertainty.get("specimen_diameter", 0.0), "m", "B"),
        Quantity("specimen, length", L, L * uncertainty.get("specimen_length", 0.0), "m", "B"),
        *(
            Quantity(f"{side} gauge, distance", x, uncertainty.get("gauge_distance", 0.0), "m", "B")
            for side, x in positions.items()
        ),
    ]


def varied_bar(bar: Bar, side: str, values: Mapping[str, float]) -> Bar:
    """The bar with other values of its `bar_quantities`, by name."""
    density = values.get(f"{side} bar, density", bar.density)
    modulus = values.get(f"{side} bar, Young's modulus", bar.youngs_modulus)
    speed = values.get(f"{side} bar, wave speed")
    return replace(
        bar,
        youngs_modulus=modulus if speed is None else density * speed**2,
        density=density,
        diameter=values.get(f"{side} bar, diameter", bar.diameter),
        poisson=values.get(f"{side} bar, Poisson's ratio", bar.poisson),
    )


def varied_specimen(specimen: Specimen, values: Mapping[str, float]) -> Specimen:
    """The specimen with other values of its `length_quantities`."""
    return replace(
        specimen,
        diameter=values.get("specimen, diameter", specimen.diameter),
        length=values.get("specimen, length", specimen.length),
        density=values.get("specimen, density", specimen.density),
    )


def varied_position(position: float, side: str, values: Mapping[str, float]) -> float:
    """A gauge's distance with another value."""
    return values.get(f"{side} gauge, distance", position)


def station_of(
    given: WavesInput, key: str, values: Mapping[str, float] | None = None, *, windows: Windows | None = None
) -> Station:
    """The strain at one station.

    ``key``: a key of its stations. ``values``: other values of its quantities, by name; None: all as
    declared. ``windows``: windows of the waves. Drift up to the end of the last window is an input of the
    budget; None: up to the end of the record. Raises ValueError for the reasons of
    `kolsky.bars.signals.stations.bar_signal`.
    """
    values = values or {}
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
        drift_until=None
        if windows is None
        else (windows.reflected if side == "incident" else windows.transmitted)[1],
    )


def budget_quantities(given: WavesInput, stations: Mapping[str, Station]) -> list[Quantity]:
    """Inputs of a test's budget: calibrations and zeros of the gauges, bars, specimen, gauge distances.

    ``stations``: strain at the stations of the two sides, with their quantities.
    """
    quantities: list[Quantity] = []
    for side in SIDES:
        quantities += stations[side].quantities
        quantities += bar_quantities(given.bars[side], side, given.uncertainty)
    quantities += length_quantities(
        given.specimen, {key: station.position for key, station in given.stations.items()}, given.uncertainty
    )
    density = given.specimen.density
    sigma = density * given.uncertainty.get("specimen_density", 0.0)
    quantities.append(Quantity("specimen, density", density, sigma, "kg/m^3", "B"))
    return merge_quantities(quantities)


def bar_correlations(given: WavesInput, quantities: Sequence[Quantity]) -> dict[tuple[str, str], float]:
    """Correlation 1 between equal properties of two bars with the same errors, e.g. bars from one rod."""
    names = {q.name for q in quantities}
    pairs = [(f"incident bar, {prop}", f"transmission bar, {prop}") for prop in BAR_PROPERTIES]
    return {pair: 1.0 for pair in pairs if given.alike and names.issuperset(pair)}


@dataclass(frozen=True)
class VariedTest:
    """One test with fixed windows. Every result is a function of the `values` of its quantities, by name."""

    given: WavesInput
    windows: Windows
    arrival: float
    """Time at which the incident wave arrives at its gauge [s]."""
    inertia: Mapping[str, str] = field(default_factory=dict)
    """Active corrections of the specimen's inertia, with their reasons; empty if none is active."""

    aligned: Mapping[str, Alignment] = field(default_factory=dict)

    ends: FreeEnds | None = None
    """Subtraction of echoes from free far ends. None: the windows end before the echoes."""

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
        """The waves at the specimen by windows.

        They are with or without dispersion and attenuation in the bars.
        """
        incident, transmission = (
            station_of(self.given, side, values, windows=self.windows).signal for side in SIDES
        )
        apart = None
        if self.ends is not None:
            band = min(largest_band(signal) for signal in (incident, transmission))
            apart = self.ends.apart(incident, transmission, self.guides(values), band)
        return face_waves(
            incident,
            transmission,
            self.windows,
            apart=apart,
            guides=self.guides(values) if dispersive or self.given.polymers else None,
            arrival=self.arrival,
            delays=delays(self.aligned, incident, transmission, values),
        )

    def faces(self, values: Mapping[str, float], log: AuditLog) -> FaceWaves:
        """The waves at the specimen for the reduction; overlapping waves are separated."""
        found = self.carried(values, dispersive=self.given.switches["dispersion"])
        if FAR not in self.given.stations:
            return found
        near, far = (
            station_of(self.given, key, values, windows=self.windows).signal for key in ("incident", FAR)
        )
        return separated(found, near, far, self.guides(values)[0], log)

    def reduced(
        self, faces: FaceWaves, values: Mapping[str, float]
    ) -> tuple[Reduction, tuple[Correction, ...]]:
        """Reduction with the active corrections for punching of the faces and for the specimen's inertia."""
        specimen = varied_specimen(self.given.specimen, values)
        dispersive = self.given.switches["dispersion"] or self.given.polymers
        guides = self.guides(values) if dispersive else None
        reduction, punching = correct_punching(
            reduce(faces, specimen, guides=guides, allowance=self.given.allowance),
            specimen,
            faces.incident_bar,
            faces.transmission_bar,
            apply=self.given.switches["punching"],
        )
        bars = {"incident": faces.incident_bar, "transmission": faces.transmission_bar}
        if not self.inertia:
            return reduction, (punching,)
        reduction, inertia = correct_inertia(reduction, specimen, bars, self.inertia)
        return reduction, (punching, *inertia)

    def span(self, reduction: Reduction, faces: FaceWaves, values: Mapping[str, float]) -> Span | None:
        """Span of the means of a varied reduction. The values of the budget's inputs shift its ends."""
        return find_span(
            reduction,
            analysis=self.given.analysis,
            allowance=self.given.allowance,
            width=averaging_width(faces),
            shift=(values.get(ENDS[0], 0.0), values.get(ENDS[1], 0.0)),
        )

    def outputs(self, values: Mapping[str, float], summary: Summary) -> dict[str, np.ndarray]:
        """All histories and reported results, for the budget."""
        faces = self.faces(values, AuditLog(self.given.switches))
        reduction, _ = self.reduced(faces, values)
        return {
            **{name: history.value for name, history in histories(reduction).items()},
            **{name: history.value for name, history in true_curve(reduction, summary.analysis).items()},
            **quoted.numbers(reduction, summary, self.span(reduction, faces, values)),
        }
