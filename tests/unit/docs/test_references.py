"""Dotted names of this project in docstrings, comments and pages exist."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("kolsky", "explicit", "doe", "dic")
NAME = re.compile(rf"`~?((?:{'|'.join(PACKAGES)})(?:\.\w+)+)`")
KEYS_OF_SHOT_TOML = "dic"  # a table of shot.toml has the name of a package: `dic.subset` is a key
FILES = sorted(
    path
    for folder in (*PACKAGES, "docs", "tests", "runs", "benchmarks", "populations")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".md") and "_build" not in path.parts and "generated" not in path.parts
)


@cache
def module(name: str) -> Path | None:
    """File of a module of ours, if there is one."""
    place = ROOT.joinpath(*name.split("."))
    for file in (place / "__init__.py", place.with_suffix(".py")):
        if file.is_file():
            return file
    return None


@cache
def names_in(file: Path) -> frozenset[str]:
    """Names at the top of a module, and the keys of the dictionary of what it offers lazily."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return frozenset(names)


def is_known(name: str) -> bool:
    """Whether a dotted name is a module of ours, or something in one."""
    parts = name.split(".")
    for depth in range(len(parts), 0, -1):
        file = module(".".join(parts[:depth]))
        if file is not None:
            return depth == len(parts) or parts[depth] in names_in(file)
    return False


def test_names_of_ours_are_there() -> None:
    unknown = {
        f"{file.relative_to(ROOT)}: {name}"
        for file in FILES
        for name in NAME.findall(file.read_text("utf-8"))
        if not is_known(name)
        and not (name.split(".")[0] == KEYS_OF_SHOT_TOML and name.count(".") == 1)  # a key, or a file: dic.h5
    }
    assert sorted(unknown) == []


def test_the_search_sees_a_name_that_is_gone() -> None:
    assert is_known("kolsky.shot.load.load_shot")
    assert is_known("kolsky.identify")
    assert not is_known("kolsky.shot.load.load_shots")
    assert not is_known("kolsky.shotfiles.schema")
