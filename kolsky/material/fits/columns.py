"""Columns of a file of a homogeneous test; the command line makes its options of them."""

from dataclasses import dataclass
from math import pi
from typing import Annotated

from kolsky.base.errors import InputError
from kolsky.base.options import COMMAND_LINE, HeaderLine, Option
from kolsky.base.units import UnitError, quantity

_AREAS = {"mm^2": 1e-6, "cm^2": 1e-4, "m^2": 1.0}
"""Units of a cross-section [m^2]."""


def _area(option: str, text: str) -> float:
    """ "12 mm^2" as a cross-section [m^2]."""
    number, _, unit = text.strip().partition(" ")
    try:
        area = quantity(number, "1") * _AREAS[unit]
    except (KeyError, UnitError):
        raise InputError(
            COMMAND_LINE,
            f"{option} {text!r} cannot be read",
            cure="write a number and mm^2, cm^2 or m^2",
        ) from None
    if not area > 0.0:
        raise InputError(COMMAND_LINE, "is not allowed", key=option, value=text, allowed="> 0 m^2")
    return area


@dataclass(frozen=True)
class Columns:
    """Columns of a file of a homogeneous test, by name or number, and the specimen's size.

    An empty text is not declared.
    """

    convention: Annotated[
        str,
        Option(
            "Sign of stress and strain in the files: tension-positive or compression-positive.",
            show_default="required",
        ),
    ] = ""
    stretch: Annotated[str, Option("The stretch, by name or number.", metavar="COLUMN")] = ""
    strain: Annotated[
        str, Option("Instead: the nominal strain, or the amount of shear.", metavar="COLUMN")
    ] = ""
    strain_unit: Annotated[
        str | None, Option('Unit of the strain, "1" or "%".', show_default="found in the file")
    ] = None
    stress: Annotated[str, Option("The nominal stress.", metavar="COLUMN")] = ""
    stress_unit: Annotated[
        str | None, Option('Unit of the stress, e.g. "kPa".', show_default="found in the file")
    ] = None
    displacement: Annotated[
        str, Option("Instead of a strain, uniaxial tests; needs --length.", metavar="COLUMN")
    ] = ""
    force: Annotated[str, Option("Instead of a stress; needs --area or --diameter.", metavar="COLUMN")] = ""
    length: Annotated[
        float | None, Option('Undeformed gauge length, e.g. "30 mm".', unit="m", positive=True)
    ] = None
    area: Annotated[float | None, Option('Undeformed cross-section, e.g. "12 mm^2".', read=_area)] = None
    diameter: Annotated[float | None, Option('Or the diameter, e.g. "50 mm".', unit="m", positive=True)] = (
        None
    )
    lateral: Annotated[
        str,
        Option("The stretch across the load, or with --lateral-strain its strain.", metavar="COLUMN"),
    ] = ""
    lateral_strain: Annotated[bool, Option("The lateral column is a nominal strain.")] = False
    """A strain is positive where the specimen gets wider."""
    loading: Annotated[
        bool, Option("Take the loading alone: up to the first point where the strain turns back.")
    ] = False
    header_line: HeaderLine = None

    def __post_init__(self) -> None:
        if self.area is not None and self.diameter is not None:
            raise ValueError("--area and --diameter exclude each other")

    @property
    def section(self) -> float | None:
        """Undeformed cross-section that the force is divided by [m^2]."""
        return self.area if self.diameter is None else 0.25 * pi * self.diameter**2
