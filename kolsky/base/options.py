"""A setting as a command-line option, independent of any command-line library."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from math import inf
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

COMMAND_LINE = Path("command line")
"""Place of an `InputError` about an option."""


@dataclass(frozen=True)
class Option:
    """Help and conversion of an option, in the annotation of a field or of a command's parameter.

    The type determines the conversion of a text, see `kolsky.cli.options.with_settings`.
    """

    help: str
    """Text of `--help`."""
    name: str = ""
    """Name of the option without its dashes; that of the field if empty."""
    short: str = ""
    """More names with their dashes, e.g. "-p/--parameter"."""
    metavar: str | None = None
    """Placeholder of the value in the help. None: the type."""
    min: float | None = None
    """Smallest number."""
    max: float | None = None
    """Largest number."""
    show_default: str | None = None
    """Default in the help. None: the field's default. Empty: no default."""
    panel: str | None = None
    """Panel of `--help` that contains it. None: the first one."""
    unit: str = ""
    """SI unit of a quantity. The text may use another unit."""
    positive: bool = False
    """True if the quantity must be above zero."""
    read: Callable[[str, str], Any] | None = None
    """Converts an option's text, given the option and the text. Raises InputError."""
    on: Callable[[], Any] | None = None
    """Value of a switch if it is given. None: True."""


def check_options(settings: Any) -> None:
    """Raise ValueError for a field of settings outside the range of its option or the choices of its type."""
    for field in fields(settings):
        value, (kind, *more) = getattr(settings, field.name), get_args(field.type) or (field.type,)
        if value is None:
            continue
        literal = [get_args(part) for part in (kind, *get_args(kind)) if get_origin(part) is Literal]
        if literal and value not in literal[0]:
            raise ValueError(f"{field.name} must be one of {', '.join(literal[0])}, got {value!r}")
        for option in more:
            if not isinstance(option, Option) or option.min is None:
                continue
            most = option.max or inf  # not by NumPy, which `--help` does not need
            if not option.min <= value <= most:
                allowed = f"[{option.min:g}, {most:g}]"
                raise ValueError(f"{field.name} must be in {allowed}, got {value:g}")


NUMERICAL = "Mesh and solver"
ADVANCED = "Advanced"
TOGETHER = "Several shots together"
"""Panels below the common options."""
