"""Pages on a narrow screen: a wide table moves in its own box, which a keyboard reaches, and not the page."""

from html.parser import HTMLParser
from pathlib import Path

import pytest

PAGES = sorted((Path(__file__).parents[3] / "kolsky" / "report" / "pages").glob("*.html"))
MOST_COLUMNS = 5
"""Columns of numbers that fit a screen 390 px wide; looked at in pictures of the pages."""
VOID = ("img", "input", "meta", "br", "link", "hr", "path")


class Tables(HTMLParser):
    """Number of columns of each table, and the attributes of the boxes around it."""

    def __init__(self) -> None:
        super().__init__()
        self.around: list[tuple[str, dict[str, str | None]]] = []
        self.found: list[tuple[int, list[dict[str, str | None]]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in VOID:
            return
        if tag == "table":
            self.found.append((0, [box for _, box in self.around]))
        if tag == "th" and ("scope", "col") in attrs and self.found:
            columns, boxes = self.found[-1]
            self.found[-1] = (columns + 1, boxes)
        self.around.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        while self.around and self.around.pop()[0] != tag:
            pass


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_wide_table_stands_in_a_box_that_scrolls(page: Path) -> None:
    tables = Tables()
    tables.feed(page.read_text(encoding="utf-8"))
    for columns, boxes in tables.found:
        if columns <= MOST_COLUMNS:
            continue
        scrolling = [box for box in boxes if "scroll" in (box.get("class") or "").split()]
        assert scrolling, f"a table of {columns} columns or more in {page.name}"
        assert all(box.get("tabindex") == "0" and box.get("aria-label") for box in scrolling)
