"""Points of a surface from a series of text files, one per frame, as exported by other DIC programs.

The column names of each program are in `LAYOUTS`.
"""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import Sheet, find_table
from kolsky.readers.text import LONGEST_FIELD, full_match, read_text


@dataclass(frozen=True)
class ExportLayout:
    """The columns of one program's export. Names are compared without their units in brackets."""

    program: str
    """The program, with its version if the names differ between versions."""
    coordinates: tuple[str, ...]
    """Three columns of the position, in the reference or in the current frame, as the numbers show."""
    displacements: tuple[str, ...]
    """Three columns of the displacement from the reference frame."""
    key: tuple[str, ...] = ()
    """Columns that identify the point of a row in every frame; without them, the order of rows does."""
    rejected: tuple[str, ...] = ()
    """Columns that are negative for points rejected by the program. Missing columns are ignored."""


_DICE = ExportLayout(
    "DICe",
    ("MODEL_COORDINATES_X", "MODEL_COORDINATES_Y", "MODEL_COORDINATES_Z"),
    ("MODEL_DISPLACEMENT_X", "MODEL_DISPLACEMENT_Y", "MODEL_DISPLACEMENT_Z"),
    key=("SUBSET_ID",),
    rejected=("SIGMA", "MATCH", "GAMMA"),
)
_XYZ, _UVW, _xyz, _uvw = (tuple(names) for names in ("XYZ", "UVW", "xyz", "uvw"))
# fmt: off
LAYOUTS: Mapping[str, tuple[ExportLayout, ...]] = {
    # Data export as CSV. sigma is -1 for a subset that was not matched.
    "vic3d": (ExportLayout("VIC-3D", _XYZ, _UVW, key=("x", "y"), rejected=("sigma",)),),
    "aramis": (
        # https://github.com/dlr-wf/aramis-data-exporter (nodemap.txt): lost facets are NaN.
        ExportLayout("ARAMIS, data exporter", ("x_undef", "y_undef", "z_undef"), _uvw, key=("ID",)),
        ExportLayout(
            "GOM Inspect, ARAMIS Professional", _xyz,
            ("displacement_x", "displacement_y", "displacement_z"), key=("id",),
        ),
    ),
    "matchid": (
        ExportLayout(
            "MatchID 2024", ("coor.X", "coor.Y", "coor.Z"),
            ("disp.Horizontal Displacement U", "disp.Vertical Displacement V", "disp.Out-Of-Plane: W"),
            key=("Coordinates.Image X", "Coordinates.Image Y"),
        ),
        ExportLayout("MatchID to 2023", _xyz, _uvw, key=("x_pic", "y_pic")),
    ),
    # Field names of https://github.com/dicengine/dice. GAMMA, SIGMA and MATCH are -1 for a failed subset.
    "dice": (
        _DICE,
        replace(_DICE, program="DICe without subset numbers", key=("COORDINATE_X", "COORDINATE_Y")),
    ),
    "opencorr": (
        ExportLayout(
            "OpenCorr", ("ref_x", "ref_y", "ref_z"), _uvw, key=("x", "y"),
            rejected=("r1r2 ZNCC", "r1t1 ZNCC", "r1t2 ZNCC"),
        ),
    ),
    # https://github.com/SolavLab/DuoDIC keeps cells of a MATLAB structure: `DUODIC_CURE` writes tables.
    "duodic": (
        ExportLayout(
            "DuoDIC, MultiDIC", ("Points3D_X", "Points3D_Y", "Points3D_Z"),
            ("DispVec_X", "DispVec_Y", "DispVec_Z"), key=("point",),
        ),
    ),
}
# fmt: on
"""Name in shot.toml -> layouts. The first layout with all its columns in the header is used."""


UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254}
"""Allowed units of length, in metres."""
FILES_LIMIT = 10_000
"""Maximum number of frames of one export."""
_HEADING_UNIT = re.compile(r".*[\[(]([^\[\]()]*)[\])]\s*")
_UNIT = re.compile(r"\s*\[[^\[\]]*\]\s*$|\s*\([^()]*\)\s*$")


class PointState(IntEnum):
    """State of a point in a frame of an export."""

    VALID = 0
    """It has a displacement."""
    REJECTED = 1
    """The program marked it as failed."""
    MISSING = 2
    """It has no row, or a row without numbers."""


@dataclass(frozen=True)
class DicExport:
    """Points of a surface in the coordinate system of the measuring program (SI)."""

    paths: tuple[Path, ...]
    """The files, by frame."""
    sha256: str
    """SHA-256 over the hashes of all files, hex."""
    program: str
    frame: IntArray
    """Frame numbers from the names of the files, increasing, shape [n_frames]."""
    X: FloatArray
    """Reference positions [m], shape [n_points, 3]."""
    u: FloatArray
    """Displacements from these positions [m], shape [n_frames, n_points, 3]; NaN for an invalid point."""
    state: IntArray
    """`PointState` of every point in every frame, shape [n_frames, n_points]."""


def matching(folder: Path, pattern: str) -> tuple[Path, ...]:
    """The files of a pattern, by name.

    Raises InputError if there is none, or if there are more than `FILES_LIMIT`.
    """
    found = tuple(sorted(path for path in folder.glob(pattern) if path.is_file()))
    if not found:
        raise InputError(folder / pattern, "matches no file", cure="correct the pattern, or put them there")
    if len(found) > FILES_LIMIT:
        raise InputError(folder / pattern, f"matches {len(found)} files", allowed=f"at most {FILES_LIMIT}")
    return found


def read(
    paths: Sequence[Path],
    layout: str,
    *,
    unit: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> DicExport:
    """Read the points of all frames.

    A point is identified by the layout's key or, without a key, by its row. The coordinates of the files may
    be reference or current positions. The numbers show which: only current ones change.

    ``paths``: the files. Their names contain the frame numbers. ``layout``: a key of `LAYOUTS`. ``unit``:
    unit of length of coordinates and displacements. None: that of the headings, or mm if they have none.
    ``delimiter``, ``decimal``: as in `kolsky.readers.layout.Layout`; detected if None. Raises InputError if a
    file cannot be read or lacks a column, if a heading has another unit than the declared one, or if names
    have no frame numbers. The same error is raised if a point is repeated, if rows cannot be distinguished,
    or if coordinates are of neither kind.
    """
    if layout not in LAYOUTS or (unit is not None and unit not in UNITS):
        message = f"is declared to be of '{layout}'" + (f" in '{unit}'" if unit is not None else "")
        allowed = f"one of {', '.join(LAYOUTS)} in one of {', '.join(UNITS)}"
        raise InputError(paths[0], message, allowed=allowed)
    numbers = _frame_numbers(paths)
    order = np.argsort(numbers)
    files = [_one(paths[i], layout, unit, Layout(delimiter=delimiter, decimal=decimal)) for i in order]
    programs = {file.program for file in files}
    if len(programs) > 1:
        message = f"and the others are of {sorted(programs)}"
        raise InputError(paths[0], message, cure="export all frames alike")
    lengths = {len(file.keys) for file in files}
    if (not files[0].keys or isinstance(files[0].keys[0], int)) and len(lengths) > 1:
        raise InputError(
            files[0].path,
            f"and the others have {min(lengths)} to {max(lengths)} rows and nothing that identifies the "
            "points",
            cure="export the points' numbers or places in the picture too",
        )
    index = {key: i for i, key in enumerate(dict.fromkeys(key for file in files for key in file.keys))}
    coordinates = np.full((len(files), len(index), 3), np.nan)
    u, state = coordinates.copy(), np.full(coordinates.shape[:2], int(PointState.MISSING))
    for i, file in enumerate(files):
        places = [index[key] for key in file.keys]
        coordinates[i, places] = file.coordinates
        u[i, places] = file.displacements
        state[i, places] = file.state
    u[state != PointState.VALID] = np.nan
    X = _reference(files[0].path, coordinates, u)
    known = np.isfinite(X).all(axis=1)
    if not known.any():
        raise InputError(files[0].path, "and the others have no valid point", cure="export valid points")
    return DicExport(
        paths=tuple(file.path for file in files),
        sha256=hashlib.sha256("".join(file.sha256 for file in files).encode()).hexdigest(),
        program=files[0].program,
        frame=numbers[order],
        X=X[known],
        u=u[:, known],
        state=state[:, known],
    )


def programs_of(path: Path) -> dict[str, tuple[str, ...]]:
    """The programs with headings that match a file, and the units of length in these headings.

    Names of one letter, such as x, y, z, u, v, w, are common. For such names, the columns that identify a
    point must also be present. `read` does not require them.

    ``path``: one file of a series. Returns: keys of `LAYOUTS`. Empty if the file is no table of a program.
    """
    try:
        _, table, sheet = _sheet(path, Layout())
    except InputError:
        return {}
    found = {}
    for program, layouts in LAYOUTS.items():
        for form in layouts:
            lengths = (*form.coordinates, *form.displacements)
            common = all(len(name) == 1 for name in lengths)
            wanted = {*lengths, *(form.key if common else ())}
            if wanted <= {*sheet.names} and program not in found:
                headings = [table.names[sheet.names.index(name)] for name in lengths]
                stated = {unit for heading in headings if (unit := _stated_unit(heading))}
                found[program] = tuple(sorted(stated))
    return found


@dataclass(frozen=True)
class _File:
    path: Path
    sha256: str
    program: str
    keys: tuple[object, ...]
    coordinates: FloatArray
    """Positions of the points [m]."""
    displacements: FloatArray
    """Displacements of the points [m]."""
    state: IntArray


def _sheet(path: Path, declared: Layout) -> tuple[str, Sheet, Sheet]:
    """The hash of a file, its table, and its columns by their names without units."""
    sha256, lines, _ = read_text(path, declared)
    # Columns that are NaN or empty in most rows are still columns of numbers.
    table = find_table(path, lines, declared, sparse=True)
    names = tuple(_UNIT.sub("", name) if len(name) <= LONGEST_FIELD else name for name in table.names)
    return sha256, table, replace(table, names=names)


def _one(path: Path, layout: str, unit: str | None, declared: Layout) -> _File:
    """The points of one frame."""
    sha256, table, sheet = _sheet(path, declared)
    names = {*sheet.names}
    fitting = [form for form in LAYOUTS[layout] if {*form.coordinates, *form.displacements} <= names]
    chosen = next((form for form in fitting if {*form.key} <= names), fitting[0] if fitting else None)
    if chosen is None:
        forms = " or ".join(
            ", ".join((*form.key, *form.coordinates, *form.displacements)) for form in LAYOUTS[layout]
        )
        message = f"lacks columns of '{layout}'; its columns are {', '.join(sheet.names)}"
        raise InputError(path, message, line=table.first_line - 1 or None, cure=f"export {forms}")

    def columns(wanted: tuple[str, ...]) -> FloatArray:
        return np.stack([sheet.numbers(sheet.column(name), gaps=True) for name in wanted], axis=-1)

    def lengths(wanted: tuple[str, ...]) -> FloatArray:
        factors = []
        for heading in (table.names[sheet.column(name)] for name in wanted):
            stated = _stated_unit(heading)
            if stated and unit is not None and UNITS[unit] != UNITS[stated]:
                message = (
                    f"has the unit '{stated}' in its column '{heading}', and unit = \"{unit}\" is declared"
                )
                raise InputError(path, message, cure=f'declare unit = "{stated}", or leave unit out')
            factors.append(UNITS[stated or unit or "mm"])
        return columns(wanted) * factors

    coordinates, displacements = lengths(chosen.coordinates), lengths(chosen.displacements)
    state = np.full(len(coordinates), int(PointState.VALID))
    for name in (name for name in chosen.rejected if name in sheet.names):
        state[columns((name,))[:, 0] < 0.0] = int(PointState.REJECTED)
    gone = ~(np.isfinite(coordinates).all(axis=1) & np.isfinite(displacements).all(axis=1))
    state[gone] = int(PointState.MISSING)
    keys: tuple[object, ...] = tuple(range(len(coordinates)))
    if chosen.key and {*chosen.key} <= names:
        keys = tuple(map(tuple, columns(chosen.key)))
        if len(set(keys)) < len(keys):
            twice = next(key for i, key in enumerate(keys) if key in keys[:i])
            message = f"has the point {chosen.key} = {twice} twice"
            raise sheet.error(message, keys.index(twice), "export each point once")
    return _File(path, sha256, chosen.program, keys, coordinates, displacements, state)


def _stated_unit(heading: str) -> str:
    """The unit of length in the brackets of a heading. Empty if there is none."""
    brackets = full_match(_HEADING_UNIT, heading)
    stated = brackets.group(1).strip() if brackets is not None else ""
    return stated if stated in UNITS else ""


def _frame_numbers(paths: Sequence[Path]) -> IntArray:
    """The frame numbers: the group of digits that differs between the file names."""
    groups = [re.findall(r"\d+", path.stem) for path in paths]
    count = min(map(len, groups), default=0)
    if any(len(group) != count for group in groups) or not count:
        message = "and the others have names with different numbers"
        raise InputError(paths[0], message, cure="end them alike: img_0012.csv")
    changing = [i for i in range(count) if len({int(group[i]) for group in groups}) == len(groups)]
    varied = [i for i in range(count) if len({int(group[i]) for group in groups}) > 1]
    place = [count - 1] if len(groups) == 1 else changing
    if len(place) != 1 or (len(groups) > 1 and varied != place):
        message = "and the others have no single number that differs from file to file"
        raise InputError(paths[0], message, cure="name them by frame: img_0012.csv")
    return np.array([int(group[place[0]]) for group in groups], dtype=np.int64)


def _reference(path: Path, coordinates: FloatArray, u: FloatArray) -> FloatArray:
    """Reference positions of all points; NaN for a point that is never valid."""
    valid = np.asarray(np.isfinite(u).all(axis=2))
    first = np.argmax(valid, axis=0)
    points = np.arange(valid.shape[1])
    still, moving = coordinates, coordinates - u
    spread = {}
    for name, candidate in (("reference", still), ("current", moving)):
        off = np.abs(candidate - candidate[first, points])[valid]
        spread[name] = float(np.median(off.max(axis=-1))) if off.size else 0.0
    kind = "reference" if spread["reference"] <= spread["current"] else "current"
    travel = float(np.median(np.abs(u[valid]).max(axis=-1))) if valid.any() else 0.0
    if spread[kind] > 1e-6 + 1e-3 * travel:  # printed digits of a micrometre at worst
        raise InputError(
            path,
            f"and the others: coordinates of a point change by {spread[kind] * 1e6:.3g} um from frame to"
            " frame, and not by its displacement",
            cure="are the keys those of the points? export without removal of rigid motion",
        )
    chosen = still if kind == "reference" else moving
    X = np.array(chosen[first, points], dtype=np.float64)
    X[~valid[first, points]] = np.nan
    return X
