"""The public names of `explicit`: loaded when first used, the same for a type checker and at run time."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import explicit


def test_a_type_checker_is_told_the_same_homes() -> None:
    told = {
        alias.name: node.module
        for node in ast.walk(ast.parse(Path(explicit.__file__).read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("explicit")
        for alias in node.names
    }
    assert told == explicit._HOME
    assert explicit.__all__ == [*explicit._HOME]


@pytest.mark.parametrize("name", explicit.__all__)
def test_every_public_name_is_there(name: str) -> None:
    # A module of the same name would take its place once it is loaded.
    assert not (Path(explicit.__file__).parent / f"{name}.py").exists()
    assert getattr(explicit, name) is not None


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'runn'; it offers .*run"):
        explicit.runn  # noqa: B018


SAYS = "import explicit, sys; print([m for m in sys.modules if m == 'warp' or m.startswith('explicit.')])"


def test_the_package_alone_loads_nothing() -> None:
    said = subprocess.run(
        [sys.executable, "-c", SAYS],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert said.stdout.strip() == "[]"
