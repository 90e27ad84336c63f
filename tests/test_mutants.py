"""The quick tests detect every named fault, and the trial itself is tested: see `tests.mutants`."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants import FAULTS, Fault
from tests.mutants.sources import ROOT, Sources, sources

FEWEST = 40
"""Faults that the project wants to hold at least, over interval, verdicts, warnings, budget, waves, rates,
image correlation, misfit and solver."""
EVERY = 240
"""Of so many faults one is planted here: a trial runs whole test files, 10 to 30 s of one core."""


def test_every_fault_fits_one_place() -> None:
    """Code that was rewritten takes its fault along: the right code stands in its function exactly once."""
    assert len(FAULTS) >= FEWEST
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    for fault in FAULTS:
        text = sources().place(fault).changed(fault)
        ast.parse(f"if True:\n{text}" if text[0].isspace() else text)
        assert fault.tests, f"{fault.name}: no test must fail"
        for test in fault.tests:
            assert (ROOT / test.partition("::")[0]).is_file(), f"{fault.name}: {test} is no file"


ONE = '''
class Line:
    """Two x."""

    slope: float = 2.0

    def at(self, x):  # not 3 * x
        return self.slope * sum(
            [x, x / 2],
        )

START = 1.0
if __name__ == "__main__":
    print(START)
'''
OTHER = """
START = 1.0

def at(x):
    def start(y):
        return y - START

    return start(x) + x
"""


@pytest.fixture
def made_up(tmp_path: Path) -> Sources:
    for name, text in {"one": ONE, "other": OTHER}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(text, "utf-8")
    return Sources(tmp_path)


@pytest.mark.parametrize(
    ("function", "right", "wrong", "near", "planted"),
    [
        ("Line.slope", "2.0", "3.0", "", "slope: float = 3.0\n"),
        ("Line.at", "sum([x, x / 2])", "x", "", "return self.slope * x\n"),  # wrapped otherwise
        ("Line.at", "2", "3", "", "[x, x / 3],\n"),
        ("START", "1.0", "2.0", "start", "START = 2.0\n\ndef at"),
        ("START", "1.0", "2.0", "class Line", "START = 2.0\nif"),
        ("at.start", "-", "+", "", "return y + START\n"),
        ("at", "return start(x)", "x = 0\nreturn start(x)", "", "    x = 0\n    return start(x) + x\n"),
        ("__main__", "print(START)", "pass", "", '"__main__":\n    pass\n'),
    ],
)
def test_a_fault_is_planted_in_the_function_it_names(
    made_up: Sources, function: str, right: str, wrong: str, near: str, planted: str
) -> None:
    fault = Fault("a fault", function, right, wrong, ("t.py",), near)
    assert planted in made_up.place(fault).planted(fault)


@pytest.mark.parametrize(
    ("function", "right", "wrong", "problem"),
    [
        ("START", "1.0", "2.0", "a fault: .* 1 times in one/.*, 1 times in other/"),
        ("Line.at", "x", "y", "a fault: .* 3 times in one/"),
        ("Line.at", "z", "y", "a fault: .* 0 times in one/"),
        ("Line.to", "x", "y", "a fault: nothing is called Line.to"),
        ("Line.at", "2", "2", "a fault: nothing changes"),
    ],
)
def test_a_fault_that_does_not_fit_one_place_is_refused(
    made_up: Sources, function: str, right: str, wrong: str, problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        made_up.place(Fault("a fault", function, right, wrong, ("t.py",)))


def python(*words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own: this one has imported what the trial must import anew."""
    return subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_no_fault_survives_the_quick_tests() -> None:
    # A sample: all take hours; by command they run whole.
    done = python("-m", "tests.mutants", "--every", str(EVERY))
    left = [line for line in done.stdout.splitlines() if " killed " not in line]
    assert done.returncode == 0, "\n".join([*left, done.stderr])
    tried = len(FAULTS[::EVERY])
    assert f"{tried} of {tried} faults killed" in done.stdout


UNSEEN = """
from tests.mutants.fault import Fault
from tests.mutants.trial import trials

unseen = Fault(
    name="a text that no test of units reads",
    function="UnitError",
    right="UnitError(ValueError)",
    wrong="UnitError(ValueError, object)",
    tests=("tests/unit/base/test_units.py",),
)
print(*(fate for _, fate in trials([unseen])))
"""


@pytest.mark.slow
def test_the_trial_tells_a_fault_that_no_test_sees() -> None:
    done = python("-c", UNSEEN)
    assert done.stdout.split() == ["survived"], done.stderr
