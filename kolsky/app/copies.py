"""A copy of a shot with one input changed to its estimated value.

The copy is identified and compared.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from kolsky.app.draft import Draft
from kolsky.base.errors import InputError
from kolsky.base.units import quantity
from kolsky.inverse.result import CauseFinding
from kolsky.schema.shot_file import SHOT_FILE

_FACTORS = ("specimen.diameter", "specimen.length", "specimen.density")
_UNITS = {
    "specimen.diameter": "m",
    "specimen.length": "m",
    "specimen.density": "kg/m^3",
    "force.sensitivity": "V/N",
}
"""SI unit of a declared quantity that a cause multiplies."""
_OFFSETS = {
    "force.clock_offset": ("s", -1.0),
    "centre_line.y_offset": ("m", 1.0),
    "centre_line.Z_offset": ("m", 1.0),
}
"""SI unit of an offset, and the sign of the correction. A lag is subtracted from a clock."""
_VALUES: dict[str, Callable[[float], str]] = {
    "model.poisson": lambda value: f"{value:.6g}",
    "model.damping": lambda value: f'"{1e6 * value:.6g} us"',
}
"""Text of values that replace the declared value."""


def changed_value(cause: CauseFinding, content: Mapping[str, Any]) -> str | None:
    """The value estimated from the data, as TOML, which replaces the declared one.

    None if it is not a single value.
    """
    table, _, key = cause.key.partition(".")
    declared = content.get(table, {}).get(key)
    if cause.key in _VALUES:
        return _VALUES[cause.key](cause.value)
    if not isinstance(declared, str):
        return None
    if cause.key in _UNITS:
        factor = cause.value if cause.key in _FACTORS else 1.0 / cause.value
        unit = _UNITS[cause.key]
        return f'"{quantity(declared, unit) * factor:.9g} {unit}"'
    if cause.key in _OFFSETS:
        unit, sign = _OFFSETS[cause.key]
        return f'"{quantity(declared, unit) + sign * cause.value:.9g} {unit}"'
    return None


def copy_of(folder: Path, cause: CauseFinding) -> Path:
    """Path of the copy of a shot with one changed input."""
    return folder.with_name(f"{folder.name}, {cause.key} changed")


def original_of(copy: Path) -> Path | None:
    """The original of a copied shot. None if the shot is not a copy, or if the original does not exist."""
    m = re.fullmatch(r"(?P<name>.+), [\w.]+ changed", copy.name)
    original = copy.with_name(m["name"]) if m else None
    return original if original is not None and (original / SHOT_FILE).is_file() else None


def copy_with(folder: Path, cause: CauseFinding) -> Path:
    """Copy a shot's folder to the same parent folder, with one input changed.

    Results are not copied. Raises InputError if the input is not a single value of the shot file, or if the
    copy exists already.
    """
    draft = Draft(folder / SHOT_FILE)
    value = changed_value(cause, draft.content())
    if value is None:
        raise InputError(
            draft.path, f"{cause.key} is not a single value there", cure="change it in a copy by hand"
        )
    copy = copy_of(folder, cause)
    if copy.exists():
        raise InputError(copy, "is there already", cure="open it, or remove it first")
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("results"))
    Draft(copy / SHOT_FILE).set_values({cause.key: value})
    return copy
