"""What is installed: the conda recipe asks for what the package asks for, every file of a page is shipped."""

import re
import tomllib
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
RENAMED = {"matplotlib": "matplotlib-base"}


def test_the_conda_recipe_has_the_dependencies_of_the_package() -> None:
    recipe = (ROOT / "conda" / "meta.yaml").read_text("utf-8")
    run = recipe[recipe.index("  run:") : recipe.index("\ntest:")]
    listed = dict(re.findall(r"- ([\w-]+) >=([\d.]+)", run))
    wanted = dict(text.split(">=") for text in PROJECT["project"]["dependencies"])
    wanted = {RENAMED.get(name, name): version for name, version in wanted.items()}
    wanted["python"] = PROJECT["project"]["requires-python"].removeprefix(">=")
    assert listed == wanted
    assert f'version: "{PROJECT["project"]["version"]}"' in recipe


def test_every_file_beside_the_modules_is_shipped() -> None:
    patterns = PROJECT["tool"]["setuptools"]["package-data"]
    missing = []
    for package in ("kolsky", "dic", "explicit", "implicit", "doe"):
        for file in (ROOT / package).rglob("*"):
            inside = file.relative_to(ROOT / package).as_posix()
            if not file.is_file() or file.suffix in (".py", ".pyc") or "__pycache__" in inside:
                continue
            if not any(fnmatch(inside, pattern) for pattern in patterns[package]):
                missing.append(f"{package}/{inside}")
    assert missing == []


def test_classifiers_name_the_pythons_and_the_field() -> None:
    said = PROJECT["project"]["classifiers"]
    assert "Programming Language :: Python :: 3.11" in said
    assert "Typing :: Typed" in said
    assert any(text.startswith("Topic :: Scientific/Engineering") for text in said)
