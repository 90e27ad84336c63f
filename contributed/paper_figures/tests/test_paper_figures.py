"""The paper's Figs. 7 to 10 on a shot with a known answer: the figures show the runs, with the paper's
trends."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contributed.paper_figures.figures import TRENDS
from contributed.paper_figures.trends import Trends, trends
from kolsky.inverse.settings import Numerics
from kolsky.inverse.simulate import simulate
from kolsky.report.canvas import build
from kolsky.shot.load import load_shot

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]
SHOT = ROOT / "runs" / "open-01"
COARSE = Numerics(mesh=(12, 16), threads=1)


@pytest.fixture(scope="module")
def found() -> Trends:
    return trends(load_shot(SHOT), stiffness=1.12, numerics=COARSE, plane_mesh=(6, 8))


def test_a_run_of_the_series_is_that_run_alone(found: Trends):
    x = found.poisson.x[3]
    run = simulate(load_shot(SHOT), {"poisson": float(x), "stiffness_factor": 1.12}, numerics=COARSE)
    assert run.terms is not None
    # One simulation has the same bits in any batch.
    assert found.poisson.phi_shape[3] == run.terms.phi_shape
    assert found.poisson.phi_force[3] == run.terms.phi_force
    assert found.poisson.steps[3] == run.response.steps[0]


def test_trends_have_the_paper_s_sign(found: Trends):
    nu = found.poisson
    near = nu.x <= 0.498
    assert (np.diff(nu.phi_shape[near]) < 0.0).all()  # Fig. 7
    assert (np.diff(nu.steps) > 0).all()
    assert nu.steps[-1] > 3.0 * nu.steps[0]
    rough = np.abs(np.diff(found.damping.simulated, axis=1)).sum(axis=1)
    assert (np.diff(rough) < 0.0).all()  # Fig. 8: more damping, less ringing
    force, shape = found.plane.left_beyond(0.4)
    # Fig. 9: "low above 0.3 (force) and 0.5 (shape)"; meshes of 6 x 8 add oscillations.
    assert shape < 0.3
    assert force < 0.5
    surrogates = found.surrogates
    for curve in (*surrogates.by_cost, *surrogates.by_response):  # Fig. 10: one minimum near the answer
        # 6 %: a mesh of 12 x 16 is too soft by 3 %, and the distance of the runs is 5 %.
        assert surrogates.x[curve.argmin()] == pytest.approx(1.12, rel=0.06)


def test_surrogates_pass_through_their_runs(found: Trends):
    s = found.surrogates
    for curves in (s.by_cost, s.by_response):
        for curve, runs in zip(curves, (s.runs.phi_force, s.runs.phi_shape), strict=True):
            # The points of the curves are 0.0025 apart and include the runs; 1e-3: neglected components of
            # the response, 1e-8 of its variance.
            np.testing.assert_allclose(np.interp(s.runs.x, s.x, curve), runs, rtol=1e-3)
    errors = s.errors()
    assert errors["response"][1] < errors["cost"][1]


def test_surfaces_pass_through_their_runs(found: Trends):
    plane = found.plane
    rows = [round(x) for x in 100 * plane.design.unit_points[:, 0]]
    columns = [round(x) for x in 100 * plane.design.unit_points[:, 1]]
    on_grid = np.abs(100 * plane.design.unit_points - np.column_stack([rows, columns])).max(axis=1) < 1e-9
    assert on_grid.sum() == 4  # ten levels and 101 points share the corners
    at = np.flatnonzero(on_grid)
    for surface, runs in ((plane.surface_force, plane.phi_force), (plane.surface_shape, plane.phi_shape)):
        np.testing.assert_allclose([surface[rows[i], columns[i]] for i in at], runs[at], rtol=1e-9)


@pytest.mark.parametrize("name", TRENDS)
def test_figures_are_drawn(found: Trends, name: str):
    figure = build(TRENDS[name], found)
    texts = [ax.get_xlabel() for ax in figure.axes if ax.get_xlabel()]
    assert texts
    assert all("(" in text for text in texts)  # a unit on every axis
    assert TRENDS[name].caption(found).endswith(".")


def test_the_script(tmp_path: Path):
    command = [sys.executable, "-m", "contributed.paper_figures", str(SHOT), str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    assert run.returncode == 0, run.stderr
    assert sorted(p.stem for p in tmp_path.iterdir()) == sorted(TRENDS)
    page = (ROOT / "docs" / "validation" / "paper_figures.md").read_text(encoding="utf-8")
    # The page's numbers are the script's.
    assert "nu = 0.4999: Phi_S = 0.00139, 7483 steps, 4.71" in run.stdout
    assert "4.71 times" in page
    assert "error at unseen runs 84 % (Phi_F), 4.4 % (Phi_S)" in run.stdout
    assert "84 % ($\\Phi_F$) and 4.4 %" in page


def test_a_shot_without_outline_is_refused():
    with pytest.raises(ValueError, match="need a measured outline"):
        trends(replace(load_shot(SHOT), centre_line=None), numerics=COARSE)
