"""Conversion of texts of the command line to typed settings, with errors that state the expected form."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import prod

from kolsky.base import errors
from kolsky.base.apparatus import INCOMPRESSIBLE, INCOMPRESSIBLE_WORD, RelaxationKind
from kolsky.base.errors import InputError
from kolsky.base.options import COMMAND_LINE

refusal = partial(InputError, COMMAND_LINE)
"""An error of the command line, from its other arguments."""
refused = partial(errors.refused, COMMAND_LINE)
"""Context that makes an error inside it bad input of the command line."""


def unreadable(option: str, text: str, expected: str) -> InputError:
    """An error of an option whose text has another form than the expected one."""
    return refusal(f"{option} {text!r} cannot be read", cure=f"write {expected}")


def refuse(given: Mapping[str, bool], problem: str, cure: str) -> None:
    """Reject options, by name, that are given but have no effect."""
    names = [option for option, is_given in given.items() if is_given]
    if names:
        raise refusal(f"{', '.join(names)} {problem}", cure=cure)


def listed(text: str) -> tuple[str, ...]:
    """The names of a comma-separated option."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def figure_formats(option: str, text: str) -> tuple[str, ...]:
    """ "pdf,svg" as formats of figures that are saved as files."""
    from kolsky.report import FIGURE_FORMATS

    return tuple(one_of(option, name, FIGURE_FORMATS) for name in listed(text))


def numbers(option: str, text: str, expected: str = "numbers with commas, e.g. 1,2") -> list[float]:
    """ "0.5, 1, 2" as numbers."""
    try:
        return [float(part) for part in listed(text)]
    except ValueError:
        raise unreadable(option, text, expected) from None


def whole_numbers(option: str, text: str) -> list[int]:
    """ "1-8,12" as whole numbers, ascending, each once."""
    numbers_read: set[int] = set()
    for part in listed(text):
        first, dash, last = part.partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise unreadable(option, text, "whole numbers and ranges, e.g. 3 or 1-8,12")
        end = int(last) if dash else int(first)
        if not int(first) <= end <= 1_000_000:
            raise unreadable(option, text, "ranges that ascend, to at most a million")
        numbers_read.update(range(int(first), end + 1))
    return sorted(numbers_read)


def plain_or_text(value: object) -> object:
    """A number from a text such as "0.3". Other texts ("0.3 %") are returned unchanged."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def physical(option: str, text: str, unit: str, *, positive: bool = False) -> float:
    """ "0.2 um/N" as a number in an SI unit. It is above zero if it must be positive."""
    from kolsky.base.units import quantity

    with refused(f"{option}: ", cure="write it as `--help` shows"):
        value = quantity(text, unit)
    if positive and not value > 0.0:
        raise refusal("is not allowed", key=option, value=text, allowed=f"> 0 {unit}")
    return value


def checked_numbers(
    expected: str, fit: Callable[[list[float]], bool]
) -> Callable[[str, str], tuple[float, ...]]:
    """Function that converts the text of an option to numbers that fit, of at least one."""

    def read(option: str, text: str) -> tuple[float, ...]:
        found = numbers(option, text, expected)
        if not found or not fit(found):
            raise unreadable(option, text, expected)
        return tuple(found)

    return read


strains = checked_numbers(
    "numbers between 0 and 1, e.g. 0.1,0.3", lambda found: all(0.0 < strain < 1.0 for strain in found)
)
"""Function that converts "0.1,0.3" to nominal compressive strains."""


def mesh(option: str, text: str) -> tuple[int, int]:
    """ "24x32" as elements across the radius and along the length."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise unreadable(option, text, "elements across the radius x along the length, e.g. 24x32")
    across, along = int(parts[0]), int(parts[1])
    if across < 2 or along < 2 or across * along > 1_000_000:
        raise unreadable(option, text, "at least 2x2 and at most a million elements")
    return across, along


def values(option: str, texts: Sequence[str]) -> dict[str, float]:
    """["stiffness_factor=1.1", "damping=25 us"] as values in SI, inside their allowed ranges."""
    by_name: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise unreadable(option, text, "NAME=VALUE, e.g. stiffness_factor=1.1")
        if name in by_name:
            raise unreadable(option, text, f"{name} once")
        by_name[name] = _value(option, text, name, value)
    return by_name


def holds(option: str, texts: Sequence[str]) -> tuple[dict[str, float], tuple[str, ...]]:
    """["poisson=0.4985", "damping"] as values in SI, and names held at the values of the shot."""
    without_value = [text for text in texts if "=" not in text]
    for text in without_value:
        _known(option, text, text)
    by_name = values(option, [text for text in texts if "=" in text])
    names = tuple(text.strip() for text in without_value)
    twice = [name for i, name in enumerate(names) if name in by_name or name in names[:i]]
    if twice:
        raise unreadable(option, twice[0], f"{twice[0]} once")
    return by_name, names


def ranges(option: str, texts: Sequence[str]) -> dict[str, tuple[float, float] | None]:
    """["stiffness_factor", "friction=0:2"] as bounds by name. None for default bounds."""
    by_name: dict[str, tuple[float, float] | None] = {}
    for text in texts:
        name, equals, bounds = text.partition("=")
        ends = bounds.split(":")
        if equals and len(ends) != 2:
            raise unreadable(option, text, "NAME or NAME=LOW:HIGH, e.g. friction=0:2")
        if name in by_name:
            raise unreadable(option, text, f"{name} once")
        if not equals:
            _known(option, text, name)
            by_name[name] = None
            continue
        low, high = (_value(option, text, name, end) for end in ends)
        if not low < high:
            raise unreadable(option, text, f"the lower bound of {name} before the upper one")
        by_name[name] = (low, high)
    return by_name


def levels(option: str, texts: Sequence[str]) -> tuple[dict[str, tuple[float, float]], list[int]]:
    """["stiffness_factor=0.75:1.25:10"] as bounds by name and the number of levels of each."""
    from kolsky.studies.sweep import MOST_RUNS

    parts = [text.rpartition(":") for text in texts]
    for text, (bounds_text, _, count) in zip(texts, parts, strict=True):
        if bounds_text.count(":") != 1 or not count.strip().isdecimal() or int(count) < 2:
            raise unreadable(
                option, text, "NAME=LOW:HIGH:LEVELS with at least 2 levels, e.g. friction=0:2:10"
            )
    bounds, counts = spans(option, [part[0] for part in parts]), [int(part[2]) for part in parts]
    if prod(counts) > MOST_RUNS:
        raise refusal(
            f"{option}: {' x '.join(map(str, counts))} levels are {prod(counts)} runs",
            allowed=f"at most {MOST_RUNS}",
            cure="take fewer levels, or --design sobol",
        )
    return bounds, counts


def spans(option: str, texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """["friction=0:2"] as bounds by name."""
    by_name: dict[str, tuple[float, float]] = {}
    for text, (name, pair) in zip(texts, ranges(option, texts).items(), strict=True):
        if pair is None:
            raise unreadable(option, text, "NAME=LOW:HIGH, e.g. friction=0:2")
        by_name[name] = pair
    return by_name


def shard(option: str, text: str) -> tuple[int, int]:
    """Number of a part and number of parts from a text such as "2/8"."""
    part, slash, parts = text.partition("/")
    if not slash or not part.isdecimal() or not parts.isdecimal() or not 1 <= int(part) <= int(parts):
        raise unreadable(option, text, "I/N with I from 1 to N, e.g. 2/8")
    return int(part), int(parts)


def one_of(option: str, text: str, choices: Sequence[str]) -> str:
    """The text, if it is one of the choices."""
    if text not in choices:
        *others, last = choices
        allowed = f"{', '.join(others)} or {last}"
        raise refusal("is not known", key=option, value=text, allowed=allowed)
    return text


def relaxation(option: str, text: str) -> tuple[RelaxationKind, int]:
    """A kind of relaxation and its branches: "prony", "prony:2", "bergstrom_boyce"."""
    from kolsky.inverse.parameters import parsed_kind

    with refused(f"{option}: ", cure="write it as `--help` shows"):
        return parsed_kind(text)


def finer(option: str, refined: tuple[int, int], than: str, mesh: tuple[int, int]) -> None:
    """Reject a refined mesh that is not finer than the other one in both directions."""
    if refined[0] <= mesh[0] or refined[1] <= mesh[1]:
        raise refusal(
            f"is not finer than {than} {mesh[0]}x{mesh[1]} in both directions",
            key=option,
            value=f"{refined[0]}x{refined[1]}",
            cure=f"write {2 * mesh[0]}x{2 * mesh[1]}",
        )


def apart(option: str, names: Iterable[str], other: str, others: Iterable[str]) -> None:
    """Reject a parameter that two options use."""
    for name in sorted(set(names) & set(others)):
        raise refusal(f"{name} is named by both {option} and {other}", cure="choose one")


def installed(option: str, package: str, extra: str) -> None:
    """Reject an option if its package is not installed."""
    from importlib.util import find_spec

    if find_spec(package) is None:
        raise refusal(f"{option} needs {package}", cure=f"install it: pip install 'kolsky[{extra}]'")


_WITH_UNIT = "write it as `--help` shows, with a unit"


def _known(option: str, whole: str, name: str) -> str:
    """The unit of a parameter that exists."""
    from kolsky.inverse.parameters import parameter

    with refused(f"{option} {whole!r}: ", cure=_WITH_UNIT):
        return parameter(name).unit


def _value(option: str, whole: str, name: str, text: str) -> float:
    """A parameter's value in SI, inside its allowed range."""
    from kolsky.base.units import quantity
    from kolsky.inverse.parameters import checked_value

    unit = _known(option, whole, name)
    if (name, text.strip()) == ("poisson", INCOMPRESSIBLE_WORD):
        return INCOMPRESSIBLE
    with refused(f"{option} {whole!r}: ", cure=_WITH_UNIT):
        try:
            number = float(text)
        except ValueError:
            number = quantity(text, unit)
        return checked_value(name, number)
