"""Notebook views of shots, surfaces and answers: HTML and pandas tables."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.axis import Axis
from shot_folders import OPEN_01
from synthetic import synthetic
from test_rates_report import five
from test_sweep_report import analysed
from wavesmaker import made_result

from dic import FrameOutcome, FullField, PointOutcome, SurfaceHistory
from dic.result import SurfaceStrain
from dic.views import ResultViews
from kolsky.prediction.predict import predict, read_test
from kolsky.report import ipython
from kolsky.report.notebook import html, to_dataframe
from kolsky.report.result_folder import RESULTS
from kolsky.results.tables import tables
from kolsky.shot.load import load_shot
from kolsky.studies.rates.comparison import compare

pytest.importorskip("pandas")

EVIL = "<script>alert(1)</script>"


def tags(text: str | None) -> set[str]:
    """The tags of a text in which every tag is closed."""
    return {element.tag for element in ElementTree.fromstring(f"<all>{text}</all>").iter()}


def surface() -> SurfaceHistory:
    """Two frames of three points; the last one is lost in the second frame."""
    outcome = np.full((2, 3), int(PointOutcome.VALID))
    lost = next(o for o in PointOutcome if o is not PointOutcome.VALID)
    outcome[1, 2] = int(lost)
    u = np.arange(18.0).reshape(2, 3, 3)
    return SurfaceHistory(
        t=np.array([0.0, 1e-3]), X=np.eye(3), u=u, sigma=np.full((2, 3, 3), 1e-6), outcome=outcome
    )


def test_a_surface_says_what_it_is() -> None:
    assert repr(surface()) == "SurfaceHistory(2 frames, 3 points, 83.3 % found)"
    assert "table" in tags(html(surface()))


def test_a_surface_as_a_data_frame() -> None:
    frame = to_dataframe(surface())
    assert len(frame) == 6
    row = frame[(frame["frame"] == 1) & (frame["point"] == 1)].iloc[0]
    assert row["t (s)"] == 1e-3
    assert [row[f"u_{name} (m)"] for name in "xyZ"] == [12.0, 13.0, 14.0]  # counted through the array
    assert [row[f"X_{name} (m)"] for name in "xyZ"] == [0.0, 1.0, 0.0]
    assert row["outcome"] == "valid"
    assert np.isnan(frame["u_x (m)"].iloc[5])  # lost: no number that could be mistaken for one
    assert frame["outcome"].iloc[5] != "valid"


def test_an_identification_says_its_answer() -> None:
    found = synthetic(shot=EVIL)
    assert "(k = 2)" in repr(found)
    assert len(repr(found)) < 500
    text = html(found)
    assert "script" not in tags(text)  # the shot's name holds one
    first, _, rest = text.partition("<details>")
    assert 3 <= first.count("<tr>") - len(found.warnings) <= 7  # a line of the answer, and these, as printed
    assert rest.count("<tr>") > 20
    assert "&lt;script&gt;" in text


@pytest.mark.parametrize("name", ["force", "profile", "design", "energy"])
def test_tables_are_those_of_the_files(name: str) -> None:
    found = synthetic()
    frame = to_dataframe(found, name)
    columns = tables(found)[name]
    assert list(frame.columns) == list(columns)
    for key in frame.columns:
        wanted = (
            [np.nan if cell == "" else cell for cell in columns[key]] if "element" in key else columns[key]
        )
        np.testing.assert_array_equal(frame[key].to_numpy(), np.asarray(wanted))


def test_estimates_and_routes_as_data_frames() -> None:
    found = synthetic(("stiffness_factor", "friction"))
    estimates = to_dataframe(found).set_index("parameter")
    for name, e in found.estimates.items():
        assert estimates.loc[name, "value"] == e.value
        assert estimates.loc[name, "lower (k = 2)"] == e.interval[0]
    assert list(to_dataframe(found, "routes")["route"]) == [route.name for route in found.routes]
    with pytest.raises(ValueError, match="there is no table 'curves'; choose from estimates, routes, force"):
        to_dataframe(found, "curves")


def field() -> FullField:
    """A plane of three points in two frames; the last one is lost in the second frame."""
    at_rest = surface()
    strain = np.broadcast_to([0.01, -0.02, 0.005], (2, 3, 3)).copy()
    zncc = np.ones((1, 2, 3))
    return FullField(
        kind="plane", unit="px", timed=False, frame_outcome=np.full(2, int(FrameOutcome.VALID)),
        surface=at_rest, strain=SurfaceStrain(strain, 0.1 * abs(strain), np.zeros((2, 3), dtype=int), 21.0),
        points=np.array([[5.0, 5.0], [10.0, 5.0], [5.0, 10.0]]), cell=np.array([[0, 0], [1, 0], [0, 1]]),
        pixels=np.full((1, 2, 3, 2), 8.0), zncc=zncc, epipolar=np.full((2, 3), np.nan), noise=np.array([1.0]),
    )  # fmt: skip


def test_a_field_has_displacements_and_strains() -> None:
    table = field().to_pandas("points")
    assert len(table) == 6
    row = table[(table["frame"] == 1) & (table["point"] == 1)].iloc[0]
    assert [row[name] for name in "uv"] == [12.0, 13.0]  # counted through the array
    assert [row[f"X_{name}"] for name in "xyZ"] == [0.0, 1.0, 0.0]
    assert [row[name] for name in ("t", "column", "row", "u_sigma")] == [1e-3, 1, 0, 1e-6]
    assert "w" not in table
    assert np.isnan(table["u"].iloc[5])  # lost
    assert [row[name] for name in ("exx", "eyy", "exy")] == [0.01, -0.02, 0.005]
    assert row["eyy_sigma"] == pytest.approx(0.002, rel=1e-12)
    assert list(table["v"][:2]) == [1.0, 4.0]
    assert list(field().to_pandas()["frame"]) == [0, 1]
    assert repr(field()).startswith("FullField(kind='plane', unit='px', timed=False, frame_outcome: 2, ")


RESULTS_DRAWN: dict[str, tuple[Callable[[], Any], str]] = {
    "identification": (synthetic, "force"),
    "waves": (made_result, "waves"),
    "rates": (lambda: compare(five()), "rate-forest"),
    "sweep": (lambda: analysed(n=64), "sweep-effects"),
    "field": (field, "histories"),
    "prediction": (lambda: predict(read_test(PLANNED), quick=True), "signals"),
}
"""Results with a figure: how one is made, the name of one of its figures."""


@pytest.mark.parametrize("which", RESULTS_DRAWN)
def test_a_result_draws_itself(which: str) -> None:
    make, name = RESULTS_DRAWN[which]
    found = make()
    assert found.plot().axes
    drawn = found.plot(name)
    assert len(str(drawn.get_label())) > 20  # the caption
    with pytest.raises(ValueError, match=f"there is no figure 'none'; choose from .*{name}"):
        found.plot("none")
    assert len(repr(found)) < 500


def test_the_ticks_of_a_figure_do_not_depend_on_the_users_style() -> None:
    drawn = made_result().plot()
    ticks = [list(axis.get_majorticklocs()) for axis in drawn.findobj(Axis)]
    with rc_context({"xtick.labelsize": 40.0, "ytick.labelsize": 40.0}):  # would leave room for fewer
        assert [list(axis.get_majorticklocs()) for axis in drawn.findobj(Axis)] == ticks


def test_without_kolsky_a_result_says_who_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dic.views.MAKERS", [])
    with pytest.raises(ImportError, match="of FullField are made by kolsky: import kolsky"):
        field().plot()


def test_a_figure_is_a_picture_in_a_notebook() -> None:
    assert ipython._png(synthetic().plot()).startswith(b"\x89PNG")


def test_a_shot_shows_what_was_understood() -> None:
    shot = load_shot(OPEN_01)
    assert repr(shot).startswith(f"Shot({shot.name!r}, ")
    assert "table" in tags(html(shot))
    frame = to_dataframe(shot).set_index(["section", "name"])
    assert frame.loc[("specimen", "diameter"), "value"] == shot.specimen.diameter


def test_without_pandas_the_cure_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)  # makes its import fail
    with pytest.raises(ImportError, match="pip install pandas"):
        to_dataframe(synthetic())


def test_a_notebook_shows_every_type_that_has_a_view() -> None:
    assert all(issubclass(kind, ResultViews) for kind in set(html.registry) - {object})
    assert surface()._repr_html_() == html(surface())
    assert field()._repr_html_() is None  # its short text is shown


def test_what_has_no_view_is_named() -> None:
    with pytest.raises(TypeError, match="dict has no view for pandas; shots, surfaces and results have one"):
        to_dataframe({})


PLANNED = Path(__file__).parents[3] / "runs" / "predict" / "paper.toml"
RESULTS_WITH_TABLES: dict[str, tuple[Callable[[], Any], str]] = {
    "waves": (made_result, "time (s)"),
    "rates": (lambda: compare(five()), "shot"),
    "prediction": (lambda: predict(read_test(PLANNED), quick=True), "time (s)"),
}
"""Results beside an identification: how one is made, a heading of its main table."""


@pytest.mark.parametrize("which", RESULTS_WITH_TABLES)
def test_any_result_has_its_tables(which: str, tmp_path: Path) -> None:
    make, heading = RESULTS_WITH_TABLES[which]
    found = make()
    frame = to_dataframe(found)
    assert heading in frame.columns
    if heading.endswith("(s)"):
        assert np.all(np.diff(frame[heading].to_numpy()) > 0.0)
    with pytest.raises(ValueError, match="there is no table 'none'; choose from "):
        to_dataframe(found, "none")


def test_the_types_that_have_tables_are_there() -> None:
    for name, known in RESULTS.items():
        assert isinstance(named(name), type)
        assert all(callable(named(function)) for function in (known.tables, *known.files.values()))


def named(place: str) -> Any:
    """What a dotted name stands for."""
    module, _, name = place.rpartition(".")
    return getattr(importlib.import_module(module), name)
