"""The public names of `doe`: loaded when first used, the same for a type checker and at run time."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import doe


def test_a_type_checker_is_told_the_same_homes() -> None:
    told = {
        alias.name: node.module
        for node in ast.walk(ast.parse(Path(doe.__file__).read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("doe")
        for alias in node.names
    }
    assert told == doe._HOME
    assert doe.__all__ == [*doe._HOME]


@pytest.mark.parametrize("name", doe.__all__)
def test_every_public_name_is_there(name: str) -> None:
    # A module of the same name would take its place once it is loaded.
    assert not (Path(doe.__file__).parent / f"{name}.py").exists()
    assert getattr(doe, name) is not None


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'sobel'; it offers .*sobol"):
        doe.sobel  # noqa: B018


def test_the_package_alone_loads_nothing() -> None:
    said = subprocess.run(
        [sys.executable, "-c", "import doe, sys; print([m for m in sys.modules if m[:4] == 'doe.'])"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert said.stdout.strip() == "[]"
