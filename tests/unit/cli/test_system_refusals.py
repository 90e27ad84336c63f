"""Errors of the system give one line with a cure and leave no files: long names, full disks."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from kolsky_command import run_kolsky
from shot_folders import ROOT, state

from benchmarks.small_cases import small_shot
from kolsky.cli.commandline import LONGEST_PLACE, of_system, refusing_bad_input

LONG = "a" * 5000
COMMANDS = "check channels dic waves wavespeed rate calibrate identify report simulate plan sweep budget film"


@pytest.mark.parametrize("command", COMMANDS.split())
def test_a_name_that_is_too_long(command: str) -> None:
    done = run_kolsky(command, LONG, code=2)
    assert isinstance(done.exception, SystemExit)
    (line,) = done.stderr.splitlines()
    assert "File name too long" in line
    assert "Cure: " in line
    assert len(line) < 6000


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOSPC, "make room"),
        (errno.EDQUOT, "make room"),
        (errno.ENAMETOOLONG, "give a shorter"),
        (errno.EACCES, "give yourself read"),
        (errno.EIO, "check the file"),
    ],
)
def test_each_refusal_has_its_cure(number: int, words: str) -> None:
    said = str(of_system(OSError(number, os.strerror(number), "/x/y")))
    assert said.startswith(f"/x/y: cannot be used: {os.strerror(number)}. Cure: {words}")
    long = str(of_system(OSError(number, "odd", LONG)))
    assert LONG[: LONGEST_PLACE + 1] not in long


def test_other_errors_are_not_hidden() -> None:
    for error in (
        BrokenPipeError(errno.EPIPE, "pipe"),
        OSError("no number"),
        KeyError("a fault of the program"),
    ):
        with pytest.raises(type(error)), refusing_bad_input():
            raise error
    with pytest.raises(typer.Exit), refusing_bad_input():
        raise MemoryError


FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as on a full disk: the write fails
from kolsky.cli.commandline import main
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
sys.argv = ["kolsky", *sys.argv[1:]]
main()
"""
WRITING = {
    "waves": ["waves", "SHOT"],
    "sweep": ["sweep", "SHOT", "--mesh", "8x11", "--design", "lhs", "--runs", "4"],
    "identify": ["identify", "SHOT", "--mesh", "4x6", "--free", "stiffness_factor", "--refined-mesh", "6x8",
     "--replicates", "2"],
    "plan": ["plan", "SHOT", "--mesh", "4x6", "--free", "stiffness_factor"],
    "virtual make": ["virtual", "make", "SPEC", "--only", "1", "--out", "FOLDER/made"],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files as Linux does")
@pytest.mark.parametrize("command", WRITING)
def test_a_disk_that_is_full(command: str, tmp_path: Path) -> None:
    """No file may grow beyond 20 kB: one line, no remains, earlier results as they were."""
    import shutil

    shot = tmp_path / "shot"
    if command == "waves":
        shutil.copytree(ROOT / "runs" / "bar-01", shot, ignore=shutil.ignore_patterns("results"))
    else:
        small_shot(shot)
    (shot / "results").mkdir()
    (shot / "results" / "kept.csv").write_text("earlier\n")
    before = state(tmp_path)
    names = {"SHOT": str(shot), "SPEC": str(ROOT / "runs" / "virtual" / "small.toml")}
    words = [names.get(word, word.replace("FOLDER", str(tmp_path))) for word in WRITING[command]]
    done = subprocess.run(
        [sys.executable, "-c", FULL, *words], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 2, done.stderr
    line = done.stderr.strip().splitlines()[-1]
    assert "Cure: " in line
    assert "Traceback" not in done.stderr
    after = state(tmp_path)
    assert {name: size for name, size in after.items() if "kept" in name} == {
        name: size for name, size in before.items() if "kept" in name
    }
    assert not [name for name in after if Path(name).name.startswith(".")]
    assert not [name for name in after if name.endswith((".csv", ".h5", ".html")) and name not in before]
