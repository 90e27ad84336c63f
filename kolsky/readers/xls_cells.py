"""Cells of an old Excel workbook (.xls) as JSON on standard output: run as a program of its own.

The library that takes the cells from the file lays out every sheet as a full rectangle. A damaged or hostile
file may name a cell so far out that the memory for it cannot be had, and then the whole process ends. So it
is not the process that reads a shot: `kolsky.readers.excel_97` starts this one.
"""

import json
import signal
import sys

MEMORY = 1_300_000_000
"""Most memory of this process, where the system can limit it [bytes]."""


LONGEST = 10
"""Time after which it ends, where the system has alarms, also when nobody waits for it any more [s]."""


def limit() -> None:
    """Have an allocation beyond `MEMORY` fail instead of taking the machine's memory, and end in time."""
    try:
        import resource
    except ImportError:  # Windows
        return
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.alarm(LONGEST)


def main(path: str) -> None:
    """Print the sheets of a workbook: title, and rows of texts, numbers and truth values."""
    from python_calamine import load_workbook

    with load_workbook(path) as book:
        sheets = [
            {"title": title, "rows": book.get_sheet_by_name(title).to_python(skip_empty_area=False)}
            for title in book.sheet_names
        ]
    json.dump(sheets, sys.stdout, default=str)


if __name__ == "__main__":
    limit()
    main(sys.argv[1])
