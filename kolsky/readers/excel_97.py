"""Old Excel workbook (.xls, Excel 97 to 2003): the stored values of one sheet, never its formulas."""

import json
import subprocess
from pathlib import Path
from typing import Any

from kolsky.base.process import run_program
from kolsky.readers.contents import Contents, Layout, file_hash, head_of
from kolsky.readers.excel import COMPRESSED_LIMIT, chosen_sheet, damaged, sheet_contents

BINARY = True

LONGEST = 9.0
"""Longest time that the cells of one workbook may take [s]."""
_HEAD = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def sniff(path: Path) -> bool:
    """True if a file ends in .xls and is a compound file; many programs call text so too."""
    return path.suffix.lower() == ".xls" and head_of(path, 8) == _HEAD


def read(path: Path, layout: Layout) -> Contents:
    """Read a sheet as a table with metadata, names, units and samples.

    Raises
    ------
    InputError
        If it is no workbook, is damaged, or has several sheets with data and none is named; and as
        `kolsky.readers.delimited.read_lines`.
    """
    sha256 = file_hash(path, limit=COMPRESSED_LIMIT)
    sheets = {sheet["title"]: sheet["rows"] for sheet in _sheets(path)}
    filled = [
        title for title, rows in sheets.items() if any(cell not in ("", None) for r in rows for cell in r)
    ]
    title = chosen_sheet(path, list(sheets), filled, layout.sheet)
    return sheet_contents(path, sha256, "excel 97", title, sheets[title], layout)


def _sheets(path: Path) -> list[dict[str, Any]]:
    """Titles and rows of all sheets, from a process of its own."""
    program = Path(__file__).with_name("xls_cells.py")
    try:
        done = run_program(program, str(path), timeout=LONGEST)
    except subprocess.TimeoutExpired:
        raise damaged(path, f"no cells after {LONGEST:g} s") from None
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if "memory allocation" in line or "Error" in line]
        raise damaged(path, said[-1] if said else f"its reader ended with code {done.returncode}")
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found
