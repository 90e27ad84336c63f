"""A folder without write permission: every command reports it in one line, and earlier results are kept."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from shot_folders import ROOT, ordinary_rights, shot_in, state

from benchmarks.small_cases import write_pictures

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="capabilities of Linux")

EACH = """
import json, sys
from typer.testing import CliRunner
from kolsky.cli import app

found = {}
for name, words in json.loads(sys.stdin.read()).items():
    done = CliRunner().invoke(app, words)
    found[name] = [done.exit_code, done.stderr]
print(json.dumps(found))
"""
COMMANDS = {
    "check": "check SHOT", "identify": "identify SHOT", "report": "report SHOT", "simulate": "simulate SHOT",
    "plan": "plan SHOT", "sweep": "sweep SHOT --design lhs --runs 4", "film": "film SHOT",
    "budget": "budget SPEC --out CLOSED", "waves": "waves BAR", "dic": "dic PICTURES",
    "specimen fit": "specimen fit STRIP/strip.toml", "virtual new": "virtual new CLOSED/one.toml",
}  # fmt: skip


@pytest.mark.slow  # twelve commands load what they need
def test_every_command_refuses_a_closed_folder_in_one_line(tmp_path: Path) -> None:
    places = {name: tmp_path / name.lower() for name in ("SHOT", "BAR", "PICTURES", "STRIP", "CLOSED")}
    shot_in(places["SHOT"])
    shutil.copytree(ROOT / "runs" / "bar-01", places["BAR"])
    for name in ("PICTURES", "STRIP", "CLOSED"):
        places[name].mkdir()
    write_pictures(places["PICTURES"], frames=3, size=(60, 80))
    text = (ROOT / "runs" / "specimen" / "silicone.toml").read_text().partition("[tests.biaxial]")[0]
    (places["STRIP"] / "strip.toml").write_text(text)
    shutil.copy(ROOT / "runs" / "specimen" / "uniaxial.csv", places["STRIP"])
    for place in places.values():
        (place / "results").mkdir(exist_ok=True)
        (place / "results" / "kept.csv").write_text("earlier\n")
    names = {**{name: str(place) for name, place in places.items()},
             "SPEC": str(ROOT / "runs" / "virtual" / "small.toml")}  # fmt: skip
    words = {
        name: [
            names.get(word.partition("/")[0], word.partition("/")[0]) + "".join(word.partition("/")[1:])
            for word in said.split()
        ]
        for name, said in COMMANDS.items()
    }
    closed = [folder for place in places.values() for folder in (place / "results", place)]
    before = state(tmp_path)
    for folder in closed:
        folder.chmod(0o555)
    try:
        done = subprocess.run(
            [sys.executable, "-c", EACH],
            input=json.dumps(words),
            capture_output=True,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            preexec_fn=ordinary_rights,
            check=False,
        )
    finally:
        for folder in closed:
            folder.chmod(0o755)
    assert done.returncode == 0, done.stderr
    for name, (code, said) in json.loads(done.stdout.splitlines()[-1]).items():
        assert code == 2, f"{name}: {said}"
        lines = said.splitlines()
        assert len(lines) == 1, f"{name}: {said}"
        assert "Cure: " in said, name
        assert "is not writable" in said or "Permission denied" in said, f"{name}: {said}"
    assert state(tmp_path) == before
