"""The committed manual is complete: every topic has its test, page and figure, and there are no other
files."""

from pages import DOCS, HERE, TOPICS


def test_every_topic_has_its_test_page_and_figure() -> None:
    wanted = [HERE / f"test_{name}.py" for name in TOPICS]
    wanted += [DOCS / f"{name}.md" for name in TOPICS]
    missing = [path.name for path in wanted if not path.is_file()]
    assert not missing


def test_no_page_without_a_topic() -> None:
    assert {path.stem for path in DOCS.glob("*.md")} == {"index", *TOPICS}
    drawn = {name for name in TOPICS if f"images/{name}.svg" in (DOCS / f"{name}.md").read_text("utf-8")}
    assert {path.stem for path in (DOCS / "images").iterdir()} == drawn


def test_the_index_links_every_topic() -> None:
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    assert [name for name in TOPICS if f"]({name}.md)" not in index] == []
