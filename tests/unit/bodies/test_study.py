"""Gaps of neighbouring chambers, the effect of healing, the printed tables of the paper, the warnings."""

import importlib.util
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from kolsky.bodies.actuator_bending import Direction, relative_bend, warnings_of
from kolsky.bodies.actuator_model import Pneunet, Touching, smallest_gap
from kolsky.equilibrium.arc_length import ArcPath
from kolsky.equilibrium.solution import Outcome

ROOT = Path(__file__).resolve().parents[3]


def _moved(shift: float):
    """Two chambers whose second one has moved by `shift` along x."""
    mesh = Pneunet(chambers=2, element="hex8").mesh
    u = np.zeros((1, *mesh.points.shape))
    u[0, mesh.points[:, 0] > 15e-3 - 1e-9, 0] = shift
    solution = SimpleNamespace(model=SimpleNamespace(mesh=mesh), displacements=u)
    return SimpleNamespace(solution=solution, pressures=np.array([[4e4]]), angle=np.array([0.1]))


def test_gap_is_the_distance_of_the_walls_and_negative_where_they_overlap() -> None:
    assert smallest_gap(_moved(0.5e-3))[0] == pytest.approx(2.5e-3)
    apart, through = _moved(-1.5e-3), _moved(-2.0e-3)
    assert smallest_gap(apart)[0] == pytest.approx(0.5e-3)
    # one point of a wall beyond its partner, the walls as a whole still apart
    mesh = through.solution.model.mesh
    through.solution.displacements[0, mesh.sets["gap_1_right"], 0] = -1.0e-3
    through.solution.displacements[0, mesh.sets["gap_1_right"][-1], 0] = -2.4e-3
    assert smallest_gap(through)[0] == pytest.approx(-0.4e-3)


def test_overlap_is_warned_of_and_its_absence_not() -> None:
    run = _moved(0.0)
    bad = Direction("down", run, None, np.array([0]), np.array([-1e-4]))  # type: ignore[arg-type]
    assert "0.4 bar" in warnings_of([bad])[0]
    assert warnings_of([replace(bad, gap=np.array([1e-4]))]) == []


def test_contact_allows_facing_points_a_tenth_of_the_gap() -> None:
    run = _moved(0.0)
    gap = np.array([2e-3, 1e-3, -1.9e-4, -2.1e-4])
    one = Direction("down", run, None, np.array([0]), gap)  # type: ignore[arg-type]
    assert one.overlapping.tolist() == [False, False, True, True]
    touching = Touching(np.zeros(4), np.zeros(4))
    assert replace(one, touching=touching).overlapping.tolist() == [False, False, False, True]


def test_a_limit_point_is_warned_of() -> None:
    arc = np.array([0.0, 1.0, 2.0])
    model, moved = _moved(0.0).solution.model, np.zeros((3, 1, 3))
    path = ArcPath(model, 5e4 * arc * (2.0 - arc), moved, arc, Outcome.UNFINISHED)  # 5e4 at 1
    one = Direction("down", _moved(0.0), None, np.array([0]), np.zeros(3), path)  # type: ignore[arg-type]
    assert "limit point at 0.5 bar" in warnings_of([one])[0]


def test_effect_of_healing_is_that_on_the_bend_from_rest() -> None:
    before = SimpleNamespace(angle=np.array([0.1, 0.3, 0.5]))
    after = SimpleNamespace(angle=np.array([0.2, 0.42, 0.66]))
    one = Direction("down", before, after, np.array([1, 2]), np.zeros(3))  # type: ignore[arg-type]
    assert relative_bend(one) == pytest.approx([0.1, 0.15])


def test_printed_tables_of_the_paper() -> None:
    found = importlib.util.spec_from_file_location("paper", ROOT / "runs" / "actuator" / "paper.py")
    assert found is not None
    assert found.loader is not None
    paper = importlib.util.module_from_spec(found)
    found.loader.exec_module(paper)
    rows = {what: follows for what, _, follows in paper.checks()}
    # nu = (3 K - 2 mu) / (2 (3 K + mu)) with mu = 0.218, K = 2 / 1.15 or 2.3 MPa
    assert rows["Poisson's ratio, D1 in 1/MPa"] == pytest.approx(4.78139 / 10.87078, rel=1e-5)
    assert rows["Poisson's ratio, D1 in MPa (Table 3)"] == pytest.approx(6.464 / 14.236)
    assert rows["volume ratio at 130 %, strain across -nu strain"] == pytest.approx(2.3 * 0.428**2)
    assert rows["efficiency of the fracture stress (%)"] == pytest.approx(96.2025, abs=1e-4)
