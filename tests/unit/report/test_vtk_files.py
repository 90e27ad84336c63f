"""VTK files hold the same bits when they are read back."""

from pathlib import Path

import numpy as np
import pytest
import pyvista

from kolsky.report.paraview import QUAD, TRIANGLE, VERTEX, write_grid, write_series

POINTS = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 3.0, 0.1]])
FIELDS = {
    "displacement [m]": POINTS + 1.0 / 3.0,
    'share < 1 & "odd"': np.array([0.1, np.nan, 0.3, -1e300]),
    "point": np.array([5, 6, 7, 2**40]),
    "plane": POINTS[:, :2],
}


def _same(found: pyvista.DataSet) -> None:
    np.testing.assert_array_equal(found.points, POINTS)  # the same bits
    assert set(found.point_data.keys()) == set(FIELDS)
    for name, values in FIELDS.items():
        np.testing.assert_array_equal(found.point_data[name], values)


@pytest.mark.parametrize(
    ("cells", "kind"),
    [([[0, 1, 2, 3]], QUAD), ([[0, 1, 2], [0, 2, 3]], TRIANGLE), ([[0], [1], [2], [3]], VERTEX)],
)
def test_a_grid_reads_back(cells: list[list[int]], kind: int, tmp_path: Path) -> None:
    write_grid(tmp_path / "a.vtu", POINTS, np.array(cells), kind, FIELDS)
    found = pyvista.read(tmp_path / "a.vtu")
    _same(found)
    np.testing.assert_array_equal(found.cells_dict[kind], cells)


def test_nothing_at_all_is_an_empty_file_that_is_read(tmp_path: Path) -> None:
    nothing = np.zeros((0, 3))
    write_grid(tmp_path / "a.vtu", nothing, np.zeros((0, 3), dtype=int), TRIANGLE, {"u": nothing})
    assert pyvista.read(tmp_path / "a.vtu").n_points == 0


def test_a_series_lists_its_times(tmp_path: Path) -> None:
    files = [tmp_path / "a.vtu", tmp_path / "b.vtu"]
    for file in files:
        write_grid(file, POINTS, np.zeros((0, 3), dtype=int), TRIANGLE, {})
    write_series(tmp_path / "s.pvd", [0.0, 1.0 / 3.0], files)
    assert pyvista.get_reader(tmp_path / "s.pvd").time_values == [0.0, 1.0 / 3.0]
