"""Installed files: the conda recipe's dependencies are the package's, and every file of a page is shipped."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from kolsky_command import run_kolsky

from kolsky.base.errors import InputError
from kolsky.cli import identify

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
RENAMED = {"matplotlib": "matplotlib-base", "opencv-contrib-python-headless": "py-opencv", "npTDMS": "nptdms"}
NOT_ON_CONDA = {"RigolWFM"}  # conda-forge has 1.0, which does not read the makes of 1.6
PACKAGES = ("kolsky", "dic", "explicit", "doe")


def test_the_conda_recipe_has_the_dependencies_of_the_package() -> None:
    recipe = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text("utf-8"))
    listed = dict(text.split(" >=") for text in recipe["requirements"]["run"])
    wanted = dict(text.split(">=") for text in PROJECT["project"]["dependencies"])
    wanted = {RENAMED.get(name, name): wanted[name] for name in wanted.keys() - NOT_ON_CONDA}
    wanted["python"] = PROJECT["project"]["requires-python"].removeprefix(">=")
    assert listed == wanted
    host = dict(text.split(" >=") for text in recipe["requirements"]["host"] if ">=" in text)
    assert [f"setuptools>={host['setuptools']}"] == PROJECT["build-system"]["requires"]
    assert recipe["context"]["version"] == PROJECT["project"]["version"]
    scripts = [f"{name} = {place}" for name, place in PROJECT["project"]["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
    assert recipe["about"]["summary"] == PROJECT["project"]["description"]
    imported = {name for test in recipe["tests"] for name in test.get("python", {}).get("imports", ())}
    assert imported == set(PACKAGES)


def test_the_conda_recipe_is_rendered() -> None:
    rattler_build = pytest.importorskip("rattler_build", reason="pip install py-rattler-build")
    recipe = rattler_build.Stage0Recipe.from_file(str(ROOT / "conda" / "recipe.yaml"))
    (variant,) = recipe.render(rattler_build.VariantConfig(), rattler_build.RenderConfig())
    assert "kolsky" in repr(variant)
    assert PROJECT["project"]["version"] in repr(variant)


def built(tmp_path: Path, kind: str) -> Path:
    """A wheel or a source distribution, made from a copy of what is shipped."""
    pytest.importorskip("setuptools", minversion="77")
    copy = tmp_path / "tree"
    copy.mkdir()
    for name in ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff"):
        shutil.copy(ROOT / name, copy)
    for name in (*PACKAGES, "conda", "contributed"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "runs" / "open-05", copy / "runs" / "open-05")
    code = f"from setuptools import build_meta as b; b.build_{kind}({str(tmp_path)!r})"
    subprocess.run([sys.executable, "-W", "ignore", "-c", code], cwd=copy, check=True, capture_output=True)
    return next(tmp_path.glob("kolsky-*"))


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_the_packages_and_runs_outside_the_tree(tmp_path: Path) -> None:
    wheel = built(tmp_path, "wheel")
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
        archive.extractall(tmp_path / "site")
    shot = {name for name in held if ".data/" in name}  # of `kolsky demo`
    assert {name.partition(".data/data/share/kolsky/")[2] for name in shot} == {
        f"open-05/{path.name}" for path in (ROOT / "runs" / "open-05").glob("*.*")
    }
    there = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert held - shot == there
    for arguments in (["--version"], ["virtual", "new", str(tmp_path / "lab")]):
        code = f"import sys; sys.argv[1:] = {arguments!r}; from kolsky.cli import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False,
            env={**os.environ, "PYTHONPATH": str(tmp_path / "site")},
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")  # no warning of a package found elsewhere
    assert (tmp_path / "lab" / "SPEC.toml").is_file()


@pytest.mark.slow
def test_the_source_distribution_holds_the_shots_and_pages(tmp_path: Path) -> None:
    with tarfile.open(built(tmp_path, "sdist")) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {"runs/open-05/shot.toml", "conda/recipe.yaml", "CITATION.cff", "contributed/adjoint/plan.py"}
    assert {*wanted, "kolsky/py.typed"} <= held


def test_every_file_beside_the_modules_is_shipped() -> None:
    patterns = PROJECT["tool"]["setuptools"]["package-data"]
    missing = []
    for package in PACKAGES:
        for file in (ROOT / package).rglob("*"):
            inside = file.relative_to(ROOT / package).as_posix()
            if not file.is_file() or file.suffix in (".py", ".pyc") or "__pycache__" in inside:
                continue
            if not any(fnmatch(inside, pattern) for pattern in patterns[package]):
                missing.append(f"{package}/{inside}")
    assert missing == []


def test_the_readme_and_ci_run_the_same_tests() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    ci = (ROOT / ".ci" / "run").read_text("utf-8")
    assert "\n.venv/bin/pip install -q '.[test]' && .venv/bin/pytest -n auto\n" in readme
    assert '"$bin/pytest" --slow -n auto >"$scratch/tests.log"' in ci  # the slow ones, too
    assert ci.rstrip().endswith('wait "$tests"')  # its result is that of CI
    assert '"$bin/kolsky" identify runs/open-05\n' in ci
    assert ".venv/bin/kolsky identify runs/open-05\n" in readme


def test_classifiers_name_the_pythons_and_the_field() -> None:
    said = PROJECT["project"]["classifiers"]
    assert "Programming Language :: Python :: 3.11" in said
    assert "Typing :: Typed" in said
    assert any(text.startswith("Topic :: Scientific/Engineering") for text in said)


def test_the_shot_of_the_demo_comes_from_the_source_tree_or_from_what_was_installed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    names = {path.name for path in (ROOT / "runs" / "open-05").glob("*.*")}
    assert {path.name for path in identify.demo_files()} == names
    (tmp_path / "open-05").mkdir()
    installed = [tmp_path / "open-05" / name for name in ("scope.csv", "shot.toml")]
    for path in installed:
        path.write_text("", "utf-8")
    listed = [SimpleNamespace(parent=path.parent, locate=lambda path=path: path) for path in installed]
    listed.append(SimpleNamespace(parent=Path("kolsky/cli"), locate=lambda: tmp_path / "identify.py"))
    monkeypatch.setattr(identify, "__file__", str(tmp_path / "kolsky" / "cli" / "identify.py"))
    monkeypatch.setattr(identify.metadata, "files", lambda name: listed)
    assert identify.demo_files() == installed
    installed[0].unlink()
    with pytest.raises(InputError, match="without its shot open-05"):
        identify.demo_files()


def test_the_demo_is_a_new_folder_with_the_shot(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    jobs: list[identify.SingleShotJob] = []
    monkeypatch.setattr(identify, "_print_one", jobs.append)
    run_kolsky("demo", tmp_path / "a" / "trial", "-v")
    assert (jobs[0].shot, jobs[0].verbose) == (tmp_path / "a" / "trial", True)
    for path in identify.demo_files():
        assert (tmp_path / "a" / "trial" / path.name).read_bytes() == path.read_bytes()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["trial"]  # nothing half-made
    refused = run_kolsky("demo", tmp_path / "a" / "trial", code=2)
    assert "exists already and was not changed" in refused.stderr
    assert len(jobs) == 1


def test_the_release_notes_are_short() -> None:
    releases = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text("utf-8"), flags=re.MULTILINE)[1:]
    assert releases[0].startswith(f"[{PROJECT['project']['version']}]")
    for notes in releases:
        assert notes.count("\n- ") <= 10, notes.partition("\n")[0]
