"""Read a file with a library that a damaged file may crash. It is a program: `child.py FORMAT PATH PLACE`.

python-calamine stores every sheet of an old Excel workbook as a full rectangle. SciPy reads beyond its
buffers if counts in a MATLAB file are damaged. The process that reads a shot must continue in both cases.
`read_in_child` of `kolsky.readers.contents` therefore starts this program. It does not import this package.
"""

import json
import math
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

MEMORY = {"xls": 1_300_000_000, "mat": 2_500_000_000}
"""Memory limit of this process, if the system supports one [bytes]."""
ALARM = 10
"""Time limit of this process, if the system supports alarms [s]; also if the parent has ended."""
UNPACKED_LIMIT = 400_000_000
"""Largest total size of the arrays of a MATLAB file [bytes]."""
NUMBERS = {
    "double": 8, "single": 4, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "logical": 1,
}  # fmt: skip
"""Class of a numeric array -> bytes per number."""


def limit(form: str) -> None:
    """Limit the memory of this process to `MEMORY` and its time to `ALARM`."""
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[name] = "1"  # each thread would take memory
    try:
        import resource
    except ImportError:  # Windows
        return
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY[form], MEMORY[form]))
    signal.alarm(ALARM)


def xls(path: str, place: str) -> list[dict[str, Any]]:
    """The sheets of a workbook: title, visibility, and rows of texts, numbers and truth values."""
    from python_calamine import SheetVisibleEnum, load_workbook

    with load_workbook(path) as book:
        shown = {one.name: one.visible == SheetVisibleEnum.Visible for one in book.sheets_metadata}
        return [
            {
                "title": title,
                "shown": shown.get(title, True),
                "rows": book.get_sheet_by_name(title).to_python(skip_empty_area=False),
            }
            for title in book.sheet_names
        ]


def mat(path: str, place: str, most: int = UNPACKED_LIMIT) -> list[tuple[str, str]]:
    """Name and class of the variables of a file before 7.3. Arrays of numbers are written to a .npz file."""
    import numpy as np
    from scipy.io import loadmat, whosmat

    with open(path, "rb") as file:
        listed = [v for v in whosmat(file) if not v[0].startswith("__") and v[2] != "opaque"]
        sizes = [NUMBERS[kind] * math.prod(shape) for _, shape, kind in listed if kind in NUMBERS]
        if sum(sizes) > most or min(sizes, default=0) < 0:
            raise ValueError(f"its variables unpack to more than {most / 1e6:g} MB")
        names = [name for name, _, kind in listed if kind in NUMBERS]
        found = loadmat(file, variable_names=names) if names else {}
    arrays: dict[str, Any] = {}
    for name in names:
        if not isinstance(found[name], np.ndarray):
            raise ValueError(found[name])
        if not np.iscomplexobj(found[name]):
            arrays[name] = found[name]
    np.savez(place, *arrays.values())
    return [
        (name, "number" if name in arrays else "complex" if kind in NUMBERS else kind)
        for name, _, kind in listed
    ]


if __name__ == "__main__":
    limit(sys.argv[1])
    readers: dict[str, Callable[..., object]] = {"xls": xls, "mat": mat}
    json.dump(readers[sys.argv[1]](*sys.argv[2:]), sys.stdout, default=str)
