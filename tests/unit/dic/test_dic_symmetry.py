"""The outline from several columns, on bodies of known shape."""

import numpy as np
import pytest

from dic import PointOutcome, SurfaceHistory, centre_line
from dic.correlation.subsets import overlap_correlation
from dic.surfaces.outline import outline, rows_of

RADIUS, HEIGHT, SCALE = 4.75e-3, 6.5e-3, 1.0 / 18e3
NOISE = np.array([1e-6, 1e-6, 4e-6])
SUBSET = 21.0


def grid(step=5.0, half=50.0):
    x, y = np.meshgrid(np.arange(-half, half + 1.0, step), np.arange(10.0, 108.0, step))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def barrel(points, bulge):
    """Places on a barrel about y and its radius there; x and y are the pixels'."""
    y = points[:, 1] * SCALE
    r = RADIUS + bulge * (1.0 - (2.0 * y / HEIGHT - 1.0) ** 2)
    angle = np.arcsin(points[:, 0] * SCALE / RADIUS)
    return np.stack([r * np.sin(angle), y, r * np.cos(angle)], axis=-1), r


def history(points, places, rng=None, outcome=None):
    rho = overlap_correlation(points, points, SUBSET) + 1e-10 * np.eye(len(points))
    X = barrel(points, 0.0)[0]
    noise = 0.0
    if rng is not None:
        noise = np.einsum("nm,fmi->fni", np.linalg.cholesky(rho), rng.standard_normal(places.shape)) * NOISE
    if outcome is None:
        outcome = np.zeros(places.shape[:2], dtype=np.int64)
    return SurfaceHistory(
        t=np.arange(float(len(places))),
        X=X,
        u=np.where((outcome == 0)[..., None], places + noise - X, np.nan),
        sigma=np.broadcast_to(NOISE, places.shape),
        outcome=outcome,
    )


def test_the_outline_is_the_barrels_one_row_a_point():
    points = grid()
    place, _ = barrel(points, 0.7e-3)
    found = outline(history(points, place[None]), points, half_width=1.2e-3, subset=SUBSET)
    assert found.Z.size == 20
    assert (np.diff(found.y) > 0.0).all()
    true = RADIUS + 0.7e-3 * (1.0 - (2.0 * found.y / HEIGHT - 1.0) ** 2)
    np.testing.assert_allclose(found.Z, true, atol=1e-12)  # rows of one y on a body of revolution: round-off


def test_the_sigma_of_the_outline_is_that_of_its_errors_and_no_promise_of_dense_columns():
    points = grid()
    place, _ = barrel(points, 0.7e-3)
    rng = np.random.default_rng(1)
    surface = history(points, np.repeat(place[None], 150, axis=0), rng)
    found = outline(surface, points, half_width=1.2e-3, subset=SUBSET)
    true = RADIUS + 0.7e-3 * (1.0 - (2.0 * found.y / HEIGHT - 1.0) ** 2)
    # 150 frames of 20 rows that overlap by four: 750 values, 2.6 %; the noise of y adds 1 % where
    # the outline slopes by 0.4.
    assert ((found.Z - true) / found.sigma).std() == pytest.approx(1.0, abs=0.09)
    single = centre_line(surface, half_width=0.1e-3).sigma.mean()
    assert 0.55 * single < found.sigma.mean() < 0.8 * single  # 43 px of columns hold 2 to 3 subsets of 21
    dense = grid(step=2.5)
    place, _ = barrel(dense, 0.7e-3)
    more = outline(history(dense, place[None]), dense, half_width=1.2e-3, subset=SUBSET)
    assert more.sigma.mean() == pytest.approx(found.sigma.mean(), rel=0.06)  # the same pixels again


def test_rows_are_those_of_the_picture_whichever_way_the_axis_runs():
    points = grid()
    surface = history(points, barrel(points, 0.0)[0][None])
    rows = rows_of(surface, points)
    np.testing.assert_array_equal(rows, np.repeat(np.arange(20), 21))
    upside_down = points * [1.0, -1.0]
    np.testing.assert_array_equal(rows_of(surface, upside_down), rows)
    np.testing.assert_array_equal(rows_of(surface, points[:, ::-1]), rows)


def test_lost_points_leave_the_mean_and_are_counted():
    points = grid()
    place, _ = barrel(points, 0.7e-3)
    outcome = np.zeros((2, len(points)), dtype=np.int64)
    outcome[1, :42] = PointOutcome.LOW_CORRELATION  # two rows
    outcome[1, 52] = PointOutcome.NOT_CONVERGED  # the middle of the third
    found = outline(
        history(points, np.array([place, place]), outcome=outcome), points, half_width=0.4e-3, subset=SUBSET
    )
    assert np.bincount(found.frame).tolist() == [20, 18]
    assert found.left_out == {PointOutcome.LOW_CORRELATION: 6, PointOutcome.NOT_CONVERGED: 1}  # 3 columns


@pytest.mark.parametrize("options", [{"half_width": 0.0}, {"subset": -1.0}, {"axis_Z": 5e-3}])
def test_an_outline_that_cannot_be_is_refused(options):
    points = grid()
    surface = history(points, barrel(points, 0.0)[0][None])
    with pytest.raises(ValueError, match=r"must be"):
        outline(surface, points, **({"half_width": 1e-3, "subset": SUBSET} | options))
