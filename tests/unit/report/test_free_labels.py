"""Legends and labels on data are detected, and legends are moved."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from figure_overlaps import overlaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from test_rates_report import five
from test_sweep_report import analysed
from wavesmaker import made_result

from kolsky.prediction.predict import predict, read_test
from kolsky.report.canvas import build, free_legends
from kolsky.report.figures import PREDICTIONS, RATES, SWEEPS, WAVES
from kolsky.studies.rates.comparison import compare


def drawn(draw: Callable[[object], None]) -> Figure:
    """A figure of one panel, 4 by 3 inches."""
    figure = Figure(figsize=(4.0, 3.0))
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    ax.set_label("panel")
    draw(ax)
    return figure


def corner(ax) -> None:
    """A line from the upper left corner, whose legend stands there."""
    ax.plot([0.0, 1.0], [1.0, 0.0], label="a line")
    ax.legend(loc="upper left")


def everywhere(ax) -> None:
    """A noise that leaves no place free."""
    x = np.linspace(0.0, 1.0, 400)
    ax.plot(x, np.sin(300.0 * x), label="a noise")
    ax.legend(loc="upper left")


def test_a_legend_moves_off_its_line() -> None:
    figure = drawn(corner)
    assert overlaps(figure) == ["panel: the legend"]
    assert free_legends(figure) is False  # no limit was changed
    assert overlaps(figure) == []


def test_where_no_place_is_free_one_is_made_above() -> None:
    figure = drawn(everywhere)
    assert overlaps(figure) == ["panel: the legend"]
    low = figure.axes[0].get_ylim()[0]
    assert free_legends(figure) is True
    assert overlaps(figure) == []
    assert figure.axes[0].get_ylim()[0] == low
    assert figure.axes[0].get_ylim()[1] < 1.1 + 0.5 * 2.2


@pytest.mark.parametrize(
    "put",
    [
        lambda ax: ax.plot([0.5], [0.5], "o"),
        lambda ax: ax.scatter([0.5], [0.5]),
        lambda ax: ax.errorbar([0.5], [0.2], yerr=[0.6]),
        lambda ax: ax.fill_between([0.4, 0.6], [0.0, 0.0], [0.52, 0.52]),
        lambda ax: ax.bar([0.5], [1.0]),
        lambda ax: ax.plot([0.0, np.nan, 0.4, 0.6], [0.0, np.nan, 0.5, 0.5]),
    ],
)
def test_every_kind_of_data_is_seen_under_a_label(put) -> None:
    def draw(ax) -> None:
        put(ax)
        ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
        ax.text(0.5, 0.5, "word", ha="center", va="center")

    assert overlaps(drawn(draw)) == ["panel: the label 'word' on data"]


def test_guides_windows_and_pictures_are_no_data() -> None:
    def draw(ax) -> None:
        ax.axhline(0.5)
        ax.axvspan(0.4, 0.6)
        ax.imshow(np.eye(3), extent=(0.0, 1.0, 0.0, 1.0))
        ax.text(0.5, 0.5, "word", ha="center", va="center")

    assert overlaps(drawn(draw)) == []


def test_numbers_of_an_axis_that_touch_are_named() -> None:
    def draw(ax) -> None:
        ax.set_xticks([0.0, 0.01, 1.0], ["first", "second", "third"])
        ax.text(0.5, 0.5, "one")
        ax.text(0.52, 0.51, "two")

    assert overlaps(drawn(draw)) == [
        "panel: the labels 'one' and 'two'",
        "panel: the numbers first and second",
    ]


PLANNED = Path(__file__).parents[3] / "runs" / "predict" / "paper.toml"


def _rates(count: int):
    return compare(five(curve=0.004)[:count]).groups[0]


PAGES = {
    "one shot's rates": (RATES, lambda: _rates(1)),
    "five shots' rates": (RATES, lambda: _rates(5)),
    "waves": (WAVES, made_result),
    "a predicted test": (PREDICTIONS, lambda: predict(read_test(PLANNED), quick=True)),
    "sweep": (SWEEPS, lambda: analysed(n=128)),
}
"""Pages beside those of an identification, whose figures have this in their own battery (test_report.py)."""


@pytest.mark.parametrize("page", PAGES)
def test_nothing_lies_on_data_in_the_figures_of_a_page(page: str) -> None:
    registry, made = PAGES[page]
    shown = made()
    kinds = [kind for kind in registry.values() if kind.applies(shown)]
    assert kinds
    for kind in kinds:
        assert overlaps(build(kind, shown)) == [], kind.name


def test_the_page_of_one_shot_has_no_empty_panel() -> None:
    shown = _rates(1)
    for kind in RATES.values():
        if kind.applies(shown):
            for ax in build(kind, shown).axes:
                assert ax.has_data(), f"{kind.name}: {ax.get_label()}"
