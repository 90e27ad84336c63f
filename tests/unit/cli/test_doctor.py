"""`kolsky doctor`: what is there is shown, what is missing is named with its cure and exit code 1."""

import json
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.testing import CliRunner

from kolsky.cli import doctor
from kolsky.cli.commandline import app
from kolsky.cli.doctor import examine


def test_a_sound_installation(tmp_path: Path) -> None:
    found = examine(tmp_path)
    assert found.problems == ()
    assert found.devices[0].startswith("cpu")
    assert found.versions["numpy"] == version("numpy")
    assert found.rows()["cores"] == str(found.cores)
    assert list(tmp_path.iterdir()) == []


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "REQUIRED", ("numpy", "no-such-distribution"))
    monkeypatch.setattr(doctor, "LEAST_SPACE", 1e18)
    found = examine(tmp_path)
    assert [problem.partition(" ")[0] for problem in found.problems] == [
        "no-such-distribution",
        str(tmp_path),
    ]
    gone = examine(tmp_path / "nowhere")
    assert any("nowhere cannot be written to (No such file" in problem for problem in gone.problems)
    assert gone.free is None


def test_the_command_says_the_same_in_json(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["doctor", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said["versions"]["kolsky"] == examine(tmp_path).versions["kolsky"]
    assert said["problems"] == []
    lost = CliRunner().invoke(app, ["doctor", str(tmp_path / "nowhere")])
    assert lost.exit_code == 1
    assert "cannot be written to" in lost.output


def test_the_version_has_a_short_option() -> None:
    runner = CliRunner()
    assert runner.invoke(app, ["-V"]).output == runner.invoke(app, ["--version"]).output
