"""MATLAB .mat: plain numeric arrays of versions 5 to 7, and of 7.3 (an HDF5 file).

Objects, functions, cells and structures are not opened. Save the signals as plain arrays. The scalars of
PicoScope and of most scripts give the clock: Tinterval and Tstart, dt and t0, fs.

SciPy reads versions 5 to 7 in a separate process (`kolsky.readers.child`), because damaged files can crash
it. Files with three random bytes changed ended in a segmentation fault or a bus error.
"""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kolsky.base.errors import InputError
from kolsky.readers.contents import Contents, file_hash, head_of, read_in_child
from kolsky.readers.hdf5 import NamedArray, array_channels, array_lines, column_of, columns_of, inside
from kolsky.readers.layout import Layout

LIMIT = 400_000_000
"""Largest file before 7.3 [bytes]."""
_HDF5_OFFSET = 512
"""A 7.3 file has its HDF5 signature after a text header."""

DUODIC_CURE = (
    "write a table a frame in MATLAB, with its structure as P: for k = 1:numel(P.Points3D), "
    "M = [(1:size(P.Points3D{k}, 1))' P.Points3D{1} P.Disp.DispVec{k}]; writetable(array2table(M, "
    "'VariableNames', {'point', 'Points3D_X', 'Points3D_Y', 'Points3D_Z', 'DispVec_X', 'DispVec_Y', "
    "'DispVec_Z'}), sprintf('duodic_%04d.csv', k)); end"
)
"""MATLAB commands that write the layout "duodic" of `kolsky.readers.dic_export`."""


def sniff(path: Path) -> bool:
    """True if a file has MATLAB's signature or ends in .mat."""
    return head_of(path, 10).startswith(b"MATLAB") or path.suffix.lower() == ".mat"


def read(path: Path, layout: Layout) -> Contents:
    """Read the numeric arrays of a file.

    Raises InputError if it is damaged or not a .mat file, or if it has only objects, cells or structures.
    """
    sha256 = file_hash(path)
    arrays, scalars, others, version = _arrays(path)
    return Contents(
        path=path,
        sha256=sha256,
        **array_channels(path, arrays, scalars, layout),
        facts={"format": "matlab", "version": version}
        | ({"without numbers": ", ".join(others)} if others else {}),
        metadata={name: f"{value:.12g}" for name, value in scalars.items()},
    )


def table_lines(path: Path, _sheet: str | None) -> tuple[str, list[str]]:
    """Hash, and the numeric arrays of equal length as tab-separated lines. Raises InputError as `read`."""
    return file_hash(path), array_lines(path, _arrays(path)[0])


def _arrays(path: Path) -> tuple[list[NamedArray], dict[str, float], list[str], str]:
    """Arrays, scalars, other variables, and the version of a file."""
    head = head_of(path, _HDF5_OFFSET + 8)
    if head[_HDF5_OFFSET:].startswith(b"\x89HDF") or head.startswith(b"\x89HDF"):
        found = inside(path)
        plain = [array for array in found.arrays if array.name.count("/") == 1]
        arrays = [replace(array, name=array.name.removeprefix("/")) for array in plain]
        scalars = {name.removeprefix("/"): value for name, value in found.scalars.items()}
        others = found.others
        version = "7.3"
    else:
        file_hash(path, limit=LIMIT)
        arrays, scalars, others = _plain(path)
        version = "5 to 7"
    if any(re.fullmatch(r"/?DIC3D\w*(/Points3D)? \(.*\)", name) for name in others):
        raise InputError(path, "holds a structure of DuoDIC or MultiDIC, with all frames", cure=DUODIC_CURE)
    if not arrays:
        raise InputError(
            path,
            "holds no numeric array" + (f", but {', '.join(others[:8])}" if others else ""),
            cure="save the signals as plain arrays: save('shot.mat', 'time', 'ch1', 'ch2'), or the fields of "
            "a structure: save('shot.mat', '-struct', 'test')",
        )
    return arrays, scalars, others, version


def _plain(path: Path) -> tuple[list[NamedArray], dict[str, float], list[str]]:
    """Arrays, scalars, and other variables with their classes, of a file before 7.3."""
    arrays: list[NamedArray] = []
    scalars, others = {}, []
    with TemporaryDirectory() as folder:
        place = Path(folder, "arrays.npz")
        listed: list[tuple[str, str]] = read_in_child(path, "mat", place, _damaged)
        with np.load(place) as stored:
            values_of = [stored[name] for name in stored.files]
    numbers = iter(values_of)
    for name, kind in listed:
        if kind != "number":
            others.append(f"{name} ({kind})")
            continue
        array = next(numbers)
        if array.size == 1:
            scalars[name] = float(array.ravel()[0])
            continue
        columns = columns_of(name, array.shape)
        if not columns:
            others.append(f"{name} (array of {' x '.join(map(str, array.shape))})")
        arrays += [NamedArray(full, samples, partial(column_of, array, i)) for full, samples, i in columns]
    return arrays, scalars, others


def _damaged(path: Path, error: str) -> InputError:
    head = head_of(path, 200)
    text = head.count(0) == 0 and not head.startswith(b"MATLAB")
    cure = "it seems to be text: rename it to end in .csv" if text else "copy it again; it may be cut off"
    return InputError(path, f"is not a .mat file that can be read ({error})", cure=cure)
