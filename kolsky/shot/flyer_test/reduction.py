"""One reduction of a flyer test: forces, strain and stress, for any values of the quantities behind them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kolsky.bars.audit import AuditLog, Switches
from kolsky.bars.flyer.events import FlyerEvents
from kolsky.bars.flyer.path import path_strain
from kolsky.bars.records import Correction, History, Quantity, Reduction, Signal
from kolsky.bars.reduction.equilibrium import balanced_span, imbalance
from kolsky.bars.reduction.inertia import axial_by_analysis, correct_axial_inertia, correct_radial_inertia
from kolsky.bars.reduction.mass import compensate_mass, path_acceleration
from kolsky.bars.reduction.validity import SHARE, Validity, validity
from kolsky.bars.reduction.varied_test import varied_specimen
from kolsky.bars.signals.force_signal import ForceSignal, force_signal
from kolsky.base.arrays import FloatArray
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
    share: float = SHARE
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
        back = _at(channel_force("transmitted force", shot.force, given, values).signal, time)
        front = back
        if given.incident is not None:
            gauge = _at(channel_force("incident force", given.incident, given, values).signal, time)
            front = gauge
            if given.mass > 0.0:
                mass = values.get("flyer, mass", given.mass)
                front, entry = compensate_mass(
                    time, gauge, acceleration, Quantity("flyer, mass", mass, 0.0, "kg", "B"),
                    apply=given.switches["mass"], source="the flyer's motion",
                )  # fmt: skip
                log.add(_keyed(entry, "mass"))
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
        log.add(_keyed(radial, "radial inertia"))
        stress["one wave"], axial = correct_axial_inertia(
            stress["one wave"], second, specimen, apply=given.switches["axial inertia"]
        )
        log.add(_keyed(axial, "axial inertia"))
        if axial.applied:  # the other analyses lack other shares of it
            change = axial_by_analysis(second.value, specimen, 0.0)
            stress["two waves"] = _raised(stress["two waves"], change["two waves"])
            corrected = _raised(corrected, change["three waves"])
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


def channel_force(
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


def _raised(history: History, change: FloatArray) -> History:
    return History(history.value + change, history.sigma, history.unit)


def _scaled(history: History, factor: float) -> History:
    unit = {"N": "Pa", "1/s": "m/s"}[history.unit]
    return History(factor * history.value, factor * history.sigma, unit)


def _keyed(entry: Correction, key: str) -> Correction:
    """The entry under the switch that the shot file knows."""
    return Correction(entry.name, key, entry.applied, entry.size, entry.rms, entry.unit, entry.reason)
