"""Common parts of all tests: the `shared` folder, the `--slow` option, and `from order import ...`."""

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).resolve().parent
VERIFICATION = TESTS / "verification"
SHARED = TESTS.parent.parent / "shared"

HELPERS = TESTS / "helpers"
if str(HELPERS) not in sys.path:
    sys.path.insert(0, str(HELPERS))  # what several tests use: order.py and others
if str(TESTS.parent) not in sys.path:
    # These folders are not installed. Last, so that the packages tested are the installed ones.
    sys.path.append(str(TESTS.parent))


# A process of `-n` has one core: more threads wait for one another in busy loops. Commands do the same.
for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
    os.environ.setdefault(library, "1")

gc.disable()  # what is collected stays, and a search for garbage in it takes ever longer


def pytest_configure(config: pytest.Config) -> None:
    """With -n, let workers and the commands that they start share the modules' bytecode: compile it once."""
    if config.getoption("numprocesses", None):
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_collection_finish() -> None:
    """Leave what has been collected, a million objects, out of every later search for garbage."""
    gc.freeze()
    gc.enable()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--slow` and `--long`: run the tests marked so too."""
    parser.addoption("--slow", action="store_true", help="also run the tests marked slow")
    parser.addoption("--long", action="store_true", help="run everything, the tests marked long too (hours)")


@pytest.hookimpl(tryfirst=True)  # the marks must be there when `-m` chooses by them
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what the verification manual rests on, and what asks for a GPU by the fixtures `cuda` or `gpu`;
    deselect slow tests unless `--slow` or `-m` is given, and begin with their files then: at the end of a run
    on several cores, short ones fill them all. Long ones run with `--long` or `-m` alone."""
    for item in items:
        if {"cuda", "gpu"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("cuda")
        if item.path.is_relative_to(VERIFICATION):
            item.add_marker("verification")
    left_out = {"slow", "long"}
    if config.getoption("--long") or config.getoption("-m"):
        left_out = set()
    elif config.getoption("--slow"):
        left_out = {"long"}
    marked = [{mark.name for mark in item.iter_markers()} for item in items]
    omitted = [item for item, marks in zip(items, marked, strict=True) if marks & left_out]
    if omitted:
        items[:] = [item for item, marks in zip(items, marked, strict=True) if not marks & left_out]
        config.hook.pytest_deselected(items=omitted)
    if "slow" not in left_out:
        minutes = {item.path for item in items if item.get_closest_marker("slow")}
        items.sort(key=lambda item: item.path not in minutes)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference solutions and other people's data that lies beside the repository."""
    if not SHARED.is_dir():
        pytest.skip("no folder 'shared' beside the repository: its data and references are not shipped")
    return SHARED


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    """A copy of open-01 that a test may change."""
    from shot_folders import shot_in

    return shot_in(tmp_path / "shot")


@pytest.fixture(scope="session")
def cuda() -> str:
    """Name of the first GPU, as `explicit` takes it."""
    from explicit.device import select_device

    try:
        select_device("cuda")
    except ValueError as absent:
        pytest.skip(str(absent))
    return "cuda"


@pytest.fixture(scope="session", autouse=True)
def _documented_json() -> Iterator[None]:
    """Hold what commands print with `--json`, wherever a test calls one, against docs/howto/json.md."""
    from json_rows import compare
    from typer.testing import CliRunner

    plain = CliRunner.invoke

    def invoke(self: CliRunner, app: Any, args: Any = None, **options: Any) -> Any:
        result = plain(self, app, args, **options)
        if args and not isinstance(args, str) and "--json" in args and result.exit_code == 0:
            compare([str(word) for word in args], result.stdout)
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CliRunner, "invoke", invoke)
        yield
