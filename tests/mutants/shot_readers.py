"""Faults of reading the tables of a shot: columns, units, what a recording is taken for."""

from tests.mutants.fault import Fault

JUDGE = ("tests/unit/readers/test_judge.py",)
READERS = ("tests/unit/readers/test_readers.py",)
UNITS = ("tests/unit/base/test_units.py",)
LAYOUTS = ("tests/unit/shot/test_layouts.py",)

FAULTS = (
    Fault(
        name="a flat top of seven samples",
        file="kolsky/readers/recordings.py",
        right="SHORTEST_FLAT_TOP = 8",
        wrong="SHORTEST_FLAT_TOP = 7",
        tests=JUDGE,
    ),
    Fault(
        name="a flat top twice as long as runs elsewhere",
        file="kolsky/readers/recordings.py",
        right="LONGER_THAN_OTHERS = 4",
        wrong="LONGER_THAN_OTHERS = 2",
        tests=JUDGE,
    ),
    Fault(
        name="a quiet beginning within half of the range",
        file="kolsky/readers/recordings.py",
        right="0.2 * (high - low)",
        wrong="0.5 * (high - low)",
        tests=JUDGE,
    ),
    Fault(
        name="micro is milli",
        file="kolsky/readers/header.py",
        right='"µ": 1e-6',
        wrong='"µ": 1e-3',
        tests=JUDGE,
    ),
    Fault(
        name="times of a unit rounded twice",
        file="kolsky/base/units.py",
        right="return number / inverse if inverse and 1.0 / inverse == factor else number * factor",
        wrong="return number * factor",
        tests=UNITS,
    ),
    Fault(
        name="a column divided by its factor",
        file="kolsky/readers/table.py",
        right="numbers * column.factor, dtype",
        wrong="numbers / column.factor, dtype",
        tests=READERS,
    ),
    Fault(
        name="the finest printed digit of numbers with exponents",
        file="kolsky/readers/table.py",
        right="exponent = max(d.adjusted() for d in nonzero) - figures + 1",
        wrong="exponent = min(d.adjusted() for d in nonzero) - figures + 1",
        tests=READERS,
    ),
    Fault(
        name="a time that repeats is later",
        file="kolsky/readers/table.py",
        right="bad = np.flatnonzero(steps <= 0)",
        wrong="bad = np.flatnonzero(steps < 0)",
        tests=READERS,
    ),
    Fault(
        name="a gap in the samples is rounding",
        file="kolsky/readers/recordings.py",
        right="excess > 1.001 * digit + 1e-9 * step",
        wrong="excess > 1001 * digit + 1e-9 * step",
        tests=READERS,
    ),
    Fault(
        name="a line of a table one too high",
        file="kolsky/readers/measured_tables.py",
        right="return self.first_line + row",
        wrong="return self.first_line + row - 1",
        tests=LAYOUTS,
    ),
    Fault(
        name="a point among decimal commas is read",
        file="kolsky/readers/table.py",
        right='if self.sheet.dialect.decimal == ",":',
        wrong='if self.sheet.dialect.decimal == "":',
        tests=LAYOUTS,
    ),
)
