"""What `kolsky identify` loads and when: the page while it simulates, other libraries where they serve."""

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from synthetic import RESULTS
from typer.testing import CliRunner

from kolsky import identification
from kolsky.cli import app
from kolsky.report import result_folder

ROOT = Path(__file__).parents[3]


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The results that a command has written; nothing is simulated, nothing is put into a file."""
    found: list[Any] = []
    monkeypatch.setattr(identification, "identify", lambda *given, **options: RESULTS["one"])
    monkeypatch.setattr(
        result_folder, "write_identify_results", lambda folder, *given, **options: found.append(folder)
    )
    return found


def identify(folder: Path) -> Any:
    words = ["identify", str(ROOT / "runs" / "open-01"), "--out", str(folder)]
    return CliRunner().invoke(app, words)


def test_loading_ends_before_anything_is_written(
    written: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[tuple[bool, int]] = []

    def load() -> None:
        begun.append((threading.current_thread() is threading.main_thread(), len(written)))

    monkeypatch.setattr(result_folder, "load_identify_page", load)
    ended = identify(tmp_path)
    assert ended.exit_code == 0, ended.output
    assert begun == [(False, 0)]
    assert written == [tmp_path]


def test_what_fails_in_the_thread_is_raised(
    written: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise ImportError("no figures here")

    monkeypatch.setattr(result_folder, "load_identify_page", fail)
    ended = identify(tmp_path)
    assert isinstance(ended.exception, ImportError)
    assert "no figures here" in str(ended.exception)
    assert written == []


def test_all_that_a_page_needs_is_loaded() -> None:
    code = (
        "import sys, kolsky.report.result_folder as made; print('matplotlib' in sys.modules); "
        "made.load_identify_page(); before = set(sys.modules); "
        "import matplotlib.backends.backend_svg, kolsky.report.pages.identification as page; "
        "page.REGISTRY, page.RECORDINGS; print(sorted(set(sys.modules) - before))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "[]"]


def test_libraries_that_most_shots_do_not_need_are_not_loaded() -> None:
    code = (
        "import sys; from pathlib import Path; from kolsky.shot.load import load_shot; "
        "load_shot(Path('runs/open-01')); import kolsky.identification, kolsky.report.result_folder; "
        "print([n for n in ('pint', 'scipy.stats', 'scipy.signal', 'matplotlib') if n in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["[]"]
