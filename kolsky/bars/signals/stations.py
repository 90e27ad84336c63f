"""Gauge stations: from recordings to the strain of the bar.

The steps are calibration, zero, sign and bending, and a check of the bar's elastic limit.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from kolsky.bars.audit import AuditLog, Switches
from kolsky.bars.records import LARGEST_JITTER, BarSignal, Correction, Quantity, Signal, uniform_clock
from kolsky.bars.signals.arrival import moving_mean
from kolsky.bars.signals.baseline import (
    SignalZero,
    check_clipping,
    check_rest,
    diffusion,
    drift_at,
    drift_quantities,
    measure_signal_zero,
)
from kolsky.bars.signals.bridge import Bridge, Calibration
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.records import Recording

LARGEST_STRAIN = {"metal": 0.02, "polymer": 0.1}
"""Strain above the elastic limit of any bar [-]. Maraging steel yields at 1.3 %, titanium and aluminium
alloys below 1 %, glassy polymers at 3 to 8 %. A larger strain indicates a wrong unit, a wrong sensitivity or
a bar that yielded."""
POLYMER = 20e9
"""Young's modulus below which a bar is a polymer bar [Pa]."""


def check_elastic(strain: FloatArray, bar: Bar, interval: float, gauge: str) -> None:
    """Raise ValueError for strains beyond the bar's elastic limit.

    Means over the time of a wave across the bar's diameter must be below a limit. It is the yield strength
    over the modulus or, without a declared strength, `LARGEST_STRAIN`.
    """
    kind = "polymer" if bar.youngs_modulus < POLYMER else "metal"
    limit = LARGEST_STRAIN[kind]
    words = f"{100.0 * limit:g} %, more than any bar of {kind} bears elastically"
    if bar.yield_strength is not None:
        limit = bar.yield_strength / bar.youngs_modulus
        words = f"{limit:.3g}, of its yield strength of {1e-6 * bar.yield_strength:.4g} MPa"
    width = max(1, min(strain.size, round(bar.diameter / bar.wave_speed / interval)))
    largest = float(np.abs(moving_mean(strain, width)).max())
    if largest > limit:
        raise ValueError(
            f"{gauge}: the largest strain of the bar is {largest:.3g}, a stress of "
            f"{1e-6 * largest * bar.youngs_modulus:.4g} MPa; it must be below {words}. Cure: check the unit "
            "of the recording (mV for V, microstrain for strain), strain per volt or the bridge, and the "
            "modulus"
        )


T = TypeVar("T")

SIDES = ("incident", "transmission")


class Station(NamedTuple):
    """A bar's strain with its corrections and the input quantities."""

    signal: BarSignal
    corrections: list[Correction]
    quantities: list[Quantity]
    """Inputs of its budget: calibration, zero, and a significant drift."""


def bar_signal(
    recordings: Sequence[Recording],
    calibration: Calibration | Sequence[Calibration],
    bar: Bar,
    position: float,
    side: str,
    *,
    baseline: tuple[float, float],
    clock_offset: float,
    compression: int | Sequence[int],
    full_scale: float | None = None,
    switches: Switches | None = None,
    uncertainty: Mapping[str, float] | None = None,
    values: Mapping[str, float] | None = None,
    drift_until: float | None = None,
) -> Station:
    """Strain of a bar at a gauge station, compression positive, on the shot's clock.

    ``recordings``: one channel, or one for each of two opposed gauges. ``calibration``: one for all channels,
    with common errors, or one for each. ``position``: distance of the gauges from the bar's specimen end [m].
    ``side``: "incident" or "transmission". ``baseline``: first and last time of the rest on the shot's clock
    [s]. ``clock_offset``: shot's clock minus recorder's clock [s]. ``compression``: +1 if compression gives
    positive values, -1 otherwise; one for all channels, or one for each. ``full_scale``: largest magnitude
    that the recorder can measure, in the unit of the recordings; None if unknown. ``switches``: switches of
    the corrections "bridge nonlinearity", "bending" and "baseline drift". ``uncertainty``: standard
    uncertainties of the calibration's fields, by their names. ``values``: values that replace the estimates
    of `quantities`, by name, as `kolsky.bars.budget.propagate` passes them. ``drift_until``: last used time
    of the signal on the shot's clock [s]. Drift up to this time is an input of the budget. Default: the
    record's last time.
    """
    if side not in SIDES:
        raise ValueError(f"side must be 'incident' or 'transmission', got {side!r}")
    if not 0.0 < position <= bar.length:
        raise ValueError(f"the {side} gauge's position must be in (0, {bar.length:g}] m, got {position:g}")
    if len(recordings) not in (1, 2):
        raise ValueError(f"a station has one channel or two of opposed gauges, got {len(recordings)}")
    gauge, wave, given = f"{side} gauge", f"{side} bar", values or {}
    shared = not isinstance(calibration, Sequence)
    calibrations: list[Calibration] = _one_per_channel(calibration, len(recordings), "calibration")
    signs: list[int] = _one_per_channel(compression, len(recordings), "compression")
    labels = [gauge if shared else f"{gauge} {i + 1}" for i in range(len(recordings))]
    log = AuditLog(switches)

    start, interval = uniform_clock(recordings[0])
    for other in recordings[1:]:
        _same_times(recordings[0], other, interval)
    start += clock_offset
    time: FloatArray = start + interval * np.arange(recordings[0].value.size, dtype=float)
    after = time > baseline[1]
    if not after.any():
        raise ValueError(
            f"{gauge}: the record ends at {time[-1]:.9g} s, before or with the baseline's last time"
        )

    strains, quantities = [], []
    for i, (recording, calibrated, label, sign) in enumerate(
        zip(recordings, calibrations, labels, signs, strict=True)
    ):
        name = gauge if len(recordings) == 1 else f"{gauge} {i + 1}"
        if not (shared and i):
            quantities += calibrated.quantities(label, uncertainty or {}, bar=wave)
        known = calibrated.with_values(label, given, bar=wave)
        rest = measure_signal_zero(time, recording.value, baseline, name=name)
        check_clipping(recording.value, rest, name=name, full_scale=full_scale)
        strains.append(_strain(recording, known, rest, sign, name=name, log=log, after=after))
    axial, bending = _axial(strains, gauge, log, after)
    if not given:
        at_rest = (time >= baseline[0]) & (time <= baseline[1])
        width = max(1, round(bar.diameter / bar.wave_speed / interval))
        times = (float(time[at_rest][0]), float(time[at_rest][-1]))
        check_rest(axial[at_rest], width, name=gauge, times=times)
    until = float(time[-1]) if drift_until is None else max(drift_until, baseline[1] + interval)
    axial, zero = _zeroed(axial, time, baseline, gauge, log, after, given, until)
    if not given:
        check_elastic(axial[after], bar, interval, gauge)
    rest, more = zero
    strain = Signal(start, interval, axial, rest.noise.sigma, "1", gauge, memory=rest.noise.memory)
    signal = BarSignal(strain, bar, position, side, bending)
    return Station(signal, list(log.corrections), quantities + more)


def _strain(
    recording: Recording,
    calibration: Calibration,
    rest: SignalZero,
    sign: int,
    *,
    name: str,
    log: AuditLog,
    after: BoolArray,
) -> FloatArray:
    """One channel in strain, compression positive, without its zero."""
    if sign not in (1, -1):
        raise ValueError(f"{name}: compression must be +1 or -1, got {sign}")
    if recording.unit != calibration.UNIT:
        raise ValueError(
            f"{name}: the calibration is for {calibration.UNIT!r}, the recording is in {recording.unit!r}"
        )
    volts = -sign * (recording.value - rest.mean)  # rises in tension, as a gauge does
    exact = calibration.strain(volts)
    if not isinstance(calibration, Bridge):
        return -exact  # a stated factor has no nonlinearity
    linear = calibration.linear_strain(volts)
    return -log.choose(
        f"bridge nonlinearity, {name}",
        "bridge nonlinearity",
        linear,
        exact,
        unit="1",
        reason=f"largest strain {np.abs(linear[after]).max():.3g}",
        over=after,
    )


def _axial(
    strains: list[FloatArray], gauge: str, log: AuditLog, after: BoolArray
) -> tuple[FloatArray, FloatArray | None]:
    """Mean and half the difference of opposed gauges."""
    if len(strains) == 1:
        return strains[0], None
    mean, bending = 0.5 * (strains[0] + strains[1]), 0.5 * (strains[0] - strains[1])
    share = float(np.linalg.norm(bending[after]) / np.linalg.norm(mean[after]))
    if share > 1.0:
        raise ValueError(
            f"{gauge}: the two gauges disagree in sign: half their difference is {share:.3g} times their mean"
            " (rms after the baseline), it must be below 1; declare the sign of each: compression ="
            ' ["positive", "negative"]'
        )
    axial = log.choose(
        f"bending, {gauge}",
        "bending",
        strains[0],
        mean,
        unit="1",
        reason=f"bending is {100 * share:.3g} % of the axial strain (rms after the baseline)",
        over=after,
    )
    return axial, bending


def _zeroed(
    axial: FloatArray,
    time: FloatArray,
    baseline: tuple[float, float],
    gauge: str,
    log: AuditLog,
    after: BoolArray,
    values: Mapping[str, float],
    until: float,
) -> tuple[FloatArray, tuple[SignalZero, list[Quantity]]]:
    """The strain with its drift removed or reported, and zero and drift as quantities of the budget."""
    rest = measure_signal_zero(time, axial, baseline, name=gauge)
    verdict = "significant" if rest.drifts else "not significant"
    fixed = log.choose(
        f"baseline drift, {gauge}",
        "baseline drift",
        axial,
        axial - rest.line(time),
        unit="1",
        reason=(
            f"slope {rest.slope:.3g} +- {rest.slope_sigma:.2g} 1/s over {rest.count} samples, {verdict}"
            f" at 1 %; left in, it is carried as a random walk; noise correlated over {rest.noise.memory:.3g}"
            f" samples, step {rest.step:.3g}"
        ),
        over=after,
    )
    resting = (time >= baseline[0]) & (time <= baseline[1])
    interval = (rest.last - rest.first) / (rest.count - 1)
    memory = max(rest.noise.memory, 1.0)
    strength = diffusion(fixed[resting], interval, sigma=rest.noise.sigma, memory=memory)
    walked = strength * (rest.last - rest.first) / 3.0  # of the mean, at the baseline's end
    sigma = float(np.sqrt(rest.mean_sigma**2 + walked))
    zero = Quantity(f"{gauge}, zero", 0.0, sigma, "1", "A", rest.freedom)
    modes = drift_quantities(gauge, strength, until - rest.last)
    quantities = [zero, *modes]
    fixed = fixed + values.get(zero.name, 0.0)
    amplitudes = np.array([values.get(mode.name, 0.0) for mode in modes])
    if amplitudes.any():
        fixed = fixed + drift_at(time, rest.last, until - rest.last, amplitudes)
    if log.switches["baseline drift"]:
        slope = Quantity(f"{gauge}, drift's slope", 0.0, rest.slope_sigma, "1/s", "A", rest.freedom)
        quantities.append(slope)
        fixed = fixed + values.get(slope.name, 0.0) * (time - 0.5 * (rest.first + rest.last))
    return fixed, (rest, quantities)


def _same_times(first: Recording, other: Recording, interval: float) -> None:
    start, step = uniform_clock(other)
    n = first.time.size
    if (
        other.time.size == n
        and abs(start - first.time[0]) + n * abs(step - interval) < LARGEST_JITTER * interval
    ):
        return
    raise ValueError(
        f"opposed gauges {first.channel} and {other.channel} must have the same times, got {n} samples from"
        f" {first.time[0]:.9g} s and {other.time.size} from {start:.9g} s, intervals {interval:.9g} and"
        f" {step:.9g} s; record them with one time base"
    )


def _one_per_channel(given: T | Sequence[T], count: int, what: str) -> list[T]:
    """One for every channel."""
    if not isinstance(given, Sequence):
        return [given] * count
    if len(given) != count:
        raise ValueError(f"{what} must be one, or one for each of {count} channels, got {len(given)}")
    return list(given)
