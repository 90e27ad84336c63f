"""What shot.toml may say about a recorder's file: the table `layout`."""

from typing import Annotated

from pydantic import BeforeValidator, Field

from kolsky.readers.layout import Layout
from kolsky.readers.signalunits import si_unit
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section


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


class LayoutSection(Section):
    """A table that says how a recorder's file is to be read; what it leaves out is found in the file."""

    format: f.Name | None = None
    encoding: f.Name | None = None
    delimiter: str | None = None
    decimal: str | None = None
    comment: f.Name | None = None
    header_line: Annotated[int, Field(ge=0)] | None = None
    units_line: Annotated[int, Field(ge=0)] | None = None
    first_line: Annotated[int, Field(ge=1)] | None = None
    sheet: f.Name | None = None
    time: str | int | dict[str, str | int] | None = None
    time_unit: Annotated[str, BeforeValidator(_time_unit)] | None = None
    interval: Annotated[float, BeforeValidator(_interval)] | None = None
    start: f.Time | None = None
    unit: Annotated[str, BeforeValidator(_unit)] | None = None

    def as_layout(self, *, full_scale: float | None = None, **said: str | int | None) -> Layout:
        """What a reader needs to know.

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
