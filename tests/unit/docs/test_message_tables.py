"""Tables of messages from the sources, and required content of their pages."""

import ast
import sys
from pathlib import Path

import pytest

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
