"""Functions for Python only: no whole module, exactly the functions of the page; the page's examples run."""

import ast
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import kolsky
from kolsky.report.figures import PLACES
from kolsky.report.result_folder import RESULTS
from tests.test_imports import MODULES, PACKAGES, ROOT, imports_of

PAGE = (ROOT / "docs" / "python_only.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def imported(name: str, path: Path) -> set[str]:
    """Modules of the repository that a file imports, with the packages that they are in."""
    package = path.name == "__init__.py"
    targets = {i.target for i in imports_of(path.read_text("utf-8"), name, is_package=package)}
    return {part for target in targets & MODULES.keys() for part in enclosing(target)}


def enclosing(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[: k + 1]) for k in range(len(parts))]


def entry_points() -> set[str]:
    """The commands, what `python -m` runs, what scripts of `runs/` import, the names of `kolsky`, and what
    is loaded by a registry's name: figures of a page, writers of a result's files."""
    found = {name for name in MODULES if "kolsky.cli" in enclosing(name)} | {"kolsky"}
    found |= {n for n, path in MODULES.items() if 'if __name__ == "__main__":' in path.read_text("utf-8")}
    for script in (ROOT / "runs").rglob("*.py"):
        found |= imported(script.stem, script)
    figures = {place.partition(".")[0] for places in PLACES.values() for place in places}
    found |= {f"kolsky.report.figures.{name}" for name in figures}
    for files in RESULTS.values():  # written by the names of their functions
        found |= {place.rpartition(".")[0] for place in files.files.values()}
    assert {kolsky._HOME[name] for name in kolsky.__all__} <= imported("kolsky", MODULES["kolsky"])
    return found


def unreachable() -> list[str]:
    """Modules that no entry point imports, directly or through others."""
    seen: set[str] = set()
    left = entry_points()
    while left:
        name = left.pop()
        seen.add(name)
        left |= ({*enclosing(name)} | imported(name, MODULES[name])) - seen
    return sorted(MODULES.keys() - seen)


def test_every_module_is_reached() -> None:
    assert unreachable() == []


def unused_names() -> list[str]:
    """Public functions and classes whose name stands once in all of the packages and scripts: where it is
    defined. A name that something else bears too is not found so; those that are left are few."""
    texts = {name: path.read_text("utf-8") for name, path in MODULES.items()}
    scripts = [path.read_text("utf-8") for path in (ROOT / "runs").rglob("*.py")]
    words = Counter(word for text in (*texts.values(), *scripts) for word in re.findall(r"\w+", text))
    kinds = (ast.FunctionDef, ast.ClassDef)
    return [
        f"{name}.{node.name}"
        for name, text in texts.items()
        for node in ast.parse(text).body
        if isinstance(node, kinds) and node.name[0] != "_" and words[node.name] == 1
    ]


def test_a_function_that_nothing_calls_is_on_the_page() -> None:
    """By the words of the sources, not by imports: another look at what no command reaches."""
    named = set(re.findall(r"\{py:\w+\}`([\w.]+)`", PAGE))
    left = [name for name in unused_names() if name not in named]
    assert not left, f"neither used nor on docs/python_only.md: {', '.join(left)}"
    stale = sorted({name for name in named if name.startswith(PACKAGES)} - set(unused_names()))
    assert not stale, f"listed as single functions on docs/python_only.md, but used: {', '.join(stale)}"


def test_the_page_is_in_the_index() -> None:
    assert re.search(r"^python_only$", (ROOT / "docs" / "index.md").read_text("utf-8"), re.MULTILINE)


@pytest.fixture(scope="module")
def run() -> dict:
    """Names after all examples, run one after the other as a reader would."""
    names: dict = {}
    for block in BLOCKS:
        exec(compile(ast.parse(block), "docs/python_only.md", "exec"), names)
    return names


def test_the_examples_give_the_answers_they_were_made_with(run: dict) -> None:
    assert run["verdict"].branches == 1
    # The force is of first degree in the constants together: its second derivatives take them to 0.
    constants, curvature = run["rubber"].parameters(), run["curvature"]
    assert np.abs(curvature * constants).max() > 1e-3
    assert curvature @ constants == pytest.approx(0.0, abs=1e-6 * np.abs(curvature * constants).max())
    assert run["parts"] is not None
