"""Columns of a text file as shot.toml names them: a name and the unit of the numbers."""

from typing import Annotated

from pydantic import Field

from kolsky.readers.table import Column
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section


class ColumnSection(Section):
    """A column of a text file; once read, `unit` is the factor that leads to SI."""

    column: f.Name
    unit: float

    def as_column(self) -> Column:
        """What a reader needs to know."""
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
