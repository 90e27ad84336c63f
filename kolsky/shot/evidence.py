"""What is known of a shot's inputs, and the units and factors that would fit where they contradict it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine, MaterialCurve
from kolsky.base.toml import TomlFile
from kolsky.base.units import UnitError, quantity, unit_factor

SCALES = {
    "m": ("um", "mm", "m", "in"),
    "s": ("ns", "us", "ms", "s"),
    "V": ("uV", "mV", "V", "kV"),
    "Pa": ("Pa", "kPa", "MPa", "GPa"),
    "kg/m^3": ("kg/m^3", "g/cm^3"),
    "V/N": ("uV/N", "mV/N", "V/N"),
    "1": ("1", "%"),
}
"""Units that are proposed in place of a wrong one, by their SI unit."""
UNIT_FACTORS = (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)
"""Errors of a prefix: ms for s, MPa for kPa, g/cm^3 for kg/m^3."""
LENGTH_FACTORS = (2.0, 0.5, 25.4, 1.0 / 25.4, *UNIT_FACTORS)
"""Errors of a length: radius for diameter, inches for millimetres, and prefixes."""


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What is known of a shot so far; a rule that needs more keeps silent."""

    file: TomlFile
    """The shot file, for keys, lines and values as written."""
    declared: Any
    """What it declares, in SI."""
    frame_time: FloatArray | None = None
    """Times of the frames [s], shape [n]."""
    force_time: FloatArray | None = None
    """Times of the force's samples [s], shape [k]."""
    force: FloatArray | None = None
    """Force, compression-positive [N], shape [k]."""
    force_noise: float = 0.0
    """Standard deviation of a sample [N]."""
    rest: float | None = None
    """Time of the last static frame, on the clock of all times here [s]."""
    flyer_time: FloatArray | None = None
    """Times of the flyer's displacements [s], shape [n]."""
    travel: FloatArray | None = None
    """The flyer's displacement from rest [m], shape [n]."""
    outline: CentreLine | None = None
    """The outline, at rest and after."""
    curve: MaterialCurve | None = None
    """The quasi-static curve."""
    recorders: Mapping[str, FloatArray] = field(default_factory=dict)
    """Times of the samples of bars' recorders by the recorder's key [s], shape [k] each."""
    bar_transit: float = 0.0
    """Time that a wave takes through the shorter bar [s]."""

    def finding(
        self, key: str, problem: str, *, cure: str, allowed: str | None = None, contradiction: bool = True
    ) -> "Finding":
        """What a rule found at a key."""
        return Finding(self.file.error(key, problem, allowed=allowed, cure=cure), contradiction)


@dataclass(frozen=True)
class Finding:
    """What a rule found."""

    error: InputError
    """Key, value, and what contradicts them."""
    contradiction: bool = True
    """Whether it is refused; else it is a warning."""


def fitting_factor(ratio: float, factors: tuple[float, ...], *, tolerance: float) -> float | None:
    """The factor that brings a ratio to 1 within a tolerance [-]; None if none does."""
    nearest = min(factors, key=lambda factor: abs(ratio * factor - 1.0))
    return nearest if abs(ratio * nearest - 1.0) <= tolerance else None


def power_of_1000(ratio: float) -> float:
    """The power of 1000 by which a ratio comes nearest to 1: 1e3 for 0.0005."""
    return float(10.0 ** (-3 * round(math.log10(ratio) / 3.0)))


def fitting_unit(written: str, si: str, factor: float) -> str | None:
    """The unit `factor` times as large as a written one: "MPa" for "kPa" and 1000; None if there is none."""
    try:
        wanted = factor * unit_factor(written, si)
    except UnitError:
        return None
    return next((name for name in SCALES[si] if abs(unit_factor(name, si) / wanted - 1.0) < 1e-6), None)


def written_value(file: TomlFile, key: str) -> Any:
    """What the file has at a dotted key, as written; None if nothing."""
    value: Any = file.content
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value


def unit_cure(
    file: TomlFile, key: str, si: str, factor: float, span: tuple[float, float] = (0.0, math.inf)
) -> str:
    """The sentence that names the unit of a column, or the value of a key, that would fit.

    It is empty if there is none, or the value [SI] would lie outside ``span``.
    """
    written = written_value(file, f"{key}.unit")
    if isinstance(written, str):
        unit = fitting_unit(written, si, factor)
        return "" if unit is None else f'{key}.unit = "{unit}" in place of "{written}" would fit'
    text = written_value(file, key)
    if not isinstance(text, str):
        return ""
    if not span[0] <= quantity(text, si) * factor <= span[1]:
        return ""
    number, _, unit_text = text.strip().partition(" ")
    unit = fitting_unit(unit_text, si, factor)
    if unit is not None:
        return f'{key} = "{number} {unit}" would fit'
    return f'{key} = "{quantity(text, si) * factor:.6g} {si}" would fit'


def likely_causes(*sentences: str) -> str:
    """The likely causes in their order."""
    return "; or ".join(sentence for sentence in sentences if sentence)
