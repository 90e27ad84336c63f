"""Instrument readings of a synthetic shot.

Forces in volts, path, outline, curve, and the recorder's file.

Transducer, amplifier, cable and recorder are applied one after the other. Each file format is one entry of
`FORMATS`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from explicit.relaxation import uniaxial_stress
from kolsky.bars.signals.transducers import low_pass
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.virtual.material import law_of
from kolsky.virtual.schema import ChannelTable, Specification
from kolsky.virtual.specification import stream
from kolsky.virtual.truth import SurfaceHistory, Truth


def with_inertia(force: FloatArray, mass: float, acceleration: FloatArray) -> FloatArray:
    """Force on the sensing plane [N], Eq. (E.5): force on the specimen plus inertia of the platen."""
    return np.asarray(force + mass * acceleration)


def droop(signal: FloatArray, step: float, time_constant: float) -> FloatArray:
    """The signal of a transducer with charge leakage.

    It is a first-order high-pass, the inverse of Eq. (U.6).

    ``signal``: uniform samples, 0 at rest, shape [n]. ``step``: sampling interval [s]. ``time_constant``:
    time in which the output of a constant force falls to 1/e [s].
    """
    return np.asarray(signal - low_pass(signal, step, 1.0 / (2.0 * np.pi * time_constant)))


def sampled(
    signal: FloatArray,
    start: float,
    step: float,
    times: FloatArray,
    *,
    delay: float = 0.0,
    jitter: float = 0.0,
    rng: np.random.Generator,
) -> FloatArray:
    """Samples of a delayed signal with jitter of the sample times, shape of `times`.

    ``signal``: uniform samples, at rest before the first, shape [n]. ``start``, ``step``: time of the first
    sample, and sampling interval [s]. ``times``: nominal times of the recorder [s]. ``delay``: delay of the
    signal [s]. ``jitter``: standard deviation of a sample's time [s]. ``rng``: random stream of the jitter.
    Raises ValueError if the record ends after the signal.
    """
    at = times - delay + jitter * rng.standard_normal(len(times))
    known = start + step * np.arange(len(signal))
    if at.max() > known[-1] + 1e-12:
        raise ValueError(f"the recorder needs {at.max():.9g} s, the signal ends at {known[-1]:.9g} s")
    return np.interp(at, known, signal)


def baseline(times: FloatArray, level: float, drift: float) -> FloatArray:
    """The recorder's zero [V], of the times' shape: a level at time 0, and its change with time."""
    return np.asarray(level + drift * times)


def code_step(full_scale: float, bits: int) -> float:
    """Volts of one code of a recorder from -full_scale to +full_scale."""
    return 2.0 * full_scale / 2**bits


def quantised(volts: FloatArray, full_scale: float, bits: int) -> FloatArray:
    """Voltage rounded to the recorder's nearest code, Eq. (E.7). It is clipped to the first and last code."""
    step = code_step(full_scale, bits)
    codes = np.clip(np.rint(volts / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return np.asarray(codes * step)


_RECORD_AFTER = 5e-6
"""Recording time after the last frame [s]."""
_LANDED = 1e-7
"""Two surface nodes with a smaller height difference than this lie on a platen [m]."""
FINER = 8
"""Number of curve points between two surface nodes."""


@dataclass(frozen=True)
class Scope:
    """The recorder's file, on the recorder's clock."""

    time: FloatArray
    """[s], shape [n]."""
    incident: FloatArray
    """[V], shape [n]."""
    transmitted: FloatArray
    """[V], shape [n]."""


@dataclass(frozen=True)
class Outline:
    """An outline as exported by a correlation program: one row per point."""

    frame: IntArray
    """Frame of the point, shape [n]."""
    y: FloatArray
    """Height [m], shape [n]."""
    Z: FloatArray
    """Toward the cameras [m], shape [n]."""


def record_forces(quantities: Specification, truth: Truth, *, shot: int) -> Scope:
    """Both forces as stored by the recorder.

    Raises ValueError if the recorder starts after the frames. There would be no baseline.
    """
    scope, wrong = quantities.scope, quantities.imperfections
    last = truth.surface.time[-1] + max(wrong.trigger, 0.0) + _RECORD_AFTER
    count = int(np.floor((last - scope.start) / scope.interval)) + 1
    times = scope.start + scope.interval * np.arange(count, dtype=np.float64)
    incident = with_inertia(truth.incident, quantities.incident.platen_mass, truth.flyer_acceleration)
    transmitted = with_inertia(
        truth.transmitted, quantities.transmitted.platen_mass, -truth.support_acceleration
    )
    made = []
    for name, channel, force, gain, bias in (
        ("incident", quantities.incident, incident, 0.0, 0.0),
        ("transmitted", quantities.transmitted, transmitted, wrong.gain, wrong.baseline),
    ):
        volts = _volts(quantities, channel, (1.0 + gain) * force, truth, times, (name, shot))
        volts = volts + bias * (times >= quantities.motion.start)
        made.append(quantised(volts, scope.full_scale, scope.bits))
    return Scope(times - scope.clock_offset, *made)


def _volts(
    quantities: Specification,
    channel: ChannelTable,
    force: FloatArray,
    truth: Truth,
    times: FloatArray,
    subject: tuple[str, int],
) -> FloatArray:
    """Voltage of a channel before quantisation, shape [n_times]."""
    name, shot = subject
    step = float(truth.force_time[1] - truth.force_time[0])
    signal = channel.sensitivity * (1.0 if channel.compression == "positive" else -1.0) * force
    if channel.time_constant is not None:
        signal = droop(signal, step, channel.time_constant)
    if channel.bandwidth is not None:
        signal = low_pass(signal, step, channel.bandwidth)
    start = float(truth.force_time[0])
    jitter = stream(quantities.seed, shot, "jitter", name)
    seen = sampled(
        signal, start, step, times, delay=channel.delay, jitter=quantities.scope.jitter, rng=jitter
    )
    noise = channel.noise * stream(quantities.seed, shot, "noise", name).standard_normal(len(times))
    return seen + baseline(times, channel.baseline, channel.drift) + noise


def side_displacement(truth: Truth) -> FloatArray:
    """Visible displacement of the flyer's side [m], Eq. (E.3): path of the centre plus pitch times radius."""
    surface = truth.surface
    return np.asarray(surface.displacement + surface.tilt * truth.flyer_radius)


def measure_flyer(quantities: Specification, truth: Truth, *, shot: int) -> FloatArray:
    """The flyer's displacement as exported by a correlation program [m], shape [n_frames]."""
    clean = side_displacement(truth)
    noise = stream(quantities.seed, shot, "noise", "flyer").standard_normal(len(clean))
    return np.asarray(clean + quantities.exports.flyer_sigma * noise)


def measure_outline(quantities: Specification, truth: Truth, *, shot: int) -> Outline:
    """The outline as exported by a correlation program, between two shares of the current height."""
    exports, wrong = quantities.exports, quantities.imperfections
    shares = np.linspace(exports.lowest, exports.highest, exports.points)
    frames, heights, radii = [], [], []
    for number in range(len(truth.surface.time)):
        y, r = free_outline(truth.surface, number)
        at = y[0] + shares * (y[-1] - y[0])
        frames.append(np.full(len(at), number))
        heights.append(at)
        radii.append(np.interp(at, y, r))
    Z = np.concatenate(radii)
    noise = stream(quantities.seed, shot, "noise", "outline").standard_normal(len(Z))
    return Outline(
        frame=np.concatenate(frames).astype(np.int64),
        y=np.concatenate(heights) + wrong.y_offset,
        Z=Z + wrong.off_centre + wrong.Z_offset + exports.outline_sigma * noise,
    )


def free_outline(surface: SurfaceHistory, frame: int) -> tuple[FloatArray, FloatArray]:
    """Height and radius of the free side surface in one frame [m], with ascending heights. Nodes on a platen
    are left out, except the last one on each side. Between nodes, the curve is a cubic spline over the node
    index."""
    y, r = surface.y[frame], surface.r[frame]
    widest = int(np.argmax(np.diff(y)))
    flat = np.flatnonzero(np.diff(y) < _LANDED)
    first = int(flat[flat < widest].max(initial=-1)) + 1
    last = int(flat[flat > widest].min(initial=len(y) - 1))
    nodes = np.arange(first, last + 1)
    fine = np.linspace(first, last, FINER * (last - first) + 1)
    height = CubicSpline(nodes, y[nodes])(fine)
    radius = CubicSpline(nodes, r[nodes])(fine)
    rising = np.concatenate([[True], height[1:] > np.maximum.accumulate(height)[:-1]])
    return height[rising], radius[rising]


def measure_curve(quantities: Specification, *, shot: int) -> tuple[FloatArray, FloatArray]:
    """Nominal strain [-] and stress [Pa] of the quasi-static test, tension-positive, beginning at rest."""
    slow, material = quantities.quasi_static, quantities.material
    strain = np.linspace(0.0, -slow.largest_strain, slow.points)
    stress = uniaxial_stress(law_of(material.law, material.parameters, material.shear_modulus), 1.0 + strain)
    noise = stream(quantities.seed, shot, "noise", "curve").standard_normal(len(strain))
    return strain, stress * (1.0 + quantities.imperfections.curve) * (1.0 + slow.sigma * noise)


TIME, INCIDENT, TRANSMITTED = "Time (s)", "CH1 incident (V)", "CH2 transmitted (V)"
_VOLT_DIGITS = 9
"""Significant digits of a printed voltage. They exceed the bits of any recorder."""
GROUP = "scope"
"""Group of the channels in a TDMS file."""


@dataclass(frozen=True)
class ScopeFormat:
    """One format of the recorder's file."""

    name: str
    write: Callable[[Path, Scope], None]
    columns: tuple[str, str]
    """Names of the incident and the transmitted channel."""
    force: dict[str, Any]
    """Further keys of [force] in shot.toml: time column and layout."""


def _text(path: Path, scope: Scope, delimiter: str, decimal: str) -> None:
    rows = [delimiter.join((TIME, INCIDENT, TRANSMITTED))]
    for t, a, b in zip(scope.time, scope.incident, scope.transmitted, strict=True):
        rows.append(delimiter.join((f"{t:.9e}", f"{a:.{_VOLT_DIGITS}g}", f"{b:.{_VOLT_DIGITS}g}")))
    text = "\n".join(rows) + "\n"
    if decimal != ".":
        head, _, rest = text.partition("\n")
        text = head + "\n" + rest.replace(".", decimal)
    path.write_text(text, encoding="utf-8")


def _workbook(path: Path, scope: Scope) -> None:
    from openpyxl import Workbook

    book = Workbook(write_only=True)
    sheet = book.create_sheet("Data")
    sheet.append([TIME, INCIDENT, TRANSMITTED])
    for row in zip(scope.time.tolist(), scope.incident.tolist(), scope.transmitted.tolist(), strict=True):
        sheet.append(row)
    book.save(path)


def _tdms(path: Path, scope: Scope) -> None:
    try:
        from nptdms import ChannelObject, TdmsWriter
    except ImportError:
        raise InputError(path, 'scope.format = "tdms" needs npTDMS', cure="pip install npTDMS") from None
    clock = {
        "wf_start_offset": float(scope.time[0]),
        "wf_increment": float(scope.time[1] - scope.time[0]),
        "unit_string": "V",
    }
    names = (INCIDENT, TRANSMITTED)
    channels = [
        ChannelObject(GROUP, name, volts, properties=clock)
        for name, volts in zip(names, (scope.incident, scope.transmitted), strict=True)
    ]
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(channels)


_TIME = {"column": TIME, "unit": "s"}
FORMATS = {
    "csv": ScopeFormat(
        "scope.csv", partial(_text, delimiter=",", decimal="."), (INCIDENT, TRANSMITTED), {"time": _TIME}
    ),
    "csv semicolon": ScopeFormat(
        "scope.csv",
        partial(_text, delimiter=";", decimal=","),
        (INCIDENT, TRANSMITTED),
        {"time": _TIME, "layout": {"delimiter": ";", "decimal": ",", "header_line": 1}},
    ),
    "xlsx": ScopeFormat(
        "scope.xlsx",
        _workbook,
        (INCIDENT, TRANSMITTED),
        {"time": _TIME, "layout": {"format": "excel", "sheet": "Data"}},
    ),
    "tdms": ScopeFormat(
        "scope.tdms", _tdms, (f"{GROUP}/{INCIDENT}", f"{GROUP}/{TRANSMITTED}"), {"layout": {"format": "tdms"}}
    ),
}
"""The formats by their names in [scope]."""
