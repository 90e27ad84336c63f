"""Extras: loaded when they are used, refused in one line where they are not installed."""

import subprocess
import sys
from pathlib import Path

import pytest
import typer

from dic.basics import OpenCVMissing, cv2
from kolsky.base.process import single_threaded_libraries
from kolsky.cli.commandline import EXTRAS, refusing_bad_input
from kolsky.cli.doctor import EXTRAS as DISTRIBUTIONS

ROOT = Path(__file__).resolve().parents[3]


def test_without_it_what_needs_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(OpenCVMissing, match=r"pip install 'kolsky\[pictures\]'"):
        _ = cv2.imread
    with single_threaded_libraries():  # of no use to OpenCV that is not there
        pass


def test_a_command_ends_with_one_line_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(typer.Exit) as ended, refusing_bad_input():
        _ = cv2.imread
    assert ended.value.exit_code == 2
    assert capsys.readouterr().err == "this needs the package cv2: pip install 'kolsky[pictures]'\n"
    with pytest.raises(ModuleNotFoundError, match="no_such_module"), refusing_bad_input():
        import no_such_module  # noqa: F401  # a fault of ours is no bad input


def test_every_extra_that_a_command_names_is_there() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert set(EXTRAS.values()) <= set(extras)
    for distribution, (extra, _) in DISTRIBUTIONS.items():
        assert any(text.startswith(distribution) for text in extras[extra]), distribution
    heavy = ("opencv", "pyvista", "vtk")  # a fresh environment is to stay below 900 MB
    assert not [text for text in project["dependencies"] if text.startswith(heavy)]


def test_a_shot_from_exports_is_checked_without_opencv_and_vtk(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "for name in ('cv2', 'pyvista', 'vtk', 'pandas', 'imageio'):\n    sys.modules[name] = None\n"
        "from kolsky.cli import main\n"
        "import kolsky.identification, kolsky.report.pages.identification, kolsky.report.figures\n"
        f"sys.argv = ['kolsky', 'check', 'runs/open-01', '--out', {str(tmp_path)!r}]\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
