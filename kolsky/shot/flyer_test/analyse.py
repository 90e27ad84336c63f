"""A flyer test reduced by classical means: forces after mass compensation, strain from the flyer's motion.

For a soft specimen this is a look at the data rather than a result: the validity window says how much of it
may be read as a curve of the material, and `kolsky identify` is what does not need equilibrium.
"""

from collections.abc import Callable
from math import inf, sqrt

import numpy as np

from kolsky.bars.audit import AuditLog
from kolsky.bars.budget.budget import budget_table
from kolsky.bars.budget.propagation import propagate
from kolsky.bars.budget.quantities import merge_quantities
from kolsky.bars.flyer.events import FlyerEvents, flyer_events
from kolsky.bars.flyer.synchronisation import Agreement, Synchronisation, synchronise
from kolsky.bars.records import Quantity, Signal
from kolsky.bars.reduction.validity import Validity
from kolsky.bars.result import FlyerResult
from kolsky.bars.signals.force_signal import ForceSignal
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.shot.flyer_test.reduction import FlyerInput, FlyerTest, Reduced, channel_force
from kolsky.shot.records import ForceChannel, Shot

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

    Raises
    ------
    ValueError
        If the shot has no flyer motion, or the signals hold no such test: see the parts in `kolsky.bars`.
    """
    shot, motion = given.shot, given.shot.flyer
    if not isinstance(motion, FlyerMotion) or not isinstance(shot.force, ForceChannel):
        raise ValueError("the shot's front face is moved by bar waves; `kolsky waves` reduces its gauges")
    progress("waves", 0, 3)
    transmitted = channel_force("transmitted force", shot.force, given, {})
    incident = None if given.incident is None else channel_force("incident force", given.incident, given, {})
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
    d, length = shot.specimen.diameter, shot.specimen.length
    quantities += [
        Quantity("specimen, diameter", d, d * u.get("specimen_diameter", 0.0), "m", "B"),
        Quantity("specimen, length", length, length * u.get("specimen_length", 0.0), "m", "B"),
    ]
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
    judged = found.validity.sentence if given.incident is not None else UNJUDGED
    remarks = [judged] if found.validity.nearly_empty else []
    if sync is not None and sync.agreement is not Agreement.AGREES:
        remarks.append(sync.sentence)
    elif sync is not None and abs(sync.gain - 1.0) > 2.0 * sync.sigma_gain:
        remarks.append(
            f"the flyer moves {sync.gain:.3f} ± {2.0 * sync.sigma_gain:.3f} (k = 2) times as much as the "
            "incident transducer and the mass before it say; cure: check incident_force.sensitivity and mass"
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
        events=_events(events, shot, pictured=given.pictured),
        valid=_span(found.validity),
        validity=judged,
        synchronisation=None if sync is None else sync.sentence,
        inertia={
            "time": found.validity.time,
            "imbalance": found.validity.imbalance,
            "inertia": found.validity.inertia,
        },
    )


def _events(
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


def _span(found: Validity) -> tuple[float, float] | None:
    """The validity window, if it is more than one averaging interval."""
    window = found.window
    return window if window is not None and window[1] > window[0] else None


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
