"""The public names of `dic`: loaded when first used, the same for a type checker and at run time."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import dic


def test_a_type_checker_is_told_the_same_homes() -> None:
    told = {
        alias.name: node.module
        for node in ast.walk(ast.parse(Path(dic.__file__).read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("dic")
        for alias in node.names
    }
    assert told == dic._HOME
    assert dic.__all__ == [*dic._HOME]


@pytest.mark.parametrize("name", dic.__all__)
def test_every_public_name_is_there(name: str) -> None:
    # A module of the same name would take its place once it is loaded.
    assert not (Path(dic.__file__).parent / f"{name}.py").exists()
    assert getattr(dic, name).__module__ == dic._HOME[name]


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'Rig'; it offers .*StereoRig"):
        dic.Rig  # noqa: B018


def test_the_package_alone_loads_nothing() -> None:
    said = subprocess.run(
        [sys.executable, "-c", "import dic, sys; print([m for m in sys.modules if m[:4] == 'dic.'])"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert said.stdout.strip() == "[]"
