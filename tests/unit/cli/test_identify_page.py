"""What `kolsky identify` loads and when: the page while it simulates, other libraries where they serve."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from synthetic import RESULTS
from typer.testing import CliRunner

from kolsky import identification
from kolsky.cli import app
from kolsky.report import page_process, result_folder

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("forks", [True, False])
def test_the_page_is_loaded_while_the_command_simulates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forks: bool
) -> None:
    """By a process that draws it, where there can be one."""
    written: list[tuple[Path, Any]] = []

    def identify(*of: Any, **options: Any) -> Any:
        return RESULTS["one"]

    monkeypatch.setattr(page_process, "can_fork", lambda: forks)
    monkeypatch.setattr(identification, "identify", identify)
    monkeypatch.setattr(
        result_folder,
        "write_identify_results",
        lambda folder, *of, **options: written.append((folder, options["page"])),
    )
    words = ["identify", str(ROOT / "runs" / "open-01"), "--out", str(tmp_path)]
    ended = CliRunner().invoke(app, words)
    assert ended.exit_code == 0, ended.output
    [(folder, page)] = written
    assert folder == tmp_path
    assert (page is not None) is forks


def test_all_that_a_page_needs_is_loaded() -> None:
    code = (
        "import sys, kolsky.report.page_process as made; print('matplotlib' in sys.modules); "
        "made.load_identify_page(); before = set(sys.modules); "
        "import matplotlib.backends.backend_svg, kolsky.report.pages.identification as page; "
        "page.REGISTRY, page.RECORDINGS; print(sorted(set(sys.modules) - before))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "[]"]


def test_what_is_loaded_shows_nothing_and_changes_no_setting() -> None:
    """Fonts of a page's own style are found before a process that draws is forked; the template is kept."""
    code = (
        "import matplotlib; before = dict(matplotlib.rcParams); "
        "from kolsky.report.page_process import load_identify_page; load_identify_page(); "
        "from matplotlib.font_manager import fontManager as fonts; "
        "import kolsky.report.pages.identification as page; "
        "print(before == dict(matplotlib.rcParams), fonts._findfont_cached.cache_info().currsize > 0, "
        "len(page._templates().cache) > 0)"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "True", "True"]


def test_libraries_that_most_shots_do_not_need_are_not_loaded() -> None:
    code = (
        "import sys; from pathlib import Path; from kolsky.shot.load import load_shot; "
        "load_shot(Path('runs/open-01')); import kolsky.identification, kolsky.report.result_folder; "
        "names = ('pint', 'scipy.stats', 'scipy.signal', 'scipy.ndimage', 'dic.result', 'dic.images', "
        "'h5py', 'matplotlib'); print([name for name in names if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["[]"]
