"""The door of commands: one file and one line of the registry give a command all that the others have."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.cli.commandline import COMMANDS, FORMER_NAMES, GROUPS, app, program
from kolsky.cli.options import Device, SolverOptions, with_settings

ROOT = Path(__file__).resolve().parents[3]
COMMAND = '''"""`kolsky weigh`: what a specimen weighs."""

from kolsky.base.errors import InputError
from kolsky.cli.options import AsJson, Mesh, ShotPath, SolverOptions


def weigh(
    shot: ShotPath, *, mesh: Mesh = "8x11", solver: SolverOptions, as_json: AsJson = False
) -> None:
    """Weigh the specimen of a shot."""
    if mesh == "0x0":
        raise InputError(shot, "weighs nothing", cure="take a heavier one")
    print(f"{shot.name} on {mesh} by {solver.element} with {solver.precision}")
'''


@pytest.fixture(scope="module")
def with_weigh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources with a command more: its file, and its line after "check"."""
    root = tmp_path_factory.mktemp("sources")
    for package in ("kolsky", "dic", "explicit", "doe"):
        shutil.copytree(ROOT / package, root / package, ignore=shutil.ignore_patterns("__pycache__"))
    (root / "kolsky" / "cli" / "weigh.py").write_text(COMMAND, "utf-8")
    registry = root / "kolsky" / "cli" / "commandline.py"
    text = registry.read_text("utf-8")
    line = '    "check": check,\n'
    assert text.count(line) == 1
    text = text.replace(line, line + '    "weigh": weigh,\n')
    # As in every registry, the name is imported where it is listed.
    last = "from kolsky.cli.virtual import virtual_make, virtual_new\n"
    assert text.count(last) == 1
    text = text.replace(last, last + "from kolsky.cli.weigh import weigh\n")
    registry.write_text(text, "utf-8")
    (root / "tables.py").write_text(
        "import sys\n"
        f"sys.path.insert(0, {str(ROOT / 'docs' / '_ext')!r})\n"
        "import made_tables\n"
        "print(made_tables.commands())\n",
        "utf-8",
    )
    return root


def run(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(root), "COLUMNS": "200", "NO_COLOR": "1"}
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=root, env=environment, timeout=60
    )


def test_a_made_up_command_is_in_the_help_in_its_place(with_weigh: Path) -> None:
    shown = run(with_weigh, "-m", "kolsky.cli", "--help")
    assert shown.returncode == 0, shown.stderr
    names = re.findall(r"^│ ([a-z][a-z-]+) ", shown.stdout, re.MULTILINE)
    alone = [words for words in COMMANDS if " " not in words]
    alone.insert(alone.index("check") + 1, "weigh")
    assert names == [*alone, *GROUPS]
    assert "Weigh the specimen of a shot." in shown.stdout


def test_a_made_up_command_has_the_shared_options_and_refusals(with_weigh: Path) -> None:
    done = run(with_weigh, "-m", "kolsky.cli", "weigh", "some/shot", "--element", "fbar", "--mesh", "4x5")
    assert (done.returncode, done.stdout) == (0, "shot on 4x5 by fbar with fp64\n"), done.stderr
    refused = run(with_weigh, "-m", "kolsky.cli", "weigh", "some/shot", "--mesh", "0x0")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == "some/shot: weighs nothing. Cure: take a heavier one\n"


def test_a_made_up_command_is_in_the_list_of_the_docs(with_weigh: Path) -> None:
    made = run(with_weigh, "tables.py")
    assert made.returncode == 0, made.stderr
    rows = made.stdout.splitlines()
    names = [re.match(r"\| `kolsky ([a-z -]+)` \|", row) for row in rows[2:]]
    words = list(COMMANDS)
    words.insert(words.index("check") + 1, "weigh")
    assert [name[1] for name in names if name] == words
    assert "Weigh the specimen of a shot." in made.stdout


def test_every_command_says_what_it_does() -> None:
    for words, command in COMMANDS.items():
        assert (command.__doc__ or "").partition("\n")[0].endswith("."), words
        assert words.partition(" ")[0] in GROUPS or " " not in words


@pytest.mark.parametrize("words", COMMANDS)
def test_every_command_has_a_help(words: str) -> None:
    shown = CliRunner().invoke(app, [*words.split(), "--help"])
    assert shown.exit_code == 0, shown.output
    assert "--help" in shown.output


@pytest.mark.parametrize("old", FORMER_NAMES)
def test_former_names_work_and_are_not_shown(old: str) -> None:
    group, _, name = old.rpartition(" ")
    assert name not in CliRunner().invoke(app, [group, "--help"]).output
    now = CliRunner().invoke(app, [*FORMER_NAMES[old].split(), "--help"])
    then = CliRunner().invoke(app, [*old.split(), "--help"])
    assert then.exit_code == now.exit_code == 0
    assert then.output.splitlines()[2:] == now.output.splitlines()[2:] or (
        then.output.replace(name, FORMER_NAMES[old].rpartition(" ")[2]).split() == now.output.split()
    )


def test_bad_input_ends_any_command_with_its_lines_and_exit_code_2() -> None:
    def bad() -> None:
        """Refuse."""
        raise InputError("scope.csv", "is not allowed", line=3, value=7, allowed="< 5")

    def good() -> None:
        """Pass."""
        typer.echo("done")

    made = program({"bad": bad, "good": good})
    refused = CliRunner().invoke(made, ["bad"])
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert refused.stderr.count("\n") == 1
    assert refused.stderr.startswith("scope.csv line 3")
    assert CliRunner().invoke(made, ["good"]).stdout == "done\n"


def test_solver_options_stand_where_the_command_has_them() -> None:
    seen = {}

    def command(shot: str, *, solver: SolverOptions, device_too: Device = "x") -> None:
        seen.update(shot=shot, solver=solver, device_too=device_too)

    made = with_settings(command)
    made(shot="a", **{**vars(SolverOptions()), "precision": "fp32", "threads": 3})
    assert seen["solver"] == SolverOptions(precision="fp32", threads=3)
    assert seen["shot"] == "a"
    names = list(made.__annotations__)
    assert names == ["shot", *vars(SolverOptions()), "device_too", "quiet"]


def test_a_command_has_its_own_defaults_of_shared_options() -> None:
    fast = SolverOptions(precision="fp32")

    def command(solver: SolverOptions = fast) -> None:
        """Nothing to do."""

    parameters = inspect.signature(with_settings(command)).parameters
    assert parameters["precision"].default == "fp32"
    assert parameters["element"].default == "one_point"
