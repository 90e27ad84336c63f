"""The allowed scripts of a page, and texts in its figures."""

import base64
import hashlib
import re
from html import unescape

import pytest
from synthetic import synthetic

from kolsky.report.canvas import build, inline_svg
from kolsky.report.figures import REGISTRY
from kolsky.report.pages.identification import render

RESULT = synthetic()


@pytest.fixture(scope="module")
def page() -> str:
    return render(RESULT)


def test_the_page_allows_its_own_script_and_style_and_nothing_else(page: str) -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    said = dict(part.strip().split(" ", 1) for part in unescape(policy[1]).split(";"))
    assert said["default-src"] == "'none'"
    assert said["img-src"] == "data:"
    for kind, tag in (("style-src", "style"), ("script-src", "script")):
        inside = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        assert len(inside) == 1
        digest = base64.b64encode(hashlib.sha256(inside[0].encode()).digest()).decode()
        assert said[kind] == f"'sha256-{digest}'"
    assert not re.search(
        r"\sstyle=|\son[a-z]+=|javascript:", re.sub(r"<script.*?</script>", "", page, flags=re.S)
    )
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)


def test_text_in_a_figure_stays_text_without_styles() -> None:
    svg = inline_svg(build(REGISTRY["force"], RESULT), "force")
    assert "Time" in "".join(re.findall(r">([^<]*)</t(?:ext|span)>", svg))
    assert not re.search(r"\sstyle=|<style", svg)
    assert 'stroke-linejoin="round"' in svg[:400]  # of everything, as the style said that was taken out
