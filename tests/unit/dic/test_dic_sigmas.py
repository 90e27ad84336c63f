"""Which noise two matches share: closed forms, and drawn scenes with a known answer."""

import numpy as np
import pytest

from dic.correlation.subsets import Shape, identity, overlap_correlation
from dic.tracking.matcher import enlarged, gradient, in_material, inherited_covariance
from populations import dic_sigmas

SIDE = 21


def weights(shape: Shape) -> np.ndarray:
    """Weights of a subset's pixels in the place of its middle, by least squares, shape [SIDE²]."""
    t = np.linspace(-1.0, 1.0, SIDE)
    x, y = (a.ravel() for a in np.meshgrid(t, t))
    monomials = [np.ones_like(x), x, y, x * x, x * y, y * y][: {Shape.AFFINE: 3, Shape.QUADRATIC: 6}[shape]]
    return np.linalg.pinv(np.stack(monomials, axis=1))[0]


@pytest.mark.parametrize("shape", [Shape.AFFINE, Shape.QUADRATIC])
@pytest.mark.parametrize("shift", [(0, 0), (4, 0), (0, 9), (7, 5), (15, 3), (19, 19), (25, 0)])
def test_points_are_alike_as_the_weights_of_their_common_pixels(shape: Shape, shift: tuple[int, int]) -> None:
    w = weights(shape).reshape(SIDE, SIDE)
    dx, dy = shift
    common = w[dy:, dx:] * w[: SIDE - dy, : SIDE - dx] if max(shift) < SIDE else np.zeros(1)
    found = overlap_correlation(np.zeros((1, 2)), np.array([shift], float), float(SIDE), shape)[0, 0]
    # 21 pixels stand for an integral: the corners' weights are off by a tenth of a pixel's share
    assert found == pytest.approx(common.sum() / np.sum(w * w), abs=0.04)


def test_the_sum_over_all_neighbours_is_that_of_the_area() -> None:
    """The weights of any shape function add up to one, so that what a dense mean takes over is the same."""
    grid = np.stack(np.meshgrid(np.arange(-30.0, 31.0), np.arange(-30.0, 31.0)), -1).reshape(-1, 2)
    for shape, variance in ((Shape.AFFINE, 1.0), (Shape.QUADRATIC, 3.5)):
        total = overlap_correlation(np.zeros((1, 2)), grid, 20.0, shape).sum()
        assert total * variance == pytest.approx(20.0**2, rel=0.02)


@pytest.mark.parametrize(
    ("matched", "tracked"), [(Shape.QUADRATIC, Shape.AFFINE), (Shape.AFFINE, Shape.QUADRATIC)]
)
def test_a_track_takes_back_what_its_shape_function_makes_of_the_noise(
    matched: Shape, tracked: Shape
) -> None:
    """A match ends at L_m (n_B - n_A), the track from there on takes L_t n_B away."""
    m, t = weights(matched), weights(tracked)
    start = np.eye(2)[None] * 2.0 * (m @ m)
    left = np.eye(2)[None] * (m @ m + (m - t) @ (m - t))
    found = inherited_covariance(start, np.eye(2)[None] * (t @ t), identity(1))
    np.testing.assert_allclose(found, left, rtol=1e-9, atol=1e-15)


def test_a_track_of_the_same_shape_function_takes_all_of_it_back() -> None:
    C = np.array([[[2.0, 0.5], [0.5, 1.0]]])
    np.testing.assert_allclose(inherited_covariance(C, 0.5 * C, identity(1)), 0.5 * C, atol=1e-14)


def test_covariances_go_back_to_the_material_by_the_gradient() -> None:
    warp = identity(1)
    warp[0, 2:6] = 1.0, 0.0, 0.0, -0.5  # stretched to 2 along x, to 1/2 along y
    np.testing.assert_allclose(gradient(warp)[0], np.diag([2.0, 0.5]))
    np.testing.assert_allclose(in_material(np.eye(2)[None], warp)[0], np.diag([0.25, 4.0]))


@pytest.mark.parametrize(("stretch", "share"), [(1.3, 0.0), (1.0, 0.0), (0.8, 0.25), (0.5, 1.0), (0.3, 1.0)])
def test_a_residual_counts_more_along_a_flattening_only(stretch: float, share: float) -> None:
    F = np.diag([1.4, stretch])[None]
    found = enlarged(np.eye(2)[None], F, np.array([3.0]))[0]
    across, along = (0.5 + share * (most - 0.5) for most in (1.0, 6.0))
    np.testing.assert_allclose(found, np.diag([(1 + 3 * across) / 4, (1 + 3 * along) / 4]), atol=1e-12)


def test_the_table_marks_what_is_out_of_bounds() -> None:
    def row(quantity: str, squares: float) -> dic_sigmas.Scatter:
        return dic_sigmas.Scatter(0, "plane, shift", 1.0, quantity, "rest", 4, squares, 0)

    text = dic_sigmas.table([row("x", 4.0), row("x", 4.0), row("y", 9.0)]).splitlines()[2]
    assert text.startswith("| plane, shift | 1 | 1.00 | **1.50** |")


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 6, 11])
def test_drawn_scenes_scatter_by_what_is_stated(number: int) -> None:
    """One scene is a single draw of lens and pattern: wider than what a population is held to."""
    for s in dic_sigmas.scattered("chosen", number):
        assert 0.65 < (s.squares / s.count) ** 0.5 < 1.35, s
