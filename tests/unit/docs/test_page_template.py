"""The text that the documentation's template replaces is still in the output of its theme."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[3]
TEMPLATE = ROOT / "docs" / "_templates" / "page.html"
WRITTEN_BY = {
    '<aside class="sidebar-drawer">': "page.html",
    '<aside class="toc-drawer': "page.html",
    '<button class="theme-toggle"': "page.html",
    "</form>": "sidebar/search.html",
    '<table style="width: 100%" class="indextable genindextable">': "genindex.html",
}
"""Text that the theme's own templates hold; the rest is written by docutils."""
BY_DOCUTILS = {
    '<p class="caption" role="heading">',
    '<th class="head"><p></p></th>',
    '<th class="head">',
    "<pre>",
    '<div class="table-wrapper',
}
BY_PANDAS = {
    "<div>\\n<style scoped>",
    '</style>\\n<table border="1" class="dataframe">',
    "<th></th>",
    "<tr>\\n      <th>",
    "<th>",
}


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
