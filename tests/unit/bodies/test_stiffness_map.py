"""Maps of stiffness: total variation by hand, the adjoint by differences, a planted inclusion found."""

from dataclasses import replace

import numpy as np
import pytest

from kolsky.bodies.sheet import ENDS, Sheet, mass_matrix
from kolsky.bodies.sheet_fit import FieldData, FieldProblem
from kolsky.bodies.stiffness_map import SMOOTHING, _Blocks, blocks_of, stiffness_map, total_variation
from kolsky.equilibrium.solve import solve
from tests.unit.bodies.sheets import PAD, constants, made, small_mesh

SHEET = Sheet(small_mesh(), "plane_stress", 1e-3, "moving", "rest")


def test_total_variation_of_a_step() -> None:
    touching = np.array([[0.0, 1.0, 2.0], [1.0, 2.0, 0.5]])
    value, gradient = total_variation(np.array([0.0, 0.7, 0.7]), touching)
    assert value == pytest.approx(2.0 * (np.hypot(0.7, SMOOTHING) - SMOOTHING))
    assert gradient == pytest.approx([-2.0, 2.0, 0.0], abs=1e-5)


def test_blocks_cover_the_sheet_and_touch() -> None:
    regions, touching = blocks_of(made(SHEET), (3, 2))
    assert np.bincount(regions).tolist() == [8] * 6
    # Blocks of 13.3 mm x 10 mm: sides over the mean size are sqrt(3/4) and sqrt(4/3).
    assert len(touching) == 7
    assert sorted(set(np.round(touching[:, 2], 6))) == pytest.approx(
        [np.sqrt(0.75), np.sqrt(4 / 3)], rel=1e-5
    )


def test_gradient_by_differences() -> None:
    problem = made(SHEET)
    blocks = _Blocks(problem, blocks_of(problem, (3, 2))[0])
    logs = np.linspace(-0.2, 0.3, 6)
    _, gradient = blocks.chi2(logs)
    for r in (0, 3):
        step = 1e-5 * (np.arange(6) == r)
        slope = (blocks.chi2(logs + step)[0] - blocks.chi2(logs - step)[0]) / 2e-5
        assert gradient[r] == pytest.approx(slope, rel=1e-4)


def _inclusion(noise: float) -> tuple[FieldProblem, np.ndarray]:
    """A field of a sheet whose middle third is twice as stiff, and the factors behind it."""
    problem = made(SHEET, start=constants())
    regions, _ = blocks_of(problem, (3, 2))
    factors = np.array([1.0, 1.0, 2.0, 2.0, 1.0, 1.0])
    sheet = replace(SHEET, regions=regions)
    solid = constants().solid(constants().start)
    truth = solve(sheet.model(solid), {ENDS: -PAD}, factors[:, None] * solid.parameters())
    rng = np.random.default_rng(4)
    u = truth.displacements + noise * rng.standard_normal(truth.displacements.shape)
    cells = np.ones(len(SHEET.mesh.cells), dtype=bool)
    area = float(mass_matrix(SHEET.mesh, cells).sum()) / len(SHEET.mesh.points)
    data = FieldData(-PAD, sheet.force(truth), u, cells, noise, 1e-4, area)
    return FieldProblem(SHEET, data, constants()), factors


def test_an_inclusion_is_found() -> None:
    problem, factors = _inclusion(2e-6)
    found = stiffness_map(problem, (3, 2), weights=(10.0, 1.0))
    assert found.uniform > 10.0 * found.degrees
    assert found.explained
    assert found.factors == pytest.approx(factors, rel=0.05)


def test_a_uniform_sheet_gets_a_uniform_map() -> None:
    problem = made(SHEET, noise=2e-6, start=constants())
    found = stiffness_map(problem, (3, 2), weights=(1e4,))
    assert found.factors == pytest.approx(np.ones(6), rel=0.01)
