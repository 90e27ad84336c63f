"""Excel workbook (.xlsx): the cached values of one sheet, never its formulas."""

import math
import zipfile
import zlib
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Contents, Layout, file_hash, head_of
from kolsky.readers.delimited import read_lines

BINARY = True

COMPRESSED_LIMIT = 100_000_000
"""Largest workbook that is read [bytes]."""
UNPACKED_LIMIT = 500_000_000
"""Largest size of all its parts unpacked [bytes]; a small file may unpack to any size."""
COLUMNS_LIMIT = 256
"""Most columns that are read."""

_DECLARATIONS = (b"<!DOCTYPE", b"<!ENTITY", "<!DOCTYPE".encode("utf-16-le"), "<!DOCTYPE".encode("utf-16-be"))


def sniff(path: Path) -> bool:
    """True if a file ends in .xlsx or .xlsm and is a zip archive."""
    return path.suffix.lower() in (".xlsx", ".xlsm") and head_of(path, 4) == b"PK\x03\x04"


def read(path: Path, layout: Layout) -> Contents:
    """Read a sheet as a table with metadata, names, units and samples.

    Raises
    ------
    InputError
        If it is no workbook, is too large unpacked, declares XML entities, has several sheets with data and
        none is named, or a cell holds an error; and as `kolsky.readers.delimited.read_lines`.
    """
    sha256 = file_hash(path, limit=COMPRESSED_LIMIT)
    _check_archive(path)
    title, rows = _rows(path, layout.sheet)
    width = max(map(len, rows), default=0)
    lines = ["\t".join(cells + [""] * (width - len(cells))) for cells in rows]
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError(path, f"sheet '{title}' is empty", cure="name the sheet with the samples")
    stated = Layout(**{**vars(layout), "delimiter": "tab", "decimal": "."})
    facts = {"format": "excel", "sheet": title}
    contents = read_lines(path, sha256, lines, stated, facts, word="row")
    kept = {key: value for key, value in contents.facts.items() if key not in ("delimiter", "decimal")}
    return Contents(path, sha256, contents.channels, kept, contents.metadata)


def _check_archive(path: Path) -> None:
    """Unpack every part once without keeping it: sizes in the directory of an archive may lie."""
    total = 0
    try:
        with zipfile.ZipFile(path) as archive:
            for part in archive.infolist():
                before = b""
                with archive.open(part) as stream:
                    while block := stream.read(1 << 20):
                        total += len(block)
                        if total > UNPACKED_LIMIT:
                            raise InputError(
                                path,
                                f"unpacks to more than {UNPACKED_LIMIT / 1e6:.0f} MB",
                                cure="export the record as CSV",
                            )
                        if any(word in before + block for word in _DECLARATIONS):
                            raise InputError(
                                path,
                                f"declares XML entities in {part.filename}",
                                cure="save it again in Excel",
                            )
                        before = block[-20:]
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError) as error:
        raise _damaged(path, error) from None


def _rows(path: Path, wanted: str | None) -> tuple[str, list[list[str]]]:
    """Title and rows of the sheet that is meant, cells as text."""
    import openpyxl

    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
    except Exception as error:  # openpyxl lets its parsers' errors through
        raise _damaged(path, error) from None
    try:
        titles = [sheet.title for sheet in book.worksheets]
        if wanted is not None and wanted not in titles:
            raise InputError(path, f"has no sheet '{wanted}'; its sheets are {titles}", cure="correct sheet")
        filled = [
            sheet
            for sheet in book.worksheets
            if sheet.title == wanted or (wanted is None and _has_rows(sheet))
        ]
        if len(filled) != 1:
            raise InputError(
                path,
                f"has {len(filled)} sheets with data: {[sheet.title for sheet in filled] or titles}",
                cure='say which: sheet = "NAME"',
            )
        return filled[0].title, [
            [_text(path, number, cell) for cell in row[:COLUMNS_LIMIT]]
            for number, row in enumerate(filled[0].iter_rows(values_only=True), start=1)
        ]
    except InputError:
        raise
    except Exception as error:
        raise _damaged(path, error) from None
    finally:
        book.close()


def _has_rows(sheet: object) -> bool:
    rows = sheet.iter_rows(values_only=True, max_row=50)  # type: ignore[attr-defined]
    return any(cell is not None for row in rows for cell in row)


def _text(path: Path, row: int, cell: object) -> str:
    """A cell as a line of text would have it; a number with all its digits."""
    if cell is None:
        return ""
    if isinstance(cell, bool | int):
        return str(cell)
    if isinstance(cell, float):
        return repr(cell) if math.isfinite(cell) else "nan"
    text = str(cell).replace("\t", " ").replace("\n", " ").replace("\r", " ")
    if text.startswith("#") and text.endswith(("!", "?", "/A")):
        raise InputError(path, f"row {row}: a cell holds the error {text}", cure="correct the sheet")
    return text


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(path, f"is not a workbook that can be read ({error})", cure="save it again in Excel")
