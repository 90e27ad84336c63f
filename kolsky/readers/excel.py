"""Excel workbooks (.xlsx, and .xls of Excel 97 to 2003): the stored values of one sheet, without formulas.

openpyxl reads the rows of .xlsx one by one. python-calamine is used for the old .xls, in a child process: it
first stores a sheet as a full rectangle. A cell at XFD1048576 then crashes the process.
"""

import math
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Contents, file_hash, head_of, read_in_child
from kolsky.readers.delimited import read_lines
from kolsky.readers.layout import Layout

COMPRESSED_LIMIT = 100_000_000
"""Largest workbook that is read [bytes]."""
UNPACKED_LIMIT = 500_000_000
"""Largest unpacked size of all its parts [bytes]. A small file may unpack to any size."""
COLUMNS_LIMIT = 256
"""Maximum number of columns that are read."""
ROWS_LIMIT = 1_048_576
"""Maximum number of rows of a sheet, as in Excel. A damaged file may declare any number."""

_DECLARATIONS = (b"<!DOCTYPE", b"<!ENTITY", "<!DOCTYPE".encode("utf-16-le"), "<!DOCTYPE".encode("utf-16-be"))


@dataclass(frozen=True)
class Workbook:
    """A format of workbooks."""

    form: str
    """Its name in `kolsky.readers.recordings.FORMATS`."""
    suffixes: tuple[str, ...]
    """Endings of its files. Some workbooks of Excel are misnamed .xls, and so are many text files."""
    start: bytes
    """First bytes of its files."""
    chosen: Callable[[Path, str | None], tuple[str, str, Sequence[Sequence[object]]]]
    """Hash of a file, and title and rows of the declared sheet or the only sheet with data."""

    def sniff(self, path: Path) -> bool:
        """True if a file looks like this format, by its ending and first bytes."""
        return path.suffix.lower() in self.suffixes and head_of(path, len(self.start)) == self.start

    def read(self, path: Path, layout: Layout) -> Contents:
        """Read a sheet as a table with metadata, names, units and samples.

        Raises InputError if the file is damaged, not a workbook, too large unpacked, or declares XML
        entities; if several sheets have data and none is declared; if the sheet is empty; or if a cell
        contains an error. Other reasons are those of `kolsky.readers.delimited.read_lines`.
        """
        sha256, title, rows = self.chosen(path, layout.sheet)
        stated = replace(layout, delimiter="tab", decimal=".")
        facts = {"format": self.form, "sheet": title}
        contents = read_lines(path, sha256, _lines(path, title, rows), stated, facts, word="row")
        kept = {key: value for key, value in contents.facts.items() if key not in ("delimiter", "decimal")}
        return replace(contents, facts=kept)

    def table_lines(self, path: Path, wanted: str | None) -> tuple[str, list[str]]:
        """Hash, and the rows of a sheet as tab-separated lines. Raises InputError as `read`."""
        sha256, title, rows = self.chosen(path, wanted)
        return sha256, _lines(path, title, rows)


def _lines(path: Path, title: str, rows: Sequence[Sequence[object]]) -> list[str]:
    """The rows of a sheet as lines with tabs, at most `COLUMNS_LIMIT` columns."""
    texts = [
        [_text(path, number, cell) for cell in row[:COLUMNS_LIMIT]]
        for number, row in enumerate(rows, start=1)
    ]
    width = max(map(len, texts), default=0)
    lines = ["\t".join(cells + [""] * (width - len(cells))) for cells in texts]
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError(path, f"sheet '{title}' is empty", cure="name the sheet with the samples")
    return lines


def _title(path: Path, titles: Sequence[str], filled: Sequence[str], wanted: str | None) -> str:
    """The title of the declared sheet or of the only sheet with data."""
    if wanted is not None and wanted not in titles:
        message = f"has no sheet '{wanted}'; its sheets are {list(titles)}"
        raise InputError(path, message, cure="correct sheet")
    if wanted is not None:
        return wanted
    if len(filled) != 1:
        raise InputError(
            path,
            f"has {len(filled)} sheets with data: {list(filled)}"
            if filled
            else f"has no cell with data in its sheets {list(titles)}",
            cure='name the sheet: layout = { sheet = "NAME" } in a TOML file, --sheet NAME for a command; or '
            "keep one sheet with data"
            if filled
            else "is it the right file? if so, save it in Excel with the values of its formulas",
        )
    return filled[0]


def _check_archive(path: Path) -> None:
    """Unpack every part once, without storing it. Sizes in the archive's directory may be wrong."""
    total = 0
    try:
        with zipfile.ZipFile(path) as archive:
            for part in archive.infolist():
                before = b""
                with archive.open(part) as stream:
                    while block := stream.read(1 << 20):
                        total += len(block)
                        if total > UNPACKED_LIMIT:
                            message = f"unpacks to more than {UNPACKED_LIMIT / 1e6:.0f} MB"
                            raise InputError(path, message, cure="export the record as CSV")
                        if any(word in before + block for word in _DECLARATIONS):
                            message = f"declares XML entities in {part.filename}"
                            raise InputError(path, message, cure="save it again in Excel")
                        before = block[-20:]
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError) as error:
        raise _damaged(path, error) from None


def _excel(path: Path, wanted: str | None) -> tuple[str, str, list[tuple[object, ...]]]:
    import openpyxl

    sha256 = file_hash(path, limit=COMPRESSED_LIMIT)
    _check_archive(path)
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
    except Exception as error:  # openpyxl passes on the errors of its parsers
        raise _damaged(path, error) from None
    try:
        sheets = {sheet.title: sheet for sheet in book.worksheets}
        filled = [title for title, sheet in sheets.items() if wanted is None and _has_rows(sheet)]
        shown = [title for title in filled if sheets[title].sheet_state == "visible"]
        filled = shown or filled  # a hidden sheet holds a program's settings
        title = _title(path, list(sheets), filled, wanted)
        rows: list[tuple[object, ...]] = []
        for row in sheets[title].iter_rows(values_only=True):
            if len(rows) == ROWS_LIMIT:
                message = f"sheet '{title}' has more than {ROWS_LIMIT} rows, more than a sheet can have"
                raise InputError(path, message, cure="save it again in Excel, or as CSV")
            rows.append(row[:COLUMNS_LIMIT])
        return sha256, title, rows
    except InputError:
        raise
    except Exception as error:
        raise _damaged(path, error) from None
    finally:
        book.close()


def _excel_97(path: Path, wanted: str | None) -> tuple[str, str, list[list[object]]]:
    sha256 = file_hash(path, limit=COMPRESSED_LIMIT)
    read = read_in_child(path, "xls", path, _damaged)
    sheets = {sheet["title"]: sheet["rows"] for sheet in read}
    filled = [
        title for title, rows in sheets.items() if any(cell not in ("", None) for r in rows for cell in r)
    ]
    filled = [sheet["title"] for sheet in read if sheet["shown"] and sheet["title"] in filled] or filled
    title = _title(path, list(sheets), filled, wanted)
    return sha256, title, sheets[title]


def _has_rows(sheet: object) -> bool:
    rows = sheet.iter_rows(values_only=True, max_row=50)  # type: ignore[attr-defined]
    return any(cell is not None for row in rows for cell in row)


def _text(path: Path, row: int, cell: object) -> str:
    """A cell as text; a number with all its digits."""
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


def _damaged(path: Path, error: Exception | str) -> InputError:
    """The error for a file that is damaged or not a workbook."""
    return InputError(path, f"is not a workbook that can be read ({error})", cure="save it again in Excel")


EXCEL = Workbook("excel", (".xlsx", ".xlsm", ".xls"), b"PK\x03\x04", _excel)
EXCEL_97 = Workbook("excel 97", (".xls",), b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", _excel_97)
