"""The report's slider over time: its numbers, the allowed scripts of the page, escaped text."""

import base64
import hashlib
import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from synthetic import synthetic

from kolsky.report.canvas import build, inline_svg
from kolsky.report.figures import REGISTRY
from kolsky.report.pages.identification import instrument, instrument_numbers, render
from kolsky.shot.recordings import part_of_picture

RESULT = synthetic()


@pytest.fixture(scope="module")
def page() -> str:
    return render(RESULT)


def test_numbers_are_those_of_the_comparison_in_a_readers_units() -> None:
    found, c, line = instrument_numbers(RESULT, None), RESULT.comparison, RESULT.comparison.centre_line
    np.testing.assert_allclose(found["force"]["time"], 1e3 * c.force_time, atol=0.5e-5)
    np.testing.assert_allclose(found["force"]["measured"], c.force_measured, atol=0.5e-4)
    right_model = np.hypot(c.force_sigma, 0.16)  # what the motion of the flyer leaves, N rms
    np.testing.assert_allclose(found["force"]["sigma"], right_model, atol=0.5e-4)
    frames = np.unique(line.frame)
    assert len(found["outlines"]) == frames.size
    for frame, shown in zip(frames, found["outlines"], strict=True):
        rows = np.flatnonzero(line.frame == frame)
        rows = rows[np.argsort(line.y[rows])]
        assert np.all(np.diff(shown["y"]) >= 0.0)
        np.testing.assert_allclose(shown["Z"], 1e3 * line.Z[rows], atol=0.5e-4)
        residual = 1e6 * (c.Z_model[rows] - line.Z[rows])
        known = np.isfinite(residual)
        assert [x is None for x in shown["residual"]] == (~known).tolist()
        told = [x for x in shown["residual"] if x is not None]
        np.testing.assert_allclose(told, residual[known], atol=0.05)
    np.testing.assert_allclose(found["simulated"]["r"][0], 1e3 * RESULT.response.surface_r[0, 0], atol=0.5e-4)
    assert found["pictures"] == {"time": [], "jpeg": []}


def test_a_number_that_is_none_is_no_number_of_the_page() -> None:
    c = RESULT.comparison
    lost = replace(RESULT, comparison=replace(c, force_model=np.full_like(c.force_model, np.nan)))
    assert set(instrument_numbers(lost, None)["force"]["model"]) == {None}
    text = str(instrument(lost, None))
    assert "NaN" not in text
    assert json.loads(text)["force"]["model"][0] is None
    assert not {"<", "&"} & set(text)  # nothing in it can end the element that it stands in


def test_the_page_allows_its_own_script_and_style_and_nothing_else(page: str) -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    said = dict(part.strip().split(" ", 1) for part in unescape(policy[1]).split(";"))
    assert said["default-src"] == "'none'"
    assert said["img-src"] == "data:"
    for kind, tag in (("style-src", "style"), ("script-src", "script")):
        inside = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        assert len(inside) == 1  # the numbers are data: their element has a type
        digest = base64.b64encode(hashlib.sha256(inside[0].encode()).digest()).decode()
        assert said[kind] == f"'sha256-{digest}'"
    assert not re.search(
        r"\sstyle=|\son[a-z]+=|javascript:", re.sub(r"<script.*?</script>", "", page, flags=re.S)
    )
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)


def test_every_part_that_the_script_asks_for_is_on_the_page(page: str) -> None:
    script = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)[0]
    wanted = set(re.findall(r'"((?:instant|instrument)[a-z-]*)"', script))
    assert wanted
    missing = wanted - set(re.findall(r'\sid="([^"]*)"', page))
    assert missing == {"instant-picture"}  # only where there are pictures
    assert '<section id="instrument" aria-label="The test over time" hidden>' in page  # without scripts


def test_text_in_a_figure_stays_text_without_styles() -> None:
    svg = inline_svg(build(REGISTRY["force"], RESULT), "force")
    assert "Time" in "".join(re.findall(r">([^<]*)</t(?:ext|span)>", svg))
    assert not re.search(r"\sstyle=|<style", svg)
    assert 'stroke-linejoin="round"' in svg[:400]  # of everything, as the style said that was taken out


def test_the_part_of_a_picture_around_its_points() -> None:
    # Points over columns 100 to 200 and rows 50 to 100: a fifth of each more on either side.
    pixels = np.array([[[100.0, 50.0], [200.0, 100.0], [np.nan, np.nan]]])
    rows, columns = part_of_picture(pixels, (512, 512))
    assert (rows.start, rows.stop) == (40, 111)
    assert (columns.start, columns.stop) == (80, 221)
    rows, columns = part_of_picture(pixels, (105, 205))  # as far as the picture goes
    assert (rows.stop, columns.stop) == (105, 205)
