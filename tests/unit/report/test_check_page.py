"""The page of `kolsky check` for a test between bars, and its figure before the pictures are read."""

from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from barrecord import classical_shot
from matplotlib import pyplot as plt
from shot_folders import OPEN_01

from kolsky.pictures.picture_set import PictureChanges
from kolsky.report.figures import CHECKS, PICTURE_CHECKS, figures_of
from kolsky.report.pages.waves import render_check
from kolsky.shot.load import load_shot
from kolsky.shot.records import PicturedShot, ShotBase
from kolsky.shot.summary import as_json


def test_a_test_between_bars_has_no_outline() -> None:
    shot = classical_shot(0)
    page = render_check(shot)
    assert "The velocity of the front face on the same clock" in page
    assert "(c) The outline at three times" not in page
    assert figures_of(shot) == CHECKS


def test_pictures_that_are_not_correlated_show_when_they_change() -> None:
    loaded: Any = load_shot(OPEN_01)
    base = {field.name: getattr(loaded, field.name) for field in fields(ShotBase)}
    found = PictureChanges(
        time=np.linspace(-50e-6, 1e-3, 5),
        change=np.array([[0.0, 0.01, 0.02, 0.03, 0.04], [0.0, 0.0, np.nan, 0.0, 0.0]]),
        rest_end=25e-6,
        shown=((-50e-6, np.zeros((4, 5))), (25e-6, np.ones((4, 5)))),
    )
    pictures: Any = SimpleNamespace(changes=found)
    shot = PicturedShot(**base, pictures=pictures)
    assert figures_of(shot) == PICTURE_CHECKS
    kind = PICTURE_CHECKS["checked-pictures"]
    assert "are not measured" in kind.caption(shot)
    names = list(dict.fromkeys(name for row in kind.panels(shot) for name in row))
    figure, axes = plt.subplots(len(names))
    panels = dict(zip(names, axes, strict=True))
    kind.draw(shot, panels)
    camera_0 = panels["motion"].lines[0]
    np.testing.assert_allclose(camera_0.get_xdata(), 1e3 * found.time, rtol=1e-12)
    np.testing.assert_allclose(camera_0.get_ydata(), [0.0, 1.0, 2.0, 3.0, 4.0], atol=1e-12)
    assert panels["motion"].get_xlim() == panels["force"].get_xlim()  # one clock
    assert [panels[name].get_title(loc="right") for name in ("first", "static", "last")] == [
        "−0.050 ms", "0.025 ms", "",
    ]  # fmt: skip
    assert [len(panels[name].images) for name in ("first", "static", "last")] == [1, 1, 0]
    plt.close(figure)


def test_the_curve_is_drawn_beside_force_over_area() -> None:
    shot: Any = load_shot(OPEN_01)
    figure, ax = plt.subplots()
    CHECKS["checked-curve"].draw(shot, {"curve": ax})
    curve, test = ax.lines
    np.testing.assert_allclose(curve.get_xdata(), 1.0 - shot.curve.stretch, rtol=1e-12)
    np.testing.assert_allclose(curve.get_ydata(), -1e-3 * shot.curve.stress, rtol=1e-12)
    # 24.09 N at most over 70.88 mm^2; frames see the peak of the force within a tenth of a newton.
    np.testing.assert_allclose(test.get_ydata().max(), 24.0 / (0.25 * np.pi * 9.5**2) * 1e3, rtol=0.02)
    np.testing.assert_allclose(test.get_xdata().max(), 3.53 / 6.5, rtol=0.01)
    plt.close(figure)


def test_the_page_and_the_summary_name_what_is_unlikely() -> None:
    shot: Any = load_shot(OPEN_01)
    odd = replace(shot, notes=("specimen.density beside model.poisson",))
    assert "<h2>Warnings</h2>" in render_check(odd)
    assert "<h2>Warnings</h2>" not in render_check(shot)
    assert as_json(odd)["warnings"] == ["specimen.density beside model.poisson"]
    assert as_json(shot)["force"]["clock"]["value"] == "2 MHz, 3341 samples, 1.671 ms"
    assert as_json(shot)["flyer"]["clock"]["value"] == "120 kHz, 186 frames, 1.55 ms"


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
