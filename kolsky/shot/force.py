"""Read [force] and [incident_force]: recorder channels with transducers. Range, zero and sign are checked."""

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from kolsky.base.apparatus import Transducer
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import FlyerMotion, Recording
from kolsky.base.units import in_us
from kolsky.readers.recordings import read_recordings, read_scope
from kolsky.schema.measured import ForceSection
from kolsky.schema.shot_file import ShotToml
from kolsky.shot.evidence import Evidence
from kolsky.shot.plausibility import gate
from kolsky.shot.records import ForceChannel, IncidentForce

_SECONDS = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
QUIET_SIGMAS = 6.0
"""Largest difference between the two halves of a quiet span, in its standard deviations. White noise exceeds
it once in 5e8. Filtered noise with correlated successive samples also stays below it."""
SMALLEST_BASELINE = 20
"""Smallest number of samples for the zero and the noise of the force."""


def force_channel(folder: Path, rest: float, toml: ShotToml, frame_time: FloatArray) -> ForceChannel:
    """[force]: the recorder's channel with its transducer.

    ``rest``: time of the last frame before the test [s]. ``frame_time``: times of all frames [s]. Raises
    InputError if the file cannot be read; if the channel is clipped or is a clock; if its times do not match
    the frames; or if its baseline is not quiet.
    """
    section = toml.declared.force
    channel = _channel_of(folder, section, "force")
    check_signal(channel.recording, toml)
    gate(Evidence(file=toml, declared=toml.declared, frame_time=frame_time, force_time=channel.time))
    check_baseline(channel.baseline_volts(), rest, toml, last=float(frame_time[-1]))
    return channel


def _channel_of(folder: Path, section: ForceSection, key: str) -> ForceChannel:
    """A recording within its range, with the declared transducer, baseline and clock."""
    recording = _force_recording(folder / section.file, section)
    check_range(recording, section, key)
    return ForceChannel(
        recording=recording,
        transducer=Transducer(
            sensitivity=section.sensitivity,
            compression_sign=1 if section.compression == "positive" else -1,
            full_scale=section.full_scale,
            time_constant=inf if section.time_constant is None else section.time_constant,
        ),
        baseline=section.baseline,
        clock_offset=section.clock_offset,
    )


def _force_recording(path: Path, section: ForceSection) -> Recording:
    """The channel of `section` in volts; a plain table without a layout keeps its printed times."""
    if section.layout is None:
        assert section.time is not None  # the section has a layout or a time column
        return read_scope(path, time=section.time.as_column(), voltage=section.voltage.as_column())
    time, unit = None, None
    if section.time is not None:
        time, unit = section.time.column, _SECONDS.get(section.time.unit)
        if unit is None:
            raise InputError(path, "force.time has an unusual unit", allowed='"s", "ms", "us" or "ns"')
    factor = section.voltage.unit
    layout = section.layout.as_layout(
        full_scale=section.full_scale / factor, unit="V", time=time, time_unit=unit
    )
    name = section.voltage.column
    recording = read_recordings(path, [name], layout=layout)[name]
    return recording if factor == 1.0 else replace(recording, value=recording.value * factor)


def check_range(scope: Recording, section: ForceSection, key: str = "force") -> None:
    """Check that no sample reaches the recorder's full scale or, with `bits`, its first or last code."""
    limit = section.full_scale
    if section.bits is not None:
        # Codes run from -2^(b-1) to 2^(b-1) - 1. Half a code is subtracted, because printed volts are
        # rounded.
        limit *= 1.0 - 1.5 / 2 ** (section.bits - 1)
    clipped = np.flatnonzero(np.abs(scope.value) >= limit)
    if clipped.size:
        row = int(clipped[0])
        raise InputError(
            scope.path,
            f"column '{scope.channel}' is clipped: {scope.value[row]:.6g} V in the first of {clipped.size}"
            f" samples at or beyond full scale ({key}.full_scale = {section.full_scale:g} V)",
            line=None if scope.first_line is None else scope.first_line + row,
            cure="a clipped force cannot be restored; repeat the test at a coarser range, or correct "
            f"{key}.full_scale",
        )


def check_signal(scope: Recording, toml: ShotToml) -> None:
    """Raise InputError if every sample exceeds the previous one, as in a clock without noise."""
    if scope.value.size > SMALLEST_BASELINE and (np.diff(scope.value) > 0.0).all():
        raise toml.error(
            "force.voltage",
            f"is not a signal: column '{scope.channel}' rises from each of its {scope.value.size} samples to "
            "the next, as a clock does",
            cure="name the column of the transmitted force",
        )


def check_baseline(volts: FloatArray, rest: float, toml: ShotToml, *, last: float = inf) -> None:
    """Check that the baseline has enough quiet samples with visible noise, before or after the test.

    ``volts``: the baseline's samples [V], shape [n]. ``rest``, ``last``: times of the last static frame and
    of the last frame [s]. Raises InputError if zero and noise cannot be estimated.
    """
    section = toml.declared.force
    start, end = section.baseline
    after = start > last
    elsewhere = f"a quiet span after the last frame at {in_us(last)}" if last < inf else "a quiet span"
    if end > rest and not after:
        allowed = f"before the last static frame at {in_us(rest)}, or {elsewhere} (shot's clock)"
        cure = "end it earlier; where the record begins too late, name a quiet span after the test"
        raise toml.error("force.baseline", "overlaps the flyer's motion", allowed=allowed, cure=cure)
    if volts.size < SMALLEST_BASELINE:
        raise toml.error(
            "force.baseline",
            f"holds {volts.size} samples",
            allowed=f"a time span with at least {SMALLEST_BASELINE} samples",
            cure="choose a longer span inside the record, on the shot's clock; where the record has too "
            f"few samples before the test, {elsewhere} is sufficient",
        )
    if after and section.time_constant is not None:
        raise toml.error(
            "force.baseline",
            f"begins after the test, and force.time_constant = {section.time_constant:g} s: a transducer that"
            " loses its charge has another zero there",
            cure="name a span before the test",
        )
    if after and _drifts(volts):
        raise toml.error(
            "force.baseline",
            f"is not quiet: its halves differ by {np.diff(_halves(volts))[0]:+.3g} V, the noise of a sample"
            f" is {float(volts.std(ddof=1)):.3g} V",
            cure="name a span without force",
        )
    if np.ptp(volts) == 0.0:
        message = f"holds the same value {volts[0]:.6g} V {volts.size} times, so the noise is unknown"
        cure = "is force.voltage the right column, and was the channel connected?"
        raise toml.error("force.baseline", message, cure=cure)


def _halves(volts: FloatArray) -> FloatArray:
    """Means of the first and the second half [V], shape [2]."""
    middle = volts.size // 2
    return np.array([volts[:middle].mean(), volts[middle:].mean()])


def _drifts(volts: FloatArray) -> bool:
    """True if the means of the halves differ by more than `QUIET_SIGMAS` times their noise."""
    # A drift hardly changes successive differences. Half their mean square is therefore the variance of the
    # noise.
    noise = float(np.sqrt(0.5 * np.mean(np.diff(volts) ** 2)))
    allowed = QUIET_SIGMAS * noise * 2.0 / np.sqrt(volts.size)
    return bool(abs(np.diff(_halves(volts))[0]) > allowed)


def check_sign(
    force: FloatArray, scope_time: FloatArray, span: tuple[float, float], flyer: FlyerMotion, toml: ShotToml
) -> None:
    """Check the sign of the force: a flyer that compresses the specimen pushes on it.

    ``force``: compression-positive force at the scope samples [N], shape [n]. ``scope_time``: their times on
    the shot's clock [s], shape [n]. ``span``: the window [s].
    """
    # A bonded face may pull during the first waves. The sign is therefore checked only at larger compression.
    inside = flyer.time <= span[1]
    if np.ptp(flyer.displacement[inside]) < 0.1 * toml.declared.specimen.length:
        return
    mean = float(force[(scope_time >= span[0]) & (scope_time <= span[1])].mean())
    if mean < 0.0:
        raise toml.error(
            "force.compression",
            f"contradicts the recording: with this sign the specimen pulls, by {-mean:.3g} N in the mean",
            cure="declare the other sign, or check force.voltage and force.baseline",
        )


def incident_channel(toml: ShotToml) -> ForceChannel | None:
    """The channel of the incident force; None if the shot file declares none.

    Raises InputError if its file cannot be read, if it is clipped, or if its baseline has too few samples.
    """
    declared = toml.declared.incident_force
    if declared is None:
        return None
    section = declared.completed(toml.declared.force)
    channel = _channel_of(toml.path.parent, section, "incident_force")
    if channel.baseline_volts().size < SMALLEST_BASELINE:
        message = f"holds {channel.baseline_volts().size} samples"
        cure = "widen it within the stretch before the test, on the shot's clock"
        allowed = f"{SMALLEST_BASELINE} or more"
        raise toml.error("incident_force.baseline", message, allowed=allowed, cure=cure)
    return channel


def incident_to_compare(toml: ShotToml, span: tuple[float, float]) -> dict[str, IncidentForce]:
    """The incident force as a field of the shot; empty if the shot does not compare it.

    The pulse that accelerates the flyer ends before the flight, and the window begins at rest. The incident
    force within the window is therefore that of the specimen. ``span``: the window [s]. Raises InputError for
    the reasons of `incident_channel`. Also if the recording does not cover the window.
    """
    declared = toml.declared.incident_force
    if declared is None or not declared.compared:
        return {}
    channel = incident_channel(toml)
    assert channel is not None  # it is declared
    time = channel.time
    if time[0] > span[0] or time[-1] < span[1]:
        raise toml.error(
            "incident_force.file",
            f"spans {in_us(time[0])} to {in_us(time[-1])}, the window {in_us(span[0])} to {in_us(span[1])} "
            "(shot's clock)",
            cure="shorten the window with window.end, or leave incident_force.compared out",
        )
    return {"incident": IncidentForce(channel, declared.mass)}
