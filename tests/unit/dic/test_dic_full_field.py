"""Parts of the full-field measurement against closed forms: extensometers, curvature bias, grey noise."""

import numpy as np
import pytest
from speckle_pictures import RenderedCylinder
from test_dic_cylinder import RIG

from dic.correlation.subsets import Shape, overlap_correlation
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
from dic.surfaces.strains import StrainGauge, StrainOutcome, strains
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


def test_the_sigma_of_an_elongation_is_that_of_two_means():
    # ends on points, windows of 3 x 3: nine equal weights each, and subsets of 9 px every 10 px share nothing
    points, surface = stretched()
    ends = Extensometer("y", ((30, 20), (30, 80)))
    found = extension(surface, points, ends, step=STEP, subset=SUBSET)
    np.testing.assert_allclose(found.sigma, SIGMA * np.sqrt(2.0 / 9.0), rtol=1e-12)
    rest = np.full((len(points), 3), SIGMA)
    both = extension(surface, points, ends, step=STEP, subset=SUBSET, reference_sigma=rest)
    np.testing.assert_allclose(both.sigma, SIGMA * np.sqrt(4.0 / 9.0), rtol=1e-12)
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
        (((1, 1), (9, np.nan)), 3, "ends of the extensometer e must be finite, got nan at 1, 1"),
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


def test_what_shape_functions_leave_of_parabola_and_quartic():
    field = (3.0 * subset_nodes(2.0)[:, :1] ** 2)[None]
    np.testing.assert_allclose(polynomial_bias(field, Shape.AFFINE), [[3.0 * moments()[0]]], rtol=1e-12)
    np.testing.assert_allclose(polynomial_bias(field, Shape.QUADRATIC), [[0.0]], atol=1e-12)
    assert moments()[0] == pytest.approx(1.0 / 3.0, rel=1.0 / NODES**2)
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
    cameras, R = RIG, 4.75e-3
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
    frame = plane_frame(X, RIG)
    np.testing.assert_allclose(frame.positions(X)[:, 2], 0.0, atol=1e-15)
    assert frame.rotation[2, 2] > 0.0  # toward the cameras, which look along -Z
    assert frame.rotation[1] @ [0, 1, 0] == pytest.approx(1.0)
    np.testing.assert_allclose(frame.rotation @ frame.rotation.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        {"step": 0},
        {"margin": np.inf},
        {"strain_window": 4},
        {"static": 0},
        {"noise": 0.0},
        {"stereo_shape": Shape.RIGID},
    ],
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
    dark = np.zeros((4, 6))
    hole = dark.copy()
    hole[2, 3] = np.nan
    with pytest.raises(ValueError, match="picture 1, row 2, column 3 is nan: grey values must be finite"):
        PicturesInMemory([dark, hole])


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ([0.0, 0.5, 1.0], [0, 32_768, 65_535]),  # of 0 to 1: a full well stays one
        ([0.25, 0.5, 0.75], [16_384, 32_768, 49_151]),
        ([-2.0, 0.0, 2.0], [1, 32_768, 65_534]),  # of any other range: none counts as saturated
        ([0.0, 4095.0], [1, 65_534]),
        ([7.0, 7.0], [1, 1]),
    ],
)
def test_floating_point_pictures_have_one_scale_for_all(values, wanted):
    series = PicturesInMemory([np.full((4, 6), value, dtype=np.float32) for value in values])
    assert series.bits == 16
    assert [int(series.frame(k).max()) for k in range(series.n_frames)] == pytest.approx(wanted, abs=1)


RADIUS, SCALE = 4.75e-3, 1.0 / 18e3  # 18 px/mm
NOISE = np.array([1e-6, 1e-6, 4e-6])
STRAINS_STEP, STRAINS_SUBSET = 5.0, 21.0
GAUGE = StrainGauge(window=5, step=STRAINS_STEP, subset=STRAINS_SUBSET)


def strains_grid(columns=13, rows=11):
    x, y = np.meshgrid(40.0 + STRAINS_STEP * np.arange(columns), 40.0 + STRAINS_STEP * np.arange(rows))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def at_rest(points):
    """The cylinder's points under a grid of pixels; rows count down, y up."""
    x, y = (points[:, 0] - 70.0) * SCALE, (100.0 - points[:, 1]) * SCALE
    return np.stack([x, y, np.sqrt(RADIUS**2 - x**2)], axis=-1)


def history(X, positions, outcome=None):
    frames = len(positions)
    if outcome is None:
        outcome = np.zeros((frames, len(X)), dtype=np.int64)
    return SurfaceHistory(
        t=np.arange(float(frames)),
        X=X,
        u=np.where((outcome == 0)[..., None], positions - X, np.nan),
        sigma=np.broadcast_to(NOISE, (frames, len(X), 3)),
        outcome=outcome,
    )


def compressed(X, stretch):
    """Homogeneous compression of an incompressible body along y."""
    wide = stretch**-0.5
    return np.array([X * [b, a, b] for a, b in zip(stretch, wide, strict=True)])


STRETCH = np.array([1.0, 0.8, 0.5, 0.3])


@pytest.mark.parametrize("order", [1, 2])
def test_a_homogeneous_compression_has_its_closed_forms_at_every_point(order):
    points = strains_grid()
    X = at_rest(points)
    gauge = StrainGauge(window=5, step=STRAINS_STEP, subset=STRAINS_SUBSET, order=order)
    found = strains(history(X, compressed(X, STRETCH)), points, gauge)
    assert (found.outcome == StrainOutcome.VALID).all()  # corners with one-sided windows too
    lam, wide = STRETCH[:, None], STRETCH[:, None] ** -0.5
    for strain, f in (
        (found.green_lagrange, lambda a: (a**2 - 1.0) / 2.0),
        (found.hencky, np.log),
        (found.nominal, lambda a: a - 1.0),
    ):
        # Around the axis the fibre in the tangent plane lies in x and Z, both of which stretch alike.
        # Linear in X, so a fit of any order has it exactly: round-off.
        np.testing.assert_allclose(strain.value[..., 0], f(wide) + 0.0 * X[:, 0], atol=1e-12)
        np.testing.assert_allclose(strain.value[..., 1], f(lam) + 0.0 * X[:, 0], atol=1e-12)
        np.testing.assert_allclose(strain.value[..., 2], 0.0, atol=1e-12)


def test_simple_shear_and_rotation_have_their_closed_forms():
    points = strains_grid()
    X = at_rest(points) * [1.0, 1.0, 0.0]  # a plane: tangents are x and y
    k, turn = 0.4, 0.7
    shear = np.array([[1.0, k, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = strains(history(X, np.array([X @ (R @ shear).T])), points, GAUGE)
    # E = (FᵀF - 1)/2 with F = 1 + k e_x e_y, whatever the rotation.
    np.testing.assert_allclose(found.green_lagrange.value - [0.0, k**2 / 2, k / 2], 0.0, atol=1e-12)
    root = np.sqrt(1.0 + k**2 / 4.0)  # principal stretches of simple shear: root ± k/2
    # Hencky's tensor has the logarithms of these as eigenvalues.
    H = found.hencky.value[0, 0]
    logs = np.linalg.eigvalsh(np.array([[H[0], H[2]], [H[2], H[1]]]))
    np.testing.assert_allclose(logs, np.log([root - k / 2, root + k / 2]), atol=1e-12)
    angle = 0.5 * np.arctan2(2.0 * H[2], H[0] - H[1])
    np.testing.assert_allclose(np.tan(2.0 * angle), -2.0 / k, atol=1e-9)  # tan 2φ = 2 C12 / (C11 - C22)


def test_a_barrelled_surface_is_off_by_the_second_order_of_the_gauge():
    points = strains_grid()
    X = at_rest(points)
    r = 1.0 + 0.1 * (1.0 - ((X[:, 1] - 1.9e-3) / 1.9e-3) ** 2)
    places = X * np.stack([r, np.ones_like(r), r], axis=-1)
    interior = (np.abs(points - [70.0, 65.0]) <= [20.0, 15.0]).all(axis=1)  # full windows of both gauges
    error = []
    for window in (3, 5):
        found = strains(history(X, places[None]), points, StrainGauge(window, STRAINS_STEP, STRAINS_SUBSET))
        assert (found.share[0, interior] == 1.0).all()
        E = found.green_lagrange.value[0, interior, 0]
        error.append(np.mean((r[interior] ** 2 - 1.0) / 2.0 - E))
    # The gauge sees the mean of r over its rows: short by r''/2 times the mean square of their places,
    # 2/3 and 2 steps², and E by r times that; the rest is of second order of it.
    curvature = 0.2 / 1.9e-3**2
    expected = (
        np.mean(r[interior]) * 0.5 * curvature * (STRAINS_STEP * SCALE) ** 2 * np.array([2.0 / 3.0, 2.0])
    )
    np.testing.assert_allclose(error, expected, rtol=0.01)


def noisy(X, positions, points, rng):
    """The history with noise that overlapping subsets have in common."""
    rho = overlap_correlation(points, points, STRAINS_SUBSET) + 1e-10 * np.eye(len(points))
    white = rng.standard_normal(positions.shape)
    return history(X, positions + np.einsum("nm,fmi->fni", np.linalg.cholesky(rho), white) * NOISE)


def test_the_sigmas_of_strains_are_those_of_their_errors():
    points = strains_grid(9, 9)
    X = at_rest(points)
    positions = np.repeat(compressed(X, np.array([0.8, 0.4])), 60, axis=0)  # 60 draws of each
    rng = np.random.default_rng(1)
    true = strains(history(X, positions), points, GAUGE)
    found = strains(noisy(X, positions, points, rng), points, GAUGE)
    for name in ("green_lagrange", "hencky", "nominal"):
        off = (getattr(found, name).value - getattr(true, name).value) / getattr(found, name).sigma
        for part in (off[:60], off[60:]):
            # 60 draws of fields whose gauges overlap over 9 x 9 points: about four independent places,
            # 240 values, each standard deviation known to 1/sqrt(480) = 4.6 %.
            assert part.std(axis=(0, 1)) == pytest.approx(np.ones(3), abs=0.15)


def test_noise_of_the_reference_counts_as_noise_of_the_frame_when_nothing_deforms():
    points = strains_grid(7, 7)
    X = at_rest(points)
    surface = history(X, X[None])
    alone = strains(surface, points, GAUGE).green_lagrange.sigma
    both = strains(surface, points, GAUGE, reference_sigma=np.broadcast_to(NOISE, X.shape))
    np.testing.assert_allclose(both.green_lagrange.sigma, np.sqrt(2.0) * alone, rtol=1e-9)  # equal parts


def test_windows_do_not_reach_across_regions_and_lost_points_are_left_out():
    points = strains_grid()
    X = at_rest(points)
    rows = ((points[:, 1] - 40.0) / STRAINS_STEP).astype(int)
    platen = rows < 3
    positions = compressed(X, np.array([0.5]))
    positions[0, platen] = X[platen] + [0.0, -1e-3, 0.0]  # rigid, and far from the specimen's motion
    outcome = np.zeros((1, len(X)), dtype=np.int64)
    outcome[0, 70] = PointOutcome.LOW_CORRELATION
    positions[0, 70] = 1.0  # what a lost point holds means nothing
    found = strains(history(X, positions, outcome), points, GAUGE, regions=platen)
    E = found.green_lagrange.value[0]
    lost = np.arange(len(X)) == 70
    np.testing.assert_allclose(E[platen], 0.0, atol=1e-12)
    # A lopsided window leans by a part of its angle on the cylinder, 0.1: here 0.02 at most.
    near = np.abs(points - points[70]).max(axis=1) <= 2 * STRAINS_STEP
    np.testing.assert_allclose(E[~platen & ~near, 1], (0.5**2 - 1.0) / 2.0, atol=1e-12)
    np.testing.assert_allclose(E[~platen & near & ~lost, 1], (0.5**2 - 1.0) / 2.0, rtol=0.02**2)
    assert found.outcome[0, 70] == StrainOutcome.POINT_LOST
    assert np.isnan(E[70]).all()
    assert (found.outcome[0, ~lost] == StrainOutcome.VALID).all()
    beside = np.abs(points - points[70]).max(axis=1) == STRAINS_STEP
    assert (found.share[0, beside & ~platen] < 1.0).all()
    first = np.flatnonzero(rows == 3)[10]  # the specimen's first row sees itself and two rows on
    assert found.centre[0, first] == pytest.approx([0.0, 1.0])


def test_too_few_neighbours_are_an_outcome():
    points = strains_grid()
    X = at_rest(points)
    outcome = np.full((1, len(X)), int(PointOutcome.NOT_CONVERGED))
    outcome[0, :13] = PointOutcome.VALID  # a single row: nothing is known along y
    found = strains(history(X, X[None], outcome), points, GAUGE)
    assert (found.outcome[0, :13] == StrainOutcome.TOO_FEW_NEIGHBOURS).all()
    assert (found.outcome[0, 13:] == StrainOutcome.POINT_LOST).all()
    assert np.isnan(found.hencky.value).all()
    for member in StrainOutcome:
        assert member.ok == (member is StrainOutcome.VALID)
        assert member.cause
        assert member.cure


def test_the_gauge_has_its_declared_size_and_refuses_what_is_none():
    assert StrainGauge(window=5, step=5.0, subset=21.0).size == 41.0  # (5 - 1) 5 + 21
    for options in ({"window": 4}, {"window": 1}, {"window": np.nan}, {"step": 0.0}, {"order": 3}):
        with pytest.raises(ValueError, match="must be"):
            StrainGauge(**({"window": 5, "step": 5.0, "subset": 21.0} | options))
    X = at_rest(strains_grid())
    with pytest.raises(ValueError, match="points has shape"):
        strains(history(X, X[None]), strains_grid()[:-1], GAUGE)
