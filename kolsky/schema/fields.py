"""Fields of the TOML files: quantities with units, ranges, file names, columns, and the layout of a table."""

from collections.abc import Callable, Iterable
from pathlib import PurePosixPath
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from kolsky.base.apparatus import INCOMPRESSIBLE, INCOMPRESSIBLE_WORD, LARGEST_POISSON
from kolsky.base.units import DIMENSIONS, LARGEST, UnitError, quantity, unit_factor
from kolsky.readers.header import si_unit
from kolsky.readers.layout import Layout
from kolsky.readers.table import Column


def problem(message: str, **context: str) -> PydanticCustomError:
    """An error with "allowed" and "cure" in its context, and "key" if the key is not the field."""
    return PydanticCustomError("shot", "{message}", {"message": message, **context})


def reject(*checks: tuple[bool, str, str, str]) -> None:
    """Raise the `problem` of the first check that applies: (it applies, key, message, cure)."""
    for applies, key, message, cure in checks:
        if applies:
            raise problem(message, key=key, cure=cure)


def physical(
    unit: str, rule: str = "finite", what: str | None = None, example: str | None = None
) -> Callable[[object], float]:
    """A validator for a quantity with unit: SI unit, range ("> 0", ">= 0" or "finite"), and description."""
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
    """A plain number; a bool is not allowed."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise problem("is not a number", cure="write a number without quotes or unit")
    if abs(value) > LARGEST:  # a NaN is no larger; the range of the key refuses it
        raise problem("is too large", allowed=f"a size of at most {LARGEST:g}")
    return float(value)


def alternatives(names: Iterable[str]) -> str:
    """Names in quotes, the last behind "or"."""
    quoted = [f'"{name}"' for name in names]
    return " or ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)


seconds = physical("s")
"""A written-out time [s]."""
length = physical("m")
"""A written-out length of any sign [m]."""


def _within(
    holds: Callable[[float], bool], allowed: str, cure: str | None = None
) -> Callable[[object], float]:
    """A validator for a plain number in a range."""

    def validate(value: object) -> float:
        size = number(value)
        if not holds(size):
            raise problem("is not allowed", allowed=allowed, **({} if cure is None else {"cure": cure}))
        return size

    return validate


def _poisson(value: object, cure: str = "write a number without quotes or unit") -> float:
    if isinstance(value, str):
        raise problem("is not a number", allowed=f"a number in [0, {LARGEST_POISSON}]", cure=cure)
    size = number(value)
    if not 0.0 <= size <= LARGEST_POISSON:
        raise problem("is not allowed", allowed=f"in [0, {LARGEST_POISSON}]", cure=cure)
    return size


def _specimen_poisson(value: object) -> float:
    if value == INCOMPRESSIBLE_WORD:
        return INCOMPRESSIBLE
    return _poisson(
        value,
        "write a number without quotes; the solver needs slight compressibility: 0.499 for a rubber-like "
        f'material, or "{INCOMPRESSIBLE_WORD}"',
    )


def _friction(value: object) -> float:
    size = number(value)
    if not 0.0 <= size < float("inf"):
        from explicit.contact import CONTACT_LAWS

        sticking = alternatives(name for name, law in CONTACT_LAWS.items() if not law.slides)
        raise problem(
            "is not allowed",
            allowed="a finite number >= 0",
            cure=f"write the Coulomb coefficient, e.g. 0.3; for no slip choose the law {sticking}",
        )
    return size


def _contact_law(name: object) -> str:
    """The name of a law of `explicit.contact`."""
    from explicit.contact import CONTACT_LAWS

    if not isinstance(name, str) or name not in CONTACT_LAWS:
        raise problem("is not allowed", allowed=alternatives(CONTACT_LAWS))
    return name


def _target(name: object) -> str:
    """The name of a calibration target; an unknown name is rejected when the pictures are opened."""
    from dic.calibration.targets import TARGETS

    if not isinstance(name, str) or not name.strip():
        raise problem("is not a name", allowed=alternatives(TARGETS))
    return name.strip()


def _share(text: object) -> float:
    value = physical("1", ">= 0", "the standard deviation relative to the stress")(text)
    if value >= 1.0:
        raise problem("is not allowed", allowed="in [0, 1)", cure='write e.g. "0.2 %"')
    return value


def _interval(pair: object) -> tuple[float, float]:
    if not isinstance(pair, list | tuple) or len(pair) != 2 or "" in pair:
        raise problem("is not a pair of times", cure='write start and end, e.g. ["-200 us", "0 us"]')
    start, end = (physical("s")(text) for text in pair)
    if end <= start:
        raise problem("ends before it begins", allowed="[start, end] with end > start")
    return start, end


def _file(name: object) -> str:
    if not isinstance(name, str) or not name.strip():
        raise problem("is not a file name", cure='write the name of a file, e.g. "scope.csv"')
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name:
        raise problem(
            "lies outside the shot", allowed="a file in the shot's folder", cure="copy it beside shot.toml"
        )
    return name


def _pattern(name: object) -> str:
    text = _file(name)
    if not any(character in PurePosixPath(text).name for character in "*?["):
        raise problem("matches one file at most", cure='write a pattern, e.g. "calibration/cam0_*.png"')
    return text


def _pixels(values: object, count: int, example: str) -> tuple[float, ...]:
    """``count`` finite numbers with magnitudes below 1e6."""
    if not isinstance(values, list | tuple) or len(values) != count:
        raise problem(f"is not a list of {count} numbers", cure=f"write pixels, e.g. {example}")
    if any(isinstance(value, str) for value in values):
        raise problem("is not a list of numbers", cure=f"write pixels without quotes, e.g. {example}")
    numbers = tuple(number(value) for value in values)
    if not all(abs(number) < 1e6 for number in numbers):
        raise problem("is not allowed", allowed="finite and below a million pixels")
    return numbers


def _pixel(values: object) -> tuple[float, float]:
    x, y = _pixels(values, 2, "[192, 192]")
    return x, y


def _pixel_range(values: object) -> tuple[float, float]:
    first, last = _pixels(values, 2, "[0, 127]")
    if last <= first:
        raise problem("ends before it begins", allowed="[first, last] with last > first")
    return first, last


def _polygon(values: object) -> tuple[tuple[float, float], ...]:
    if not isinstance(values, list | tuple) or not 3 <= len(values) <= 1000:
        raise problem("is not a polygon", allowed="3 to 1000 corners [x, y]")
    return tuple(_pixel(corner) for corner in values)


def _places(values: object) -> tuple[tuple[int, int], ...]:
    """Pairs of whole numbers."""
    if not isinstance(values, list | tuple) or not values or len(values) > 1000:
        raise problem("is not a list of [column, row]", cure="write e.g. [[2, 2], [11, 2], [2, 7]]")
    pairs = [_pixel(pair) for pair in values]
    if any(not number.is_integer() or number < 0.0 for pair in pairs for number in pair):
        raise problem("is not allowed", allowed="whole numbers from 0: column and row of each hollow dot")
    return tuple((int(column), int(row)) for column, row in pairs)


def _anchors(values: object) -> tuple[tuple[int, int, float, float], ...]:
    """Dots by column and row with their positions in a picture."""
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise problem("is not three dots", cure="write [[column, row, x, y], [...], [...]]")
    anchors = []
    for value in values:
        if not isinstance(value, list | tuple) or len(value) != 4:
            raise problem("is not three dots", cure="each dot is [column, row, x, y], x and y in pixels")
        (column, row), (x, y) = _places([value[:2]])[0], _pixel(value[2:])
        anchors.append((column, row, x, y))
    return tuple(anchors)


def _odd(low: int, high: int, unit: str) -> Callable[[object], int]:
    def validate(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise problem("is not a whole number", cure="write a whole number without quotes")
        if value % 2 == 0 or not low <= value <= high:
            raise problem("is not allowed", allowed=f"odd, from {low} to {high} {unit}")
        return value

    return validate


def _text(name: object) -> str:
    if not isinstance(name, str) or not name.strip():
        raise problem("is not a name", cure="write a text in quotes")
    return name.strip()


Length = Annotated[float, BeforeValidator(physical("m", "> 0"))]
Offset = Annotated[float, BeforeValidator(physical("m"))]
Time = Annotated[float, BeforeValidator(physical("s"))]
PositiveTime = Annotated[float, BeforeValidator(physical("s", "> 0"))]
Damping = Annotated[float, BeforeValidator(physical("s", ">= 0", "the damping time beta"))]
Rate = Annotated[float, BeforeValidator(physical("1/s", ">= 0", "the mass-proportional damping alpha"))]
StrainRate = Annotated[float, BeforeValidator(physical("1/s", "> 0", "a nominal strain rate"))]
Density = Annotated[float, BeforeValidator(physical("kg/m^3", "> 0", "the mass density"))]
Modulus = Annotated[float, BeforeValidator(physical("Pa", "> 0", "Young's modulus"))]
Stress = Annotated[float, BeforeValidator(physical("Pa", ">= 0"))]
ReleaseStress = Annotated[
    float, BeforeValidator(physical("Pa", ">= 0", "the tensile stress at which a bonded face is released"))
]
Voltage = Annotated[float, BeforeValidator(physical("V", "> 0", "the largest voltage the recorder shows"))]
SignedVoltage = Annotated[float, BeforeValidator(physical("V"))]
Sensitivity = Annotated[
    float, BeforeValidator(physical("V/N", "> 0", 'the size of the sensitivity (its sign is "compression")'))
]
Velocity = Annotated[float, BeforeValidator(physical("m/s", "> 0"))]
Resistance = Annotated[float, BeforeValidator(physical("ohm", "> 0"))]
Mass = Annotated[float, BeforeValidator(physical("kg", ">= 0", "the mass between sensing plane and face"))]
StrainPerVolt = Annotated[
    float, BeforeValidator(physical("1/V", "> 0", 'the size of strain per volt (its sign is "compression")'))
]
Uncertainty = Annotated[
    float, BeforeValidator(physical("1", ">= 0", "a standard uncertainty (k = 1) relative to its quantity"))
]
Ratio = Annotated[float, BeforeValidator(physical("1", "> 0", "a ratio"))]
LeadResistance = Annotated[float, BeforeValidator(physical("ohm", ">= 0"))]
TimeDeviation = Annotated[
    float, BeforeValidator(physical("s", ">= 0", "a standard uncertainty (k = 1)", "0.5 us"))
]
LengthDeviation = Annotated[
    float, BeforeValidator(physical("m", ">= 0", "a standard uncertainty (k = 1)", "5 um"))
]
Deviation = Annotated[
    float,
    BeforeValidator(
        _within(lambda x: 0.0 <= x < 0.5, "in [0, 0.5)", "write a standard uncertainty, e.g. 0.01")
    ),
]
Number = Annotated[float, BeforeValidator(number)]
Share = Annotated[float, BeforeValidator(_share)]
Poisson = Annotated[float, BeforeValidator(_poisson)]
SpecimenPoisson = Annotated[float, BeforeValidator(_specimen_poisson)]
Friction = Annotated[float, BeforeValidator(_friction)]
TimeUnit = Annotated[float, BeforeValidator(factor("s"))]
LengthUnit = Annotated[float, BeforeValidator(factor("m"))]
VoltageUnit = Annotated[float, BeforeValidator(factor("V"))]
StressUnit = Annotated[float, BeforeValidator(factor("Pa"))]
RatioUnit = Annotated[float, BeforeValidator(factor("1"))]
Interval = Annotated[tuple[float, float], BeforeValidator(_interval)]
FileName = Annotated[str, BeforeValidator(_file)]
FilePattern = Annotated[str, BeforeValidator(_pattern)]
Pixel = Annotated[tuple[float, float], BeforeValidator(_pixel)]
PixelRange = Annotated[tuple[float, float], BeforeValidator(_pixel_range)]
Polygon = Annotated[tuple[tuple[float, float], ...], BeforeValidator(_polygon)]
Anchors = Annotated[tuple[tuple[int, int, float, float], ...], BeforeValidator(_anchors)]
Places = Annotated[tuple[tuple[int, int], ...], BeforeValidator(_places)]
Subset = Annotated[int, BeforeValidator(_odd(5, 101, "px"))]
StrainWindow = Annotated[int, BeforeValidator(_odd(3, 51, "points"))]
Prefilter = Annotated[
    float, BeforeValidator(_within(lambda x: 0.0 <= x <= 5.0, "in [0, 5] px", "0 smooths nothing"))
]
Name = Annotated[str, BeforeValidator(_text)]
TargetName = Annotated[str, BeforeValidator(_target)]
ContactStiffness = Annotated[
    float, BeforeValidator(physical("Pa/m", "> 0", "the stiffness of the springs of contact"))
]
ContactLawName = Annotated[str, BeforeValidator(_contact_law)]


class Section(BaseModel):
    """A table of the file: unknown keys are rejected, and no value is converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def exactly_one(self, keys: tuple[str, ...], cure: str) -> None:
        """Check that a table has exactly one of some keys. The first key is the usual one."""
        given = [key for key in keys if getattr(self, key) is not None]
        if len(given) != 1:
            raise problem(
                f"is given beside {given[0]}" if given else "is missing",
                key=given[1] if given else keys[0],
                cure=cure,
            )

    def needs(self, key: str, why: str, cure: str) -> None:
        """Check that a table has a key. ``why``: the reason for this requirement."""
        if not getattr(self, key):
            raise problem(f"is missing; {why} needs it", key=key, cure=cure)

    def without(self, keys: tuple[str, ...], why: str, cure: str) -> None:
        """Check that every key has an effect."""
        for key in keys:
            if getattr(self, key):
                raise problem(f"is given, but {why}, so it would have no effect", key=key, cure=cure)

    def alike(self, keys: tuple[str, ...], model: str, cure: str) -> None:
        """Check that lists have the same length as the list of a key."""
        for key in keys:
            stated, wanted = getattr(self, key), getattr(self, model)
            if isinstance(stated, list | tuple) and len(stated) != len(wanted):
                raise problem(f"has {len(stated)} entries, {model} has {len(wanted)}", key=key, cure=cure)


class ColumnSection(Section):
    """A column of a text file; after validation, `unit` is the factor to SI.

    The type of `unit` in the subclasses defines the quantity of the column.
    """

    column: Name
    unit: float

    def as_column(self) -> Column:
        """The declaration in the form that readers need."""
        return Column(name=self.column, factor=self.unit)


class TimeColumn(ColumnSection):
    """A column of times."""

    unit: TimeUnit


class LengthColumn(ColumnSection):
    """A column of lengths."""

    unit: LengthUnit


class VoltageColumn(ColumnSection):
    """A column of voltages."""

    unit: VoltageUnit


class StressColumn(ColumnSection):
    """A column of stresses."""

    unit: StressUnit


class RatioColumn(ColumnSection):
    """A column of plain ratios; the unit is "1" or "%"."""

    unit: RatioUnit


class ModeColumns(Section):
    """All columns with one prefix, each a standard uncertainty common to all points."""

    prefix: Annotated[str, Field(min_length=1)]
    unit: StressUnit


def _check_unit(text: object) -> str:
    if not isinstance(text, str) or si_unit(text) is None:
        raise problem("is not a known unit", allowed='a unit such as "V", "mV", "N", "strain"')
    return text


def _check_time_unit(text: object) -> str:
    known = si_unit(text) if isinstance(text, str) else None
    if known is None or known[0] != "s":
        raise problem("is not a unit of time", allowed='"s", "ms", "us" or "ns"')
    return str(text)


class TextLayoutSection(Section):
    """A table that declares the layout of a text file.

    In the tables of a shot ([frames], [flyer], [centre_line], [curve]) the defaults are UTF-8, commas,
    decimal points and one header line. In a recorder's file, undeclared properties are detected.
    """

    encoding: Name | None = None
    delimiter: str | None = None
    decimal: str | None = None
    comment: Name | None = None
    header_line: Annotated[int, Field(ge=0)] | None = None
    units_line: Annotated[int, Field(ge=0)] | None = None
    first_line: Annotated[int, Field(ge=1)] | None = None
    sheet: Name | None = None

    def as_layout(self) -> Layout:
        """The declaration in the form that readers need."""
        return Layout(**{name: getattr(self, name) for name in TextLayoutSection.model_fields})


class LayoutSection(TextLayoutSection):
    """A table that declares the layout of a recorder's file; undeclared properties are detected."""

    format: Name | None = None
    time: str | int | dict[str, str | int] | None = None
    time_unit: Annotated[str, BeforeValidator(_check_time_unit)] | None = None
    interval: PositiveTime | None = None
    start: Time | None = None
    unit: Annotated[str, BeforeValidator(_check_unit)] | None = None

    def as_layout(self, *, full_scale: float | None = None, **said: str | int | None) -> Layout:
        """The declaration in the form that readers need.

        ``full_scale``: largest recordable magnitude, in the SI unit of the samples. ``said``: fields of
        `Layout` that other keys declare, e.g. ``unit="V"``.
        """
        declared = {name: getattr(self, name) for name in LayoutSection.model_fields}
        return Layout(
            **{**declared, **{name: value for name, value in said.items() if value is not None}},
            full_scale=full_scale,
        )
