"""A classical test as declared and recorded, and the time windows of its three pulses.

Windows come from travel times and are checked against observed arrivals. Alignment shifts each wave until its
observed arrival agrees at the specimen.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import hypot, inf, isfinite
from types import MappingProxyType

from kolsky.bars.audit import Switches
from kolsky.bars.guides.waveguide import PronyModulus
from kolsky.bars.records import BarSignal, Quantity, Signal, Windows
from kolsky.bars.reduction.validity import ALLOWANCE, VALIDITY_SHARE
from kolsky.bars.reduction.validity import PLATEAU_SHARE as PLATEAU
from kolsky.bars.signals.arrival import LOW, Arrival, find_arrival, first_rise, low_level
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
        "the inertia of the bar; an insert or a cap there is not modelled",
    }
)
"""Corrections that do not apply to a test between bars, with the reason."""


@dataclass(frozen=True)
class StationInput:
    """Recordings and calibration of one gauge station."""

    recordings: tuple[Recording, ...]
    """One channel, or two of opposed gauges."""
    calibration: Calibration
    position: float
    """Distance from the bar's specimen end [m]."""
    baseline: tuple[float, float]
    """Span of rest on the shot's clock [s]."""
    clock_offset: float
    """Shot's clock minus recorder's clock [s]."""
    compression: int | tuple[int, ...]
    """+1 if compression gives positive values, -1 otherwise. One value for all channels, or one for each."""
    full_scale: float | None = None
    """Largest magnitude that the recorder can measure; None if unknown."""


@dataclass(frozen=True)
class WavesInput:
    """A classical test, ready to be reduced (SI)."""

    name: str
    specimen: Specimen
    bars: Mapping[str, Bar]
    """Bars by side, "incident" and "transmission"."""
    stations: Mapping[str, StationInput]
    """Gauge stations by side. "incident far" is a second one on the incident bar, for overlapping pulses."""
    load: str = "compression"
    """"compression" or "tension"."""
    polymers: Mapping[str, PronyModulus] = field(default_factory=dict)
    """Complex moduli of the viscoelastic bars, by side."""
    windows: Windows | None = None
    """Windows from the shot file; None for automatic detection."""
    analysis: str = "three waves"
    """The analysis of the reported results: "one wave", "two waves" or "three waves"."""
    allowance: float = ALLOWANCE
    """|R| up to which the forces are balanced [-]."""
    plateau: float = PLATEAU
    """Smallest balanced length of a plateau, as a share of the incident pulse's length [-]."""
    share: float = VALIDITY_SHARE
    """Largest share of the stress that inertia, or the difference of the forces, may have for a valid curve
    [-]."""
    switches: Switches = field(default_factory=Switches)
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainties (k = 1) by the keys of [uncertainty]. They are relative, except lengths and
    Poisson's ratio."""
    alike: bool = False
    """True if the properties of the bars have the same errors, as for bars cut from one rod."""
    inputs: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of every file, by name."""
    notes: tuple[str, ...] = ()
    """Remarks on the files with remedies: contradicting units, interpolated samples."""
    settings: Mapping[str, str] = field(default_factory=dict)


_TAIL = 0.25
"""Extra length of the windows, as a share of the incident pulse's duration."""

OTHER_SIGN = 0.2
"""Share of the incident pulse's level. A preceding pulse of the other sign above this level is not noise."""


@dataclass(frozen=True)
class Limit:
    """End of the time in which a gauge measures a single pulse."""

    time: float
    """Time after the arrival of its pulse at the gauge [s]."""
    reason: str
    """The wave that ends it, in words."""


def incident_arrival(incident: BarSignal, *, tension: bool = False) -> Arrival:
    """Arrival of the incident pulse at its gauge.

    Raises ValueError if there is no pulse of the declared sign, or if one of the other sign comes first.
    """
    sign, average = -1 if tension else 1, averaging_time(incident)
    arrival = find_arrival(incident.strain, sign=sign, average=average)
    try:
        other = find_arrival(incident.strain, sign=-sign, average=average, before=arrival.onset)
    except ValueError:
        return arrival  # no pulse of the other sign before it, as expected
    if abs(other.level) < OTHER_SIGN * abs(arrival.level):
        return arrival
    declared, found = ("tension", "compression") if tension else ("compression", "tension")
    raise ValueError(
        f"{incident.strain.name}: a pulse of {found} comes first, at {other.time:.6g} s ({other.level:.3g}), "
        f"before that of {declared} at {arrival.time:.6g} s, and the shot is declared one of {declared}. "
        "Cure: check the kind of test and the channel's declared sign"
    )


def averaging_time(signal: BarSignal) -> float:
    """Travel time of a wave across the bar's diameter [s]. It is the resolution of one-dimensional theory."""
    return signal.bar.diameter / signal.bar.wave_speed


def find_windows(
    incident: BarSignal,
    transmission: BarSignal,
    *,
    tension: bool = False,
    manual: Windows | None = None,
    ends: tuple[Limit, ...] | None = None,
) -> Windows:
    """Windows of the incident, reflected and transmitted pulse.

    The incident pulse is found by its arrival t_i. The others follow by travel times from the gauges'
    distances x and the bars' wave speeds c0, Eqs. (R.1) and (R.2) of the theory page:

        t_r = t_i + 2 x_i / c_i,    t_t = t_i + x_i / c_i + x_t / c_t.

    All windows are equally long. They begin two diameters' travel before the arrival. They end `_TAIL` times
    the incident pulse's duration after its end, or at the first `usable_limits` of any of them.

    ``incident``, ``transmission``: the strains at the two stations, on one clock. ``tension``: True if the
    shot declares a tensile incident pulse. The transmitted window starts when a wave would arrive without a
    specimen. This is never too late. ``manual``: windows from the shot file. They are checked against the
    records and returned. ``ends``: ends of the windows if echoes are subtracted; they replace
    `usable_limits`. Returns: with the source "travel times", or "shot file" for `manual`. Raises ValueError
    if there is no incident pulse of the declared sign, if it overlaps with the reflected one at the gauge, or
    if a window leaves its record.
    """
    if manual is not None:
        return _checked(manual, incident, transmission)
    _check_sides(incident, transmission)
    arrival = incident_arrival(incident, tension=tension)
    usable = usable_limits(incident, transmission)
    limits = usable if ends is None else ends
    duration = arrival.end - arrival.time
    apart = usable[0]
    if duration > apart.time:
        found = f"{duration:.4g} s long" if isfinite(duration) else "not over before the record ends"
        raise ValueError(
            f"{incident.strain.name}: the incident pulse is {found}, and the reflected one arrives at the "
            f"gauge {apart.time:.4g} s after it: they overlap. It must be shorter than 2 x / c0. Cure: a "
            "second gauge on the bar and wave separation, a gauge farther from the specimen, or a shorter "
            "striker"
        )
    lead = 2.0 * averaging_time(incident)
    reflected = arrival.time + 2.0 * travel_time(incident)
    transmitted = arrival.time + travel_time(incident) + travel_time(transmission)
    for signal, at in ((incident, reflected), (transmission, transmitted)):
        left = signal.strain.end - at
        if left < duration:
            raise ValueError(
                f"{signal.strain.name}: the record ends {left:.4g} s after its pulse should arrive, at "
                f"{at:.6g} s, and the incident pulse lasts {duration:.4g} s. Cure: a longer record, check "
                "wave speed and distance, or windows by hand"
            )
    longest = min(
        min(limit.time for limit in limits),
        incident.strain.end - reflected,
        transmission.strain.end - transmitted,
    )
    start = min(arrival.time, arrival.onset) - lead - arrival.time
    length = min((1.0 + _TAIL) * duration, longest)

    def window(at: float) -> tuple[float, float]:
        return at + start, at + length

    windows = Windows(window(arrival.time), window(reflected), window(transmitted), source="travel times")
    return _checked(windows, incident, transmission)


def travel_time(signal: BarSignal) -> float:
    """Travel time of a wave between the gauge and the specimen [s]."""
    return signal.position / signal.bar.wave_speed


def usable_limits(incident: BarSignal, transmission: BarSignal) -> tuple[Limit, Limit, Limit]:
    """Times at which another wave reaches a gauge, counted from the arrival of its pulse.

    Returns: three times, Eq. (R.3). The first is the arrival of the reflected wave at the incident gauge. The
    second is its return from the far end of the incident bar. The third is the transmitted wave's return from
    the far end of the transmission bar. Each is reduced by one diameter's travel, because a part of a
    dispersed pulse precedes its foot.
    """
    margin = max(averaging_time(incident), averaging_time(transmission))

    def far_end(signal: BarSignal) -> float:
        return 2.0 * (signal.bar.length - signal.position) / signal.bar.wave_speed - margin

    return (
        Limit(2.0 * travel_time(incident) - margin, "the reflected wave reaches the incident gauge"),
        Limit(far_end(incident), "the reflected wave returns from the far end of the incident bar"),
        Limit(far_end(transmission), "the transmitted wave returns from the far end of the transmission bar"),
    )


def check_baselines(
    given: WavesInput, incident: BarSignal, transmission: BarSignal, *, tension: bool = False
) -> None:
    """Raise ValueError for baselines that end after their gauge's first pulse has begun."""
    average, sign = averaging_time(incident), -1 if tension else 1
    rise = first_rise(incident.strain, sign=sign, average=average)
    begins = incident_arrival(incident, tension=tension).time if rise is None else rise.time
    arrivals = {
        "incident": begins,
        "transmission": begins + travel_time(incident) + travel_time(transmission),
    }
    for side, begin in arrivals.items():
        last = given.stations[side].baseline[1]
        if last > begin:
            raise ValueError(
                f"{side} gauge: the baseline ends at {last:.6g} s, after the pulse arrives there at "
                f"{begin:.6g} s, so it is not at rest. Cure: end the baseline before {begin:.6g} s"
            )


def _check_sides(incident: BarSignal, transmission: BarSignal) -> None:
    for signal, side in ((incident, "incident"), (transmission, "transmission")):
        if signal.side != side:
            raise ValueError(
                f"{signal.strain.name} is of the {signal.side} bar, it must be of the {side} bar"
            )
        if not 0.0 < signal.position < signal.bar.length:
            raise ValueError(
                f"{signal.strain.name}: its distance to the specimen = {signal.position} m must lie between "
                f"0 and the bar's length, {signal.bar.length} m"
            )


def _checked(windows: Windows, incident: BarSignal, transmission: BarSignal) -> Windows:
    """The windows, if each is in order and inside its record."""
    for name, (first, last), record in (
        ("incident", windows.incident, incident.strain),
        ("reflected", windows.reflected, incident.strain),
        ("transmitted", windows.transmitted, transmission.strain),
    ):
        if not -inf < first < last < inf:
            raise ValueError(f"the {name} window [{first}, {last}] s must end after it begins")
        if first < record.start or last > record.end:
            raise ValueError(
                f"the {name} window [{first:.6g}, {last:.6g}] s leaves the record of {record.name}, "
                f"[{record.start:.6g}, {record.end:.6g}] s. Cure: a longer record, or windows by hand"
            )
    if windows.reflected[0] < windows.incident[0]:
        raise ValueError(
            f"the reflected window begins at {windows.reflected[0]:.6g} s, before the incident one "
            f"({windows.incident[0]:.6g} s)"
        )
    return windows


VISIBLE = 0.05
"""Smallest level of an observable reflected or transmitted pulse, as a share of the incident pulse's
level."""
SCATTER = 0.4, 0.05
"""Scatter of a first rise relative to that of the incident pulse, in addition to noise. It is given in units
of a wave's travel time across the bar, and as a share of the incident pulse's rise time. Its causes are
dispersion, ringing and the specimen's effect on the foot. It was chosen on the first population of
`populations/bar_signals.py` and tested on the second."""


@dataclass(frozen=True)
class PulseCheck:
    """Predicted and observed arrival of a pulse."""

    predicted: float
    """Arrival computed from the incident pulse and the travel times [s]."""
    observed: Arrival | None
    """Arrival found in the signal; None if no arrival was found."""
    reason: str
    """The delay in words, or the reason why there is no observed arrival."""
    offset: float = float("nan")
    """First rise of the pulse minus that of the incident pulse and the travel time [s]; NaN without an
    observed pulse. Unlike `delay`, it does not extrapolate the flank's tangent."""
    offset_sigma: float = float("inf")
    """Standard deviation of `offset` [s], by noise, sampling, and the scatter of the estimator."""

    @property
    def delay(self) -> float:
        """Observed minus predicted arrival [s]; NaN without an observed arrival."""
        return float("nan") if self.observed is None else self.observed.time - self.predicted


def check_windows(
    incident: BarSignal, transmission: BarSignal, *, tension: bool = False
) -> tuple[PulseCheck, PulseCheck]:
    """Predicted and observed arrivals of the reflected and the transmitted pulse.

    A delayed or early reflected pulse indicates a wrong distance or wave speed. If a specimen does not touch
    the bars, or loads slowly, the transmitted pulse is delayed.

    Returns: the arrivals of the reflected and of the transmitted pulse.
    """
    sign = -1 if tension else 1
    arrival = incident_arrival(incident, tension=tension)
    limits = usable_limits(incident, transmission)
    reflected = arrival.time + 2.0 * travel_time(incident)
    transmitted = arrival.time + travel_time(incident) + travel_time(transmission)
    smallest = VISIBLE * abs(arrival.level)
    source = _Source(incident, arrival, sign)
    behind = arrival.end if isfinite(arrival.end) else reflected - 5.0 * averaging_time(incident)
    return (
        _pulse_check(source, incident, reflected, limits[1].time, -sign, smallest, behind),
        _pulse_check(source, transmission, transmitted, limits[2].time, sign, smallest, -inf),
    )


@dataclass(frozen=True)
class _Source:
    """The incident pulse, the reference for the times of the others."""

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
    if rough is not None:  # a pulse that arrives long before the predicted time
        before = max(min(before, rough.time - 4.0 * average), behind)
    # The reflected pulse is superposed on the tail of the incident pulse. The level of the tail is
    # subtracted.
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
    """First rise of a pulse relative to that of the incident one at the same strain, and its sigma [s]."""
    nothing = (float("nan"), inf)
    found = first_rise(strain, sign=sign, average=average, after=span[0], before=span[1])
    if found is None:
        return nothing
    incident, arrival = source.signal.strain, source.arrival
    level = max(found.level, low_level(incident, found.level / LOW, average))
    pulses = [
        first_rise(s, sign=way, average=average, after=first, before=last, level=level)
        for s, way, first, last in ((incident, source.sign, -inf, arrival.end), (strain, sign, *span))
    ]
    if pulses[0] is None or pulses[1] is None:
        return nothing
    way = predicted - arrival.time
    sigma = hypot(pulses[0].sigma, pulses[1].sigma, SCATTER[0] * average, SCATTER[1] * arrival.rise_time)
    return pulses[1].time - pulses[0].time - way, sigma


KEYS = {"reflected": "reflected alignment", "transmitted": "transmitted alignment"}
"""Switch of each wave."""


@dataclass(frozen=True)
class Alignment:
    """Observed arrival of one wave at its gauge."""

    wave: str
    """"reflected" or "transmitted"."""
    late: float
    """Observed minus predicted arrival with the declared distances and wave speeds [s]."""
    way: float
    """Predicted time from the incident pulse's arrival at its gauge, as declared [s]."""
    sigma: float
    """Standard uncertainty of the difference of the two arrivals [s]."""

    @property
    def quantity(self) -> Quantity:
        """Input that the alignment adds to the budget."""
        return Quantity(f"alignment, {self.wave} wave", 0.0, self.sigma, "s", "A")


def alignments(
    arrival: Arrival, checks: tuple[PulseCheck, PulseCheck], switches: Switches
) -> tuple[dict[str, Alignment], dict[str, str]]:
    """Alignment of each wave with an observed pulse, and the reason why another wave has none.

    ``arrival``: arrival of the incident pulse at its gauge. ``checks``: predicted and observed arrival of the
    reflected and the transmitted pulse. ``switches``: an active alignment must be possible. Returns: wave ->
    alignment, applied or not, and wave -> reason.
    """
    found, missing = {}, {}
    for (wave, key), check in zip(KEYS.items(), checks, strict=True):
        if check.observed is None:
            missing[wave] = f"no {wave} pulse is found: {check.reason}"
            if switches[key]:
                raise ValueError(
                    f"the {wave} wave cannot be aligned: {check.reason}. Cure: leave {key!r} off, or set "
                    "windows by hand"
                )
            continue
        sigma = hypot(arrival.sigma, check.observed.sigma)
        found[wave] = Alignment(wave, check.delay, check.predicted - arrival.time, sigma)
    return found, missing


def delays(
    aligned: Mapping[str, Alignment],
    incident: BarSignal,
    transmission: BarSignal,
    values: Mapping[str, float],
) -> tuple[float, float]:
    """Delays of the reflected and the transmitted wave relative to the travel times [s].

    An aligned wave keeps its observed time. A longer distance or a slower bar changes the prediction, but not
    the observation.

    ``aligned``: the active alignments, by wave. ``incident``, ``transmission``: the stations, with the varied
    distances and wave speeds. ``values``: values of the budget's quantities, by name.
    """
    ways = {
        "reflected": 2.0 * travel_time(incident),
        "transmitted": travel_time(incident) + travel_time(transmission),
    }
    late = {wave: 0.0 for wave in KEYS}
    for wave, found in aligned.items():
        late[wave] = found.late + found.way - ways[wave] + values.get(found.quantity.name, 0.0)
    return late["reflected"], late["transmitted"]
