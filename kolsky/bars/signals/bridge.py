"""Wheatstone bridges: volts to strain with the exact formula, its inverse, and the shunt calibration.

A shunt calibration gives gain, excitation and sign from the measured step of a known resistance.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dic.basics import check_interval
from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray

Arms = tuple[float, float, float, float]

AXIAL, ACROSS, REST = "axial", "across", "rest"
KINDS: Mapping[str, tuple[str, str, str, str]] = {
    "quarter": (AXIAL, REST, REST, REST),
    "half, opposed": (AXIAL, REST, AXIAL, REST),
    "half, Poisson": (AXIAL, ACROSS, REST, REST),
    "full, Poisson": (AXIAL, ACROSS, AXIAL, ACROSS),
}
"""Strain of arms 1 to 4, in their order around the bridge. Arms 1 and 3 are opposite to each other.

"half, opposed" and "full, Poisson" have the gauges of arms 1 and 3 on opposite sides of the bar, which
cancels bending. The other arrangements measure bending too. Gauges in series in one arm count as one gauge
that measures their mean.
"""


@dataclass(frozen=True)
class Bridge:
    """A strain-gauge bridge of four equal resistances, its supply and its amplifier.

    Raises ValueError if the kind is unknown, if a value is impossible, or if Poisson's ratio is missing or
    without effect.
    """

    kind: str
    """Arrangement of the gauges in the arms, a key of `KINDS`."""
    gauge_factor: float
    """Relative change of resistance per strain [-], > 0."""
    excitation: float
    """Supply voltage at the bridge [V], > 0."""
    gain: float = 1.0
    """Recorded volts per volt of the bridge's output [-], > 0."""
    poisson: float | None = None
    """Poisson's ratio of the bar [-], for arrangements with a transverse gauge."""
    gauge_resistance: float = 120.0
    """Resistance of a gauge [ohm]."""
    lead_resistance: float = 0.0
    """Resistance in series with a gauge inside its arm [ohm]: that of one lead with three wires, of both
    leads with two."""

    UNIT: ClassVar[str] = "V"
    WORDS: ClassVar[Mapping[str, tuple[str, str]]] = {
        "gauge_factor": ("gauge factor", "1"),
        "excitation": ("excitation", "V"),
        "gain": ("gain", "1"),
        "poisson": ("Poisson's ratio", "1"),
        "gauge_resistance": ("gauge resistance", "ohm"),
        "lead_resistance": ("lead resistance", "ohm"),
    }

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"bridge kind must be one of {_listed(KINDS)}, got {self.kind!r}")
        check_interval("(0, inf)", gauge_factor=self.gauge_factor, excitation=self.excitation, gain=self.gain)
        check_interval("(0, inf) ohm", gauge_resistance=self.gauge_resistance)
        check_interval("[0, inf) ohm", lead_resistance=self.lead_resistance)
        across = ACROSS in KINDS[self.kind]
        if across and (self.poisson is None or not 0.0 <= self.poisson < 0.5):
            raise ValueError(f"a bridge '{self.kind}' needs poisson in [0, 0.5), got {self.poisson}")
        if not across and self.poisson is not None:
            raise ValueError(
                f"a bridge '{self.kind}' has no gauge across, so poisson has no effect; remove it"
            )

    @property
    def arms(self) -> Arms:
        """Strain of arms 1 to 4 per axial strain [-]."""
        seen = {AXIAL: 1.0, ACROSS: -(self.poisson or 0.0), REST: 0.0}
        a, b, c, d = (seen[what] for what in KINDS[self.kind])
        return a, b, c, d

    @property
    def arm_factor(self) -> float:
        """Gauge factor of an arm with its leads, Eq. (U.3) [-]."""
        return self.gauge_factor * self.gauge_resistance / (self.gauge_resistance + self.lead_resistance)

    @property
    def strain_per_volt(self) -> float:
        """Strain per recorded volt for small strains, Eq. (U.4) [1/V]."""
        s = self.arms
        return 4.0 / ((s[0] - s[1] + s[2] - s[3]) * self.arm_factor * self.excitation * self.gain)

    def strain(self, volts: ArrayLike) -> FloatArray:
        """Strain of the bar, tension positive, Eq. (U.2). The recorded volts must increase in tension.

        ``volts``: recorded volts above rest [V], any shape. Raises ValueError if no strain gives such an
        output.
        """
        V = np.asarray(volts, dtype=float)
        e = V / (self.gain * self.excitation)
        s1, s2, s3, s4 = self.arms
        A, B, C, D = s1 + s2, s3 + s4, s1 - s2 + s3 - s4, s1 * s3 - s2 * s4
        slope = C - 2.0 * e * (A + B)
        under = slope**2 - 16.0 * e * (e * A * B - D)
        bottom = slope + np.sqrt(np.maximum(under, 0.0))  # a negative value raises an error below
        with np.errstate(divide="ignore", invalid="ignore"):
            x = 8.0 * e / bottom
            possible = (under >= 0.0) & (bottom > 0.0)
            for s in (s1, s2, s3, s4):
                possible &= 1.0 + s * x > 0.0
        if not possible.all():
            worst = float(V[~possible].flat[0])
            raise ValueError(
                f"no strain gives {worst:.6g} V with a bridge '{self.kind}', gain {self.gain:g} and"
                f" excitation {self.excitation:g} V: a resistance would be negative; correct them"
            )
        return np.asarray(x / self.arm_factor)

    def linear_strain(self, volts: ArrayLike) -> FloatArray:
        """Strain with the slope at zero, which most instruments assume."""
        return self.strain_per_volt * np.asarray(volts, dtype=float)

    def volts(self, strain: ArrayLike) -> FloatArray:
        """Recorded volts of a strain, tension positive, Eq. (U.1) [V]. It is the inverse of `strain`."""
        return self.gain * self.excitation * self.ratio(self.arm_factor * np.asarray(strain, dtype=float))

    def ratio(self, x: FloatArray) -> FloatArray:
        """Output over excitation, Eq. (U.1), if axial gauges change by the share `x` [-]."""
        s1, s2, s3, s4 = self.arms
        return (1.0 + s1 * x) / (2.0 + (s1 + s2) * x) - (1.0 + s4 * x) / (2.0 + (s3 + s4) * x)

    def quantities(
        self, gauge: str, uncertainty: Mapping[str, float], *, bar: str | None = None
    ) -> list[Quantity]:
        """Inputs of the strain, for a budget.

        ``gauge``: name of the gauge, e.g. "incident gauge"; prefix of the names. ``uncertainty``: standard
        uncertainties (k = 1, SI) by field. A field without an uncertainty is listed with 0. ``bar``: name of
        the bar, prefix of the name of Poisson's ratio. Raises ValueError if an uncertainty is given for a
        field without effect.
        """
        used = self._fields()
        check_fields(uncertainty, used, f"a bridge '{self.kind}'")
        return [
            Quantity(
                self._name(f, gauge, bar), getattr(self, f), uncertainty.get(f, 0.0), self.WORDS[f][1], "B"
            )
            for f in used
        ]

    def with_values(self, gauge: str, values: Mapping[str, float], *, bar: str | None = None) -> "Bridge":
        """The bridge with other values of its `quantities`, by their names. The other values do not
        change.
        """
        names = {f: self._name(f, gauge, bar) for f in self._fields()}
        changed: dict[str, Any] = {f: values[name] for f, name in names.items() if name in values}
        return replace(self, **changed)

    def _fields(self) -> list[str]:
        used = ["gauge_factor", "excitation", "gain"]
        if self.poisson is not None:
            used.append("poisson")
        return used + (["gauge_resistance", "lead_resistance"] if self.lead_resistance > 0.0 else [])

    def _name(self, field: str, gauge: str, bar: str | None) -> str:
        owner = bar if field == "poisson" and bar is not None else gauge
        return f"{owner}, {self.WORDS[field][0]}"


@dataclass(frozen=True)
class Linear:
    """A declared factor from recorded values to strain, e.g. from a calibration of the whole chain.

    Raises ValueError if the factor is not finite and positive.
    """

    factor: float
    """Strain per recorded unit [1/unit], > 0. The sign is that of the declared compression."""
    unit: str = "V"
    """Unit of the recording: "V", or "1" if it is already strain."""

    def __post_init__(self) -> None:
        check_interval("(0, inf)", **{"calibration factor": self.factor})  # its sign is declared separately

    @property
    def UNIT(self) -> str:
        """Unit that a recording must have."""
        return self.unit

    def strain(self, volts: ArrayLike) -> FloatArray:
        """Strain, tension positive, of values that increase in tension."""
        return self.factor * np.asarray(volts, dtype=float)

    def quantities(
        self, gauge: str, uncertainty: Mapping[str, float], *, bar: str | None = None
    ) -> list[Quantity]:
        """The factor, for a budget; see `Bridge.quantities`.

        Raises ValueError if an uncertainty belongs to another field.
        """
        check_fields(uncertainty, ["factor"], "a calibration factor")
        unit = "1/V" if self.unit == "V" else "1"
        return [Quantity(f"{gauge}, strain per volt", self.factor, uncertainty.get("factor", 0.0), unit, "B")]

    def with_values(self, gauge: str, values: Mapping[str, float], *, bar: str | None = None) -> "Linear":
        """The calibration with another factor, if `values` names it."""
        return replace(self, factor=values.get(f"{gauge}, strain per volt", self.factor))


Calibration = Bridge | Linear


def check_fields(uncertainty: Mapping[str, float], used: list[str], owner: str) -> None:
    """Reject uncertainties of fields that have no effect, and impossible values.

    Raises ValueError. The message names the field and the fields with an effect.
    """
    for field, sigma in uncertainty.items():
        if field not in used:
            raise ValueError(f"uncertainty of {field!r} has no effect on {owner}; allowed: {_listed(used)}")
        check_interval("[0, inf)", **{f"standard uncertainty of {field}": sigma})


def _listed(names: Mapping[str, object] | list[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)


@dataclass(frozen=True)
class Shunt:
    """A resistance connected across one arm of a bridge, and the recorded step."""

    resistance: float
    """Resistance of the shunt [ohm], > 0."""
    step: float
    """Recorded volts with the shunt minus those without it [V], with their sign, not 0."""
    arm: int = 1
    """The arm with the shunt, 1 to 4; see `kolsky.bars.signals.bridge.KINDS`."""
    at_gauge: bool = False
    """True if it is connected across the gauge. False if it is connected across gauge and leads at the
    instrument."""
    resistance_sigma: float = 0.0
    """Standard uncertainty of the shunt [ohm]."""
    step_sigma: float = 0.0
    """Standard uncertainty of the step [V]."""

    def __post_init__(self) -> None:
        check_interval("(0, inf) ohm", **{"shunt resistance": self.resistance})
        if not np.isfinite(self.step) or self.step == 0.0:
            raise ValueError(f"the step of a shunt must be finite and not 0 V, got {self.step}")
        if self.arm not in (1, 2, 3, 4):
            raise ValueError(f"the arm of a shunt must be 1, 2, 3 or 4, got {self.arm}")
        check_interval("[0, inf) ohm", **{"resistance_sigma of a shunt": self.resistance_sigma})
        check_interval("[0, inf) V", **{"step_sigma of a shunt": self.step_sigma})


@dataclass(frozen=True)
class ShuntCheck:
    """Gain and sign from a shunt calibration, compared with the declared values."""

    gain: float
    """Gain from the step with the declared excitation [-]."""
    gain_sigma: float
    """Its standard uncertainty from shunt and step [-]."""
    ratio: float
    """Measured product of gain and excitation divided by the declared one [-]."""
    compression_sign: int
    """Sign of the recorded volts under compression, from the sign of the step."""


def check_shunt(bridge: Bridge, shunt: Shunt) -> ShuntCheck:
    """Gain and sign of a measuring chain from the step of a shunt, Eq. (U.5).

    The step's size depends on resistances and not on the gauge factor. It is computed exactly.
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
    tension = 1 if shunt.step * output > 0.0 else -1
    return ShuntCheck(
        gain=gain, gain_sigma=float(gain * relative), ratio=gain / bridge.gain, compression_sign=-tension
    )


ALLOWANCE = 0.02
"""Largest relative difference of the measured and the declared gain [-]."""


def with_shunt(bridge: Bridge, shunt: Shunt) -> tuple[Bridge, ShuntCheck]:
    """The bridge with the gain from a shunt calibration.

    Raises ValueError if measured and declared gain differ by more than `ALLOWANCE`: one of them is wrong.
    """
    found = check_shunt(bridge, shunt)
    if abs(found.ratio - 1.0) > ALLOWANCE:
        raise ValueError(
            f"the shunt of {shunt.resistance:g} ohm gives gain x excitation ="
            f" {found.gain * bridge.excitation:.6g} V, stated are {bridge.gain * bridge.excitation:.6g} V: a"
            f" ratio of {found.ratio:.4g}, allowed is 1 within {ALLOWANCE:g}; correct the shunt, its arm, the"
            " gain or the excitation"
        )
    return replace(bridge, gain=found.gain), found


def _output(R: float, lead: float, shunt: Shunt) -> float:
    """Output over excitation with the shunt. Other arms are at rest, with leads as long as the gauge's."""
    if shunt.at_gauge:
        x = -R / (R + shunt.resistance) * R / (R + lead)
    else:
        x = -(R + lead) / (R + lead + shunt.resistance)
    sign = 1.0 if shunt.arm in (1, 3) else -1.0
    return sign * x / (2.0 * (2.0 + x))
