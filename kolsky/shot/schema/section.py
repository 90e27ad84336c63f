"""Parts that tables of shot.toml share: the table itself, its columns, and how a file is laid out."""

from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from kolsky.readers.contents import Layout
from kolsky.readers.signalunits import si_unit
from kolsky.readers.table import Column
from kolsky.shot.schema import fields as f


class Section(BaseModel):
    """A table of the file: unknown keys are refused, nothing is converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class ColumnSection(Section):
    """A column of a text file; once read, `unit` is the factor that leads to SI."""

    column: f.Name
    unit: float

    def as_column(self) -> Column:
        """The declaration as readers take it."""
        return Column(name=self.column, factor=self.unit)


class TimeColumn(ColumnSection):
    """A column of times."""

    unit: f.TimeUnit


class LengthColumn(ColumnSection):
    """A column of lengths."""

    unit: f.LengthUnit


class VoltageColumn(ColumnSection):
    """A column of voltages."""

    unit: f.VoltageUnit


class StressColumn(ColumnSection):
    """A column of stresses."""

    unit: f.StressUnit


class RatioColumn(ColumnSection):
    """A column of plain ratios; the unit is "1" or "%"."""

    unit: f.RatioUnit


class ModeColumns(Section):
    """All columns whose names begin alike: each a standard uncertainty that moves all points together."""

    prefix: Annotated[str, Field(min_length=1)]
    unit: f.StressUnit


def _interval(text: object) -> float:
    value = f.seconds(text)
    if value <= 0.0:
        raise f.problem("is not allowed", allowed="> 0 s", cure='write e.g. "100 ns"')
    return value


def _unit(text: object) -> str:
    if not isinstance(text, str) or si_unit(text) is None:
        raise f.problem("is not a known unit", allowed='a unit such as "V", "mV", "N", "strain"')
    return text


def _time_unit(text: object) -> str:
    known = si_unit(text) if isinstance(text, str) else None
    if known is None or known[0] != "s":
        raise f.problem("is not a unit of time", allowed='"s", "ms", "us" or "ns"')
    return str(text)


class TextLayoutSection(Section):
    """A table that says how a text file is to be read.

    In the tables of a shot ([frames], [flyer], [centre_line], [curve]) what it leaves out is as without it:
    UTF-8, commas, decimal points, one header line. In a recorder's file it is found.
    """

    encoding: f.Name | None = None
    delimiter: str | None = None
    decimal: str | None = None
    comment: f.Name | None = None
    header_line: Annotated[int, Field(ge=0)] | None = None
    units_line: Annotated[int, Field(ge=0)] | None = None
    first_line: Annotated[int, Field(ge=1)] | None = None

    def as_layout(self) -> Layout:
        """The declaration as readers take it."""
        return Layout(**{name: getattr(self, name) for name in TextLayoutSection.model_fields})


class LayoutSection(TextLayoutSection):
    """A table that says how a recorder's file is to be read; what it leaves out is found in the file."""

    format: f.Name | None = None
    sheet: f.Name | None = None
    time: str | int | dict[str, str | int] | None = None
    time_unit: Annotated[str, BeforeValidator(_time_unit)] | None = None
    interval: Annotated[float, BeforeValidator(_interval)] | None = None
    start: f.Time | None = None
    unit: Annotated[str, BeforeValidator(_unit)] | None = None

    def as_layout(self, *, full_scale: float | None = None, **said: str | int | None) -> Layout:
        """The declaration as readers take it.

        Parameters
        ----------
        full_scale
            Largest size that the recorder shows, in the SI unit of the samples.
        said
            Fields of `Layout` that other keys of the shot file say, e.g. ``unit="V"``; None says nothing.
        """
        declared = {name: getattr(self, name) for name in LayoutSection.model_fields}
        return Layout(
            **{**declared, **{name: value for name, value in said.items() if value is not None}},
            full_scale=full_scale,
        )
