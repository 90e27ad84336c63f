"""Files and sizes of homogeneous tests, as commands take them: modes, columns, cross-sections, ratios."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from kolsky.base.errors import InputError
from kolsky.cli import texts

if TYPE_CHECKING:
    from kolsky.material.fits.homogeneous_files import Columns
    from kolsky.material.fits.homogeneous_test import HomogeneousTest
    from kolsky.material.fits.modes import Mode

AREAS = {"mm^2": 1e-6, "cm^2": 1e-4, "m^2": 1.0}
"""Units of a cross-section [m^2]."""


def poisson_of(text: str | None, lateral: str) -> tuple[float | None, bool]:
    """ "0.44" as a ratio, "free" as one that is fitted."""
    if text is None:
        return None, False
    if text == "free":
        if not lateral:
            raise InputError(texts.COMMAND_LINE, "--poisson free needs --lateral", cure="name its column")
        return None, True
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 <= value <= 0.49999:
        raise InputError(
            texts.COMMAND_LINE, "is no ratio", key="--poisson", value=text, allowed="0 to 0.49999, or free"
        )
    return value, False


def area_of(area: str | None, diameter: str | None) -> float | None:
    """Cross-section [m^2] by itself or by its diameter."""
    from math import pi

    if area is not None and diameter is not None:
        raise InputError(texts.COMMAND_LINE, "--area and --diameter exclude each other", cure="leave one out")
    if diameter is not None:
        return 0.25 * pi * texts.physical("--diameter", diameter, "m", positive=True) ** 2
    if area is None:
        return None
    number, _, unit = area.strip().partition(" ")
    if unit not in AREAS:
        raise InputError(
            texts.COMMAND_LINE, f"--area {area!r} cannot be read", cure="write a number and mm^2, cm^2 or m^2"
        )
    return texts.physical("--area", number, "1", positive=True) * AREAS[unit]


def read_tests(
    files: Sequence[str], columns: "Columns", *, mean: int = 0
) -> "tuple[tuple[HomogeneousTest, ...], dict[str, str]]":
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
    from kolsky.material.fits.homogeneous_files import (
        means_by_mode,
        named_apart,
        read_homogeneous_test,
        with_own_headings,
    )

    hashes: dict[str, str] = {}
    tests: list[HomogeneousTest] = []
    for text in files:
        mode, path = _mode_and_path(text)
        there = with_own_headings(path, columns)
        _refuse_columns(path, mode, there)
        test, hashes[str(path)] = read_homogeneous_test(path, there, mode=mode)
        tests.append(test)
    if mean:
        try:
            tests = means_by_mode(tests, mean)
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, f"--mean: {error}", cure="give two files or more of one kind of test"
            ) from None
    return named_apart(tests), hashes


def _mode_and_path(text: str) -> "tuple[Mode, Path]":
    """ "planar:FILE" as a mode and a file; a file alone is uniaxial."""
    from kolsky.material.fits.modes import Mode, mode_named

    head, colon, rest = text.partition(":")
    if colon and rest:
        try:
            return mode_named(head), Path(rest)
        except ValueError:
            # A drive of Windows, or a mode that does not exist: only one of them is a file.
            if len(head) > 1 and not Path(text).exists():
                raise InputError(
                    texts.COMMAND_LINE,
                    "is no mode",
                    key=text,
                    allowed=", ".join(mode.value.replace(" ", "-") for mode in Mode)
                    + ", then a colon and FILE",
                ) from None
    return Mode.UNIAXIAL, Path(text)


def _refuse_columns(path: Path, mode: "Mode", columns: "Columns") -> None:
    """Refuse columns that are not enough for a test, or contradict each other."""
    from kolsky.material.fits.homogeneous_files import CONVENTIONS
    from kolsky.material.fits.modes import Mode
    from kolsky.readers.columns import column_names
    from kolsky.readers.contents import Layout

    texts.one_of("--convention", columns.convention, CONVENTIONS)
    if columns.stretch and columns.strain:
        raise InputError(
            texts.COMMAND_LINE, "--stretch and --strain exclude each other", cure="leave one out"
        )
    if (columns.force != "") != (columns.displacement != ""):
        raise InputError(texts.COMMAND_LINE, "--force and --displacement belong together", cure="name both")
    if columns.force:
        if mode is not Mode.UNIAXIAL or columns.area is None or columns.length is None:
            raise InputError(
                texts.COMMAND_LINE,
                f"{path}: --force and --displacement are of uniaxial tests; they need --length, and --area or"
                " --diameter",
                cure="give the specimen's undeformed size",
            )
        return
    if not columns.stress or not (columns.stretch or columns.strain):
        there = ", ".join(column_names(path, Layout(header_line=columns.header_line)))
        raise InputError(
            path,
            f"does not say which columns are the test; its columns of numbers are {there}",
            cure="name stress and deformation, or give their numbers: --stress COLUMN, and --stretch COLUMN "
            "or --strain COLUMN",
        )
    if mode is Mode.SIMPLE_SHEAR and columns.stretch:
        raise InputError(
            texts.COMMAND_LINE,
            f"{path}: simple shear has no stretch",
            cure="name the amount of shear with --strain",
        )
