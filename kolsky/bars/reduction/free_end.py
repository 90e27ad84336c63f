"""One station a bar, and a free far end: echoes from it are taken off, and the windows may be longer.

A wave F that leaves the specimen passes the gauge, is turned round at the free end with the other sign, and
passes the gauge again: eps = F + B with B = -F carried over twice the way from the gauge to the end. Solved
for F = eps - B pass by pass it holds until B would load the specimen again: for one round trip of the bar.
"""

from dataclasses import dataclass, replace
from math import ceil, sqrt

import numpy as np

from kolsky.bars.guides.propagation import propagate
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import BarSignal, Windows
from kolsky.bars.reduction.windows import Limit, averaging_time, travel_time
from kolsky.base.arrays import FloatArray

KEY = "free end"
"""The switch."""


@dataclass(frozen=True)
class FreeEnds:
    """Echoes from the far ends of both bars are taken off."""

    reflected: float
    """Time at the incident gauge when the incident pulse is over and the reflected one not yet there [s]."""

    def apart(
        self, incident: BarSignal, transmission: BarSignal, guides: tuple[Waveguide, Waveguide], band: float
    ) -> tuple[BarSignal, BarSignal, BarSignal]:
        """The incident, the reflected and the transmitted wave, each by itself at its gauge.

        Parameters
        ----------
        incident, transmission
            The stations.
        guides
            Their bars.
        band
            Frequency up to which the guides carry waves [Hz].
        """
        later = self._later(incident)
        toward = replace(
            incident, strain=replace(incident.strain, value=incident.strain.value * (1.0 - later))
        )
        back = replace(incident, strain=replace(incident.strain, value=incident.strain.value * later))
        return toward, without_echo(back, guides[0], band), without_echo(transmission, guides[1], band)

    def _later(self, incident: BarSignal) -> FloatArray:
        """0 before, 1 after, over the time that a wave needs to cross the bar."""
        wide = averaging_time(incident)
        return np.clip((incident.strain.time - (self.reflected - wide)) / wide, 0.0, 1.0)


def free_ends(incident: BarSignal, arrival: float) -> FreeEnds:
    """Both far ends free; the incident pulse is over when the reflected one comes.

    Parameters
    ----------
    incident
        The station of the incident bar.
    arrival
        Arrival of the incident pulse there [s].
    """
    return FreeEnds(arrival + 2.0 * travel_time(incident) - 2.0 * averaging_time(incident))


def without_echo(station: BarSignal, guide: Waveguide, band: float) -> BarSignal:
    """The wave that goes to the free end, from the strain at a station that sees its echoes too.

    Parameters
    ----------
    station
        The station; the strain holds nothing but this wave and its echoes.
    guide
        The bar.
    band
        Frequency up to which it carries waves [Hz].

    Returns
    -------
    BarSignal
        The wave at the station; its noise is that of every pass of the echo together.
    """
    strain, way = station.strain, 2.0 * (station.bar.length - station.position)
    passes = ceil((strain.end - strain.start) * guide.wave_speed / way)
    out = strain
    for _ in range(passes):
        echo = propagate(out, guide, way, band=band, start=strain.start, samples=strain.value.size)
        out = replace(strain, value=strain.value + echo.value)
    seen = 1 + int((strain.end - strain.start) * guide.wave_speed / (2.0 * station.bar.length))
    return replace(station, strain=replace(out, sigma=strain.sigma * sqrt(seen + 1.0)))


def free_end_limits(incident: BarSignal, transmission: BarSignal) -> tuple[Limit, Limit]:
    """Times at which an echo comes back to the specimen and loads it again, from the arrival of a pulse."""
    margin = max(averaging_time(incident), averaging_time(transmission))
    limits = [
        Limit(
            2.0 * s.bar.length / s.bar.wave_speed - margin,
            f"the echo from the far end of the {s.side} bar is back at the specimen",
        )
        for s in (incident, transmission)
    ]
    return limits[0], limits[1]


def check_length(windows: Windows, limits: tuple[Limit, Limit]) -> None:
    """Refuse windows that last until an echo is back at the specimen.

    Raises
    ------
    ValueError
        With the wave and the time.
    """
    length = max(last - first for first, last in (windows.incident, windows.reflected, windows.transmitted))
    end = min(limits, key=lambda limit: limit.time)
    if length > end.time:
        raise ValueError(
            f"the windows last {length:.4g} s, and {end.reason} {end.time:.4g} s after a pulse. Cure: "
            "shorter windows"
        )
