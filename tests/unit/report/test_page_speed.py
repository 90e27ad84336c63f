"""Fast drawing gives the same figures: cycles, spines, two processes; files are written meanwhile."""

import gc
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from synthetic import RESULTS

from kolsky.base.errors import InputError
from kolsky.base.process import GC_THRESHOLD, infrequent_gc
from kolsky.report import canvas, result_folder
from kolsky.report.canvas import STYLE
from kolsky.report.figures import REGISTRY
from kolsky.report.pages import rendering
from kolsky.report.pages.identification import render


def test_cycles_are_looked_for_seldom_until_the_end_or_an_error():
    before, within = gc.get_threshold(), []

    @infrequent_gc()
    def failing():
        within.append(gc.get_threshold())
        raise KeyError("a figure")

    with pytest.raises(KeyError):
        failing()
    assert within == [(GC_THRESHOLD, *before[1:])]
    assert gc.get_threshold() == before


def test_spines_take_no_room_of_their_own():
    with matplotlib.rc_context(fname=STYLE):
        figure = Figure(figsize=(3.3, 2.5), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2)
        left.plot([0.0, 1.3], [0.0, 2.0e3])
        left.set(xlabel="Time (ms)", ylabel="Force (N)", title="one")
        left.twinx().plot([0.0, 1.3], [3.0, 4.0])
        right.imshow(np.arange(12.0).reshape(3, 4))
        figure.colorbar(right.images[0], ax=right, location="bottom", extend="both")
        figure.draw_without_rendering()
        for ax in figure.axes:
            whole = ax.get_tightbbox().extents
            for spine in ax.spines.values():
                spine.set_in_layout(False)
            # [px]; the same numbers added in another order
            np.testing.assert_allclose(ax.get_tightbbox().extents, whole, atol=1e-9)


def test_two_processes_draw_the_same_page(monkeypatch):
    few = {name: REGISTRY[name] for name in ("force", "energy", "misfit")}
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", few)
    assert render(RESULTS["one"], processes=2) == render(RESULTS["one"], processes=1)


def test_groups_share_one_numbering_and_the_outer_figures_are_begun_first(monkeypatch):
    begun = []

    def draw(kind, shown, name):
        begun.append((name, shown))
        return f"<svg>{name}</svg>", f"{name}: Φ_F"

    monkeypatch.setattr(rendering, "_drawn", draw)
    kinds = {name: REGISTRY[name] for name in ("force", "energy", "misfit")}
    first = ([kinds["misfit"]], RESULTS["one"])
    second = ([kinds["force"], kinds["energy"]], RESULTS["two"])
    drawn = rendering.draw_groups([first, second], first=4, mark="a")
    assert begun == [("misfit-a", RESULTS["one"]), ("energy-a", RESULTS["two"]), ("force-a", RESULTS["two"])]
    assert [(figure["id"], figure["number"]) for figure in drawn] == [
        ("misfit-a", 4),
        ("force-a", 5),
        ("energy-a", 6),
    ]
    assert [figure["svg"] for figure in drawn] == [f"<svg>{figure['id']}</svg>" for figure in drawn]
    assert drawn[2]["caption"] == rendering.with_subscripts("energy-a: Φ_F")


@pytest.mark.parametrize("processes", [1, 2])
def test_a_result_file_that_cannot_be_written_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: int
) -> None:
    def refuse(path: Path, found: object) -> None:
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    def page(folder: Path, *given: object, **options: object) -> None:
        (folder / result_folder.PAGE).write_text("page", encoding="utf-8")

    monkeypatch.setattr(result_folder, "shot_recordings", lambda shot, folder: SimpleNamespace(numbers={}))
    monkeypatch.setattr(result_folder, "write_identify_page", page)
    monkeypatch.setattr(result_folder, "_nominal_rate", lambda shot: 1.0)
    result_folder.write_identify_results(tmp_path / "good", RESULTS["one"], None, processes=processes)
    assert {"identification.h5", "report.html"} <= {path.name for path in (tmp_path / "good").iterdir()}
    monkeypatch.setattr("kolsky.results.hdf5.write_identification", refuse)
    with pytest.raises(InputError, match="No space left"):
        result_folder.write_identify_results(tmp_path / "bad", RESULTS["one"], None, processes=processes)
    assert not (tmp_path / "bad").exists()


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_exactly_the_ticks_between_the_limits_remain(scale: str) -> None:
    axis = Figure().subplots().yaxis
    axis.axes.set(yscale=scale, ylim=(0.3, 40.0))
    every = axis.get_major_locator()
    all_ticks = np.asarray(every())
    axis.set_major_locator(canvas._Between(every))
    inside = all_ticks[(all_ticks >= 0.3) & (all_ticks <= 40.0)]
    assert 0 < inside.size < all_ticks.size
    np.testing.assert_array_equal(axis.get_majorticklocs(), inside)
    axis.axes.set(ylim=(40.0, 0.3))  # upside down
    np.testing.assert_array_equal(np.sort(axis.get_majorticklocs()), inside)


def test_a_text_with_quotes_stays_as_it_is_in_a_page() -> None:
    figure = canvas.build(REGISTRY["force"], RESULTS["one"])
    text = 'file id="a" style="b: c" href="#d" <e>'
    figure.axes[0].set_title(text)
    root = ElementTree.fromstring(canvas.inline_svg(figure, "name"))
    assert text in ["".join(one.itertext()) for one in root.iter("text")]
