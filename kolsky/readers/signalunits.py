"""Units as instruments write them."""

import re
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.text import matched

_PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6}
_WORDS = {
    "volt": "V", "volts": "V", "millivolt": "mV", "millivolts": "mV", "microvolts": "uV",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sekunden": "s", "sekunde": "s",
    "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "µsec": "us", "microsecond": "us", "microseconds": "us",
    "nsec": "ns", "nanosecond": "ns", "nanoseconds": "ns",
    "newton": "N", "newtons": "N", "pascal": "Pa", "ampere": "A", "amp": "A", "amps": "A",
    "strain": "1", "m/m": "1", "ustrain": "uε", "microstrain": "uε", "microstrains": "uε", "µstrain": "uε",
    "μstrain": "uε", "micro strain": "uε", "με": "uε", "µε": "uε", "ue": "uε", "µe": "uε", "μe": "uε",
    "um/m": "uε", "µm/m": "uε", "μm/m": "uε", "mm/m": "mε", "millistrain": "mε", "me": "mε", "%": "%",
}  # fmt: skip
_BASES = {"V": "V", "s": "s", "N": "N", "Pa": "Pa", "A": "A", "C": "C", "ε": "1", "m/s": "m/s"}
_PLAIN = {"1": ("1", 1.0), "-": ("1", 1.0), "%": ("1", 1e-2), "m/s^2": ("m/s^2", 1.0), "m/s²": ("m/s^2", 1.0)}
_BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]+?)\s*[)\]]\s*")
_SLASH = re.compile(r"(.*\S)\s*/\s*(\S+)")
_TAIL = re.compile(r"(.*?[^\s_,])(?:_|\s*,\s*|\s+in\s+)([A-Za-zµμε%]+)")
"""A unit behind a last underscore, a comma or "in": time_s, "CH1, mV", "Zeit in ms"."""
_TIME_WORDS = re.compile(r"(.*[\s_])?(time|timestamp|zeit|temps|tiempo|tempo|t)", re.IGNORECASE)
_TAIL_UNITS = re.compile(r"([mµμuk]?V|[mk]?N|[kM]?Pa|(?:micro|[mµμu])?strain|[mµμu]?ε|volts?|millivolts?)")
"""Units that a tail may name in any column; of times they are those of time. CH_A is no current."""


def si_unit(text: str) -> tuple[str, float] | None:
    """The SI unit and the factor to it of a unit as instruments write it; None if it is not known.

    "mV" is ("V", 1e-3), "Volts" ("V", 1.0), "µs" ("s", 1e-6).
    """
    plain = text.strip().strip("()[]").strip()
    plain = _WORDS.get(plain.lower(), plain)
    if plain in _PLAIN:
        return _PLAIN[plain]
    for base, unit in _BASES.items():
        prefix = plain.removesuffix(base)
        if plain.endswith(base) and prefix in _PREFIXES:
            return unit, _PREFIXES[prefix]
    return None


def split_unit(heading: str) -> tuple[str, str | None]:
    """Name and unit of a column heading; None without a unit.

    "CH1 (mV)", "Time [s]", "Time/s", and by its last word "time_s", "strain_microstrain", "Zeit in ms".
    """
    match = matched(_BRACKETS, heading) or matched(_SLASH, heading)
    if match is not None and si_unit(match.group(2)) is not None:
        return match.group(1).strip(), match.group(2)
    tail = matched(_TAIL, heading.strip())
    if tail is not None and (known := si_unit(tail.group(2))) is not None:
        name, unit = tail.groups()
        of_time = known[0] == "s" and _TIME_WORDS.fullmatch(name) is not None
        if of_time or _TAIL_UNITS.fullmatch(unit) is not None:
            return name, unit
    return heading.strip(), None


def time_factor(path: Path, unit: str | None, what: str) -> float:
    """Seconds per unit of a time.

    Raises
    ------
    InputError
        If the unit is not stated or is no unit of time.
    """
    if unit is None:
        raise InputError(path, f"{what} has no unit", cure='say it in the layout: time_unit = "s"')
    known = si_unit(unit)
    if known is None or known[0] != "s":
        raise InputError(
            path,
            f"{what} has the unit '{unit}'",
            allowed='a unit of time: "s", "ms", "us", "ns"',
            cure='say it in the layout: time_unit = "s"',
        )
    return known[1]
