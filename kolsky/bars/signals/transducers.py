"""Force transducers: from volts to a force, and means over bins.

The steps are noise, droop compensation and calibration.

Charge leaks from transducer and amplifier with one time constant. The output of a constant force therefore
decays. This is a high-pass filter of first order; its inverse is Eq. (U.6).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dic.basics import check_interval, check_shape
from kolsky.bars.audit import AuditLog, Switches
from kolsky.bars.records import Correction, Quantity, Signal, uniform_clock
from kolsky.bars.signals.baseline import measure_signal_zero
from kolsky.bars.signals.bridge import check_fields
from kolsky.base.apparatus import Transducer
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.records import ForceHistory, Recording


def compensate_droop(
    time: FloatArray, value: FloatArray, time_constant: float, *, start: float
) -> FloatArray:
    """Signal of a transducer without droop, v + (1/tau) int v dt, Eq. (U.6)."""
    check_interval("(0, inf) s", time_constant=time_constant)
    check_shape(time.shape, value=value)
    first = int(np.searchsorted(time, start))
    lost = np.zeros(time.size)
    if first < time.size:
        from scipy.integrate import cumulative_trapezoid  # loaded where it is of use

        lost[first:] = cumulative_trapezoid(value[first:], time[first:], initial=0.0) / time_constant
    return value + lost


def droop_sigma(time: FloatArray, sigma: float, time_constant: float, *, start: float) -> FloatArray:
    """Standard deviation of compensated samples from white noise in the recorded ones, Eq. (U.7), shape
    [n].
    """
    check_interval("(0, inf) s", time_constant=time_constant)
    check_interval("[0, inf)", sigma=sigma)
    first = int(np.searchsorted(time, start))
    factor = np.ones(time.size)
    h = np.diff(time[first:]) / time_constant
    if h.size:
        # Weights of the trapezoid rule up to sample k: w_0 = h_0/2, w_j = (h_(j-1) + h_j)/2, w_k = h_(k-1)/2.
        inner = np.concatenate([[0.5 * h[0]], 0.5 * (h[1:] + h[:-1])])
        factor[first + 1 :] = np.sqrt(np.cumsum(inner**2) + (1.0 + 0.5 * h) ** 2)
    return sigma * factor


def low_pass(signal: FloatArray, step: float, frequency: float) -> FloatArray:
    """The signal after a first-order low-pass, Eq. (E.6)."""
    from scipy.linalg import solve_banded  # scipy.signal takes much longer to load

    check_interval("(0, inf)", step=step, frequency=frequency)
    x = 2.0 * np.pi * frequency * step
    decay = np.exp(-x)
    # Exact for a straight line between samples: y_1 = d y_0 + (g - d) u_0 + (1 - g) u_1, g = (1 - d) / x.
    share = -np.expm1(-x) / x
    change = signal - signal[0]
    driven = (1.0 - share) * change
    driven[1:] += (share - decay) * change[:-1]
    bands = np.broadcast_to([[1.0], [-decay]], (2, len(change)))
    return np.asarray(solve_banded((1, 0), bands, driven) + signal[0])


_FEWEST_BASELINE = 20
"""Smallest number of samples of a baseline. With 20, the noise is known to 16 %."""
CAMERA_FRAME = 1.0 / 120e3
"""Frame interval of the cameras [s], the default width of a force bin."""


@dataclass(frozen=True)
class ForceBins:
    """Means of a force over successive bins. Bin edges are recorded sample times."""

    edges: FloatArray
    """Bin edges on the shot's clock [s], shape [n_bins + 1]."""
    mean: FloatArray
    """Time mean of the force between the edges [N], shape [n_bins]."""
    sigma: FloatArray
    """Standard deviation of the mean from the samples' noise [N], shape [n_bins]."""
    n: IntArray
    """Number of samples from edge to edge with both edges, shape [n_bins]."""

    @property
    def centres(self) -> FloatArray:
        """Bin centres [s], shape [n_bins]."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


def force_history(
    recording: Recording, transducer: Transducer, *, baseline: tuple[float, float], clock_offset: float
) -> ForceHistory:
    """Turn a recording in volts into a force.

    ``recording``: the channel, in volts, on the recorder's clock. ``transducer``: sensitivity, sign and full
    scale. ``baseline``: first and last time of the span for zero and noise, on the shot's clock [s].
    ``clock_offset``: shot's clock minus recorder's clock [s]. Returns: force = sign * (V - mean baseline V) /
    sensitivity at every sample; sigma is the baseline's standard deviation (with n - 1), the same for each
    sample. A finite time constant of the transducer is compensated from the end of the baseline on, Eq.
    (U.6), and sigma grows by Eq. (U.7).
    """
    _check_recording(recording, transducer)
    time = recording.time + clock_offset
    rest = recording.value[_within(time, baseline, "baseline")]
    _enough(rest.size, baseline)
    noise = float(np.std(rest, ddof=1))
    if not noise > 0.0:
        raise ValueError(
            f"{recording.channel}: all {rest.size} baseline samples are {rest[0]:.6g} V, so the noise is"
            " unknown (it must be > 0 V); record with a finer range, or choose another baseline"
        )
    newtons = transducer.compression_sign / transducer.sensitivity
    force = newtons * (recording.value - rest.mean())
    sigma = np.full(time.size, noise / transducer.sensitivity)
    if np.isfinite(transducer.time_constant):
        force = compensate_droop(time, force, transducer.time_constant, start=baseline[1])
        sigma = droop_sigma(time, sigma[0], transducer.time_constant, start=baseline[1])
    return ForceHistory(time=time, force=force, sigma=sigma)


def noise_correlation(force: ForceHistory, baseline: tuple[float, float]) -> float:
    """Lag-1 autocorrelation of the baseline's noise [-].

    For white noise it lies within about +-2 / sqrt(n) of zero, where n is the number of baseline samples. For
    other noise, the sigma of a bin mean is wrong by about sqrt((1 + c) / (1 - c)).

    Raises ValueError if the baseline has fewer than 20 samples.
    """
    rest = force.force[_within(force.time, baseline, "baseline")]
    _enough(rest.size, baseline)
    e = rest - rest.mean()
    return float(e[1:] @ e[:-1] / (e @ e))


def bin_force(force: ForceHistory, *, window: tuple[float, float], width: float = CAMERA_FRAME) -> ForceBins:
    """Average a force over bins of nearly equal width. The bins cover all samples inside a window.

    Edges are recorded sample times, the nearest to an even division of the window's samples. The mean
    therefore needs no interpolation. It is the trapezoid rule over the samples between the edges, and its
    sigma follows exactly from theirs. Neighbouring bins share the sample on their edge. With n intervals per
    bin, their noise has the correlation 1 / (4 n - 2), which is neglected (1.6 % at 16).

    ``force``: the samples; their noise is taken as independent. ``window``: first and last time [s].
    ``width``: requested width of a bin [s]. The window is divided into the number of bins that comes nearest
    to it.
    """
    inside = _within(force.time, window, "window")
    t, F, sigma = force.time[inside], force.force[inside], force.sigma[inside]
    if t.size < 2:
        raise ValueError(
            f"the window {window[0]:.9g} to {window[1]:.9g} s holds {t.size} force samples, at least 2 are"
            f" needed; the record spans {force.time[0]:.9g} to {force.time[-1]:.9g} s"
        )
    span, interval = t[-1] - t[0], float(np.diff(t).max())
    if not interval <= width <= span:
        raise ValueError(
            f"bin width {width:.3g} s must be between the largest sample interval {interval:.3g} s and the"
            f" samples' span {span:.3g} s"
        )
    ideal = np.linspace(t[0], t[-1], round(span / width) + 1)
    # The nearest sample: the first sample after the midpoint to its predecessor.
    edge = np.searchsorted(0.5 * (t[1:] + t[:-1]), ideal)
    edge = np.unique(edge)  # a wide sample interval may take two ideal edges
    return force_between(ForceHistory(time=t, force=F, sigma=sigma), edge)


def force_between(force: ForceHistory, edge: NDArray[np.intp]) -> ForceBins:
    """Means of a force between some of its samples, see `bin_force`.

    ``edge``: increasing numbers of the samples at the edges of the bins, shape [n_bins + 1].
    """
    t, F, sigma = force.time, force.force, force.sigma
    h = np.diff(t)
    mean, deviation = np.empty(edge.size - 1), np.empty(edge.size - 1)
    for i, (a, b) in enumerate(pairwise(edge)):
        weight = np.zeros(b - a + 1)
        weight[:-1] += 0.5 * h[a:b]
        weight[1:] += 0.5 * h[a:b]
        weight /= t[b] - t[a]
        mean[i] = weight @ F[a : b + 1]
        deviation[i] = np.linalg.norm(weight * sigma[a : b + 1])
    return ForceBins(edges=t[edge], mean=mean, sigma=deviation, n=np.diff(edge) + 1)


def _within(time: FloatArray, span: tuple[float, float], name: str) -> NDArray[np.bool_]:
    first, last = span
    if not first < last:
        raise ValueError(f"{name} must start before it ends, got {first:.9g} to {last:.9g} s")
    return (time >= first) & (time <= last)


def _enough(count: int, baseline: tuple[float, float]) -> None:
    if count < _FEWEST_BASELINE:
        raise ValueError(
            f"the baseline {baseline[0]:.9g} to {baseline[1]:.9g} s holds {count} samples, at least"
            f" {_FEWEST_BASELINE} are needed; widen it within the pre-trigger stretch, on the shot's clock"
        )


def _check_recording(recording: Recording, transducer: Transducer) -> None:
    time, value, name = recording.time, recording.value, recording.channel
    if recording.unit != "V":
        raise ValueError(f"{name}: unit must be 'V', got {recording.unit!r}; convert the recording first")
    check_shape((time.size,), **{f"time of {name}": time, name: value})
    check_interval("(0, inf) s", **{f"step of the time of {name}": np.diff(time)})
    clipped = np.flatnonzero(np.abs(value) >= transducer.full_scale)
    if clipped.size:
        raise ValueError(
            f"{name}: {clipped.size} samples reach full scale, the first {value[clipped[0]]:.6g} V at"
            f" {time[clipped[0]]:.9g} s; |V| must be < {transducer.full_scale:.6g} V: choose a wider range on"
            " the recorder, or correct full_scale"
        )


class ForceSignal(NamedTuple):
    """A force with its corrections and quantities."""

    signal: Signal
    """Force, compression positive [N], on the shot's clock."""
    corrections: list[Correction]
    quantities: list[Quantity]
    """Inputs of its budget: sensitivity, time constant, zero."""


def force_signal(
    recording: Recording,
    transducer: Transducer,
    *,
    name: str,
    baseline: tuple[float, float],
    clock_offset: float,
    switches: Switches | None = None,
    uncertainty: Mapping[str, float] | None = None,
    values: Mapping[str, float] | None = None,
) -> ForceSignal:
    """Force of a transducer on uniform samples.

    It is that of `kolsky.bars.signals.transducers.force_history`, with its audit.

    ``recording``: the channel, in volts, on the recorder's clock. ``transducer``: sensitivity, sign, full
    scale and time constant. ``name``: name of the force, e.g. "transmission force". ``baseline``: first and
    last time of the rest on the shot's clock [s]. ``clock_offset``: shot's clock minus recorder's clock [s].
    ``switches``: switch of the correction "droop". ``uncertainty``: standard uncertainties (k = 1, SI) of
    "sensitivity" and "time_constant". ``values``: values that replace the estimates of `quantities`, by name.
    """
    given, stated = values or {}, uncertainty or {}
    droops = np.isfinite(transducer.time_constant)
    check_fields(stated, ["sensitivity", "time_constant"] if droops else ["sensitivity"], "the force")
    quantities = [
        Quantity(f"{name}, sensitivity", transducer.sensitivity, stated.get("sensitivity", 0.0), "V/N", "B")
    ]
    if droops:
        tau = transducer.time_constant
        quantities.append(Quantity(f"{name}, time constant", tau, stated.get("time_constant", 0.0), "s", "B"))
    transducer = replace(
        transducer,
        sensitivity=given.get(f"{name}, sensitivity", transducer.sensitivity),
        time_constant=given.get(f"{name}, time constant", transducer.time_constant),
    )
    start, interval = uniform_clock(recording)
    seen = force_history(
        recording, replace(transducer, time_constant=np.inf), baseline=baseline, clock_offset=clock_offset
    )
    force, log = seen.force, AuditLog(switches)
    if droops:
        full = force_history(recording, transducer, baseline=baseline, clock_offset=clock_offset)
        reason = f"time constant {transducer.time_constant:.4g} s"
        over = seen.time > baseline[1]
        force = log.choose(f"droop, {name}", "droop", force, full.force, unit="N", reason=reason, over=over)
    rest = measure_signal_zero(seen.time, seen.force, baseline, name=name)
    zero = Quantity(f"{name}, zero", 0.0, rest.mean_sigma, "N", "A", rest.freedom)
    return ForceSignal(
        signal=Signal(
            start + clock_offset, interval, force + given.get(zero.name, 0.0), rest.noise.sigma, "N", name
        ),
        corrections=list(log.corrections),
        quantities=[*quantities, zero],
    )
