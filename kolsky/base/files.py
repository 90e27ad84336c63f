"""Bytes and text of a file, result folders, CSV tables and JSON values.

Result folders are written completely or not at all.
"""

import csv
import hashlib
import json
import math
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from enum import Enum
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from dic.files import HIDDEN, alone_in, replacing, scratch, text_cell
from dic.files import regular as regular  # for the readers, which import no other package
from kolsky.base.errors import InputError

CURE = "give another place with --out FOLDER"
SIZE_LIMIT = 200_000_000
"""Largest text export that is read [bytes]."""


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Convert a system error inside it to an InputError about a file that is read."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(path, "there is no such file", cure="put it there or correct its name") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", cure="copy it again, and see that it may be read"
        ) from None


@contextmanager
def beginning(path: Path) -> Iterator[None]:
    """Make the folder of a new file, which is then opened with the mode "x".

    Raises InputError if the file exists, if its folder is not a folder, or if either cannot be written.
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except FileExistsError as error:
        at_fault = path if folder.is_dir() else Path(error.filename)
        raise InputError(
            at_fault, "exists already and was not changed", cure="edit it, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(
            folder, f"cannot be written ({error.strerror})", cure="give another folder, or make it writable"
        ) from None


def check_size(path: Path, size: int, limit: int) -> None:
    """Raise InputError if a file has more than `limit` bytes."""
    if size > limit:
        raise InputError(
            path,
            f"has {size / 1e6:.0f} MB, more than the {limit / 1e6:.0f} MB that are read",
            cure="export the time span of the test only",
        )


def read_bytes(path: Path, *, limit: int = SIZE_LIMIT) -> bytes:
    """The bytes of a regular file of sensible size.

    Raises InputError if there is no such file, if it is a folder, a device or empty, or if it may not be
    read. The same error is raised if it is larger than `limit` bytes; its size is found without reading it.
    """
    with read_errors(path):
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(path, "is a folder, not a file", cure="name the file inside it")
        if not stat.S_ISREG(status.st_mode):
            kind = "a pipe" if stat.S_ISFIFO(status.st_mode) else "a device or a socket"
            raise InputError(path, f"is {kind}, not a regular file", cure="copy the data into a file")
        check_size(path, status.st_size, limit)
        data = path.read_bytes()
    if not data.strip():
        raise InputError(path, "is empty", cure="export it again")
    return data


def decode(path: Path, data: bytes) -> str:
    """UTF-8 text of a file, with or without a byte order mark.

    Raises InputError if the bytes are not UTF-8, with the offset of the first invalid byte.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        offset = error.start + (3 if data.startswith(b"\xef\xbb\xbf") else 0)
        raise InputError(
            path,
            f"is not UTF-8 text: byte 0x{data[offset]:02x} at byte offset {offset}",
            line=data.count(b"\n", 0, offset) + 1,
            cure="convert it to UTF-8, e.g. `iconv -f latin1 -t utf-8`",
        ) from None


def write_table(path: Path, columns: Mapping[str, Iterable[Any]]) -> Path:
    """Write named columns of equal length, floats with 9 significant digits.

    Returns the path. Text that a spreadsheet would read as a formula gets a leading apostrophe; see
    `dic.files.text_cell`.

    Parameters
    ----------
    path
        Path of the file. Its folder is created if absent.
    columns
        Heading, with the unit, -> values.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow([text_cell(name) for name in columns])
        rows.writerows([_cell(value) for value in row] for row in zip(*columns.values(), strict=True))
    return path


def write_tables(folder: Path, tables: Mapping[str, Mapping[str, Iterable[Any]]]) -> list[Path]:
    """Write tables by name, see `write_table`. Returns their paths."""
    return [write_table(Path(folder) / f"{name}.csv", columns) for name, columns in tables.items()]


def columns_of(rows: Iterable[Mapping[str, Any]], headings: Iterable[str] = ()) -> dict[str, list[Any]]:
    """A table of rows given as heading -> cell. ``headings``: headings that it has even without rows."""
    columns: dict[str, list[Any]] = {heading: [] for heading in headings}
    for row in rows:
        for heading, cell in row.items():
            columns.setdefault(heading, []).append(cell)
    return columns


Files = Mapping[str, Any]
"""Name of a file -> its text, an object of JSON types, or the function of its path that writes it."""


def write_folder(
    folder: Path, files: Files, tables: Mapping[str, Mapping[str, Iterable[Any]]] | None = None
) -> None:
    """Write files, and tables by name (see `write_table`), into a folder: all of them, or none.

    Raises InputError as `filling`.
    """
    with filling(folder) as partial:
        write_tables(partial, tables or {})
        write_files(partial, files)


def write_files(folder: Path, files: Files) -> None:
    """Write files into a folder; see `Files`."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if callable(content):
            content(path)
        elif isinstance(content, str):
            path.write_text(content, encoding="utf-8")
        else:
            write_json(path, content)


def write_json(path: Path, content: Any) -> None:
    """Write an object of JSON types."""
    path.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _cell(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else text_cell(str(value))


def usable_folder(folder: Path) -> Path:
    """The folder, after a check that results can be written into it.

    The folder is not created. Raises InputError if it is a file. The same error is raised if the folder, or
    its nearest existing parent, cannot be written to.
    """
    folder = Path(folder)
    above = folder
    try:
        while not above.exists() and above != above.parent:
            above = above.parent
        if not above.is_dir():
            raise InputError(above, "is a file; results need a folder", cure=CURE)
    except OSError as error:  # a name that is too long, a folder that may not be entered
        raise InputError(folder, f"cannot be used for results: {error.strerror}", cure=CURE) from None
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(above, "is not writable", cure=CURE)
    return folder


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """A temporary folder.

    Its files are moved to `folder` when the block ends without an exception. The files are first written
    beside the old ones. A full disk, an error or an interrupt therefore leaves every old result unchanged and
    creates no new folder.

    Raises InputError if a file cannot be written or moved to its place.
    """
    made = missing(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with scratch(folder) as partial:
            yield partial
            files = sorted(p for p in partial.rglob("*") if p.is_file() and not _hidden(p, partial))
            places = [folder / p.relative_to(partial) for p in files]
            for place in places:
                if place.is_dir():
                    raise InputError(place, "is a folder where a result must go", cure=CURE)
            with alone_in(folder):
                for place in places:
                    place.parent.mkdir(parents=True, exist_ok=True)
                for file, place in zip(files, places, strict=True):
                    os.replace(file, place)
    except OSError as error:
        remove_empty(made)
        cause = error.strerror or str(error)
        raise InputError(folder, f"results cannot be written: {cause}", cure=CURE) from error
    except BaseException:
        remove_empty(made)
        raise


def _hidden(path: Path, above: Path) -> bool:
    """True if a file lies in a hidden folder of `dic.files.scratch` inside another."""
    return any(part.startswith(HIDDEN) for part in path.relative_to(above).parts[:-1])


def missing(folder: Path) -> list[Path]:
    """The folder and its parents that do not exist, innermost first."""
    return [path for path in (folder, *folder.parents) if not path.exists()]


def remove_empty(folders: list[Path]) -> None:
    """Remove those of these folders that are empty, innermost first."""
    for path in folders:
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()


@cache
def template_file(name: str) -> str:
    """An annotated file with every key: shot.toml, bars.toml, pictures.toml, specimen.toml, virtual.toml."""
    return files("kolsky").joinpath("cli", "templates", name).read_text(encoding="utf-8")


def source_hash() -> str:
    """SHA-256 of the sources of `kolsky` and `explicit`.

    A version number does not identify a working copy.
    """
    total = hashlib.sha256()
    root = Path(__file__).parents[2]
    for path in sorted(p for package in ("kolsky", "explicit") for p in (root / package).rglob("*.py")):
        total.update(str(path.relative_to(root)).encode() + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def jsonable(value: Any, where: str) -> Any:
    """A value as JSON types.

    Arrays and tuples become lists, enums text, and numbers that are not finite null. Raises TypeError if a
    part of it has no such form. The message gives the place of this part, beginning with `where`.
    """
    if isinstance(value, Enum):
        return value.value if isinstance(value.value, str) else value.name
    if hasattr(value, "tolist"):  # an array or a number of NumPy, which a command loads only if it needs it
        return jsonable(value.tolist(), where)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): jsonable(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item, f"{where}[{number}]") for number, item in enumerate(value)]
    raise TypeError(f"{where} is a {type(value).__name__}; JSON has numbers, texts, lists and objects only")
