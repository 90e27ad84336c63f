"""Files of homogeneous tests, as the command line names them, turned into tests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kolsky.base.errors import InputError
from kolsky.cli.work import options
from kolsky.material.fits.modes import Mode, mode_named
from kolsky.material.fits.test_data import HomogeneousTest, mean_test
from kolsky.readers import homogeneous
from kolsky.readers.contents import Layout

CONVENTIONS = ("tension-positive", "compression-positive")


@dataclass(frozen=True)
class Columns:
    """What the command line says of the files' columns; a text that is empty was not said."""

    convention: str = ""
    """Sign of stress and strain."""
    stretch: str = ""
    """Column of the stretch."""
    strain: str = ""
    """Or of the nominal strain or amount of shear."""
    strain_unit: str | None = None
    """Its unit."""
    stress: str = ""
    """Column of the nominal stress."""
    stress_unit: str | None = None
    """Its unit."""
    header_line: int | None = None
    """Line of the column names."""


def read_tests(
    files: Sequence[str], columns: Columns, *, mean: int = 0
) -> tuple[tuple[HomogeneousTest, ...], dict[str, str]]:
    """The tests, and the hashes of their files by path.

    Parameters
    ----------
    files
        "MODE:FILE", or a file of a uniaxial test.
    columns
        What is said of the files.
    mean
        Strains at which the files of a mode are averaged; 0 keeps each as a test with all its points.

    Raises
    ------
    InputError
        If a file cannot be read, what is said of it is not enough, or it holds no such test.
    """
    hashes: dict[str, str] = {}
    tests: list[HomogeneousTest] = []
    for text in files:
        mode, path = _named(text)
        tests.append(_of_file(mode, path, columns, hashes))
    if mean:
        tests = _averaged(tests, mean)
    return _told_apart(tests), hashes


def _named(text: str) -> tuple[Mode, Path]:
    head, colon, rest = text.partition(":")
    if colon and rest:
        try:
            return mode_named(head), Path(rest)
        except ValueError:
            # A drive of Windows, or a mode that does not exist: only one of them is a file.
            if len(head) > 1 and not Path(text).exists():
                raise InputError(
                    options.COMMAND_LINE,
                    "is no mode",
                    key=text,
                    allowed=", ".join(mode.value.replace(" ", "-") for mode in Mode)
                    + ", then a colon and FILE",
                ) from None
    return Mode.UNIAXIAL, Path(text)


def _of_file(mode: Mode, path: Path, columns: Columns, hashes: dict[str, str]) -> HomogeneousTest:
    options.one_of("--convention", columns.convention, CONVENTIONS)
    layout = Layout(header_line=columns.header_line)
    if columns.stretch and columns.strain:
        raise InputError(
            options.COMMAND_LINE, "--stretch and --strain exclude each other", cure="leave one out"
        )
    if not columns.stress or not (columns.stretch or columns.strain):
        there = ", ".join(homogeneous.column_names(path, layout))
        raise InputError(
            path,
            f"does not say which columns are the test; its columns of numbers are {there}",
            cure="name stress and deformation, or give their numbers: --stress COLUMN, and --stretch COLUMN "
            "or --strain COLUMN",
        )
    if mode is Mode.SIMPLE_SHEAR and columns.stretch:
        raise InputError(
            options.COMMAND_LINE,
            f"{path}: simple shear has no stretch",
            cure="name the amount of shear with --strain",
        )
    table = homogeneous.read(
        path,
        deformation=columns.stretch or columns.strain,
        stress=columns.stress,
        deformation_unit=columns.strain_unit,
        stress_unit=columns.stress_unit,
        layout=layout,
    )
    hashes[str(path)] = table.sha256
    sign = 1.0 if columns.convention == "tension-positive" else -1.0
    # A stretch has no sign to be declared; strain and stress share theirs.
    deformation = table.deformation if columns.stretch else mode.at_rest + sign * table.deformation
    try:
        return HomogeneousTest(
            name=path.stem, mode=mode, deformation=np.asarray(deformation), stress=sign * table.stress
        )
    except ValueError as error:
        raise InputError(path, str(error), cure="check columns, units and --convention") from None


def _told_apart(tests: Sequence[HomogeneousTest]) -> tuple[HomogeneousTest, ...]:
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


def _averaged(tests: Sequence[HomogeneousTest], points: int) -> list[HomogeneousTest]:
    groups: dict[tuple[Mode, bool], list[HomogeneousTest]] = {}
    for test in tests:
        groups.setdefault((test.mode, bool(test.strain.sum() > 0.0)), []).append(test)
    made = []
    for (mode, _), group in groups.items():
        name = group[0].name if len(group) == 1 else f"mean of {len(group)} {mode.value}"
        try:
            made.append(mean_test(group, points=points, name=name))
        except ValueError as error:
            raise InputError(options.COMMAND_LINE, f"--mean: {error}") from None
    return made
