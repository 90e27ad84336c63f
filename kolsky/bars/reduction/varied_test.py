"""A classical test whose quantities can be given other values: the model that its budget goes through."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kolsky.bars.audit import AuditLog
from kolsky.bars.guides.polymer_waveguide import ViscoelasticWaveguide
from kolsky.bars.guides.waveguide import ElasticWaveguide, Waveguide
from kolsky.bars.records import Correction, FaceWaves, Reduction, Windows
from kolsky.bars.reduction import quoted
from kolsky.bars.reduction.faces import face_waves
from kolsky.bars.reduction.histories import histories
from kolsky.bars.reduction.inputs import FAR, SIDES, WavesInput
from kolsky.bars.reduction.overlap import separated
from kolsky.bars.reduction.punching import correct_punching
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.bars.reduction.summary import Summary
from kolsky.bars.reduction.varied import varied_bar, varied_position, varied_specimen
from kolsky.bars.signals.stations import Station, bar_signal
from kolsky.base.apparatus import Bar


def station_of(given: WavesInput, key: str, values: Mapping[str, float] | None = None) -> Station:
    """The strain at one station.

    Parameters
    ----------
    given
        The test.
    key
        A key of its stations.
    values
        Other values of its quantities, by name; None: all as declared.

    Raises
    ------
    ValueError
        As `kolsky.bars.signals.stations.bar_signal`.
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
    )


@dataclass(frozen=True)
class VariedTest:
    """One test, its windows held; every result is a function of the `values` of its quantities, by name."""

    given: WavesInput
    """The test as declared."""
    windows: Windows
    """Where its waves are."""
    arrival: float
    """Time at which the incident wave arrives at its gauge [s]."""

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
        incident, transmission = (station_of(self.given, side, values).signal for side in SIDES)
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
        near, far = (station_of(self.given, key, values).signal for key in ("incident", FAR))
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
        return {
            **{name: history.value for name, history in histories(reduction).items()},
            **quoted.numbers(reduction, summary),
        }
