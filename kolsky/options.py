"""Texts of the command line turned into typed settings; every refusal says what was expected."""

from collections.abc import Sequence
from pathlib import Path

from kolsky.errors import InputError

COMMAND_LINE = Path("command line")


def _refuse(option: str, text: str, expected: str) -> InputError:
    return InputError(COMMAND_LINE, f"{option} {text!r} cannot be read", cure=f"write {expected}")


def mesh(option: str, text: str) -> tuple[int, int]:
    """ "24x32" as elements across the radius and along the length."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
        raise _refuse(option, text, "elements across the radius x along the length, e.g. 24x32")
    across, along = int(parts[0]), int(parts[1])
    if across < 2 or along < 2 or across * along > 1_000_000:
        raise _refuse(option, text, "at least 2x2 and at most a million elements")
    return across, along


def values(option: str, texts: Sequence[str]) -> dict[str, float]:
    """["stiffness_factor=1.1", "damping=25 us"] as values in SI, checked against the allowed ranges."""
    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise _refuse(option, text, "NAME=VALUE, e.g. stiffness_factor=1.1")
        if name in found:
            raise _refuse(option, text, f"{name} once")
        found[name] = _value(option, text, name, value)
    return found


def ranges(option: str, texts: Sequence[str]) -> dict[str, tuple[float, float] | None]:
    """["stiffness_factor", "friction=0:2"] as bounds by name; None where the default bounds apply."""
    found: dict[str, tuple[float, float] | None] = {}
    for text in texts:
        name, equals, bounds = text.partition("=")
        ends = bounds.split(":")
        if equals and len(ends) != 2:
            raise _refuse(option, text, "NAME or NAME=LOW:HIGH, e.g. friction=0:2")
        if name in found:
            raise _refuse(option, text, f"{name} once")
        low_high = tuple(_value(option, text, name, end) for end in ends) if equals else None
        found[name] = None if low_high is None else (low_high[0], low_high[1])
        _bounds(option, text, name, found[name])
    return found


def levels(option: str, texts: Sequence[str]) -> tuple[dict[str, tuple[float, float]], list[int]]:
    """["stiffness_factor=0.75:1.25:10"] as bounds by name and the number of levels of each."""
    bounds: dict[str, tuple[float, float]] = {}
    counts: list[int] = []
    for text in texts:
        name, _, rest = text.partition("=")
        parts = rest.split(":")
        if len(parts) != 3 or not parts[2].strip().isdigit() or int(parts[2]) < 2:
            raise _refuse(option, text, "NAME=LOW:HIGH:LEVELS with at least 2 levels, e.g. friction=0:2:10")
        pair = (_value(option, text, name, parts[0]), _value(option, text, name, parts[1]))
        _bounds(option, text, name, pair)
        if name in bounds:
            raise _refuse(option, text, f"{name} once")
        bounds[name] = pair
        counts.append(int(parts[2]))
    return bounds, counts


def _value(option: str, whole: str, name: str, text: str) -> float:
    from kolsky.parameters import checked_value, parameter
    from kolsky.units import UnitError, quantity

    try:
        unit = parameter(name).unit
    except ValueError as error:
        raise InputError(COMMAND_LINE, f"{option} {whole!r}: {error}") from None
    try:
        number = float(text)
    except ValueError:
        try:
            number = quantity(text, unit)
        except UnitError as error:
            raise InputError(COMMAND_LINE, f"{option} {whole!r}: {error}") from None
    try:
        return checked_value(name, number)
    except ValueError as error:
        raise InputError(COMMAND_LINE, f"{option} {whole!r}: {error}") from None


def _bounds(option: str, text: str, name: str, pair: tuple[float, float] | None) -> None:
    if pair is not None and not pair[0] < pair[1]:
        raise _refuse(option, text, f"the lower bound of {name} before the upper one")
