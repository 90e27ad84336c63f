"""Parts of the full-field measurement against closed forms: extensometers, curvature bias, grey noise."""

import numpy as np
import pytest
from speckle_pictures import RenderedCylinder
from test_dic_cylinder import rig

from dic.correlation.subsets import Shape
from dic.full_field.measure import Extensometer, FullFieldSettings, extension, extensions, noise_from_matches
from dic.full_field.stereo import (
    NODES,
    match_bias,
    on_cylinder,
    plane_frame,
    polynomial_bias,
    subset_nodes,
    without_bias,
)
from dic.images.series import PicturesInMemory
from dic.outcome import PointOutcome
from dic.surfaces.cylinder import fit_cylinder
from dic.surfaces.strains import StrainOutcome
from dic.surfaces.surface_history import SurfaceHistory
from dic.tracking import Track

STEP, SUBSET, SIGMA = 10.0, 9.0, 0.02


def grid():
    x, y = np.meshgrid(np.arange(0.0, 61.0, STEP), np.arange(0.0, 101.0, STEP))
    return np.column_stack([x.ravel(), y.ravel()])


def stretched(strain=0.1, sigma=SIGMA):
    """Two frames of a plane in px: at rest, and stretched along y."""
    points = grid()
    X = np.column_stack([points, np.zeros(len(points))])
    u = np.zeros((2, len(X), 3))
    u[1, :, 1] = strain * X[:, 1]
    size = np.full(u.shape, sigma)
    return points, SurfaceHistory(np.arange(2.0), X, u, size, np.zeros((2, len(X)), dtype=int))


def test_an_extensometer_follows_a_homogeneous_stretch_exactly():
    points, surface = stretched()
    found = extension(surface, points, Extensometer("y", ((30, 20), (33, 80))), step=STEP, subset=SUBSET)
    before, after = np.hypot(3, 60), np.hypot(3, 66)
    assert found.outcome.tolist() == [StrainOutcome.VALID] * 2
    np.testing.assert_allclose(found.length, [before, after], rtol=1e-12)
    np.testing.assert_allclose(found.elongation, [0.0, after - before], atol=1e-12)
    np.testing.assert_allclose(found.strain, [0.0, after / before - 1.0], atol=1e-12)


def test_the_sigma_of_an_elongation_is_that_of_two_means_of_nine():
    # ends on points, windows of 3 x 3: nine equal weights each, and subsets of 9 px every 10 px share nothing
    points, surface = stretched()
    ends = Extensometer("y", ((30, 20), (30, 80)))
    found = extension(surface, points, ends, step=STEP, subset=SUBSET)
    np.testing.assert_allclose(found.sigma, SIGMA * np.sqrt(2.0 / 9.0), rtol=1e-12)
    rest = np.full((len(points), 3), SIGMA)
    both = extension(surface, points, ends, step=STEP, subset=SUBSET, reference_sigma=rest)
    np.testing.assert_allclose(both.sigma, SIGMA * np.sqrt(4.0 / 9.0), rtol=1e-12)


def test_subsets_that_overlap_make_the_mean_of_an_end_noisier():
    # side 20, distance 10: neighbours share 1/2, diagonal ones 1/4: the sum over 3 x 3 is (3 + 2)² of 81
    points, surface = stretched()
    found = extension(surface, points, Extensometer("y", ((30, 20), (30, 80))), step=STEP, subset=20.0)
    one_end = (3.0 + 4.0 * 0.5) ** 2 / 81.0
    np.testing.assert_allclose(found.sigma, SIGMA * np.sqrt(2.0 * one_end), rtol=1e-12)


def test_an_end_without_points_has_an_outcome_and_no_number():
    points, surface = stretched()
    near = np.hypot(*(points - [30, 80]).T) < 15.0
    surface.outcome[1, near] = int(PointOutcome.LOW_CORRELATION)
    found = extension(surface, points, Extensometer("y", ((30, 20), (30, 80))), step=STEP, subset=SUBSET)
    assert found.outcome.tolist() == [StrainOutcome.VALID, StrainOutcome.TOO_FEW_NEIGHBOURS]
    assert np.isnan(found.length[1])
    assert np.isfinite(found.length[0])


@pytest.mark.parametrize(
    ("ends", "window", "said"),
    [
        (((1, 1), (1, 1)), 3, "one place"),
        (((1, 1), (9, 1)), 4, "odd"),
        (((1, 1), (400, 1)), 3, "place it on"),
    ],
)
def test_an_extensometer_that_cannot_be_is_refused(ends, window, said):
    points, surface = stretched()
    with pytest.raises(ValueError, match=said):
        extensions(surface, points, [Extensometer("e", ends, window)], step=STEP, subset=SUBSET)


def moments(h=1.0):
    """Means of x², x⁴ and x⁶ over the nodes of a subset of half side h."""
    x = np.unique(subset_nodes(2.0 * h)[:, 0])
    return [np.mean(x**k) for k in (2, 4, 6)]


def test_a_first_order_leaves_the_mean_of_a_parabola():
    field = (3.0 * subset_nodes(2.0)[:, :1] ** 2)[None]
    np.testing.assert_allclose(polynomial_bias(field, Shape.AFFINE), [[3.0 * moments()[0]]], rtol=1e-12)
    np.testing.assert_allclose(polynomial_bias(field, Shape.QUADRATIC), [[0.0]], atol=1e-12)
    assert moments()[0] == pytest.approx(1.0 / 3.0, rel=1.0 / NODES**2)


def test_a_second_order_leaves_three_thirtyfifths_of_a_quartic():
    field = (subset_nodes(2.0)[:, :1] ** 4)[None]
    m2, m4, m6 = moments()
    by_hand = (m4 * m4 - m2 * m6) / (m4 - m2 * m2)  # least squares of x⁴ by 1 and x², at the centre
    np.testing.assert_allclose(polynomial_bias(field, Shape.QUADRATIC), [[by_hand]], rtol=1e-10)
    assert by_hand == pytest.approx(-3.0 / 35.0, rel=0.05)  # that of the integral; 15 nodes


def test_a_subset_that_a_mask_cuts_in_half_is_biased_many_times_as_much():
    x = subset_nodes(2.0)[:, 0]
    field = (x**4)[None, :, None]
    half = np.where(x[None, :, None] >= -1e-9, field, np.nan)
    side = np.unique(x[x >= -1e-9])
    by_hand = np.polynomial.polynomial.polyfit(side, side**4, 2)[0]
    np.testing.assert_allclose(polynomial_bias(half, Shape.QUADRATIC), [[by_hand]], rtol=1e-8)
    assert np.isnan(polynomial_bias(np.where(x[None, :, None] > 0.7, field, np.nan), Shape.AFFINE)).all()


def test_the_bias_of_a_cylinder_is_that_of_its_sagitta():
    """Of first order: the surface bends away by x²/2R, a third of h²/2R on average, seen as disparity."""
    cameras, R = rig(), 4.75e-3
    body = RenderedCylinder(radius=R)
    angle, y = np.meshgrid(np.linspace(-0.6, 0.6, 15), np.linspace(0.0, 6e-3, 9))
    X = np.column_stack([R * np.sin(angle.ravel()), y.ravel(), R * np.cos(angle.ravel())])
    cylinder = fit_cylinder(X, np.broadcast_to(1e-12 * np.eye(3), (len(X), 3, 3)))
    middle = cameras.cameras[0].project(np.array([[0.0, 3e-3, R]]))
    np.testing.assert_allclose(
        on_cylinder(cameras.cameras[0], middle, cylinder), body.hit(cameras.cameras[0], middle), atol=1e-9
    )
    mask = np.ones((512, 512), dtype=bool)
    bias = match_bias(cameras, cylinder, middle, mask, 21, Shape.AFFINE)[0]
    pixel = 0.305 / 5400.0  # m on the specimen; the cameras look 6.25 degrees to each side
    depth = -moments(10.5 * pixel)[0] / (2.0 * R)
    expected = 2.0 * np.sin(np.radians(6.25)) * depth / pixel
    # the obliquity of 6.25 degrees and the slope across the subset are left out of the hand's sum
    assert abs(bias[0]) == pytest.approx(abs(expected), rel=0.06)
    assert abs(bias[1]) < 0.05 * abs(bias[0])
    quadratic = match_bias(cameras, cylinder, middle, mask, 21, Shape.QUADRATIC)[0]
    assert np.linalg.norm(quadratic) < 0.01 * abs(expected)


def test_a_bias_rides_with_the_deformation():
    warp = np.zeros((2, 1, 12))
    warp[1, 0, 2] = 0.5  # stretched by 1.5 along x since the material frame
    blank = np.zeros((2, 1))
    track = Track(np.zeros((1, 2)), warp, np.zeros((2, 1, 2, 2)), blank, blank, blank)
    found = without_bias(track, np.array([[0.2, 0.1]]), 0)
    np.testing.assert_allclose(found.warp[:, 0, :2], [[-0.2, -0.1], [-0.3, -0.1]], rtol=1e-12)


def test_noise_is_what_explains_the_correlation_of_two_noisy_pictures():
    rng, sigma, subset = np.random.default_rng(5), 3.0, 21
    x, y = np.meshgrid(np.arange(200.0), np.arange(200.0))
    truth = 100.0 + 30.0 * np.sin(x / 1.7) * np.sin(y / 2.1)
    a, b = (truth + sigma * rng.standard_normal(truth.shape) for _ in range(2))
    places = np.array([(i, j) for i in range(15, 185, 12) for j in range(15, 185, 12)], dtype=float)
    zncc = []
    for i, j in places.astype(int):
        part = np.s_[j - 10 : j + 11, i - 10 : i + 11]
        zncc.append(np.corrcoef(a[part].ravel(), b[part].ravel())[0, 1])
    # 225 subsets of 441 pixels: the median is known to about 0.3 %
    assert noise_from_matches(a, places, np.array(zncc), subset) == pytest.approx(sigma, rel=0.02)
    with pytest.raises(ValueError, match="declare it"):
        noise_from_matches(a, places[:0], np.array([]), subset)


def test_the_frame_of_a_plane_looks_at_the_cameras():
    x, y = np.meshgrid(np.linspace(-2e-3, 2e-3, 5), np.linspace(0.0, 4e-3, 5))
    X = np.column_stack([x.ravel(), y.ravel(), 0.2 * x.ravel()])
    frame = plane_frame(X, rig())
    np.testing.assert_allclose(frame.positions(X)[:, 2], 0.0, atol=1e-15)
    assert frame.rotation[2, 2] > 0.0  # toward the cameras, which look along -Z
    assert frame.rotation[1] @ [0, 1, 0] == pytest.approx(1.0)
    np.testing.assert_allclose(frame.rotation @ frame.rotation.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    "wrong", [{"step": 0}, {"strain_window": 4}, {"static": 0}, {"noise": 0.0}, {"stereo_shape": Shape.RIGID}]
)
def test_settings_outside_their_range_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        FullFieldSettings(**wrong)


def test_arrays_in_memory_are_a_series():
    series = PicturesInMemory([np.zeros((4, 6), dtype=np.uint8), np.ones((4, 6), dtype=np.uint8)])
    assert (series.n_frames, series.shape, series.bits) == (2, (4, 6), 8)
    assert series.frame(1).max() == 1
    with pytest.raises(ValueError, match="one array"):
        PicturesInMemory([])
