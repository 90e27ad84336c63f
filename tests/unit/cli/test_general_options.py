"""Options of every command: `--quiet`, `--json`, and their output."""

import io
import json
from pathlib import Path

import pytest
import typer
from json_rows import compare, row_of, rows
from typer.testing import CliRunner

from doe.ledger import Pace
from kolsky.cli import app
from kolsky.cli.commandline import COMMANDS
from kolsky.cli.terminal import is_quiet, print_result, printing, progress_bars, sweep_progress

runner = CliRunner()


def commands(command: object, name: str = "") -> dict[str, object]:
    below = getattr(command, "commands", None)
    if below is None:
        return {name: command}
    return {k: v for word, part in below.items() for k, v in commands(part, f"{name} {word}".strip()).items()}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_json_and_quiet(name: str) -> None:
    made = commands(typer.main.get_command(app))
    options = {text for parameter in made[name].params for text in parameter.opts}  # type: ignore[attr-defined]
    assert {"--json", "--quiet", "-q"} <= options


def test_quiet_leaves_the_answer_and_its_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    for quiet in (False, True):
        with printing(quiet=quiet):
            print_result({"m": "1.12"}, {}, files={"page": "a.html"}, warnings=["it is late"])
        shown = capsys.readouterr()
        assert "1.12" in shown.out
        assert ("wall time" in shown.out) is ("a.html" in shown.out) is not quiet
        assert shown.err == "warning: it is late\n"
        with printing(as_json=True, quiet=quiet):
            print_result({"m": "1.12"}, {"m": 1.12}, files={"page": "a.html"})
        shown = capsys.readouterr()
        assert json.loads(shown.out) == {"m": 1.12}
        assert ("wall time" in shown.err) is ("a.html" in shown.err) is not quiet
    assert not is_quiet()  # nothing is left of it


def test_quiet_has_no_progress(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with printing(quiet=True), progress_bars() as progress, sweep_progress() as pace:
        progress("design", 1, 2)
        pace(Pace(finished=1, total=2, rate=1.0))
    assert capsys.readouterr().err == ""


def test_progress_is_a_line_a_minute_without_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = iter([0.0, 59.0, 61.0, 62.0, 3725.0])
    monkeypatch.setattr("kolsky.cli.terminal.time.monotonic", lambda: next(now))
    with progress_bars() as progress:
        for done in range(4):
            progress("design", done, 7)
    first, second = capsys.readouterr().err.splitlines()
    assert first.endswith(": 1 of 7, 0:01:01 since the start, 0:00:12 left of this stage")  # 2 s for a run
    assert second.endswith(": 3 of 7, 1:02:05 since the start, 1:21:28 left of this stage")  # 1222 s each


def test_progress_on_a_terminal_is_one_line_that_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "110")
    with progress_bars() as progress:
        progress("design", 1, 2)
        progress("refinement", 1, 3)
    said = screen.getvalue()
    assert "1/3" in said
    assert "left of this stage, 0:00:00 since the start" in said
    assert said.count("\n") <= 1  # a stage takes the line of the one before
    assert said.endswith("\x1b[2K")  # the line is erased


def test_a_new_shot_says_what_it_found_as_one_object(shot: Path, tmp_path: Path) -> None:
    (shot / "shot.toml").unlink()
    said = json.loads(runner.invoke(app, ["new", str(shot), "--json"]).stdout)
    assert set(said) == {"file", "found", "recordings", "doubtful", "to_fill_in"}
    assert said["found"]["force"] == "scope.csv"
    assert "specimen.diameter" in said["to_fill_in"]
    made = json.loads(runner.invoke(app, ["virtual", "new", str(tmp_path / "v"), "--json"]).stdout)
    assert Path(made["file"]).is_file()


def test_the_page_has_a_row_for_every_command_and_no_other() -> None:
    assert set(rows()) == set(COMMANDS)


def test_a_row_fits_its_object_and_no_other() -> None:
    row = row_of("of a shot: `shot`, `found` (part, `not_a_key`); at times `figures`")
    assert row.fits({"shot", "found"})
    assert row.fits({"shot", "found", "figures"})
    assert not row.fits({"shot"})
    assert not row.fits({"shot", "found", "not_a_key"})
    assert row_of("`shot`, and a key for each table").fits({"shot", "specimen"})


def test_a_command_that_says_something_else_is_noticed() -> None:
    with pytest.raises(AssertionError, match="virtual new prints the keys path"):
        compare(["virtual", "new", "lab", "--json"], '{"path": "lab"}')


@pytest.mark.parametrize("words", ["identify", "simulate -p stiffness_factor=1.1", "plan", "sweep"])
def test_pictures_are_correlated_on_the_device_of_the_solver(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []

    def measured(pictures: object, folder: Path, *, device: str, progress: object) -> None:
        seen.append(device)
        raise typer.Exit(3)

    monkeypatch.setattr("explicit.device.select_device", lambda text: text)  # as if it were there
    monkeypatch.setattr("kolsky.shot.load.load_shot", lambda shot, measure: measure(None))
    monkeypatch.setattr("kolsky.shot.optical_data.measured", measured)
    name, *more = words.split()
    line = [name, "runs/open-05", *more, "--device", "cuda:1", "--out", str(tmp_path)]
    assert runner.invoke(app, line).exit_code == 3
    assert seen == ["cuda:1"]
