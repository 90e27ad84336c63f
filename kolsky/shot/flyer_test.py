"""A flyer test reduced by classical means: forces after mass compensation, strain from the flyer's motion.

The reduction is a function of the values behind it, so that each can be varied for the budget.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import inf, sqrt

import numpy as np

from kolsky.bars.audit import AuditLog, Switches
from kolsky.bars.budget import budget_table, merge_quantities, propagate
from kolsky.bars.flyer.events import FlyerEvents, flyer_events
from kolsky.bars.flyer.path import path_strain
from kolsky.bars.flyer.synchronisation import Agreement, Synchronisation, synchronise
from kolsky.bars.records import FlyerResult, History, Quantity, Reduction, Signal
from kolsky.bars.reduction.inertia import (
    axial_by_analysis,
    compensate_mass,
    correct_axial_inertia,
    correct_radial_inertia,
    path_acceleration,
)
from kolsky.bars.reduction.validity import VALIDITY_SHARE, Validity, balanced_span, imbalance, validity
from kolsky.bars.reduction.varied_test import length_quantities, varied_specimen
from kolsky.bars.signals.transducers import ForceSignal, force_signal
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.shot.records import ForceChannel, Shot

AVERAGE = 10e-6
"""Span over which forces are averaged before they are judged [s]."""


@dataclass(frozen=True)
class FlyerInput:
    """A flyer test, ready to be reduced."""

    shot: Shot
    """The shot."""
    incident: ForceChannel | None = None
    """The flyer's own transducer; None where there is none."""
    mass: float = 0.0
    """Mass between its sensing plane and the specimen [kg]."""
    pictured: bool = False
    """Whether the flyer's motion is from pictures, which see its direction too."""
    share: float = VALIDITY_SHARE
    """Share of the stress that inertia or the forces' difference may have [-]."""
    switches: Switches = field(default_factory=Switches)
    """Which corrections are applied."""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainties (k = 1) by the keys of [uncertainty]."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """What was declared, and the versions."""


@dataclass(frozen=True)
class Reduced:
    """One reduction and what it was made of."""

    reduction: Reduction
    validity: Validity
    acceleration: History


@dataclass(frozen=True)
class FlyerTest:
    """One test whose quantities can be given other values."""

    given: FlyerInput
    events: FlyerEvents
    time: FloatArray

    def reduced(self, values: Mapping[str, float], log: AuditLog) -> Reduced:
        """Reduction on `time`; corrections go into the log."""
        given, time, shot = self.given, self.time, self.given.shot
        specimen = varied_specimen(shot.specimen, values)
        strain, rate, second = path_strain(self.events.path, time, length=specimen.length)
        acceleration = path_acceleration(self.events.path, time)
        assert isinstance(shot.force, ForceChannel)  # `analyse_flyer` saw to it
        back = _at(_channel_force("transmitted force", shot.force, given, values).signal, time)
        front = back
        if given.incident is not None:
            gauge = _at(_channel_force("incident force", given.incident, given, values).signal, time)
            front = gauge
            if given.mass > 0.0:
                mass = values.get("flyer, mass", given.mass)
                front, entry = compensate_mass(
                    time, gauge, acceleration, Quantity("flyer, mass", mass, 0.0, "kg", "B"),
                    apply=given.switches["mass"], source="the flyer's motion",
                )  # fmt: skip
                log.add(replace(entry, key="mass"))
        area = specimen.area
        stress = {
            "one wave": _scaled(back, 1.0 / area),
            "two waves": _scaled(front, 1.0 / area),
            "three waves": History(
                0.5 * (front.value + back.value) / area, 0.5 * np.hypot(front.sigma, back.sigma) / area, "Pa"
            ),
        }
        plain = stress["three waves"]
        corrected, radial = correct_radial_inertia(
            plain, strain, rate, second, specimen, apply=given.switches["radial inertia"]
        )
        log.add(replace(radial, key="radial inertia"))
        stress["one wave"], axial = correct_axial_inertia(
            stress["one wave"], second, specimen, apply=given.switches["axial inertia"]
        )
        log.add(replace(axial, key="axial inertia"))
        if axial.applied:  # the other analyses lack other shares of it
            change = axial_by_analysis(second.value, specimen, 0.0)
            two = stress["two waves"]
            stress["two waves"] = replace(two, value=two.value + change["two waves"])
            corrected = replace(corrected, value=corrected.value + change["three waves"])
        everything, _ = correct_radial_inertia(plain, strain, rate, second, specimen, apply=True)
        interval = float(time[1] - time[0])
        width = max(1, round(AVERAGE / interval))
        known = given.incident is not None  # with one force nothing is known of their balance
        ratio = np.full(time.size, np.inf)
        if known:
            ratio = imbalance(front.value, back.value, front.sigma[0], back.sigma[0], width=width)
        still = History(np.zeros(time.size), np.zeros(time.size), "m/s")
        reduction = Reduction(
            time=time,
            strain=dict.fromkeys(stress, strain),
            rate=dict.fromkeys(stress, rate),
            stress=stress | {"three waves": corrected},
            front_force=front,
            back_force=back,
            front_velocity=_scaled(rate, specimen.length),
            back_velocity=still,
            imbalance=ratio,
            balanced=balanced_span(time, ratio, allowance=given.share, bridge=width * interval),
        )
        window = validity(
            time, front, back, strain,
            inertial_stress=plain.value - everything.value, area=area, share=given.share, average=AVERAGE,
        )  # fmt: skip
        if not known:
            unknown = np.full(window.imbalance.shape, np.inf)
            window = replace(window, window=None, strain=None, covered=0.0, imbalance=unknown)
        return Reduced(reduction, window, acceleration)

    def outputs(self, values: Mapping[str, float]) -> dict[str, FloatArray]:
        """Quoted numbers and forces, for the budget."""
        r = self.reduced(values, AuditLog(self.given.switches)).reduction
        return {
            "largest strain": r.strain["three waves"].value,
            "back stress": r.stress["one wave"].value,
            "front stress": r.stress["two waves"].value,
        }


def _channel_force(
    name: str, channel: ForceChannel, given: FlyerInput, values: Mapping[str, float]
) -> ForceSignal:
    """The force of a transducer with its quantities; `values` replace the named ones."""
    relative = given.uncertainty.get("sensitivity", 0.0)
    return force_signal(
        channel.recording,
        channel.transducer,
        name=name,
        baseline=channel.baseline,
        clock_offset=channel.clock_offset,
        switches=given.switches,
        uncertainty={"sensitivity": relative * channel.transducer.sensitivity},
        values=values,
    )


def _at(signal: Signal, time: FloatArray) -> History:
    return History(np.interp(time, signal.time, signal.value), np.full(time.size, signal.sigma), "N")


def _scaled(history: History, factor: float) -> History:
    unit = {"N": "Pa", "1/s": "m/s"}[history.unit]
    return History(factor * history.value, factor * history.sigma, unit)


EARLY = 0.05
"""Share of the specimen's length up to which the flyer's travel serves to compare the clocks [-]."""
UNJUDGED = (
    "whether the forces on the faces are balanced is not known, as only the one behind the specimen was "
    "measured; cure: declare the flyer's own transducer in [incident_force], or use the inverse method "
    "(kolsky identify), which needs no balance"
)
"""What is said of the validity window where the force on the front face is not known."""


def analyse_flyer(
    given: FlyerInput, *, progress: Callable[[str, int, int], None] = lambda stage, done, total: None
) -> FlyerResult:
    """Forces, strain, stress, events and the window in which they are a curve of the material.

    Raises ValueError if the shot has no flyer motion, or the signals hold no such test: see the parts in
    `kolsky.bars`.
    """
    shot, motion = given.shot, given.shot.flyer
    if not isinstance(motion, FlyerMotion) or not isinstance(shot.force, ForceChannel):
        raise ValueError("the shot's front face is moved by bar waves; `kolsky waves` reduces its gauges")
    progress("waves", 0, 3)
    transmitted = _channel_force("transmitted force", shot.force, given, {})
    incident = None if given.incident is None else _channel_force("incident force", given.incident, given, {})
    rest = shot.window[0]
    events = flyer_events(
        motion,
        rest=rest,
        incident=None if incident is None else incident.signal,
        transmitted=transmitted.signal,
        bar=shot.transmission_bar,
    )
    sync = _synchronised(given, motion, incident, rest)
    progress("waves", 1, 3)
    last = min(events.path.end, events.usable[0], inf if shot.symmetry_end is None else shot.symmetry_end)
    time = _times(transmitted.signal, rest, last)
    state = FlyerTest(given, events, time)
    log = AuditLog(given.switches)
    for force in (incident, transmitted):
        log.add(*([] if force is None else force.corrections))
    found = state.reduced({}, log)
    progress("waves", 2, 3)
    return _result(given, state, found, log, (incident, transmitted), events, sync, progress)


def _result(
    given: FlyerInput,
    state: FlyerTest,
    found: Reduced,
    log: AuditLog,
    forces: tuple[ForceSignal | None, ForceSignal],
    events: FlyerEvents,
    sync: Synchronisation | None,
    progress: Callable[[str, int, int], None],
) -> FlyerResult:
    shot, r = given.shot, found.reduction
    quantities = [q for force in forces if force is not None for q in force.quantities]
    u = given.uncertainty
    quantities += length_quantities(shot.specimen, {}, u)
    if given.incident is not None and given.mass > 0.0:
        quantities.append(Quantity("flyer, mass", given.mass, given.mass * u.get("mass", 0.0), "kg", "B"))
    budget = propagate(
        state.outputs,
        merge_quantities(quantities),
        noise={
            "largest strain": r.strain["three waves"].sigma,
            "back stress": r.stress["one wave"].sigma,
            "front stress": r.stress["two waves"].sigma,
        },
    )
    names = {"largest strain": "1", "back stress": "Pa"} | (
        {} if given.incident is None else {"front stress": "Pa"}
    )
    last = int(np.argmax(np.abs(r.strain["three waves"].value)))
    progress("waves", 3, 3)
    facts: dict[str, tuple[float, str]] = {
        "largest strain rate": (float(np.abs(r.rate["three waves"].value).max()), "1/s"),
        "largest acceleration of the flyer": (float(np.abs(found.acceleration.value).max()), "m/s^2"),
        **{f"noise, {force.signal.name}": (force.signal.sigma, "N") for force in forces if force is not None},
    }
    if sync is not None:
        facts |= {"lag of the cameras": (sync.lag, "s"), "its standard uncertainty": (sync.sigma, "s")}
    window = found.validity.window  # of one averaging interval it is none
    judged = found.validity.sentence if given.incident is not None else UNJUDGED
    remarks = [judged] if found.validity.nearly_empty else []
    if sync is not None and sync.agreement is not Agreement.AGREES:
        remarks.append(sync.sentence)
    elif sync is not None and abs(sync.gain - 1.0) > 2.0 * sync.sigma_gain:
        remarks.append(
            f"the flyer moves {sync.gain:.3f} ± {2.0 * sync.sigma_gain:.3f} (k = 2) times as much as the "
            "incident transducer and the mass before it give; cure: check incident_force.sensitivity and mass"
        )
    return FlyerResult(
        name=shot.name,
        specimen=shot.specimen,
        load="compression",
        reduction=r,
        corrections=log.corrections,
        budget=budget_table(
            budget,
            {
                name if name == "largest strain" else f"{name} there": (name, last, unit)
                for name, unit in names.items()
            },
        ),
        facts=facts,
        remarks=tuple(remarks),
        inputs=shot.inputs,
        settings=given.settings,
        signals=tuple(force.signal for force in forces if force is not None),
        events=_flyer_events(events, shot, pictured=given.pictured),
        valid=window if window is not None and window[1] > window[0] else None,
        validity=judged,
        synchronisation=None if sync is None else sync.sentence,
        inertia={
            "time": found.validity.time,
            "imbalance": found.validity.imbalance,
            "inertia": found.validity.inertia,
        },
    )


def _flyer_events(
    found: FlyerEvents, shot: Shot, *, pictured: bool
) -> tuple[tuple[str, float | None, float | None, str], ...]:
    """The events; the end of symmetry from the flyer's flight, where there are pictures."""
    rows = [(e.name, e.time, e.sigma, e.how) for e in found.events if e.name != "end of symmetry"]
    if not pictured or not isinstance(shot.flyer, FlyerMotion):
        return tuple((e.name, e.time, e.sigma, e.how) for e in found.events)
    if shot.symmetry_end is None:
        kept = "the flyer keeps its first direction to the last frame"
        return (*rows, ("end of symmetry", None, None, kept))
    frame = float(np.median(np.diff(shot.flyer.time)))
    how = "the flyer leaves its first direction, by its flight in the pictures"
    return (*rows, ("end of symmetry", shot.symmetry_end, frame / sqrt(12.0), how))


def _synchronised(
    given: FlyerInput, motion: FlyerMotion, incident: ForceSignal | None, rest: float
) -> Synchronisation | None:
    if incident is None or given.mass <= 0.0:
        return None
    zero = next(q for q in incident.quantities if q.name.endswith("zero"))
    return synchronise(
        motion,
        incident.signal,
        mass=given.mass,
        rest=rest,
        travel=EARLY * given.shot.specimen.length,
        sigma_zero=zero.sigma,
    )


def _times(signal: Signal, first: float, last: float) -> FloatArray:
    """The signal's samples in a span."""
    time = signal.time
    return time[(time >= first) & (time <= last)]
