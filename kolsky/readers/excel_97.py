"""Old Excel workbook (.xls, Excel 97 to 2003): the stored values of one sheet. Formulas are not used."""

from pathlib import Path

from kolsky.readers.contents import Contents, Layout, file_hash, head_of, read_in_child
from kolsky.readers.excel import COMPRESSED_LIMIT, chosen_sheet, damaged, sheet_contents, sheet_lines

BINARY = True

_HEAD = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def sniff(path: Path) -> bool:
    """True if a file ends in .xls and is a compound file. Many programs also use .xls for text files."""
    return path.suffix.lower() == ".xls" and head_of(path, 8) == _HEAD


def read(path: Path, layout: Layout) -> Contents:
    """Read a sheet as a table with metadata, names, units and samples.

    Raises InputError if it is damaged or not a workbook, or if several sheets have data and none is declared.
    Other reasons are those of `kolsky.readers.delimited.read_lines`.
    """
    sha256, title, rows = _chosen(path, layout.sheet)
    return sheet_contents(path, sha256, "excel 97", title, rows, layout)


def table_lines(path: Path, wanted: str | None) -> list[str]:
    """The rows of the declared sheet or the only sheet with data, as tab-separated lines.

    Raises InputError as `read`.
    """
    _, title, rows = _chosen(path, wanted)
    return sheet_lines(path, title, rows)


def _chosen(path: Path, wanted: str | None) -> tuple[str, str, list[list[object]]]:
    """Hash of the file, and title and rows of the selected sheet."""
    sha256 = file_hash(path, limit=COMPRESSED_LIMIT)
    read = read_in_child(path, "xls", path, damaged)
    sheets = {sheet["title"]: sheet["rows"] for sheet in read}
    filled = [
        title for title, rows in sheets.items() if any(cell not in ("", None) for r in rows for cell in r)
    ]
    filled = [sheet["title"] for sheet in read if sheet["shown"] and sheet["title"] in filled] or filled
    title = chosen_sheet(path, list(sheets), filled, wanted)
    return sha256, title, sheets[title]
