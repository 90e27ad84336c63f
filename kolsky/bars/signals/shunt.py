"""Shunt calibration: gain, excitation and sign from the measured step of a known resistance."""

from dataclasses import dataclass, replace

import numpy as np

from kolsky.bars.signals.bridge import KINDS, REST, Bridge


@dataclass(frozen=True)
class Shunt:
    """A resistance laid across one arm of a bridge, and the step that was recorded.

    Raises
    ------
    ValueError
        If a value is impossible.
    """

    resistance: float
    """Resistance of the shunt [ohm], > 0."""
    step: float
    """Recorded volts with the shunt minus without [V], with their sign, not 0."""
    arm: int = 1
    """The arm it lies across, 1 to 4; see `kolsky.bars.signals.bridge.KINDS`."""
    at_gauge: bool = False
    """Across the gauge itself, not across gauge and leads at the instrument."""
    resistance_sigma: float = 0.0
    """Standard uncertainty of the shunt [ohm]."""
    step_sigma: float = 0.0
    """Standard uncertainty of the step [V]."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.resistance) and self.resistance > 0.0):
            raise ValueError(f"shunt resistance must be finite and > 0 ohm, got {self.resistance}")
        if not np.isfinite(self.step) or self.step == 0.0:
            raise ValueError(f"the step of a shunt must be finite and not 0 V, got {self.step}")
        if self.arm not in (1, 2, 3, 4):
            raise ValueError(f"the arm of a shunt must be 1, 2, 3 or 4, got {self.arm}")
        if not (self.resistance_sigma >= 0.0 and self.step_sigma >= 0.0):
            raise ValueError(
                f"uncertainties of a shunt must be >= 0, got {self.resistance_sigma} ohm, {self.step_sigma} V"
            )


@dataclass(frozen=True)
class ShuntCheck:
    """Gain and sign of a shunt calibration, beside the stated ones."""

    gain: float
    """Gain with the stated excitation, from the step [-]."""
    gain_sigma: float
    """Its standard uncertainty from shunt and step [-]."""
    ratio: float
    """Measured over stated product of gain and excitation [-]."""
    apparent_strain: float
    """Axial strain that the step stands for, tension positive [-]."""
    compression_sign: int
    """Sign of the recorded volts under compression, from the sign of the step."""


def check_shunt(bridge: Bridge, shunt: Shunt) -> ShuntCheck:
    """Gain and sign of a measuring chain from the step of a shunt, Eq. (U.5).

    The step's size depends on resistances only, not on the gauge factor, and is computed exactly.

    Raises
    ------
    ValueError
        If the shunt lies at a gauge that the arm does not have.
    """
    R, lead = bridge.gauge_resistance, bridge.lead_resistance
    if shunt.at_gauge and KINDS[bridge.kind][shunt.arm - 1] == REST:
        raise ValueError(
            f"arm {shunt.arm} of a bridge '{bridge.kind}' holds no gauge; a shunt cannot lie at it"
        )
    output = _output(R, lead, shunt)
    nudged = _output(R, lead, replace(shunt, resistance=shunt.resistance * 1.001))
    slope = (nudged - output) / (1e-3 * shunt.resistance)  # relative error of the slope: 1e-3
    gain = abs(shunt.step / output) / bridge.excitation
    relative = np.hypot(slope * shunt.resistance_sigma / output, shunt.step_sigma / shunt.step)
    volts = bridge.gain * bridge.excitation * output
    tension = 1 if shunt.step * output > 0.0 else -1
    return ShuntCheck(
        gain=gain,
        gain_sigma=float(gain * relative),
        ratio=gain / bridge.gain,
        apparent_strain=float(bridge.strain(volts)),
        compression_sign=-tension,
    )


def with_shunt(bridge: Bridge, shunt: Shunt, *, allowance: float = 0.02) -> tuple[Bridge, ShuntCheck]:
    """The bridge with the gain that a shunt measured.

    Parameters
    ----------
    bridge
        As stated.
    shunt
        What was measured.
    allowance
        Largest relative difference of measured and stated gain [-]. Beyond it one of them is a mistake.

    Raises
    ------
    ValueError
        If they disagree by more, or as `check_shunt`.
    """
    found = check_shunt(bridge, shunt)
    if abs(found.ratio - 1.0) > allowance:
        raise ValueError(
            f"the shunt of {shunt.resistance:g} ohm gives gain x excitation ="
            f" {found.gain * bridge.excitation:.6g} V, stated are {bridge.gain * bridge.excitation:.6g} V: a"
            f" ratio of {found.ratio:.4g}, allowed is 1 within {allowance:g}; correct the shunt, its arm, the"
            " gain or the excitation"
        )
    return replace(bridge, gain=found.gain), found


def _output(R: float, lead: float, shunt: Shunt) -> float:
    """Output over excitation with the shunt; other arms at rest, with leads as long as the gauge's."""
    if shunt.at_gauge:
        x = -R / (R + shunt.resistance) * R / (R + lead)
    else:
        x = -(R + lead) / (R + lead + shunt.resistance)
    sign = 1.0 if shunt.arm in (1, 3) else -1.0
    return sign * x / (2.0 * (2.0 + x))
