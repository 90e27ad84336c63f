"""What the instruments of a made shot report: volts of both forces, flyer's path, outline, curve."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.virtual import signals
from kolsky.virtual.material import law_of, uniaxial_stress
from kolsky.virtual.records import SurfaceHistory, Truth
from kolsky.virtual.schema import ChannelTable, Specification
from kolsky.virtual.streams import stream

RECORD_AFTER = 5e-6
"""How long the recorder goes on after the last frame [s]."""
LANDED = 1e-7
"""Two nodes of the surface whose heights differ by less lie on a platen [m]."""
FINER = 8
"""Points of the curve through the surface's nodes from one node to the next."""


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
    """An outline as a correlation program exports it: one row a point."""

    frame: IntArray
    """Frame of the point, shape [n]."""
    y: FloatArray
    """Height [m], shape [n]."""
    Z: FloatArray
    """Toward the cameras [m], shape [n]."""


def record_forces(quantities: Specification, truth: Truth, *, shot: int) -> Scope:
    """Both forces as the recorder keeps them.

    Raises
    ------
    ValueError
        If the recorder starts after the frames, so that there is no baseline.
    """
    scope, wrong = quantities.scope, quantities.imperfections
    last = truth.surface.time[-1] + max(wrong.trigger, 0.0) + RECORD_AFTER
    count = int(np.floor((last - scope.start) / scope.interval)) + 1
    times = scope.start + scope.interval * np.arange(count, dtype=np.float64)
    incident = signals.with_inertia(truth.incident, quantities.incident.platen_mass, truth.flyer_acceleration)
    transmitted = signals.with_inertia(
        truth.transmitted, quantities.transmitted.platen_mass, -truth.support_acceleration
    )
    made = []
    for name, channel, force, gain, bias in (
        ("incident", quantities.incident, incident, 0.0, 0.0),
        ("transmitted", quantities.transmitted, transmitted, wrong.gain, wrong.baseline),
    ):
        volts = _volts(quantities, channel, (1.0 + gain) * force, truth, times, (name, shot))
        volts = volts + bias * (times >= quantities.motion.start)
        made.append(signals.quantised(volts, scope.full_scale, scope.bits))
    return Scope(times - scope.clock_offset, *made)


def _volts(
    quantities: Specification,
    channel: ChannelTable,
    force: FloatArray,
    truth: Truth,
    times: FloatArray,
    subject: tuple[str, int],
) -> FloatArray:
    """Volts of a channel before they are quantised, shape [n_times]."""
    name, shot = subject
    step = float(truth.force_time[1] - truth.force_time[0])
    signal = channel.sensitivity * (1.0 if channel.compression == "positive" else -1.0) * force
    if channel.time_constant is not None:
        signal = signals.droop(signal, step, channel.time_constant)
    if channel.bandwidth is not None:
        signal = signals.low_pass(signal, step, channel.bandwidth)
    start = float(truth.force_time[0])
    jitter = stream(quantities.seed, shot, "jitter", name)
    seen = signals.sampled(
        signal, start, step, times, delay=channel.delay, jitter=quantities.scope.jitter, rng=jitter
    )
    noise = channel.noise * stream(quantities.seed, shot, "noise", name).standard_normal(len(times))
    return seen + signals.baseline(times, channel.baseline, channel.drift) + noise


def seen_displacement(truth: Truth) -> FloatArray:
    """What is seen of the flyer's side: its centre's path and the pitch over its radius, Eq. (E.3) [m]."""
    surface = truth.surface
    return np.asarray(surface.displacement + surface.tilt * truth.flyer_radius)


def measure_flyer(quantities: Specification, truth: Truth, *, shot: int) -> FloatArray:
    """The flyer's displacement as a correlation program exports it [m], shape [n_frames]."""
    clean = seen_displacement(truth)
    noise = stream(quantities.seed, shot, "noise", "flyer").standard_normal(len(clean))
    return np.asarray(clean + quantities.exports.flyer_sigma * noise)


def measure_outline(quantities: Specification, truth: Truth, *, shot: int) -> Outline:
    """The outline as a correlation program exports it, between two shares of the height at the time."""
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
    """Height and radius of the free side surface in one frame [m], a fine curve, heights ascending.

    Nodes that lie on a platen are left out but for the last on either side. Between nodes the curve is a
    cubic spline in the node's number.
    """
    y, r = surface.y[frame], surface.r[frame]
    widest = int(np.argmax(np.diff(y)))
    flat = np.flatnonzero(np.diff(y) < LANDED)
    first = int(flat[flat < widest].max(initial=-1)) + 1
    last = int(flat[flat > widest].min(initial=len(y) - 1))
    nodes = np.arange(first, last + 1)
    fine = np.linspace(first, last, FINER * (last - first) + 1)
    height = CubicSpline(nodes, y[nodes])(fine)
    radius = CubicSpline(nodes, r[nodes])(fine)
    rising = np.concatenate([[True], height[1:] > np.maximum.accumulate(height)[:-1]])
    return height[rising], radius[rising]


def measure_curve(quantities: Specification, *, shot: int) -> tuple[FloatArray, FloatArray]:
    """Nominal strain [-] and stress [Pa] of the quasi-static test, tension-positive, from rest outward."""
    slow, material = quantities.quasi_static, quantities.material
    strain = np.linspace(0.0, -slow.largest_strain, slow.points)
    stress = uniaxial_stress(law_of(material.law, material.parameters, material.shear_modulus), 1.0 + strain)
    noise = stream(quantities.seed, shot, "noise", "curve").standard_normal(len(strain))
    return strain, stress * (1.0 + quantities.imperfections.curve) * (1.0 + slow.sigma * noise)
