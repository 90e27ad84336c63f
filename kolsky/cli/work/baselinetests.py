"""What the command line says of quasi-static tests, turned into tests and their treatment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from kolsky.base.apparatus import Specimen
from kolsky.base.errors import InputError
from kolsky.base.units import UnitError, quantity
from kolsky.cli.work import options
from kolsky.material.curves.uniaxial import Toe, UniaxialTest
from kolsky.material.end_friction.problem import EndFriction
from kolsky.material.end_friction.slow_test import SlowNumerics
from kolsky.material.reference_curve import Treatment
from kolsky.readers.columns import read_columns

CONVENTIONS = ("tension-positive", "compression-positive")
BRANCHES = ("compression", "tension")
KINDS = {"strain": "1", "stress": "Pa", "displacement": "m", "force": "N", "time": "s", "bulge": "m"}
"""What a column may hold -> its SI unit."""


@dataclass(frozen=True)
class Given:
    """What the command line says; texts as they were written, empty or None where nothing was said."""

    files: Sequence[Path]
    columns: Mapping[str, str]
    units: Sequence[str]
    convention: str
    branch: str
    header_line: int | None
    diameter: str | None
    length: str | None
    compliance: str | None
    toe: str
    friction: str
    friction_sigma: float
    bulge_sigma: str | None
    scale_sigma: str
    poisson: float
    points: int
    last: float | None
    conditioned: bool


def treatment_of(given: Given) -> Treatment:
    """How the tests are corrected and averaged.

    Raises
    ------
    InputError
        If a text cannot be read, is outside its range, or contradicts another.
    """
    size = None
    if given.diameter is not None or given.length is not None:
        if given.diameter is None or given.length is None:
            raise InputError(options.COMMAND_LINE, "needs both --diameter and --length or neither")
        diameter = _positive("--diameter", given.diameter, "m")
        size = Specimen(diameter=diameter, length=_positive("--length", given.length, "m"), density=0.0)
    if ("bulge" in given.columns) != (given.friction == "free"):
        raise InputError(
            options.COMMAND_LINE,
            "--bulge and --friction free belong together: the radius at mid-height finds the friction",
        )
    if ("bulge" in given.columns) != (given.bulge_sigma is not None):
        raise InputError(options.COMMAND_LINE, "--bulge and --bulge-sigma belong together")
    try:
        return Treatment(
            toe=_toe(given.toe),
            compliance=0.0 if given.compliance is None else _value("--compliance", given.compliance, "m/N"),
            scale_sigma=_value("--scale-sigma", given.scale_sigma, "1"),
            specimen=size,
            ends=_ends(given),
            bulge_sigma=0.0
            if given.bulge_sigma is None
            else _positive("--bulge-sigma", given.bulge_sigma, "m"),
            points=given.points,
            last=given.last,
            numerics=SlowNumerics(passages=160.0, poisson=given.poisson),
        )
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, str(error)) from None


def read_tests(given: Given, size: Specimen | None) -> tuple[list[UniaxialTest], dict[str, str]]:
    """Every file as a test, positive along its branch, and the hashes of the files.

    Parameters
    ----------
    given
        What the command line says.
    size
        The specimen; needed where the columns are displacement and force.

    Raises
    ------
    InputError
        If the columns make no test, or a file cannot be read or holds no such test.
    """
    options.one_of("--convention", given.convention, CONVENTIONS)
    options.one_of("--branch", given.branch, BRANCHES)
    columns = given.columns
    pair = {"strain", "stress"} if "stress" in columns else {"displacement", "force"}
    if (set(columns) & {"strain", "stress", "displacement", "force"}) != pair:
        raise InputError(
            options.COMMAND_LINE,
            "a test needs --strain and --stress, or --displacement and --force",
            cure="name two columns, or give their numbers",
        )
    if "force" in pair and size is None:
        raise InputError(options.COMMAND_LINE, "--displacement and --force need --diameter and --length")
    units = _units(given)
    compression = given.branch == "compression"
    sign = 1.0 if compression == (given.convention == "compression-positive") else -1.0
    tests, hashes = [], {}
    for path in given.files:
        values, digest = read_columns(
            path,
            {what: (column, KINDS[what]) for what, column in columns.items()},
            units=units,
            header_line=given.header_line,
        )
        if str(path) in hashes:
            raise InputError(path, "is named twice", cure="a test counts once")
        hashes[str(path)] = digest
        if size is not None and "force" in pair:
            values["strain"] = values["displacement"] / size.length
            values["stress"] = values["force"] / size.area
        try:
            tests.append(
                UniaxialTest(
                    name=path.name,
                    strain=sign * values["strain"],
                    stress=sign * values["stress"],
                    compression=compression,
                    time=values.get("time"),
                    bulge=values.get("bulge"),
                )
            )
        except ValueError as error:
            raise InputError(path, str(error)) from None
    return tests, hashes


def _ends(given: Given) -> EndFriction | None:
    text, sigma = given.friction, given.friction_sigma
    number = None
    if text not in ("none", "bonded", "rough", "free"):
        try:
            number = float(text)
        except ValueError:
            options.one_of("--friction", text, ("none", "bonded", "rough", "free", "a number"))
    if number is None and sigma > 0.0:
        raise InputError(options.COMMAND_LINE, "--friction-sigma goes with a number as --friction")
    if text == "none":
        return None
    if text in ("bonded", "rough"):
        return EndFriction("bonded" if text == "bonded" else "rough")
    return EndFriction("coulomb", number, sigma)


def _toe(text: str) -> Toe:
    """ "gaussian:0.03:0.12" as a toe."""
    if text == "none":
        return Toe()
    kind, *ends = text.split(":")
    try:
        if kind not in ("line", "gaussian") or len(ends) != 2:
            raise ValueError
        low, high = (float(end) for end in ends)
    except ValueError:
        raise InputError(
            options.COMMAND_LINE,
            f"--toe {text!r} cannot be read",
            cure="write none, or line:LOW:HIGH or gaussian:LOW:HIGH with strains, e.g. gaussian:0.03:0.12",
        ) from None
    return Toe("line" if kind == "line" else "gaussian", low, high)


def _units(given: Given) -> dict[str, str]:
    """["Load=N"] as units by column."""
    found = {}
    for text in given.units:
        column, equals, unit = text.rpartition("=")
        if not equals or column not in given.columns.values():
            raise InputError(
                options.COMMAND_LINE,
                f"--unit {text!r} names no column that is read",
                cure="write COLUMN=UNIT",
            )
        found[column] = unit
    return found


def _value(option: str, text: str, unit: str) -> float:
    try:
        return quantity(text, unit)
    except UnitError as error:
        raise InputError(options.COMMAND_LINE, f"{option}: {error}") from None


def _positive(option: str, text: str, unit: str) -> float:
    value = _value(option, text, unit)
    if not value > 0.0:
        raise InputError(
            options.COMMAND_LINE, "is not allowed", key=option, value=text, allowed=f"> 0 {unit}"
        )
    return value
