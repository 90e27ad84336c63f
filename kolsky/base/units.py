"""Written-out quantities ("9.5 mm") to SI floats, and times back to text.

No other module uses Pint.
"""

import math
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

DIMENSIONS = {
    "m": ("a length", "9.5 mm"),
    "s": ("a time", "25 us"),
    "V": ("a voltage", "1 V"),
    "Pa": ("a stress", "190 GPa"),
    "m^2": ("an area", "12 mm^2"),
    "kg/m^3": ("a mass density", "870 kg/m^3"),
    "V/N": ("volts per force", "0.0112 V/N"),
    "1/s": ("a rate", "10 1/s"),
    "1/V": ("strain per volt", "0.0005 1/V"),
    "m/s": ("a velocity", "5188 m/s"),
    "ohm": ("a resistance", "350 ohm"),
    "kg": ("a mass", "7.1 g"),
    "N": ("a force", "12 N"),
    "m/N": ("a compliance", "0.2 um/N"),
    "N/m": ("a stiffness", "5e8 N/m"),
    "Pa/m": ("a stress per length", "1e13 Pa/m"),
    "1/Pa": ("a compressibility", "1.15 1/MPa"),
    "rad": ("an angle", "0.2 deg"),
    "V/s": ("a drift", "0.5 V/s"),
    "1": ("a plain ratio", "0.2 %"),
}
"""Quantities of this package: SI unit -> (dimension in words, an example)."""

USUAL = {
    "m": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
    "V": {"V": 1.0, "mV": 1e-3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "kg/m^3": {"kg/m^3": 1.0},
    "V/N": {"V/N": 1.0},
    "1/s": {"1/s": 1.0},
    "m/s": {"m/s": 1.0},
    "kg": {"kg": 1.0, "g": 1e-3},
    "N": {"N": 1.0},
    "1": {"": 1.0, "1": 1.0, "%": 1e-2},
}
"""SI unit -> common units of shots, with Pint's factors. Loading Pint takes half a second. It is used only
for other units."""
LARGEST = 1e30
"""Largest accepted magnitude of a number, in any unit. Its inverse is the smallest nonzero one. Measured
values lie far inside. Squares and products of such numbers are finite."""
LONGEST = 200
"""Longest text that is read as a quantity or a unit [characters]."""
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)
# Pint evaluates whole expressions, even towers of powers. A unit consists of names, small powers, "*" and
# "/".
_NAME = r"(?:1|[A-Za-zµμΩ%°]+(?:(?:\^|\*\*)[+-]?\d{1,2})?)"
_UNIT = re.compile(rf"\s*(?:{_NAME}(?:(?:\s*[*/]\s*|\s+){_NAME}){{0,8}})?\s*")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺−·⋅∙", "0123456789-+-***")
"""Raised digits, signs and dots between units as plain characters."""
_POWER = re.compile(r"([A-Za-zµμΩ])([+-]?\d)(?![\w.])")
"""A power directly behind a unit: "cm2", "s-1"."""
_DOT = re.compile(r"(?<=[A-Za-zµμ0-9])\.(?=[A-Za-zµμ])")
"""A dot between two units: "kgf.cm-2"."""
_SPELLINGS = {
    "kp": "kgf", "kgf": "kgf", "gf": "gf", "lbf": "lbf", "kn": "kN", "newton": "N", "newtons": "N",
    "psi": "psi", "ksi": "ksi", "bar": "bar", "mbar": "mbar", "kpa": "kPa", "gpa": "GPa",
    "pascal": "Pa", "pascals": "Pa", "strain": "strain",
}  # fmt: skip
"""Pint's spelling of units in lower case. It contains only units with a meaning that does not depend on the
case; "mpa" is not one."""
_CAPITALS = {"MPA": "MPa", "MM": "mm", "ε": "strain", "µε": "microstrain", "με": "microstrain"}
"""Pint's spelling of units that are case-sensitive."""
_WORD = re.compile(r"[A-Za-zµμε]+")


class UnitError(ValueError):
    """A text is not a quantity of the expected dimension.

    Its message names the text, the expected dimension and an example.
    """

    def __init__(self, text: object, problem: str, unit: str) -> None:
        self.problem = problem
        self.expected, self.example = DIMENSIONS[unit]
        super().__init__(f"{text!r} {problem}; expected {self.expected}, e.g. {self.example!r}")


@lru_cache(maxsize=1)
def _registry() -> "pint.UnitRegistry":
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=256)
def unit_factor(text: str, unit: str) -> float:
    """SI units in one of the written units, e.g. 1e-3 for "mm".

    ``text``: a unit without a number, e.g. "mm", "kg/m^3", "%", "1". ``unit``: the expected SI unit, a key of
    `DIMENSIONS`. Raises UnitError if the text is not a unit, or if its unit has another dimension.
    """
    if text in USUAL.get(unit, {}):
        return USUAL[unit][text]
    import pint

    plain = _pint_text(text) if len(text) <= LONGEST else text
    if len(text) > LONGEST or not _UNIT.fullmatch(plain):
        raise UnitError(text, "is not a unit", unit)
    try:
        written = _registry().Quantity(1.0, _registry().parse_units(plain))
        factor = float(written.to(unit if unit != "1" else "dimensionless").magnitude)
    except pint.DimensionalityError:
        raise UnitError(text, f"is {_in_words(written)}", unit) from None
    except pint.UndefinedUnitError:
        raise UnitError(text, "is not a known unit", unit) from None
    except (pint.PintError, ValueError, ArithmeticError, AssertionError):  # pint asserts on "dB%"
        raise UnitError(text, "is not a unit", unit) from None
    if not 1e-40 < factor < 1e40:  # no laboratory unit lies outside
        raise UnitError(text, "is not a usable unit", unit)
    return factor


def _pint_text(text: str) -> str:
    """A unit as machines print it, e.g. "kgf/cm2", "N·mm⁻²", "kgf.cm-2", "PSI", as Pint reads it."""

    def spelled(match: re.Match[str]) -> str:
        word = match[0]
        return _CAPITALS.get(word) or _SPELLINGS.get(word.lower(), word)

    plain = _WORD.sub(spelled, text.translate(_RAISED))
    return _DOT.sub("*", _POWER.sub(r"\1^\2", plain))


SHOT_KINDS = ("s", "m", "V", "Pa", "N", "1")
"""SI units of the values in the tables of a shot."""


def dimension_of(unit: str, kinds: Iterable[str] = SHOT_KINDS) -> str:
    """The first of some SI units that has the dimension of a written unit. Empty if none has it."""
    written, kinds = "1" if unit == "-" else unit, tuple(kinds) if unit else ()
    usual = next((kind for kind in kinds if written in USUAL.get(kind, {})), "")
    for kind in () if usual else kinds:
        try:
            unit_factor(written, kind)
        except UnitError:
            continue
        return kind
    return usual


def quantity(text: str, unit: str) -> float:
    """A written-out quantity in SI.

    ``text``: number and unit, e.g. "9.5 mm". It has one number and one unit; expressions are not evaluated.
    ``unit``: the expected SI unit, a key of `DIMENSIONS`. Returns: the value in `unit`. Raises UnitError if
    the text is not a number with a unit of that dimension, or is not finite. The same error is raised if it
    is larger than `LARGEST`, or closer to zero than its inverse but not zero.
    """
    if not isinstance(text, str):
        raise UnitError(text, "has no unit", unit)
    match = _NUMBER.fullmatch(text) if len(text) <= LONGEST else None
    if match is None:
        raise UnitError(text, "is not a number with a unit", unit)
    number, written = match.groups()
    if not written and unit != "1":
        raise UnitError(text, "has no unit", unit)
    try:
        value = _times(float(number), unit_factor(written, unit))
    except UnitError as error:
        other_dimension = not error.problem.startswith("is not")
        problem = error.problem if other_dimension else f"has the unit {written!r}, which {error.problem}"
        raise UnitError(text, problem, unit) from None
    if not math.isfinite(value):
        raise UnitError(text, "is not a finite number", unit)
    if value and not 1.0 / LARGEST <= abs(value) <= LARGEST:
        raise UnitError(text, "has a size that nothing measured has", unit)
    return value


def in_us(seconds: float) -> str:
    """A time [s] in the form that a user writes, e.g. "25 us".

    Large clock readings have the form "58.300025000 s".
    """
    return f"{seconds * 1e6:.7g} us" if abs(seconds) < 1.0 else f"{seconds:.9f} s"


def _times(number: float, factor: float) -> float:
    """The product. Division by 1e6 rounds once, multiplication by 1e-6 rounds twice: 25 us is 2.5e-5 s."""
    inverse = round(1.0 / factor) if factor < 1.0 else 0
    return number / inverse if inverse and 1.0 / inverse == factor else number * factor


def _in_words(written: "pint.Quantity[float]") -> str:
    """The dimension of a quantity: its name if this package knows it, otherwise base units."""
    for unit, (words, _) in DIMENSIONS.items():
        if written.is_compatible_with("dimensionless" if unit == "1" else unit):
            return words
    return f"in {written.to_base_units().units:~C}"
