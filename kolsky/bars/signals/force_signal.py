"""A force transducer's recording as a signal with its corrections and the quantities it rests on."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kolsky.bars.audit import AuditLog, Switches
from kolsky.bars.records import Correction, Quantity, Signal
from kolsky.bars.signals.bridge import check_fields
from kolsky.bars.signals.signal_zero import measure_signal_zero
from kolsky.bars.signals.transducers import force_history
from kolsky.bars.signals.uniform_clock import uniform_clock
from kolsky.base.apparatus import Transducer
from kolsky.base.records import Recording


class ForceSignal(NamedTuple):
    """A force with its corrections and quantities."""

    signal: Signal
    """Force, compression positive [N], on the shot's clock."""
    corrections: list[Correction]
    """Corrections, applied or not."""
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
    """Force of a transducer on uniform samples; `kolsky.bars.signals.transducers.force_history` with its
    audit.

    Parameters
    ----------
    recording
        The channel, in volts, on the recorder's clock.
    transducer
        Sensitivity, sign, full scale and time constant.
    name
        Whose force it is, e.g. "transmission force".
    baseline
        First and last time of the rest on the shot's clock [s].
    clock_offset
        Shot's clock minus recorder's clock [s].
    switches
        Which corrections are applied: "droop".
    uncertainty
        Standard uncertainties (k = 1, SI) of "sensitivity" and "time_constant".
    values
        Values to take instead of the estimates of `quantities`, by name.

    Raises
    ------
    ValueError
        As `kolsky.bars.signals.transducers.force_history`, and if the times are not uniform or an
        uncertainty belongs to no field that matters.
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
