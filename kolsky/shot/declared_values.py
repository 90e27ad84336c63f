"""Plausibility rules for single declared values: units of columns, densities, bars, specimen size."""

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.units import UnitError, dimension_of, quantity, unit_factor
from kolsky.readers.header import heading_unit, si_unit, split_unit
from kolsky.readers.recordings import list_channels
from kolsky.shot.evidence import Evidence, Finding, entries, power_of_1000, unit_cure

LARGEST_TABLE = 1_000_000
"""Largest file read a second time for its units [bytes]. Tables of points have tens of thousands."""
DENSITIES = (10.0, 25_000.0)
"""Smallest and largest density of a solid [kg/m^3]. Smaller values are gases, or numbers in g/cm^3 (up to
10) declared as kg/m^3. Larger values exceed the densest metal (osmium, 22 600)."""
FOAM_DENSITY = 100.0
"""A solid below this density contains more than 90 % gas [kg/m^3]; the lightest solid polymer has 850."""
FOAM_POISSON = 0.45
"""Largest Poisson's ratio accepted for such a foam [-]. Measured values are near 0 and at most 0.35."""
BAR_DENSITY = 500.0
"""Smallest density of a bar [kg/m^3]: magnesium has 1 740, PMMA 1 180, wood 600."""
BAR_SPEEDS = (300.0, 20_000.0)
"""Smallest and largest wave speed of a bar [m/s]: polyethylene 700, PMMA 2 200, beryllium 12 900. If a
metal's modulus is 1000 times too small, its wave speed is at most 170."""
SPECIMEN_SIZES = (0.1e-3, 0.3)
"""Smallest and largest length or diameter of a specimen in a bar test [m]."""
SLENDERNESS = (0.02, 10.0)
"""Length divided by diameter [-]: thin discs of gels have 0.1, tensile specimens 3."""


def check_unit_of_heading(e: Evidence) -> Iterator[Finding]:
    """Check the unit in a column's heading, or in a line of units below it, against the declared unit."""
    for key, section in entries(e.file.content):
        column = section if isinstance(section, dict) else {}
        heading, declared = column.get("column"), column.get("unit")
        if not isinstance(heading, str) or not isinstance(declared, str):
            continue
        stated = heading_unit(heading) or split_unit(heading)[1] or _unit_in_file(e, key, heading)
        kind = dimension_of(declared)
        if stated is None or not kind:
            continue
        size = _size(stated, kind)
        if size is None and not dimension_of(stated) and si_unit(stated) is None:
            continue  # not a unit but a remark
        if size is None:
            message = f"is of another kind than the unit '{stated}' of the column '{heading}' in the file"
            cure = f"is {key}.column the right column?"
            yield e.finding(f"{key}.unit", message, cure=cure, contradiction=False)
            continue
        ratio = unit_factor(declared, kind) / size
        if abs(ratio - 1.0) > 1e-6:  # factors of units are exact, up to rounding
            yield e.finding(
                f"{key}.unit",
                f"contradicts the column '{heading}', whose unit in the file, '{stated}', differs by a"
                f" factor of {ratio:.6g}",
                cure=f'write {key}.unit = "{stated}", or correct the heading of the file',
            )


def _size(unit: str, kind: str) -> float | None:
    """Value of a unit in SI, as instruments write it ("Volts" and "-" too); None for another quantity."""
    try:
        return unit_factor("1" if unit == "-" else unit, kind)
    except UnitError:
        written = si_unit(unit)
        return written[1] if written is not None and written[0] == kind else None


def _unit_in_file(e: Evidence, key: str, heading: str) -> str | None:
    """The unit in a line of units or a row of a workbook. None if there is none or if the file is large."""
    name = e.file.written(f"{key.partition('.')[0]}.file")
    path = e.file.path.parent / name if isinstance(name, str) else None
    if path is None or not path.is_file() or path.stat().st_size > LARGEST_TABLE:
        return None
    try:
        return next((one.unit for one in list_channels(path) if one.name == heading), None)
    except InputError:  # the reader of the file reports the error
        return None


def check_densities(e: Evidence) -> Iterator[Finding]:
    """Check that specimen and bars have plausible densities."""
    poisson = getattr(getattr(e.declared, "model", None), "poisson", None)
    for key, value in _quantities(e, "density", "kg/m^3"):
        low, high = DENSITIES if key.startswith("specimen.") else (BAR_DENSITY, DENSITIES[1])
        if not low <= value <= high:
            factor = 1e3 if value < low else 1e-3
            fits = low <= value * factor <= high
            yield e.finding(
                key,
                f"is {value:.6g} kg/m^3, which is not the density of a specimen",
                allowed=f"in [{low:g}, {high:g}] kg/m^3",
                cure=f'{key} = "{value * factor:.6g} kg/m^3" would fit: was the number in g/cm^3?'
                if fits and factor > 1.0
                else f'{key} = "{value * factor:.6g} kg/m^3" would fit: was the unit g/cm^3 written for'
                " a number in kg/m^3?"
                if fits
                else "correct the number or its unit",
            )
        elif key.startswith("specimen.") and value < FOAM_DENSITY and poisson is not None:
            foam = poisson <= FOAM_POISSON
            yield e.finding(
                key,
                f"is that of a foam, and model.poisson = {poisson:g}"
                + ("" if foam else f" is above {FOAM_POISSON:g}, too large for a foam"),
                allowed=None if foam else f"at least {FOAM_DENSITY:g} kg/m^3 with this Poisson's ratio",
                cure=f'is it a foam? if not, "{value * 10:.6g} kg/m^3" has one digit more'
                if foam
                else f'correct specimen.density ("{value * 10:.6g} kg/m^3"?); for a foam correct'
                " model.poisson",
                contradiction=not foam,
            )


OTHER_BAR = ("incident", "input bar", "striker", "reflected")
"""Words in a heading that indicate a channel in front of the specimen."""


def check_channels(e: Evidence) -> Iterator[Finding]:
    """Check that the transmitted force is not a channel of the incident bar."""
    force, other = (e.file.content.get(key) for key in ("force", "incident_force"))
    column = _voltage_column(force)
    if column is None or not isinstance(force, dict):
        return
    if isinstance(other, dict) and _voltage_column(other) == column:
        if other.get("file", force.get("file")) == force.get("file"):
            message = f"is the column '{column}', which is incident_force.voltage too"
            yield e.finding("force.voltage", message, cure="name the channel behind the specimen")
    elif any(word in column.lower() for word in OTHER_BAR):
        message = f"is the column '{column}', whose heading is that of the other bar"
        cure = "name the channel behind the specimen, or correct the heading"
        yield e.finding("force.voltage", message, cure=cure, contradiction=False)


def _voltage_column(section: Any) -> str | None:
    """Heading of a channel's voltage column; None if the column is not declared by heading."""
    voltage = section.get("voltage") if isinstance(section, dict) else None
    column = voltage.get("column") if isinstance(voltage, dict) else None
    return column if isinstance(column, str) else None


def _quantities(e: Evidence, last: str, si: str) -> Iterator[tuple[str, float]]:
    """Dotted keys that end in a name, with their values in SI. The schema reports invalid quantities."""
    for key, value in entries(e.file.content):
        if key.rpartition(".")[2] == last and key != f"uncertainty.{last}":
            with suppress(UnitError):
                yield key, quantity(value, si)


def check_bar_speeds(e: Evidence) -> Iterator[Finding]:
    """Check that modulus and density of a bar give a plausible wave speed."""
    densities = dict(_quantities(e, "density", "kg/m^3"))
    for key, modulus in _quantities(e, "youngs_modulus", "Pa"):
        density = densities.get(beside := f"{key.removesuffix('youngs_modulus')}density")
        if density is not None and density >= BAR_DENSITY:
            words = f"with {beside} = {density:.6g} kg/m^3"
            yield from _bar_speed(e, key, math.sqrt(modulus / density), words, "Pa")
    for key, speed in _quantities(e, "wave_speed", "m/s"):
        yield from _bar_speed(e, key, speed, "", "")


def _bar_speed(e: Evidence, key: str, speed: float, beside: str, si: str) -> Iterator[Finding]:
    low, high = BAR_SPEEDS
    if low <= speed <= high:
        return
    factor = power_of_1000(speed / 5000.0)  # of metals; the modulus has the square of this factor
    if si:
        factor = power_of_1000((speed / 5000.0) ** 2)
    scaled = speed * (math.sqrt(factor) if si else factor)
    cure = unit_cure(e.file, key, si, factor) if si and low <= scaled <= high else ""
    message = f"gives waves of {speed:.4g} m/s{' ' * bool(beside)}{beside}, which is not possible in a bar"
    allowed = f"such that they run at {low:g} to {high:g} m/s"
    yield e.finding(key, message, allowed=allowed, cure=cure or "correct the number or its unit")


def check_specimen_size(e: Evidence) -> Iterator[Finding]:
    """Check that diameter, length and their ratio are plausible for a specimen."""
    if getattr(e.declared, "specimen", None) is None:  # bars only
        return
    low, high = SPECIMEN_SIZES
    sizes = {name: getattr(e.declared.specimen, name) for name in ("diameter", "length")}
    wrong = False
    for name, size in sizes.items():
        key, other = f"specimen.{name}", sizes["length" if name == "diameter" else "diameter"]
        if not low <= size <= high:
            wrong = True
            factor = power_of_1000(size / (other if low <= other <= high else 0.01))
            message = f"is {1e3 * size:.6g} mm, which is not the size of a specimen"
            cure = unit_cure(e.file, key, "m", factor) or "correct the number or its unit"
            yield e.finding(key, message, allowed=f"in [{1e3 * low:g}, {1e3 * high:g}] mm", cure=cure)
    slender = sizes["length"] / sizes["diameter"]
    if not wrong and not SLENDERNESS[0] <= slender <= SLENDERNESS[1]:
        yield e.finding(
            "specimen.length",
            f"is {slender:.3g} times specimen.diameter = {1e3 * sizes['diameter']:.6g} mm; such specimens"
            f" have {SLENDERNESS[0]:g} to {SLENDERNESS[1]:g}",
            cure="check the unit of both",
            contradiction=False,
        )
