"""Examples in docstrings of the public interface are run, from the repository's folder."""

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in ("kolsky", "dic", "explicit", "doe")
    for path in (ROOT / package).rglob("*.py")
    if ">>> " in path.read_text("utf-8")
)
FEWEST = 15  # fewest examples: one for each thing that a first script does


def examples(module: str) -> list[doctest.DocTest]:
    found = doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(module))
    return [test for test in found if test.examples]


@pytest.mark.parametrize("module", MODULES)
def test_examples_hold(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    said: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    for test in examples(module):
        runner.run(test, out=said.append)
    assert not said, "".join(said)


def test_there_are_examples_in_every_package() -> None:
    assert {module.partition(".")[0] for module in MODULES} == {"kolsky", "dic", "explicit", "doe"}
    assert sum(len(examples(module)) for module in MODULES) >= FEWEST
