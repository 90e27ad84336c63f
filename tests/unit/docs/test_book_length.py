"""Limits of length: words of the tutorials, how-to pages and chapters of theory."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[3] / "docs"
LIMITS = {("tutorials", "howto"): 27_000, ("tutorials", "howto", "theory"): 45_000}
"""Folders -> words at most. 45 000 are a working day at 100 a minute."""


def words(text: str) -> int:
    """Words of a page, code and tables included; rules and bars of tables are no words."""
    return len(re.findall(r"\S*\w\S*", text))


@pytest.mark.parametrize("folders", LIMITS, ids="+".join)
def test_the_book_is_short(folders: tuple[str, ...]) -> None:
    pages = {path: words(path.read_text("utf-8")) for name in folders for path in (DOCS / name).glob("*.md")}
    assert len(pages) >= 5 * len(folders)  # the pages are there
    longest = sorted(pages, key=pages.__getitem__)[-5:]
    named = ", ".join(f"{path.name} {pages[path]}" for path in reversed(longest))
    assert sum(pages.values()) <= LIMITS[folders], f"{sum(pages.values())} words; the longest: {named}"


def test_words_are_counted() -> None:
    assert words("| key | µm |\n| --- | --- |\n# A *title*\n\n`a = 1`, done.\n") == 7


def test_every_task_of_the_landing_page_is_in_the_sidebar() -> None:
    text = (DOCS / "index.md").read_text("utf-8")
    listed = re.findall(r"^(howto/\w+)$", text, re.MULTILINE)
    assert sorted(listed) == sorted(f"howto/{path.stem}" for path in (DOCS / "howto").glob("*.md"))
    assert len(listed) == len(set(listed))
