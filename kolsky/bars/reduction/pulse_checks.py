"""Observed arrivals of the reflected and the transmitted pulse, against those that travel times predict."""

from dataclasses import dataclass, replace
from math import hypot, inf, isfinite

from kolsky.bars.records import BarSignal, Signal
from kolsky.bars.reduction.windows import averaging_time, incident_arrival, travel_time, usable_limits
from kolsky.bars.signals.arrival import Arrival, find_arrival
from kolsky.bars.signals.first_rise import LOW, first_rise, low_level

VISIBLE = 0.05
"""Smallest level of an observable reflected or transmitted pulse, as a share of the incident one's."""
SCATTER = 0.4, 0.05
"""Scatter of a first rise against the incident one's that noise does not explain, in times that a wave needs
across the bar, and as a share of the incident pulse's rise: dispersion, ringing, the specimen's part in the
foot. From the first population of `benchmarks/bar_signals.py`, judged on the second."""


@dataclass(frozen=True)
class PulseCheck:
    """Predicted and observed arrival of a pulse."""

    predicted: float
    """Arrival by the travel times from the incident pulse [s]."""
    observed: Arrival | None
    """Arrival found in the signal; None if there is none."""
    reason: str
    """The delay in words, or the reason why there is no observed arrival."""
    offset: float = float("nan")
    """First rise of the pulse less that of the incident one and the travel time [s]: nothing extrapolated, as
    the flank's tangent is in `delay`; nan without an observed pulse."""
    offset_sigma: float = float("inf")
    """Standard deviation of `offset`: noise, sampling, and the estimator's own scatter [s]."""

    @property
    def delay(self) -> float:
        """Observed less predicted arrival [s]; nan without an observed one."""
        return float("nan") if self.observed is None else self.observed.time - self.predicted


def check_windows(
    incident: BarSignal, transmission: BarSignal, *, tension: bool = False, transit: float = 0.0
) -> tuple[PulseCheck, PulseCheck]:
    """Predicted and observed arrivals of the reflected and the transmitted pulse.

    A delayed or early reflected pulse indicates a wrong distance or wave speed; a specimen that does not
    touch the bars, or is slow to load, delays the transmitted one.

    Parameters
    ----------
    incident, transmission, tension, transit
        As for `find_windows`.

    Returns
    -------
    tuple of PulseCheck
        Of the reflected and of the transmitted pulse.
    """
    sign = -1 if tension else 1
    arrival = incident_arrival(incident, tension=tension)
    limits = usable_limits(incident, transmission)
    reflected = arrival.time + 2.0 * travel_time(incident)
    transmitted = arrival.time + travel_time(incident) + travel_time(transmission) + transit
    smallest = VISIBLE * abs(arrival.level)
    source = _Source(incident, arrival, sign)
    behind = arrival.end if isfinite(arrival.end) else reflected - 5.0 * averaging_time(incident)
    return (
        _pulse_check(source, incident, reflected, limits[1].time, -sign, smallest, behind),
        _pulse_check(source, transmission, transmitted, limits[2].time, sign, smallest, -inf),
    )


@dataclass(frozen=True)
class _Source:
    """The incident pulse, against which the others are timed."""

    signal: BarSignal
    arrival: Arrival
    sign: int


def _pulse_check(
    source: _Source,
    signal: BarSignal,
    predicted: float,
    length: float,
    sign: int,
    smallest: float,
    behind: float,
) -> PulseCheck:
    average = averaging_time(signal)
    before = predicted - min(5.0 * average, 0.5 * travel_time(signal))
    strain = signal.strain
    rough = first_rise(
        strain, sign=sign, average=average, after=behind, before=predicted + length, smallest=smallest
    )
    if rough is not None:  # one that comes long before it is due
        before = max(min(before, rough.time - 4.0 * average), behind)
    # The incident pulse leaves a tail on which the reflected one sits; its level is taken off.
    tail = (strain.time >= before) & (strain.time < before + 2.0 * average)
    if not tail.any():
        return PulseCheck(predicted, None, f"{strain.name}: the record ends before {before:.6g} s")
    flat = replace(strain, value=strain.value - strain.value[tail].mean())
    try:
        observed = find_arrival(
            flat, sign=sign, average=average, after=before, before=predicted + length, smallest=smallest
        )
    except ValueError as missing:
        return PulseCheck(predicted, None, str(missing))
    offset, offset_sigma = _offset(source, flat, predicted, sign, average, (before, predicted + length))
    delay = observed.time - predicted
    word = "later" if delay > 0.0 else "earlier"
    reason = (
        f"observed {1e6 * abs(delay):.3g} us {word} than predicted "
        f"(sigma of the observed: {1e6 * observed.sigma:.2g} us)"
    )
    return PulseCheck(predicted, observed, reason, offset, offset_sigma)


def _offset(
    source: _Source, strain: Signal, predicted: float, sign: int, average: float, span: tuple[float, float]
) -> tuple[float, float]:
    """First rise of a pulse against that of the incident one at the same strain, and its sigma [s]."""
    nothing = (float("nan"), inf)
    found = first_rise(strain, sign=sign, average=average, after=span[0], before=span[1])
    if found is None:
        return nothing
    incident, arrival = source.signal.strain, source.arrival
    level = max(found.level, low_level(incident, found.level / LOW, average))
    pulses = [
        first_rise(s, sign=way, average=average, after=first, before=last, level=level)
        for s, way, first, last in (
            (incident, source.sign, -inf, arrival.end),
            (strain, sign, *span),
        )
    ]
    if pulses[0] is None or pulses[1] is None:
        return nothing
    way = predicted - arrival.time
    sigma = hypot(pulses[0].sigma, pulses[1].sigma, SCATTER[0] * average, SCATTER[1] * arrival.rise_time)
    return pulses[1].time - pulses[0].time - way, sigma
