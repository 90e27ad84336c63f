"""Faults of the slow compression's error."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/material/test_slow_compression.py",)
FILE = "kolsky/material/slow_compression.py"

FAULTS = (
    Fault(
        name="the error of a longer run by the shorter one's share",
        file=FILE,
        right="/ found.stress[0] - 1.0) / (ratio - 1.0)",
        wrong="/ found.stress[0] - 1.0) / ratio",
        tests=TESTS,
    ),
    Fault(
        name="the error of a slow run is judged at the outset too",
        file=FILE,
        right="left[strain >= min(OUTSET, strain[-1])].max()",
        wrong="left.max()",
        tests=TESTS,
    ),
    Fault(
        name="a slow run that has not come to its error is handed over",
        file=FILE,
        right="if errors[-1] <= error:",
        wrong="if errors[-1] <= 10.0 * error:",
        tests=TESTS,
    ),
    Fault(
        name="a slow force without the stiffness factor",
        file=FILE,
        right="stress = stiffness_factor * found.stress[0]",
        wrong="stress = found.stress[0]",
        tests=TESTS,
    ),
)
