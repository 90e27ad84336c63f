"""The committed manual is complete: every topic has its test, page and figure, every page all its values."""

import ast
import builtins
from importlib import import_module

import pytest
from page_values import made_tables, stored
from pages import DOCS, HERE, TOPICS


def test_every_topic_has_its_test_and_page_and_no_page_is_without_a_topic() -> None:
    assert [name for name in TOPICS if not (HERE / f"test_{name}.py").is_file()] == []
    assert {path.stem for path in DOCS.glob("*.md")} == {"index", *TOPICS}
    drawn = {name for name in TOPICS if f"images/{name}.svg" in (DOCS / f"{name}.md").read_text("utf-8")}
    assert {path.stem for path in (DOCS / "images").iterdir()} == drawn
    assert drawn == {name for name in TOPICS if hasattr(import_module(f"test_{name}"), "draw")}


@pytest.mark.parametrize("name", TOPICS)
def test_a_page_has_all_its_values_and_no_others(name: str) -> None:
    page = DOCS / f"{name}.md"
    wanted = made_tables.expressions(page)
    assert list(stored(page)) == list(dict.fromkeys(wanted))
    topic = import_module(f"test_{name}")
    known = {*vars(builtins), "np", "table", "result", *vars(topic)}
    if hasattr(topic, "shown"):
        known |= {*topic.shown.__code__.co_varnames, *topic.shown.__code__.co_cellvars}
    nodes = [node for one in wanted for node in ast.walk(ast.parse(f'f"""{{{one}}}"""'))]
    names = [node for node in nodes if isinstance(node, ast.Name)]
    known |= {node.id for node in names if isinstance(node.ctx, ast.Store)}
    assert {node.id for node in names} - known == set()
    assert "{{" not in made_tables.with_values(page, page.read_text("utf-8"))
