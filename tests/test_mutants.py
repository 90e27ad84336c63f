"""No named fault gets past the quick tests, and the trial itself can tell: see `tests.mutants`."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants import FAULTS, Fault

ROOT = Path(__file__).resolve().parents[1]

FEWEST = 40
"""Faults that the project wants to hold at least, over interval, verdicts, warnings, budget, waves, rates,
image correlation, misfit and solver."""


def test_every_fault_fits_its_file() -> None:
    """A line that was rewritten takes its fault along: the right text stands in the file exactly once."""
    assert len(FAULTS) >= FEWEST
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    for fault in FAULTS:
        fault.planted((ROOT / fault.file).read_text("utf-8"))
        assert fault.tests, f"{fault.name}: no test must fail"
        for test in fault.tests:
            assert (ROOT / test.partition("::")[0]).is_file(), f"{fault.name}: {test} is no file"


def test_a_fault_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"stands 2 times in a\.py, not once"):
        Fault("twice", "a.py", "x", "y", ("t.py",)).planted("x = x")
    with pytest.raises(ValueError, match="nothing changes"):
        Fault("none", "a.py", "x", "x", ("t.py",)).planted("x = 1")


def python(*words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own: this one has imported what the trial must import anew."""
    return subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_no_fault_survives_the_quick_tests() -> None:
    # Every twelfth one: all take longer than the continuous integration has; by command they run whole.
    done = python("-m", "tests.mutants", "--every", "12")
    left = [line for line in done.stdout.splitlines() if " killed " not in line]
    assert done.returncode == 0, "\n".join([*left, done.stderr])
    tried = len(FAULTS[::12])
    assert f"{tried} of {tried} faults killed" in done.stdout


UNSEEN = """
from tests.mutants.fault import Fault
from tests.mutants.trial import trials

unseen = Fault(
    name="a text that no test of units reads",
    file="kolsky/base/units.py",
    right="Written-out quantities",
    wrong="Quantities in words",
    tests=("tests/unit/base/test_units.py",),
)
print(*(fate for _, fate in trials([unseen])))
"""


@pytest.mark.slow
def test_the_trial_tells_a_fault_that_no_test_sees() -> None:
    done = python("-c", UNSEEN)
    assert done.stdout.split() == ["survived"], done.stderr
