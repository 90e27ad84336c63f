"""The values that may stand in a specification beside those of shot.toml."""

from typing import Annotated

from pydantic import BeforeValidator

from kolsky.shot.schema import fields as f

Angle = Annotated[float, BeforeValidator(f.physical("rad"))]
"""An angle of any sign [rad]."""
Drift = Annotated[float, BeforeValidator(f.physical("V/s"))]
"""Volts per time of any sign [V/s]."""
Frequency = Annotated[float, BeforeValidator(f.physical("1/s", "> 0", "a frequency"))]
"""A frequency or a rate of repetition [1/s]."""
Relative = Annotated[float, BeforeValidator(f.physical("1"))]
"""A relative difference of any sign [-]."""
Noise = Annotated[float, BeforeValidator(f.physical("V", ">= 0", "a standard deviation"))]
"""Standard deviation of a voltage [V]."""
Width = Annotated[float, BeforeValidator(f.physical("m", ">= 0", "a length"))]
"""A length that may be zero: of something that is not there [m]."""


def _numbers(values: object) -> tuple[float, ...]:
    """A list of plain numbers."""
    if not isinstance(values, list | tuple) or len(values) > 100:
        raise f.problem("is not a list of numbers", cure="write e.g. [0.1, 0.2]")
    return tuple(f.number(value) for value in values)


def _times(values: object) -> tuple[float, ...]:
    """A list of written-out times [s]."""
    if not isinstance(values, list | tuple) or len(values) > 100:
        raise f.problem("is not a list of times", cure='write e.g. ["20 us", "1 ms"]')
    return tuple(f.seconds(value) for value in values)


def _mesh(values: object) -> tuple[int, int]:
    """Elements across the radius and along the length."""
    if not isinstance(values, list | tuple) or len(values) != 2:
        raise f.problem("is not a mesh", cure="write elements across and along, e.g. [96, 129]")
    across, along = (int(f.number(value)) for value in values)
    if not (4 <= across <= 1000 and 4 <= along <= 1000):
        raise f.problem("is not allowed", allowed="[across, along], each from 4 to 1000")
    return across, along


Numbers = Annotated[tuple[float, ...], BeforeValidator(_numbers)]
Times = Annotated[tuple[float, ...], BeforeValidator(_times)]
Mesh = Annotated[tuple[int, int], BeforeValidator(_mesh)]
