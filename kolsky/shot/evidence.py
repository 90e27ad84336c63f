"""Evidence on a shot's inputs for the plausibility rules, and units or factors that would correct them."""

import math
from collections.abc import Iterator, Mapping
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
"""Units that are proposed as a correction, by SI unit."""
UNIT_FACTORS = (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)
"""Factors of wrong unit prefixes: ms for s, MPa for kPa, g/cm^3 for kg/m^3."""
LENGTH_FACTORS = (2.0, 0.5, 25.4, 1.0 / 25.4, *UNIT_FACTORS)
"""Factors of wrong lengths: radius for diameter, inches for millimetres, and prefixes."""


Finding = tuple[InputError, bool]
"""A finding of a rule as an error, and True for a contradiction, which rejects the shot, not a warning."""


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """The data of a shot that have been read so far. A rule without its data has no result."""

    file: TomlFile
    """The shot file, for keys, lines and values as written."""
    declared: Any
    """Its declared values, in SI."""
    frame_time: FloatArray | None = None
    """Times of the frames [s], shape [n]."""
    force_time: FloatArray | None = None
    """Times of the force's samples [s], shape [k]."""
    force: FloatArray | None = None
    """Force, compression-positive [N], shape [k]."""
    force_noise: float = 0.0
    """Standard deviation of a sample [N]."""
    rest: float | None = None
    """Time of the last static frame [s]; all times in this class use the same clock."""
    flyer_time: FloatArray | None = None
    """Times of the flyer's displacements [s], shape [n]."""
    travel: FloatArray | None = None
    """The flyer's displacement from rest [m], shape [n]."""
    outline: CentreLine | None = None
    """The outline, at rest and during the test."""
    curve: MaterialCurve | None = None
    """The quasi-static curve."""
    recorders: Mapping[str, FloatArray] = field(default_factory=dict)
    """Times of the samples of bars' recorders by the recorder's key [s], shape [k] each."""
    bar_transit: float = 0.0
    """Transit time of a wave through the shorter bar [s]."""

    def finding(
        self, key: str, problem: str, *, cure: str, allowed: str | None = None, contradiction: bool = True
    ) -> Finding:
        """The finding of a rule at a key."""
        return self.file.error(key, problem, allowed=allowed, cure=cure), contradiction


def entries(content: Mapping[str, Any], key: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted key and value of every table and key of a TOML file, as written."""
    for name, value in content.items():
        dotted = f"{key}.{name}" if key else name
        yield dotted, value
        if isinstance(value, Mapping):
            yield from entries(value, dotted)


def missing_files(file: TomlFile, names: Mapping[str, str]) -> list[InputError]:
    """An error for every file that does not exist. ``names``: dotted key -> file name."""
    places = {key: file.path.parent / name for key, name in names.items()}
    return [
        file.error(key, f"names a missing file: {place}", cure="put it there or correct its name")
        for key, place in places.items()
        if not place.exists()
    ]


def fitting_factor(ratio: float, factors: tuple[float, ...], *, tolerance: float) -> float | None:
    """The factor by which a ratio becomes 1 within a tolerance [-]; None if there is none."""
    nearest = min(factors, key=lambda factor: abs(ratio * factor - 1.0))
    return nearest if abs(ratio * nearest - 1.0) <= tolerance else None


def power_of_1000(ratio: float) -> float:
    """The power of 1000 that brings a ratio nearest to 1: 1e3 for 0.0005."""
    return float(10.0 ** (-3 * round(math.log10(ratio) / 3.0)))


def fitting_unit(written: str, si: str, factor: float) -> str | None:
    """The unit `factor` times as large as a written one, e.g. "MPa" for "kPa" and 1000; None if unknown."""
    try:
        wanted = factor * unit_factor(written, si)
    except UnitError:
        return None
    return next((name for name in SCALES[si] if abs(unit_factor(name, si) / wanted - 1.0) < 1e-6), None)


def unit_cure(
    file: TomlFile, key: str, si: str, factor: float, span: tuple[float, float] = (0.0, math.inf)
) -> str:
    """A sentence that proposes the correct unit of a column, or the correct value of a key.

    It is empty if no unit fits, or if the value [SI] would be outside ``span``.
    """
    written = file.written(f"{key}.unit")
    if isinstance(written, str):
        unit = fitting_unit(written, si, factor)
        return "" if unit is None else f'{key}.unit = "{unit}" in place of "{written}" would fit'
    text = file.written(key)
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
    """The likely causes in the given order, as one text without empty sentences."""
    return "; or ".join(sentence for sentence in sentences if sentence)
