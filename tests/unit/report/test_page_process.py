"""A process beside an identification: the same page, figures drawn ahead, what happens when it is gone."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import RESULTS

from dic.processes import background, can_fork
from kolsky.inverse.result import CheckRun, Identification
from kolsky.report import canvas, page_process
from kolsky.report.figures import CHECK_RUNS
from kolsky.report.pages.identification import render
from kolsky.report.picture_views import SurfaceView
from kolsky.report.result_folder import write_identify_results

pytestmark = pytest.mark.skipif(not can_fork(), reason="no forks here")

FOUND = RESULTS["one"]


def check_run(found: Identification) -> CheckRun:
    return CheckRun(found.comparison, found.response, found.refined_mesh, found.provenance)


def written(path: Path, found: Identification, *, ahead: CheckRun | None = None) -> str:
    with page_process.page_process(2) as page:
        assert page is not None
        if ahead is not None:
            page.draw_ahead(ahead)
        page.begin(path, found, None)()  # type: ignore[arg-type]  # a page without recordings
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("ahead", [None, check_run(FOUND)])
def test_the_process_writes_the_page_that_is_written_here(tmp_path: Path, ahead: CheckRun | None) -> None:
    assert written(tmp_path / "page.html", FOUND, ahead=ahead) == render(FOUND)


def test_figures_drawn_ahead_are_used_if_they_are_of_the_run_that_was_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(canvas, "inline_svg", lambda kind, shown: f"<svg>ahead: {kind.name}</svg>")
    page = written(tmp_path / "page.html", FOUND, ahead=check_run(FOUND))
    shown = [name for name, kind in CHECK_RUNS.items() if kind.applies(FOUND)]
    assert len(shown) > 3
    assert [name for name in CHECK_RUNS if f"<svg>ahead: {name}</svg>" in page] == shown
    assert page.count("ahead: ") == len(shown)
    other = replace(FOUND, comparison=replace(FOUND.comparison))
    assert "ahead: " not in written(tmp_path / "page.html", other, ahead=check_run(FOUND))


@pytest.mark.parametrize("name", ["comparison", "response", "refined_mesh", "provenance"])
def test_a_check_run_is_of_one_identification(name: str) -> None:
    run = check_run(FOUND)
    assert run.is_of(FOUND)
    assert run.is_of(replace(FOUND, warnings=("another",)))
    changed: dict[str, Any] = {name: None}
    assert not run.is_of(replace(FOUND, **changed))


def test_the_figures_of_a_check_run_need_nothing_else() -> None:
    """What is drawn of it has the bytes of what is drawn of the identification, and the same captions."""
    kinds = [kind for kind in CHECK_RUNS.values() if kind.applies(FOUND)]
    assert [kind for kind in CHECK_RUNS.values() if kind.applies(check_run(FOUND))] == kinds
    for kind in kinds:
        assert canvas.inline_svg(kind, check_run(FOUND)) == canvas.inline_svg(kind, FOUND)
        assert kind.caption(check_run(FOUND)) == kind.caption(FOUND)


def test_a_page_is_drawn_here_if_the_process_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_process, "_draw", lambda take, processes: os._exit(1))
    assert written(tmp_path / "page.html", FOUND, ahead=check_run(FOUND)) == render(FOUND)


def test_an_error_of_drawing_is_raised_here(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        written(tmp_path / "nowhere" / "page.html", FOUND)


def test_results_are_written_with_the_page_of_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Page:
        def begin(self, path: Path, *shown: object) -> Any:
            return lambda: path.write_text("the page", encoding="utf-8")

    monkeypatch.setattr(
        "kolsky.report.result_folder.recorded", lambda shot, folder: SimpleNamespace(numbers={})
    )
    page: Any = Page()
    shot: Any = None
    write_identify_results(tmp_path, FOUND, shot, processes=2, page=page)
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "the page"
    assert (tmp_path / "identification.h5").stat().st_size > 0


def test_only_a_process_beside_this_one_stands_back() -> None:
    usual = os.getpriority(os.PRIO_PROCESS, 0)
    work = page_process.standing_back(lambda k: f"{k} {os.getpriority(os.PRIO_PROCESS, 0) - usual}")
    assert work(0) == "0 0"
    with background(lambda: (work(1), work(2)), fork=True) as there:
        assert there() == (f"1 {page_process.PATIENCE}", f"2 {page_process.PATIENCE}")
    assert os.getpriority(os.PRIO_PROCESS, 0) == usual


def test_there_is_no_such_process_for_one_process() -> None:
    with page_process.page_process(1) as page:
        assert page is None


@pytest.mark.parametrize(("cores", "processes"), [(1, 2), (2, 2), (3, 3), (64, page_process.MOST_DRAWERS)])
def test_as_many_draw_as_there_are_cores(monkeypatch: pytest.MonkeyPatch, cores: int, processes: int) -> None:
    monkeypatch.setattr(page_process, "cores", lambda: cores)
    assert page_process.drawers() == processes


def view(shot: str, flight: str = "not asked for") -> SurfaceView:
    result: Any = SimpleNamespace(shot=shot)
    return SurfaceView(shot, result, {}, np.zeros((2, 3)), flight)


@pytest.fixture
def plain_surfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page of surfaces that says what it was made of, and by whom its figure was drawn."""

    @contextmanager
    def drawn_ahead(shown: SurfaceView, processes: int) -> Iterator[dict[str, Callable[[], str]]]:
        yield {"figure": lambda: f"{shown.shot}, {shown.flight}"}

    def write(path: Path, shown: SurfaceView, inputs: Any, *, processes: int, ahead: Any = None) -> None:
        figure = ahead["figure"]() if ahead else "drawn at the end"
        path.write_text(f"{shown.shot}; {shown.flight}; {inputs}; {figure}; {os.getpid()}", encoding="utf-8")

    monkeypatch.setattr(page_process, "_drawn_ahead", drawn_ahead)
    monkeypatch.setattr("kolsky.report.pages.surfaces.write_page", write)


@pytest.mark.usefixtures("plain_surfaces")
def test_surfaces_are_drawn_before_their_flight_is_known(tmp_path: Path) -> None:
    first, path = view("one"), tmp_path / "page.html"
    with page_process.surface_page_process(2) as page:
        assert page is not None
        page.draw_ahead(first)
        assert page.view_of(first.result) is first
        assert page.view_of(view("one").result) is None
        page.begin(path, replace(first, flight="no flight"), {"a": "b"})()
    *said, process = path.read_text(encoding="utf-8").split("; ")
    assert said == ["one", "no flight", "{'a': 'b'}", "one, not asked for"]
    assert process != str(os.getpid())


@pytest.mark.usefixtures("plain_surfaces")
def test_a_page_is_never_drawn_of_another_result(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    with page_process.surface_page_process(2) as page:
        assert page is not None
        page.draw_ahead(view("one"))
        page.begin(path, view("two", "its flight"), {})()
    assert path.read_text(encoding="utf-8").split("; ")[:4] == ["two", "its flight", "{}", "two, its flight"]


@pytest.mark.usefixtures("plain_surfaces")
def test_surfaces_are_drawn_here_if_the_process_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_process, "_draw_surfaces", lambda take, processes: os._exit(1))
    path = tmp_path / "page.html"
    with page_process.surface_page_process(2) as page:
        assert page is not None
        page.draw_ahead(view("one"))
        page.begin(path, view("two", "its flight"), {})()
    said = ["two", "its flight", "{}", "drawn at the end", str(os.getpid())]
    assert path.read_text(encoding="utf-8").split("; ") == said


def test_one_process_draws_no_surfaces_ahead() -> None:
    with page_process.surface_page_process(1) as page:
        assert page is None
