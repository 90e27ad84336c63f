"""Tables that pages take from the sources, and the template of a page."""

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import kolsky
from kolsky.report.figures import PLACES
from kolsky.report.result_folder import RESULTS
from tests.test_imports import MODULES, PACKAGES, ROOT, Import, imports_in, imports_of

# Tables of messages from the sources, and required content of their pages.

DOCS = Path(__file__).resolve().parents[3] / "docs"
SOURCE = """
def f(path, n, table):
    if n < 1:
        raise InputError(path, f"has {n} lines", allowed="at least 1", cure="export " "it again")
    raise table.error(f"column '{n}' is " + ("late" if n else "early"), cure=f"say {n}|{n}")
    raise ValueError("not for a reader")
"""


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    monkeypatch.delitem(sys.modules, "message_tables", raising=False)
    import message_tables

    return message_tables


def test_every_refusal_of_a_file_is_a_row(tables, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.py").write_text(SOURCE, encoding="utf-8")
    monkeypatch.setattr(tables, "ROOT", tmp_path)
    assert tables.messages("a.py").splitlines() == [
        "| what is said | it must be | cure |",
        "| --- | --- | --- |",
        "| `has … lines` | `at least 1` | `export it again` |",
        "| `column '…' is …` |  | `say …\\|…` |",
    ]


def test_the_places_that_pages_name_are_there_and_together_hold_every_message(tables) -> None:
    named: set[Path] = set()
    for page in (DOCS / "messages").glob("*.md"):
        for kind, words in tables.LINE.findall(page.read_text("utf-8")):
            if kind == "messages":
                for place in words.split():
                    path = tables.ROOT / place
                    assert path.exists(), f"{page.name}: {place}"
                    named |= {path} if path.is_file() else set(path.rglob("*.py"))
            else:
                assert kind == "outcomes"
                assert "| cause |" in tables.outcomes(words)
    missing = [
        str(file.relative_to(tables.ROOT))
        for package in ("kolsky", "dic")
        for file in (tables.ROOT / package).rglob("*.py")
        if file not in named and tables.refusals(file)
    ]
    assert missing == []


def test_figures_are_listed_with_words_that_tell_them_apart(tables) -> None:
    rows = tables.figures().splitlines()[2:]
    drawn = sum(page.read_text("utf-8").count("```{figure}") for page in DOCS.rglob("*.md"))
    assert drawn >= len(rows) > 30  # a figure may stand on a page twice
    assert len(set(rows)) == len(rows)
    assert not any("{doc}`../" in row for row in rows)  # relative to its own page
    assert all(len(row.split("|")[1]) > 20 for row in rows)


def test_a_text_is_what_is_printed(tables) -> None:
    def shown(code: str) -> str:
        return tables.text_of(ast.parse(code, mode="eval").body)

    assert shown("'a ' 'b'") == "a b"
    assert shown("f'{x} of {y!r}'") == "… of …"
    assert shown("'a ' + x") == "a …"
    assert tables.text_of(None) == ""


# The text that the documentation's template replaces is still in the output of its theme.

PAGE_TEMPLATE_ROOT = Path(__file__).resolve().parents[3]
TEMPLATE = PAGE_TEMPLATE_ROOT / "docs" / "_templates" / "page.html"
WRITTEN_BY = {
    '<aside class="sidebar-drawer">': "page.html",
    '<aside class="toc-drawer': "page.html",
    '<button class="theme-toggle"': "page.html",
    "</form>": "sidebar/search.html",
    '<table style="width: 100%" class="indextable genindextable">': "genindex.html",
}
"""Text that the theme's own templates hold; the rest is written by docutils."""
BY_DOCUTILS = {
    '<p class="caption" role="heading">', '<th class="head"><p></p></th>', '<th class="head">', "<pre>",
    '<div class="table-wrapper',
}  # fmt: skip
BY_PANDAS = {
    "<div>\\n<style scoped>", '</style>\\n<table border="1" class="dataframe">', "<th></th>",
    "<tr>\\n      <th>", "<th>",
}  # fmt: skip


def replaced() -> dict[str, str]:
    """Text of the theme -> what stands in its place."""
    return dict(re.findall(r"replace\('([^']*)', '([^']*)'\)", TEMPLATE.read_text("utf-8")))


def test_every_replacement_is_of_known_text() -> None:
    assert set(replaced()) == {*WRITTEN_BY, *BY_DOCUTILS, *BY_PANDAS}


@pytest.mark.parametrize("text", WRITTEN_BY)
def test_the_theme_still_writes_it(text: str) -> None:
    furo = pytest.importorskip("furo")
    page = Path(furo.__file__).parent / "theme" / "furo" / WRITTEN_BY[text]
    assert text in page.read_text("utf-8")


@pytest.mark.parametrize("text", sorted(BY_PANDAS))
def test_pandas_still_writes_it(text: str) -> None:
    table = pd.DataFrame({"a": [1]})._repr_html_()
    assert text.replace("\\n", "\n") in table


def test_names_and_levels_are_given() -> None:
    new = replaced()
    assert 'aria-label="Documentation"' in new['<aside class="sidebar-drawer">']
    assert 'aria-label="On this page"' in new['<aside class="toc-drawer']
    assert new['<th class="head">'] == '<th class="head" scope="col">'
    assert "overflow-wrap: anywhere" in new['<table style="width: 100%" class="indextable genindextable">']
    assert new["<pre>"] == '<pre tabindex="0">'  # what scrolls is reached by the keyboard


# Functions for Python only: no whole module, exactly the functions of the page; the page's examples run.

PAGE = (ROOT / "docs" / "python_only.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def imported(imports: Iterable[Import]) -> set[str]:
    """Modules of the repository among imports, with the packages that they are in."""
    return {part for one in imports if one.target in MODULES for part in enclosing(one.target)}


def enclosing(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[: k + 1]) for k in range(len(parts))]


def entry_points() -> set[str]:
    """The commands, what `python -m` runs, what scripts of `runs/` import, the names of `kolsky`, and what
    is loaded by a registry's name: figures of a page, writers of a result's files."""
    found = {name for name in MODULES if "kolsky.cli" in enclosing(name)} | {"kolsky"}
    found |= {n for n, path in MODULES.items() if 'if __name__ == "__main__":' in path.read_text("utf-8")}
    for script in (ROOT / "runs").rglob("*.py"):
        found |= imported(imports_of(script.read_text("utf-8"), script.stem))
    figures = {place.partition(":")[0] for _, *places in PLACES.values() for place in places}
    found |= {f"kolsky.report.figures.{name}" for name in figures}
    for files in RESULTS.values():  # written by the names of their functions
        found |= {place.rpartition(".")[0] for place in files.files.values()}
    assert {kolsky._HOME[name] for name in kolsky.__all__} <= imported(imports_in("kolsky"))
    return found


def unreachable() -> list[str]:
    """Modules that no entry point imports, directly or through others."""
    seen: set[str] = set()
    left = entry_points()
    while left:
        name = left.pop()
        seen.add(name)
        left |= ({*enclosing(name)} | imported(imports_in(name))) - seen
    return sorted(MODULES.keys() - seen)


def test_every_module_is_reached() -> None:
    assert unreachable() == []


def unused_names() -> list[str]:
    """Public functions and classes whose name stands once in all of the packages and scripts: where it is
    defined. A name that something else bears too is not found so; those that are left are few."""
    texts = {name: path.read_text("utf-8") for name, path in MODULES.items()}
    scripts = [path.read_text("utf-8") for path in (ROOT / "runs").rglob("*.py")]
    words = Counter(word for text in (*texts.values(), *scripts) for word in re.findall(r"\w+", text))
    return [
        f"{name}.{one}"
        for name, text in texts.items()
        for one in re.findall(r"^(?:def|class) ([a-zA-Z]\w*)", text, re.MULTILINE)
        if words[one] == 1
    ]


def test_a_function_that_nothing_calls_is_on_the_page() -> None:
    """By the words of the sources, not by imports: another look at what no command reaches."""
    named = set(re.findall(r"\{py:\w+\}`([\w.]+)`", PAGE))
    unused = set(unused_names())
    left = sorted(unused - named)
    assert not left, f"neither used nor on docs/python_only.md: {', '.join(left)}"
    stale = sorted({name for name in named if name.startswith(PACKAGES)} - unused)
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
