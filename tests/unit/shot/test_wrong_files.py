"""A wrong file for a command: exit code 2, a line with file and cure, no output."""

import re
from pathlib import Path

import pytest
from kolsky_command import run_kolsky
from typer.testing import CliRunner

from kolsky.cli import app

FILES = {
    "words.csv": b"strain,stress\n1,2\n2,3\n3,4\n4,banana\n",
    "noise.csv": bytes([*range(128, 256), 0]) * 8,
    "empty.csv": b"",
    "shot/shot.toml": b"[specimen\n",
    "points.csv": b"stiffness_factor (1)\n1.0\nbanana\n",
}
SHOTS = {
    "words.csv": "words.csv line 1: .*'strain,stress'. Cure: give the folder of a shot",
    "noise.csv": "noise.csv line 1: is not UTF-8 text: byte 0x80.* Cure: ",
    "shot": "shot.toml line 1: .*'.specimen'. Cure: ",
    "absent": "absent: there is no such f.*Cure: ",
}
"""Given in place of a shot -> what must be said."""
TABLES = {
    "words.csv": "words.csv line 5: .*'banana'.*Cure: is it the right file",
    "noise.csv": "noise.csv: is of no known format. Cure: is it the right file",
    "empty.csv": "empty.csv: is empty. Cure: ",
    "absent.csv": "absent.csv: there is no such file. Cure: ",
}
"""Given in place of a table of numbers."""
DESIGNS = {
    "points.csv": "points.csv line 3: 'banana' is not a number .*Cure: ",
    "noise.csv": "noise.csv line 1: is not UTF-8 text: byte 0x80.*Cure: ",
    "absent.csv": "absent.csv: there is no such file. Cure: ",
}
"""Given in place of a design."""
OF_SHOTS = (
    *("check", "waves", "wavespeed", "repeats", "identify", "simulate", "report", "film", "plan", "sweep"),
    *("dic", "rate", "calibrate"),
)
OF_TABLES = {
    "channels": "channels {f}",
    "fit": "material fit uniaxial:{f} --convention tension-positive --out out",
    "baseline": "material baseline {f} --convention tension-positive --branch tension --strain strain "
    "--stress stress --out curve.csv",
}
CASES = {
    **{f"{c}-{f}": (f"{c} {f}", said) for c in OF_SHOTS for f, said in SHOTS.items()},
    **{f"{n}-{f}": (c.format(f=f), said) for n, c in OF_TABLES.items() for f, said in TABLES.items()},
    **{f"sweep-{f}": (f"sweep shot --design csv --points {f}", said) for f, said in DESIGNS.items()},
    # It has two names of files, so no folder is asked for.
    "calibrate-absent": ("calibrate absent", "absent: there is no such file. Cure: "),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with every wrong file, the current one."""
    for name, content in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_file_is_refused_with_its_name_and_a_cure(case: str, folder: Path) -> None:
    command, said = CASES[case]
    there = sorted(folder.rglob("*"))
    words = command.split()
    done = CliRunner().invoke(app, [*words, words[1]] if words[0] == "repeats" else words)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert re.search(said, done.stderr), done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(folder.rglob("*")) == there


def test_a_fit_without_columns_is_told_what_the_file_has(folder: Path) -> None:
    (folder / "good.csv").write_text("step,stress (kPa)\n0,0\n0.1,10\n0.2,18\n0.3,24\n0.4,29\n0.5,33\n")
    done = run_kolsky("material", "fit", "good.csv", "--convention", "tension-positive", code=2)
    assert re.search(r"good.csv: .*has the columns of numbers .*stress.*Cure: .*--stress COLUMN", done.stderr)
