"""Validators of written-out quantities, units and plain numbers, to build the fields of a file on."""

from collections.abc import Callable, Iterable

from pydantic_core import PydanticCustomError

from kolsky.base.units import DIMENSIONS, LARGEST, UnitError, quantity, unit_factor


def problem(message: str, **context: str) -> PydanticCustomError:
    """An error whose context holds "allowed", "cure" and, if it is another than the field, "key"."""
    return PydanticCustomError("shot", "{message}", {"message": message, **context})


def physical(
    unit: str, rule: str = "finite", what: str | None = None, example: str | None = None
) -> Callable[[object], float]:
    """A validator for a written-out quantity: SI unit, "> 0", ">= 0" or "finite", and what it is in words."""
    words, usual = DIMENSIONS[unit]
    hint = f'write {what or words}, e.g. "{example or usual}"'

    def validate(text: object) -> float:
        try:
            value = quantity(text, unit)  # type: ignore[arg-type]  # it refuses what is no text
        except UnitError as error:
            allowed = words if rule == "finite" else f"{words} {rule}"
            raise problem(error.problem, allowed=allowed, cure=hint) from None
        if (rule == "> 0" and value <= 0.0) or (rule == ">= 0" and value < 0.0):
            raise problem("is not allowed", allowed=f"{rule} {unit}".removesuffix(" 1"), cure=hint)
        return value

    return validate


def factor(unit: str) -> Callable[[object], float]:
    """A validator for the unit of a column."""
    words, example = DIMENSIONS[unit]
    sample = example.split(" ", 1)[1]

    def validate(text: object) -> float:
        try:
            if not isinstance(text, str) or not text.strip():
                raise UnitError(text, "is not a unit", unit)
            return unit_factor(text, unit)
        except UnitError as error:
            raise problem(
                error.problem, allowed=f"a unit of {words}", cure=f'write the unit, e.g. "{sample}"'
            ) from None

    return validate


def number(value: object) -> float:
    """A plain number; bool is not one."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise problem("is not a number", cure="write a number without quotes or unit")
    if abs(value) > LARGEST:  # a NaN is no larger; the range of the key refuses it
        raise problem("is too large", allowed=f"a size of at most {LARGEST:g}")
    return float(value)


def alternatives(names: Iterable[str]) -> str:
    """Names in quotes, the last behind "or"."""
    quoted = [f'"{name}"' for name in names]
    return " or ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)
