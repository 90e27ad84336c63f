"""Data tables of figures contain exactly the drawn data."""

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from kolsky_command import rows_of
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from synthetic import RESULTS

from kolsky.report.canvas import DATA_COLUMNS, build, write_data
from kolsky.report.figures import REGISTRY


def column(rows: list[dict[str, str]], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def test_the_force_of_the_report(tmp_path: Path) -> None:
    result = RESULTS["one"]
    rows = rows_of(write_data(tmp_path / "force.csv", build(REGISTRY["force"], result)))
    assert tuple(rows[0]) == DATA_COLUMNS
    simulated = [row for row in rows if row["panel"] == "force" and row["series"] == "simulated"]
    c = result.comparison
    np.testing.assert_allclose(column(simulated, "x"), 1e3 * c.force_time, rtol=1e-8)  # nine digits written
    np.testing.assert_allclose(column(simulated, "y"), c.force_model, rtol=1e-8)
    assert {row["y axis"] for row in simulated} == {"Force $F$ (N)"}


@pytest.fixture
def figure() -> Figure:
    made = Figure()
    FigureCanvasAgg(made)
    return made


def test_kinds_by_hand(figure: Figure, tmp_path: Path) -> None:
    ax = figure.subplots()
    ax.plot([0, 1], [2, 3], label="line")
    ax.axhline(5.0)  # a guide
    ax.imshow(np.eye(3), cmap="gray")  # a picture
    shown = ax.imshow(np.array([[1.0, 2.0], [3.0, 4.0]]), extent=(0, 2, 0, 4), origin="lower", label="map")
    figure.colorbar(shown, ax=ax, label="Height (m)")
    ax.scatter([7], [8], c=[9.0], label="points")
    ax.pcolormesh([0, 1, 2], [0, 1], [[5.0, 6.0]], label="cells")
    ax.stairs([1, 2], [0, 1, 2], label="steps")
    ax.quiver([1], [2], [3], [4], label="arrows")
    ax.bar([1.0], [2.0], width=0.5, label="bar")
    with matplotlib.rc_context():
        rows = rows_of(write_data(tmp_path / "x.csv", figure))

    def of(series: str) -> list[tuple[float, float, str]]:
        return [(float(r["x"]), float(r["y"]), r["value"]) for r in rows if r["series"] == series]

    assert of("line") == [(0, 2, ""), (1, 3, "")]
    assert of("map") == [(0.5, 1, "1"), (1.5, 1, "2"), (0.5, 3, "3"), (1.5, 3, "4")]
    assert {r["value axis"] for r in rows if r["series"] == "map"} == {"Height (m)"}
    assert of("points") == [(7, 8, "9")]
    assert of("cells") == [(0.5, 0.5, "5"), (1.5, 0.5, "6")]
    assert of("steps") == [(0, 1, ""), (1, 2, "")]
    assert of("arrows") == [(1, 2, "3"), (1, 2, "4")]
    assert {(x, y) for x, y, _ in of(next(r["series"] for r in rows if r["kind"] == "outline"))} == {
        (0.75, 0.0), (1.25, 0.0), (1.25, 2.0), (0.75, 2.0),
    }  # fmt: skip
    assert len(rows) == 2 + 4 + 1 + 2 + 2 + 2 + 5  # the bar's outline is closed; no guide, no picture


def test_contours_carry_their_level(figure: Figure, tmp_path: Path) -> None:
    ax = figure.subplots()
    x = np.linspace(0, 1, 11)
    ax.contour(x, x, np.tile(x, (11, 1)), levels=[0.35])  # of z = x: the line x = 0.35
    rows = rows_of(write_data(tmp_path / "x.csv", figure))
    np.testing.assert_allclose(column(rows, "x"), 0.35, rtol=1e-12)  # round-off
    assert {row["value"] for row in rows} == {"0.35"}


def test_no_data_no_rows(figure: Figure, tmp_path: Path) -> None:
    figure.subplots()
    assert rows_of(write_data(tmp_path / "x.csv", figure)) == []
