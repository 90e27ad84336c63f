"""Tables of measurements by their columns, in SI: frames, flyer, outline, material tests, testing
machines."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.units import DIMENSIONS, UnitError, dimension_of, unit_factor
from kolsky.readers import recordings
from kolsky.readers.contents import Channel, Contents, Layout
from kolsky.readers.header import si_unit, split_unit
from kolsky.readers.recordings import read_contents
from kolsky.readers.table import Column, Table, read_table
from kolsky.readers.text import full_match

MOST_MODES = 1000
"""Most columns of common uncertainties that are read."""


@dataclass(frozen=True, kw_only=True)
class ShotTable:
    """Columns of a file, row by row."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    first_line: int = 2
    """Line of the first row, counted from 1."""

    def line(self, row: int) -> int:
        """Line of a row of data that is counted from 0."""
        return self.first_line + row


@dataclass(frozen=True, kw_only=True)
class FrameTimes(ShotTable):
    """When each frame was taken, on the clock of the file."""

    frame: IntArray
    """Frame numbers, increasing, shape [n_frames]."""
    time: FloatArray
    """Frame times, increasing [s], shape [n_frames]."""
    digit: float
    """The last printed digit of the times [s]."""


@dataclass(frozen=True, kw_only=True)
class FlyerTable(ShotTable):
    """The flyer's displacement with the sign of the file."""

    frame: IntArray
    """Frame numbers, increasing, shape [n]."""
    displacement: FloatArray
    """Displacement, sign as in the file [m], shape [n]."""
    time: FloatArray | None
    """The file's own time column [s], shape [n]; None if it has none."""
    digit: float
    """The last printed digit of the times [s]; 0 without a time column."""


@dataclass(frozen=True, kw_only=True)
class OutlineTable(ShotTable):
    """Points of the specimen's outline in the coordinates of the file, frame by frame."""

    frame: IntArray
    """Frame number of each point, never falling, shape [n]."""
    y: FloatArray
    """Coordinate along the compression axis [m], shape [n]."""
    Z: FloatArray
    """Out-of-plane coordinate [m], shape [n]."""
    sigma: FloatArray | None
    """Standard deviation of Z [m], shape [n]; None if the file gives none."""
    time: FloatArray | None
    """The file's own time column [s], shape [n]; None if it has none."""
    digit: float
    """The last printed digit of the times [s]; 0 without a time column."""


@dataclass(frozen=True, kw_only=True)
class UniaxialTable(ShotTable):
    """Strain and stress of a quasi-static test with the signs of the file."""

    strain: FloatArray
    """Nominal strain [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    sigma: FloatArray | None = None
    """Standard uncertainty of each stress alone [Pa], shape [n]; None if there is no such column."""
    modes: FloatArray | None = None
    """Standard uncertainties that move all points together [Pa], shape [n_modes, n]; None likewise."""


def read_frame_times(path: Path, *, frame: Column, time: Column, layout: Layout | None = None) -> FrameTimes:
    """Frame numbers and times of the cameras.

    Raises InputError if the file is not such a table, a frame number is not whole, or numbers or times do not
    increase.
    """
    table = read_table(path, layout=layout)
    numbers = _frames(table, frame)
    times = table.values(time)
    table.check_increasing(time, times)
    return FrameTimes(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=numbers,
        time=times,
        digit=table.printed_digit(time),
    )


def read_flyer(
    path: Path,
    *,
    frame: Column,
    displacement: Column,
    time: Column | None = None,
    layout: Layout | None = None,
) -> FlyerTable:
    """Frame numbers, displacements of the flyer and, if there is one, the time column.

    Raises InputError if the file is not such a table, a frame number is not whole, or frame numbers do not
    increase.
    """
    table = read_table(path, layout=layout)
    return FlyerTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=_frames(table, frame),
        displacement=table.values(displacement),
        time=None if time is None else table.values(time),
        digit=0.0 if time is None else table.printed_digit(time),
    )


def read_outline(
    path: Path,
    *,
    frame: Column,
    y: Column,
    Z: Column,
    sigma: Column | None = None,
    time: Column | None = None,
    layout: Layout | None = None,
) -> OutlineTable:
    """Points (y, Z) of the specimen's outline; a frame may have any number of them.

    Raises InputError if the file is not such a table, a frame number is not whole or falls, or a sigma is not
    positive.
    """
    table = read_table(path, layout=layout)
    numbers = table.integers(frame)
    back = np.flatnonzero(np.diff(numbers) < 0)
    if back.size:
        row = int(back[0]) + 1
        raise table.error(
            f"column '{frame.name}' is not sorted: {numbers[row]} after {numbers[row - 1]}",
            row=row,
            cure="export the points frame by frame",
        )
    deviations = None if sigma is None else table.values(sigma)
    if sigma is not None and deviations is not None and deviations.min() <= 0.0:
        row = int(np.argmin(deviations))
        raise table.error(
            f"column '{sigma.name}' is '{table.field(sigma, row)}'; it must be > 0",
            row=row,
            cure="give every point its standard deviation, or declare one for all: centre_line.sigma",
        )
    return OutlineTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=numbers,
        y=table.values(y),
        Z=table.values(Z),
        sigma=deviations,
        time=None if time is None else table.values(time),
        digit=0.0 if time is None else table.printed_digit(time),
    )


def read_uniaxial(
    path: Path,
    *,
    strain: Column,
    stress: Column,
    sigma: Column | None = None,
    modes: Column | None = None,
    layout: Layout | None = None,
) -> UniaxialTable:
    """Nominal strain and stress of a quasi-static test, with what is known of their uncertainty.

    ``path``: the file. ``strain``, ``stress``, ``sigma``: their columns. ``modes``: all columns whose names
    begin with this name. ``layout``: as in `kolsky.readers.table.read_table`. Raises InputError if the file
    is not such a table, or an uncertainty is negative.
    """
    table = read_table(path, layout=layout)
    return UniaxialTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        strain=table.values(strain),
        stress=table.values(stress),
        sigma=None if sigma is None else _sigma(table, sigma),
        modes=None if modes is None else _modes(table, modes),
    )


def _frames(table: Table, frame: Column) -> IntArray:
    numbers = table.integers(frame)
    table.check_increasing(frame, numbers)
    return numbers


def _sigma(table: Table, column: Column) -> FloatArray:
    values = table.values(column)
    bad = np.flatnonzero(values < 0.0)
    if bad.size:
        row = int(bad[0])
        raise table.error(
            f"column '{column.name}' is {table.field(column, row)}, a standard uncertainty is >= 0", row=row
        )
    return values


def _modes(table: Table, beginning: Column) -> FloatArray:
    """All columns whose names begin alike, shape [n_modes, n]."""
    names = [name for name in table.header if name.startswith(beginning.name)]
    if not 1 <= len(names) <= MOST_MODES:
        raise InputError(
            table.path,
            f"{len(names)} columns begin with '{beginning.name}', 1 to {MOST_MODES} are read",
            line=table.header_line,
            cure="correct the beginning in the shot file, or leave it out",
        )
    return np.array([table.values(Column(name, beginning.factor)) for name in names])


_HEADING = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*")


def read_columns(
    path: Path,
    wanted: Mapping[str, tuple[str, str]],
    *,
    units: Mapping[str, str] | None = None,
    header_line: int | None = None,
) -> tuple[dict[str, FloatArray], str]:
    """Read some columns of a text or workbook.

    ``path``: the file. ``wanted``: what is wanted -> its column, by name or number counted from 1, and the SI
    unit of its kind. ``units``: column, as in `wanted` -> its unit, where the file does not say it.
    ``header_line``: line of the column names; found if not given. Returns: what is wanted -> values in SI,
    shape [n] each; the hash of the file. Raises InputError if the file cannot be read, a column is missing,
    named twice or not of finite numbers, or its unit is unknown or of another kind.
    """
    contents = read_contents(path, layout=Layout(header_line=header_line))
    found: dict[str, FloatArray] = {}
    for what, (column, base) in wanted.items():
        channel = _find(contents, column) or _find_clock(contents, column, header_line)
        if channel is None:
            names = ", ".join(f"'{c.name}' ({c.number})" for c in contents.channels[:20])
            raise InputError(
                path,
                f"column '{column}' for the {what} is missing; the columns of numbers are {names}",
                cure="correct its name, or give its number; `kolsky channels FILE` lists them",
            )
        values = channel.values() * _factor(path, channel, (units or {}).get(column), base, what)
        recordings.check_finite(path, channel, values)
        found[what] = values
    return found, contents.sha256


def _find(contents: Contents, column: str) -> Channel | None:
    found = [c for c in contents.channels if column in (c.name, _bare(c), f"{_bare(c)} ({c.unit})")]
    if not found and column.isdecimal():
        found = [c for c in contents.channels if c.number == int(column)]
    if len(found) > 1:
        raise InputError(
            contents.path, f"column '{column}' is there {len(found)} times", cure="give its number"
        )
    return found[0] if found else None


def _bare(channel: Channel) -> str:
    """Its name without the unit in brackets."""
    match = full_match(_HEADING, channel.name)
    return match.group(1) if match else channel.name


def heading_unit(name: str) -> str | None:
    """The unit that a heading has in brackets, "mm" of "Travel (mm)"; None if it has none that is known."""
    match = _HEADING.fullmatch(name)
    if match is None:
        return None
    text = match.group(2)
    if text == "-":
        return "1"
    return text if dimension_of(text, DIMENSIONS) else None


def _find_clock(contents: Contents, column: str, header_line: int | None) -> Channel | None:
    """A column of times is no channel while it is the clock of the others: let one of them serve as it."""
    if not contents.channels:
        return None
    other = Layout(header_line=header_line, time=contents.channels[0].number, time_unit="s")
    return _find(read_contents(contents.path, layout=other), column)


def _factor(path: Path, channel: Channel, stated: str | None, base: str, what: str) -> float:
    match = full_match(_HEADING, channel.name)
    text = stated or channel.unit or (match.group(2) if match else None)
    if text == "-":
        text = "1"
    try:
        if text is None:
            raise UnitError(channel.name, "has no unit", base)
        return unit_factor(text, base)
    except UnitError as error:
        raise InputError(
            path,
            f"column '{channel.name}' for the {what} {error.problem if text is None else f'is in {text!r}'}",
            allowed=f"in a unit of {error.expected}",
            cure=f"say it: --unit '{channel.name}={error.example.split(' ', 1)[1]}'",
        ) from None


@dataclass(frozen=True)
class HomogeneousTable:
    """Deformation and stress with the signs of the file."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    deformation: FloatArray
    """Stretch, nominal strain or amount of shear, as the column holds it [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""


def read_homogeneous(
    path: Path,
    *,
    deformation: str,
    stress: str,
    deformation_unit: str | None = None,
    stress_unit: str | None = None,
    layout: Layout | None = None,
) -> HomogeneousTable:
    """Read two columns of a table of text or a workbook.

    ``path``: the file. ``deformation``, ``stress``: its columns, by name or by number counted from 1.
    ``deformation_unit``, ``stress_unit``: their units where the file does not say them, e.g. "%" and "kPa".
    ``layout``: what has to be said of the file; found in it if not given. Raises InputError if the file
    cannot be read, a column is missing, not of numbers, or its unit is missing or of another kind.
    """
    contents = read_contents(path, layout=layout or Layout())
    columns = [_wanted_column(contents, wanted) for wanted in (deformation, stress)]
    units = [
        _stated_factor(contents, columns[0], deformation_unit, "1", '"1" or "%"', "--strain-unit"),
        _stated_factor(contents, columns[1], stress_unit, "Pa", '"kPa" or "MPa"', "--stress-unit"),
    ]
    values = [column.values() * unit for column, unit in zip(columns, units, strict=True)]
    for column, value in zip(columns, values, strict=True):
        recordings.check_finite(path, column, value)
    return HomogeneousTable(path, contents.sha256, *values)


def read_ratio(path: Path, column: str, layout: Layout, *, cure: str) -> FloatArray:
    """A column of stretches or strains as pure numbers, shape [n]; one without a unit is taken as it stands.

    Raises InputError if the file cannot be read, or the column is missing, not of numbers, or has a unit of
    another kind; `cure` is said there.
    """
    contents = read_contents(path, layout=layout)
    found = _wanted_column(contents, column)
    values: FloatArray = found.values() * _stated_factor(contents, found, None, "1", '"1" or "%"', cure)
    recordings.check_finite(path, found, values)
    return values


def column_names(path: Path, layout: Layout) -> list[str]:
    """Names and numbers of the columns of numbers, the first twenty, as messages show them.

    Raises InputError if the file cannot be read.
    """
    return _numbered(read_contents(path, layout=layout))


def _numbered(contents: Contents) -> list[str]:
    return [f"'{column.name}' ({column.number})" for column in contents.channels[:20]]


def _wanted_column(contents: Contents, wanted: str) -> Channel:
    found: Sequence[Channel] = [
        c for c in contents.channels if wanted in (c.name, split_unit(c.name)[0], _bare(c))
    ]
    if not found and wanted.isdecimal():
        found = [c for c in contents.channels if c.number == int(wanted)]
    if len(found) == 1:
        return found[0]
    names = ", ".join(_numbered(contents))
    problem = "is missing" if not found else f"is there {len(found)} times"
    raise InputError(
        contents.path,
        f"column '{wanted}' {problem}; the columns of numbers are {names}",
        cure="correct the name, or give its number",
    )


def _stated_factor(
    contents: Contents, column: Channel, stated: str | None, base: str, allowed: str, option: str
) -> float:
    text = stated if stated is not None else column.unit or heading_unit(column.name)
    if text is None and base == "1":
        return 1.0  # a column of strains or stretches without a unit is a pure number
    if text is None:
        raise InputError(
            contents.path,
            f"does not say the unit of column '{column.name}'",
            cure=f"say it: {option} {allowed}",
        )
    known = si_unit(text)
    if known is not None and known[0] == base:
        return known[1]
    try:
        return unit_factor(text, base)
    except UnitError:
        raise InputError(
            contents.path,
            f"column '{column.name}' has the unit '{text}'",
            allowed=f"a unit such as {allowed}",
            cure=f"say it with {option}, or choose another column",
        ) from None
