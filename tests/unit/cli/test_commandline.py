"""The registry of commands: a new command needs one file and one line."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import typer
from kolsky_command import run_kolsky
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.base.options import Option
from kolsky.cli.commandline import COMMANDS, GROUPS, program
from kolsky.cli.options import changed

ROOT = Path(__file__).resolve().parents[3]
COMMAND = '''"""`kolsky weigh`: what a specimen weighs."""

from kolsky.base.errors import InputError
from kolsky.cli.options import ShotPath
from kolsky.inverse.settings import Numerics


def weigh(shot: ShotPath, *, numerics: Numerics) -> None:
    """Weigh the specimen of a shot."""
    if numerics.mesh == (2, 2):
        raise InputError(shot, "weighs nothing", cure="take a heavier one")
    print(f"{shot.name} on {numerics.mesh} by {numerics.element} with {numerics.precision}")
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
    last = "from kolsky.cli.sweep import budget, sweep\n"
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
    assert (done.returncode, done.stdout) == (0, "shot on (4, 5) by fbar with None\n"), done.stderr
    refused = run(with_weigh, "-m", "kolsky.cli", "weigh", "some/shot", "--mesh", "2x2")
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
    shown = run_kolsky(*words.split(), "--help")
    assert "--help" in shown.output


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


@dataclass(frozen=True)
class Choices:
    """Settings of each kind of option."""

    mesh: Annotated[tuple[int, int], Option("Cells.")] = (2, 3)
    kind: Annotated[Literal["one", "two"], Option("one or two.")] = "one"
    size: Annotated[float | None, Option("A length.", unit="m", positive=True)] = None
    words: Annotated[tuple[str, ...], Option("Repeated.", name="word")] = ()
    fine: Annotated[bool, Option("Not coarse.")] = False
    exact: Annotated[bool, Option("Not exact.")] = True
    depth: float = 3.0

    def __post_init__(self) -> None:
        if self.size == 1.0:
            raise ValueError("a size of 1 m is too large")


@dataclass(frozen=True)
class Whole:
    """A record in a record."""

    choices: Choices = field(default_factory=Choices)
    count: Annotated[int, Option("How many.", min=1)] = 4


def given(*words: str, whole: Whole | None = None) -> Any:
    """The record that a command gets, or the error that ends it."""
    records: list[Whole] = []
    default = whole or Whole(count=5)

    def command(*, whole: Whole = default) -> None:
        """Take it."""
        records.append(whole)

    done = CliRunner().invoke(program({"command": command}), ["command", *words])
    return records[0] if done.exit_code == 0 else done.output


def test_a_record_is_made_of_its_options() -> None:
    assert given() == Whole(count=5)
    assert given("--mesh", "4x5", "--count", "2").choices.mesh == (4, 5)
    words = ("--kind", "two", "--size", "3 mm", "--word", "a", "--word", "b", "--fine", "--no-exact")
    made = given(*words).choices
    assert made == Choices(kind="two", size=0.003, words=("a", "b"), fine=True, exact=False)
    assert [name for name, is_changed in changed(made).items() if is_changed] == [
        "--kind", "--size", "--word", "--fine", "--no-exact",
    ]  # fmt: skip
    assert not any(changed(Choices()).values())
    other = given("--kind", "two", whole=Whole(Choices(depth=7.0)))
    assert (other.choices.depth, other.count) == (7.0, 4)  # of the command's own defaults


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--mesh", "4"), "--mesh '4' cannot be read"),
        (("--kind", "six"), "it must be one or two"),
        (("--size", "3 s"), "--size"),
        (("--size", "0 m"), "must be > 0 m"),
        (("--size", "1 m"), "a size of 1 m is too large"),
        (("--depth", "1"), "No such option"),
    ],
)
def test_what_no_option_can_be_is_refused(words: tuple[str, ...], message: str) -> None:
    assert message in given(*words)
