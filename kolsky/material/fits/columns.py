"""Columns of a file of a homogeneous test. The command line makes its options from them."""

from dataclasses import dataclass, field
from math import pi
from typing import Annotated

from kolsky.base.options import Option
from kolsky.readers.layout import Layout


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
    area: Annotated[
        float | None, Option('Undeformed cross-section, e.g. "12 mm^2".', unit="m^2", positive=True)
    ] = None
    diameter: Annotated[float | None, Option('Or the diameter, e.g. "50 mm".', unit="m", positive=True)] = (
        None
    )
    lateral: Annotated[
        str, Option("The stretch across the load, or with --lateral-strain its strain.", metavar="COLUMN")
    ] = ""
    lateral_strain: Annotated[bool, Option("The lateral column is a nominal strain.")] = False
    """A strain is positive if the specimen gets wider."""
    loading: Annotated[
        bool, Option("Take the loading alone: up to the first point where the strain turns back.")
    ] = False
    layout: Annotated[Layout, ("header_line", "sheet")] = field(default_factory=Layout)
    """Declared layout of the files."""

    def __post_init__(self) -> None:
        if self.area is not None and self.diameter is not None:
            raise ValueError("--area and --diameter exclude each other")

    @property
    def section(self) -> float | None:
        """Undeformed cross-section, the divisor of the force [m^2]."""
        return self.area if self.diameter is None else 0.25 * pi * self.diameter**2
