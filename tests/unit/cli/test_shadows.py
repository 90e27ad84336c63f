"""The import of kolsky reports another distribution that has a package of the same name."""

import subprocess
import sys
from pathlib import Path

import pytest

from kolsky.base.shadows import shadowed

ROOT = Path(__file__).resolve().parents[3]


def test_ours_are_ours() -> None:
    assert shadowed() == []


def test_a_package_of_that_name_in_front_is_named_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "doe").mkdir()
    (tmp_path / "doe" / "__init__.py").write_text("", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", "import kolsky"],
        cwd=tmp_path, env={"PYTHONPATH": f"{tmp_path}:{ROOT}"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    lines = [line for line in done.stderr.splitlines() if "of kolsky should be at" in line]
    assert len(lines) == 1
    assert "the package doe of kolsky" in lines[0]
    assert str(tmp_path / "doe") in lines[0]


def test_a_module_of_that_name_counts_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dic.py").write_text("", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "dic", raising=False)
    assert [line.split()[2] for line in shadowed()] == ["dic"]
