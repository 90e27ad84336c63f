"""The whole test in one dimension: striker, pulse shaper, incident bar, joint, flyer, transmission side."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from explicit.bars.contacts import Joint, JointContact, PulseShaper, ShaperContact
from explicit.bars.lines import LineHistory, WaveLine
from explicit.bars.sections import Section


@dataclass(frozen=True)
class Apparatus:
    """Striker, bars, flyer and specimen, left to right."""

    striker: tuple[Section, ...]
    """The striker."""
    speed: float
    """Its velocity at impact [m/s]."""
    shaper: PulseShaper | None
    """What lies between striker and incident bar; None is face on face."""
    incident: tuple[Section, ...]
    """The incident bar."""
    joint: Joint
    """What holds the flyer to the incident bar."""
    flyer: tuple[Section, ...]
    """Transducer and platen, the specimen's side last."""
    transmission: tuple[Section, ...]
    """Platen, transducer and bar behind the specimen, the specimen's side first."""

    def __post_init__(self) -> None:
        if not 0.0 < self.speed < np.inf:
            raise ValueError(f"speed of the striker must be > 0 m/s and finite, got {self.speed}")


@dataclass(frozen=True)
class SpecimenForce:
    """Force of the specimen on both platens: a static curve, and the rest over time."""

    compression: FloatArray
    """Approach of the platens [m], ascending, shape [n]."""
    force: FloatArray
    """Compressive force there [N], shape [n]; linear between, constant outside."""
    excess_flyer: FloatArray
    """Added to the force on the flyer at every step [N], shape [n_times]."""
    excess_transmission: FloatArray
    """Added to the force on the transmission platen at every step [N], shape [n_times]."""


@dataclass(frozen=True)
class FlightHistory:
    """Motion and force of every part, at every step from the impact of the striker on."""

    times: FloatArray
    """Times since the striker touched [s], shape [n_times]."""
    striker: LineHistory
    """Waves in the striker."""
    incident: LineHistory
    """Waves in the incident bar."""
    flyer: LineHistory
    """Waves in the flyer."""
    transmission: LineHistory
    """Waves on the transmission side."""
    shaper_force: FloatArray
    """Compressive force between striker and incident bar [N], shape [n_times]."""
    shaper_approach: FloatArray
    """Approach of the faces there [m], shape [n_times]; a gap is negative."""
    joint_force: FloatArray
    """Compressive force between incident bar and flyer [N], shape [n_times]; tension is negative."""
    joint_gap: FloatArray
    """Gap there [m], shape [n_times]."""
    force_flyer: FloatArray
    """Force of the flyer on the specimen [N], shape [n_times]."""
    force_transmission: FloatArray
    """Force of the specimen on the transmission platen [N], shape [n_times]."""
    flyer_path: FloatArray
    """Displacement of the flyer's face toward the specimen [m], shape [n_times]."""
    flyer_velocity: FloatArray
    """Its velocity [m/s], shape [n_times]."""
    support_path: FloatArray
    """Displacement of the transmission platen's face, away from the specimen [m], shape [n_times]."""
    support_velocity: FloatArray
    """Its velocity [m/s], shape [n_times]."""

    @property
    def compression(self) -> FloatArray:
        """Approach of the platens [m], shape [n_times]."""
        return self.flyer_path - self.support_path


def integrate_test(
    apparatus: Apparatus, *, end: float, step: float, specimen: SpecimenForce | None = None
) -> FlightHistory:
    """March the bars from the striker's touch.

    Parameters
    ----------
    apparatus
        The bars and what is between them.
    end : float
        Last time [s].
    step : float
        Time step [s]; travel times of the sections are rounded to it.
    specimen : SpecimenForce, optional
        What the specimen does; nothing if left out.

    Raises
    ------
    ValueError
        If the step is too long for a section, or the specimen's excess does not fit the steps.
    """
    n_times = round(end / step) + 1
    striker = WaveLine(apparatus.striker, step=step, n_times=n_times, velocity=apparatus.speed)
    incident, flyer, transmission = (
        WaveLine(sections, step=step, n_times=n_times)
        for sections in (apparatus.incident, apparatus.flyer, apparatus.transmission)
    )
    lines = (striker, incident, flyer, transmission)
    direct = JointContact(Joint(0.0), step)
    shaper = direct if apparatus.shaper is None else ShaperContact(apparatus.shaper, step)
    joint = JointContact(apparatus.joint, step)
    first = 1.0 / striker.impedances[-1] + 1.0 / incident.impedances[0]
    second = 1.0 / incident.impedances[-1] + 1.0 / flyer.impedances[0]
    if specimen is not None and not (
        len(specimen.excess_flyer) == len(specimen.excess_transmission) == n_times
    ):
        raise ValueError(f"the specimen's excess needs one value at each of {n_times} steps")
    record = np.zeros((10, n_times))
    x_f = v_f = x_t = v_t = 0.0
    for n in range(n_times):
        for line in lines:
            line.meet_inside(n)
        push = shaper.force(striker.free_velocity(n, -1) - incident.free_velocity(n, 0), first)
        hold = joint.force(incident.free_velocity(n, -1) - flyer.free_velocity(n, 0), second)
        on_flyer = on_support = 0.0
        if specimen is not None:
            # The static curve answers the positions of this step to first order: it is far softer than steel.
            static = float(np.interp(x_f - x_t + step * (v_f - v_t), specimen.compression, specimen.force))
            on_flyer = static + specimen.excess_flyer[n]
            on_support = static + specimen.excess_transmission[n]
        striker.load(n, 0, 0.0)
        striker.load(n, -1, push)
        incident.load(n, 0, push)
        incident.load(n, -1, hold)
        flyer.load(n, 0, hold)
        transmission.load(n, -1, 0.0)
        before_f, before_t = v_f, v_t
        v_f, v_t = flyer.load(n, -1, on_flyer), transmission.load(n, 0, on_support)
        if n:
            x_f += 0.5 * step * (before_f + v_f)
            x_t += 0.5 * step * (before_t + v_t)
        approach = -shaper.gap if isinstance(shaper, JointContact) else shaper.approach
        record[:, n] = push, approach, hold, joint.gap, on_flyer, on_support, x_f, v_f, x_t, v_t
    times = step * np.arange(n_times, dtype=np.float64)
    waves = [line.history() for line in lines]
    return FlightHistory(times, waves[0], waves[1], waves[2], waves[3], *record)
