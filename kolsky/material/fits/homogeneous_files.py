"""Homogeneous tests from their files: columns and signs, means of repeats, names of their own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.material.fits.homogeneous_test import HomogeneousTest, mean_test
from kolsky.material.fits.modes import Mode
from kolsky.readers.columns import column_names, read_columns, read_homogeneous, read_ratio
from kolsky.readers.contents import Layout

CONVENTIONS = ("tension-positive", "compression-positive")
"""Signs of stress and strain that a file may have."""


OWN = ("nominal strain (1)", "nominal stress (Pa)")
"""Headings of strain and stress in the tables of this package: curves, laws without friction."""


@dataclass(frozen=True)
class Columns:
    """Columns of a file of a homogeneous test, by name or number; a text that is empty was not said."""

    convention: str = ""
    """Sign of stress and strain, one of `CONVENTIONS`."""
    stretch: str = ""
    """Column of the stretch."""
    strain: str = ""
    """Or of the nominal strain or amount of shear."""
    strain_unit: str | None = None
    """Its unit; found in the file if None."""
    stress: str = ""
    """Column of the nominal stress."""
    stress_unit: str | None = None
    """Its unit; found in the file if None."""
    header_line: int | None = None
    """Line of the column names; found if None, 0 for none."""
    displacement: str = ""
    """Or columns of displacement and force, of a uniaxial test."""
    force: str = ""
    """The force's."""
    length: float | None = None
    """Undeformed length that the displacement is divided by [m]."""
    area: float | None = None
    """Undeformed cross-section that the force is divided by [m^2]."""
    lateral: str = ""
    """Column of the stretch of the free direction."""
    lateral_strain: bool = False
    """True if that is a nominal strain, positive where the specimen gets wider."""


def read_homogeneous_test(
    path: str | Path, columns: Columns, *, mode: Mode = Mode.UNIAXIAL
) -> tuple[HomogeneousTest, str]:
    """Read a homogeneous test, positive in tension, and the SHA-256 of its file.

    Parameters
    ----------
    path
        The file.
    columns
        Which columns hold stress and deformation, in which units and with which sign.
    mode
        Deformation of the test.

    Raises
    ------
    InputError
        If the file cannot be read, or its columns are no test of this mode.
    """
    path = Path(path)
    if columns.force:
        return _of_force(path, columns)
    table = read_homogeneous(
        path,
        deformation=columns.stretch or columns.strain,
        stress=columns.stress,
        deformation_unit=columns.strain_unit,
        stress_unit=columns.stress_unit,
        layout=Layout(header_line=columns.header_line),
    )
    sign = 1.0 if columns.convention == "tension-positive" else -1.0
    # A stretch has no sign to be declared; strain and stress share theirs.
    deformation = table.deformation if columns.stretch else mode.at_rest + sign * table.deformation
    try:
        test = HomogeneousTest(
            name=path.stem,
            mode=mode,
            deformation=np.asarray(deformation),
            stress=sign * table.stress,
            lateral=_lateral(path, columns),
        )
    except ValueError as error:
        raise InputError(path, str(error), cure="check columns, units and --convention") from None
    return test, table.sha256


def with_own_headings(path: Path, columns: Columns) -> Columns:
    """The columns of a table of this package, where none was said.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    if columns.stretch or columns.strain or columns.stress or columns.force or columns.displacement:
        return columns
    names = {text.rpartition(" (")[0].strip("'") for text in
             column_names(path, Layout(header_line=columns.header_line))}  # fmt: skip
    return replace(columns, strain=OWN[0], stress=OWN[1]) if names.issuperset(OWN) else columns


def _of_force(path: Path, columns: Columns) -> tuple[HomogeneousTest, str]:
    """A uniaxial test from displacement and force."""
    assert columns.length is not None
    assert columns.area is not None
    values, digest = read_columns(
        path,
        {"displacement": (columns.displacement, "m"), "force": (columns.force, "N")},
        units={
            column: unit
            for column, unit in (
                (columns.displacement, columns.strain_unit),
                (columns.force, columns.stress_unit),
            )
            if unit is not None
        },
        header_line=columns.header_line,
    )
    sign = 1.0 if columns.convention == "tension-positive" else -1.0
    try:
        test = HomogeneousTest(
            name=path.stem,
            mode=Mode.UNIAXIAL,
            deformation=1.0 + sign * values["displacement"] / columns.length,
            stress=sign * values["force"] / columns.area,
            lateral=_lateral(path, columns),
        )
    except ValueError as error:
        raise InputError(path, str(error), cure="check columns, units and --convention") from None
    return test, digest


def _lateral(path: Path, columns: Columns) -> FloatArray | None:
    """Stretch across the load, if its column is named."""
    if not columns.lateral:
        return None
    values = read_ratio(
        path, columns.lateral, Layout(header_line=columns.header_line), cure='"(1)" or "(%)" in its heading'
    )
    return values + 1.0 if columns.lateral_strain else values


def named_apart(tests: Sequence[HomogeneousTest]) -> tuple[HomogeneousTest, ...]:
    """The tests with names of their own: files of one name are told apart by mode and number."""
    made: list[HomogeneousTest] = []
    for test in tests:
        name = test.name
        if sum(other.name == name for other in tests) > 1:
            name = f"{test.mode.value} {name}"
            twins = [t for t in tests if t.name == test.name and t.mode is test.mode]
            if len(twins) > 1:
                name += f" ({1 + sum(t.name.startswith(name) for t in made)})"
        made.append(replace(test, name=name))
    return tuple(made)


def means_by_mode(tests: Sequence[HomogeneousTest], points: int) -> list[HomogeneousTest]:
    """Mean tests of the repeats of each mode, tension and compression apart.

    Parameters
    ----------
    tests
        Single tests.
    points
        Strains at which they are averaged.

    Raises
    ------
    ValueError
        If repeats have too few strains in common.
    """
    groups: dict[tuple[Mode, bool], list[HomogeneousTest]] = {}
    for test in tests:
        groups.setdefault((test.mode, bool(test.strain.sum() > 0.0)), []).append(test)
    made = []
    for (mode, _), group in groups.items():
        name = group[0].name if len(group) == 1 else f"mean of {len(group)} {mode.value}"
        made.append(mean_test(group, points=points, name=name))
    return made
