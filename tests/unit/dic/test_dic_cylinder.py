"""The best-fit cylinder, the test frame and the surface in it, for points on known cylinders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stereo_scene import turned_pair

from dic import PointOutcome, SurfaceHistory, centre_line
from dic.correlation.subsets import overlap_factor
from dic.stereo.reconstruction import Reconstruction
from dic.surfaces import cylinder as cylinder_fit
from dic.surfaces import surface_history

RADIUS, LENGTH = 4.75e-3, 6.5e-3
NOISE = np.array([1e-6, 1e-6, 4e-6])
PLACE = np.array([1e-3, -2e-3, 0.3])


RIG = turned_pair(256.0, (256.0, 256.0))


def patch(rng, arc, n=400):
    """Points on ±arc degrees of the cylinder about y, shape [n, 3]."""
    angle, y = np.radians(rng.uniform(-arc, arc, n)), rng.uniform(0.0, LENGTH, n)
    return np.stack([RADIUS * np.sin(angle), y, RADIUS * np.cos(angle)], axis=-1)


def errors(fit, R):
    """Errors of a fit in the order of its covariance; the true axis is R's second column through PLACE."""
    axis = R[:, 1] * np.sign(R[:, 1] @ fit.axis)
    true = PLACE + axis * ((fit.point - PLACE) @ fit.axis) / (axis @ fit.axis)
    return np.concatenate(
        [(fit.basis @ (fit.point - true))[:2], (fit.basis @ (fit.axis - axis))[:2], [fit.radius - RADIUS]]
    )


@pytest.mark.parametrize(
    ("arc", "known"),
    [
        (20.0, None),
        pytest.param(180.0, None, marks=pytest.mark.slow),
        (50.0, 0.0),
        pytest.param(20.0, 5e-6, marks=pytest.mark.slow),
    ],
)
def test_the_covariance_of_a_cylinder_is_that_of_its_errors(arc, known):
    rng = np.random.default_rng(4)
    ratios = []
    for seed in range(25):
        R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        X = patch(rng, arc) + NOISE * rng.standard_normal((400, 3))
        C = np.broadcast_to(R @ np.diag(NOISE**2) @ R.T, (400, 3, 3))
        given = {} if known is None else {"radius": RADIUS + known * rng.standard_normal()}
        fit = cylinder_fit.fit_cylinder(X @ R.T + PLACE, C, **given, radius_sigma=known or 0.0)
        n = 4 if known == 0.0 else 5
        off = errors(fit, R)[:n]
        ratios.append(off @ np.linalg.solve(fit.covariance[:n, :n], off) / n)
        assert fit.chi2_per_dof == pytest.approx(1.0, abs=0.4)  # 5 standard deviations of 395 dof
    # The mean of 25 chi-squared of 4 or 5 dof over their dof: standard deviation sqrt(2/100) = 0.14.
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.42)


def test_a_narrow_arc_says_that_it_knows_no_radius_and_a_wide_one_does():
    rng = np.random.default_rng(0)
    sigma = {}
    for arc in (10.0, 20.0, 40.0):
        C = np.broadcast_to(np.diag(NOISE**2), (400, 3, 3))
        sigma[arc] = cylinder_fit.fit_cylinder(patch(rng, arc), C).sigma[4]
    # The sagitta's curvature is seen over the arc squared.
    assert sigma[10.0] / sigma[20.0] == pytest.approx(4.0, rel=0.25)  # 400 random angles; cos, not θ²
    assert sigma[20.0] / sigma[40.0] == pytest.approx(4.0, rel=0.25)


def test_points_far_off_are_left_out_and_marked():
    rng = np.random.default_rng(1)
    X = patch(rng, 40.0) + NOISE * rng.standard_normal((400, 3))
    X[::20] += [0.0, 0.0, 0.3e-3]  # a flake of paint
    fit = cylinder_fit.fit_cylinder(X, np.broadcast_to(np.diag(NOISE**2), (400, 3, 3)))
    assert not fit.used[::20].any()
    assert fit.used.sum() >= 375  # of 380; 4 sigmas leave out 0.02 of them
    assert abs(fit.radius - RADIUS) < 5.0 * fit.sigma[4]


def test_a_scatter_beyond_the_sigmas_widens_the_covariance():
    rng = np.random.default_rng(2)
    X = patch(rng, 40.0) + 3.0 * NOISE * rng.standard_normal((400, 3))
    fit = cylinder_fit.fit_cylinder(X, np.broadcast_to(np.diag(NOISE**2), (400, 3, 3)))
    assert fit.noise_scale == pytest.approx(3.0, rel=0.15)  # chi-squared of 395 dof: 4 % on its root


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X: X[:5], "at least 6 points"),
        (lambda X: X * [1.0, 1.0, 0.0], "on no cylinder"),
        (lambda X: np.where(np.arange(len(X))[:, None] == 3, np.nan, X), "finite"),
    ],
)
def test_points_that_are_no_cylinder_are_refused(change, message):
    X = change(patch(np.random.default_rng(3), 40.0))
    with pytest.raises(ValueError, match=message):
        cylinder_fit.fit_cylinder(X, np.broadcast_to(np.diag(NOISE**2), (len(X), 3, 3)))


def cylinder(rng=None):
    X = patch(rng or np.random.default_rng(5), 40.0, 200)
    if rng is not None:
        X = X + NOISE * rng.standard_normal(X.shape)
    return cylinder_fit.fit_cylinder(X, np.broadcast_to(np.diag(NOISE**2), (200, 3, 3)))


@pytest.mark.parametrize(("toward", "sign"), [((0.1, -1.0), 1.0), ((0.0, 3.0), -1.0)])
def test_the_frame_has_the_declared_sense_and_faces_the_cameras(toward, sign):
    frame = cylinder_fit.test_frame(cylinder(), RIG, toward_flyer=toward, zero=[1e-3, 2e-3, 3e-3])
    # Points without noise: round-off of a fit to 1e-12 of the radius.
    np.testing.assert_allclose(frame.rotation, np.diag([sign, sign, 1.0]), atol=1e-8)
    np.testing.assert_allclose(frame.origin, [0.0, 2e-3, 0.0], atol=1e-10)
    assert np.linalg.det(frame.rotation) == pytest.approx(1.0)
    X = patch(np.random.default_rng(0), 30.0, 5)
    np.testing.assert_allclose(frame.in_rig(frame.positions(X)), X, atol=1e-15)


def test_a_direction_across_the_axis_is_refused():
    with pytest.raises(ValueError, match=r"toward_flyer is \(1.0, 0.2\)"):
        cylinder_fit.test_frame(cylinder(), RIG, toward_flyer=(1.0, 0.2), zero=np.zeros(3))


@pytest.mark.slow
def test_the_covariance_of_the_frame_is_that_of_its_errors():
    rng = np.random.default_rng(6)
    points = np.array([[0.0, 0.0, RADIUS], [1e-3, 6e-3, 4e-3]])
    off = []
    for _ in range(120):
        zero = np.array([1e-3, 2e-6 * rng.standard_normal(), 3e-3])
        frame = cylinder_fit.test_frame(
            cylinder(rng), RIG, toward_flyer=(0.0, -1.0), zero=zero, zero_sigma=2e-6
        )
        off.append((frame.positions(points) - points) / frame.sigma(points))
    # 120 draws: the standard deviation of each is known to 1/sqrt(240) = 6.5 %.
    assert np.std(off, axis=0) == pytest.approx(np.ones((2, 3)), abs=0.2)


def test_a_pixel_is_carried_back_to_the_cylinder():
    camera = replace(RIG.cameras[0], distortion=(-0.15, 0.0, 1e-4, 0.0, 0.0))
    X = np.array([1.5e-3, 1e-3, np.sqrt(RADIUS**2 - 1.5e-3**2)])
    # The pixel is exact to the undistortion's 1e-12, the cylinder to the fit's.
    found = cylinder_fit.on_cylinder(camera, camera.project(X), cylinder())
    np.testing.assert_allclose(found, X, atol=1e-10)
    with pytest.raises(ValueError, match="passes the cylinder"):
        cylinder_fit.on_cylinder(camera, [5.0, 256.0], cylinder())


def reconstruction(positions, outcome):
    """A reconstruction from places and outcomes, all points of the same noise."""
    shape = outcome.shape
    return Reconstruction(
        position=np.where((outcome == 0)[..., None], positions, np.nan),
        covariance=np.broadcast_to(np.diag(NOISE**2), (*shape, 3, 3)),
        epipolar=np.zeros(shape),
        pixels=(np.zeros((*shape, 2)), np.zeros((*shape, 2))),
        outcome=outcome,
    )


def test_a_surface_in_a_turned_rig_is_the_surface_in_the_test_frame():
    rng = np.random.default_rng(7)
    X = patch(rng, 30.0, 50)
    moved = np.array([X, X, X * [1.1, 0.8, 1.1]])
    R = Rotation.from_rotvec([0.1, -0.2, 1.3]).as_matrix()
    frame = cylinder_fit.SpecimenFrame(R, PLACE, np.zeros((6, 6)))
    outcome = np.zeros((3, 50), dtype=np.int64)
    outcome[0, 3] = outcome[2, 4] = PointOutcome.LOW_CORRELATION
    seen = reconstruction(frame.in_rig(moved), outcome)
    surface = surface_history.to_surface(seen, frame, [0.0, 1.0, 2.0], reference=(0, 1))
    np.testing.assert_allclose(surface.X, X, atol=1e-15)
    np.testing.assert_allclose(surface.position[surface.valid], moved[surface.valid], atol=1e-15)
    # The noise is R's: its components in the test frame are the diagonal of R C Rᵀ.
    expected = np.sqrt([(R[i] ** 2) @ NOISE**2 for i in range(3)])
    np.testing.assert_allclose(surface.sigma[surface.valid], np.tile(expected, (148, 1)))
    assert (surface.outcome == outcome).all()


def test_a_point_without_a_reference_must_be_left_out_by_name():
    outcome = np.zeros((2, 10), dtype=np.int64)
    outcome[0, 2] = PointOutcome.OUT_OF_VIEW
    X = patch(np.random.default_rng(8), 30.0, 10)
    seen = reconstruction(np.array([X, X]), outcome)
    frame = cylinder_fit.SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
    with pytest.raises(ValueError, match="1 of 10 points"):
        surface_history.to_surface(seen, frame, [0.0, 1.0])
    points = surface_history.referenced(seen)
    assert surface_history.to_surface(seen, frame, [0.0, 1.0], points=points).n_points == 9


def test_the_mean_of_static_frames_keeps_the_noise_of_the_material_picture():
    rng = np.random.default_rng(9)
    n, frames = 2000, 8
    common = rng.standard_normal((n, 3))
    own = rng.standard_normal((frames, n, 3))
    seen = reconstruction(NOISE * np.sqrt(0.5) * (common + own), np.zeros((frames, n), dtype=np.int64))
    mean, C = surface_history.static_mean(seen, range(frames))
    ratio = mean.std(axis=0) / np.sqrt(np.einsum("nii->ni", C)[0])
    assert ratio == pytest.approx(np.ones(3), abs=0.07)  # 2000 draws: 1.6 %


def test_overlapping_subsets_promise_less_and_distant_ones_nothing_less():
    grid = np.stack(np.meshgrid(np.arange(0.0, 50.0, 5.0), np.arange(0.0, 50.0, 5.0)), axis=-1).reshape(-1, 2)
    factor = overlap_factor(grid, 20.0)
    # In the interior the triangles add up to (s / step)² = 16.
    middle = (np.abs(grid - 25.0) <= 5.0).all(axis=1)
    np.testing.assert_allclose(factor[middle], 16.0)
    np.testing.assert_allclose(overlap_factor(grid, 5.0), 1.0)
    valid = np.zeros((2, 100), dtype=bool)
    valid[1, [0, 1]] = True
    np.testing.assert_allclose(overlap_factor(grid, 20.0, valid)[:, :3], [[1, 1, 1], [1.75, 1.75, 1]])


SIGMA = np.array([2e-6, 1e-6, 4e-6])


def outline(y, bulge):
    """Radius of the barrelled cylinder [m]: a parabola between the platens, `bulge` at mid-height."""
    return RADIUS + bulge * (1.0 - (2.0 * y / LENGTH - 1.0) ** 2)


def barrel(axis_x=0.0, axis_Z=0.0):
    """Three frames of a barrelling cylinder seen from Z over +-23 degrees: 13 angles x 9 heights."""
    t = np.array([0.0, 1e-4, 2e-4])
    bulge = np.array([0.0, 0.2e-3, 0.7e-3])
    angle, y = (a.ravel() for a in np.meshgrid(np.linspace(-0.4, 0.4, 13), np.linspace(0.5e-3, 6e-3, 9)))

    def place(b):
        r = outline(y, b)
        return np.stack([axis_x + r * np.sin(angle), y, axis_Z + r * np.cos(angle)], axis=-1)

    X = place(0.0)
    u = np.array([place(b) - X for b in bulge])
    outcome = np.zeros(u.shape[:2], dtype=np.int64)
    return SurfaceHistory(t=t, X=X, u=u, sigma=np.broadcast_to(SIGMA, u.shape), outcome=outcome), bulge


@pytest.mark.parametrize(("axis_x", "axis_Z"), [(0.0, 0.0), (0.3e-3, -1.2e-3)])
def test_every_point_of_the_strip_gives_the_true_radius(axis_x, axis_Z):
    surface, bulge = barrel(axis_x, axis_Z)
    line = centre_line(surface, half_width=0.5e-3, axis_x=axis_x, axis_Z=axis_Z)
    assert line.frame.size > 3 * 9  # more than the middle column alone
    np.testing.assert_allclose(line.Z, outline(line.y, bulge[line.frame]), rtol=1e-14)  # round-off
    np.testing.assert_array_equal(line.t, surface.t[line.frame])
    assert not line.left_out


def test_without_the_correction_the_strip_would_read_short():
    surface, bulge = barrel()
    half_width = 0.7e-3
    position = surface.position
    strip = np.abs(position[..., 0]) <= half_width
    frame, _ = np.nonzero(strip)
    short = outline(position[strip][:, 1], bulge[frame]) - position[strip][:, 2]
    expected = position[strip][:, 0] ** 2 / (2.0 * RADIUS)
    # the docstring's d^2/(2 r): r grows by 15 % and the next term is d^2/(4 r^2) = 0.5 %
    np.testing.assert_allclose(short, expected, rtol=0.16, atol=1e-17)
    assert short.max() > 10e-6  # worth correcting: more than the noise of a point


def test_the_strip_follows_the_current_position():
    surface, _ = barrel()
    line = centre_line(surface, half_width=0.65e-3)
    per_frame = np.bincount(line.frame)
    assert per_frame[0] > per_frame[2]  # barrelling carries points outward, out of the strip
    assert np.all(np.diff(line.frame) >= 0)
    for k in range(3):
        assert np.all(np.diff(line.y[line.frame == k]) >= 0.0)


def test_sigma_is_the_scatter_of_repeated_measurements():
    rng = np.random.default_rng(7)
    d, depth, n = 2.0e-3, 4.3e-3, 20_000
    noisy = np.array([d, 1e-3, depth]) + SIGMA * rng.standard_normal((1, n, 3))
    X = noisy[0]
    surface = SurfaceHistory(
        t=np.zeros(1), X=X, u=np.zeros((1, n, 3)), sigma=np.broadcast_to(SIGMA, (1, n, 3)),
        outcome=np.zeros((1, n), dtype=np.int64),
    )  # fmt: skip
    line = centre_line(surface, half_width=3e-3)
    # standard error of a standard deviation 1/sqrt(2 n) = 0.5 %, four of them
    assert np.mean(line.sigma) == pytest.approx(np.std(line.Z), rel=0.02)


def test_lost_points_are_left_out_and_counted():
    surface, bulge = barrel()
    outcome = surface.outcome.copy()
    u = surface.u.copy()
    centre = np.nonzero(np.abs(surface.X[:, 0]) < 1e-9)[0]
    outcome[2, centre[:4]] = PointOutcome.LOW_CORRELATION
    outcome[1, centre[0]] = PointOutcome.OUT_OF_VIEW
    outcome[1, 0] = PointOutcome.NOT_CONVERGED  # far from the strip: not its business
    u[outcome != PointOutcome.VALID] = np.nan
    line = centre_line(replace(surface, u=u, outcome=outcome), half_width=0.1e-3)
    np.testing.assert_array_equal(np.bincount(line.frame), [9, 8, 5])
    assert line.left_out == {PointOutcome.LOW_CORRELATION: 4, PointOutcome.OUT_OF_VIEW: 1}
    np.testing.assert_allclose(line.Z, outline(line.y, bulge[line.frame]), rtol=1e-14)  # round-off


def test_every_outcome_has_a_cause_and_a_cure():
    texts = [(o.cause, o.cure) for o in PointOutcome]
    assert all(cause and cure for cause, cure in texts)
    assert len(set(texts)) == len(PointOutcome)
    assert [o for o in PointOutcome if o.ok] == [PointOutcome.VALID]


def first_point_not_finite(s):
    u = s.u.copy()
    u[1, 5] = np.nan
    return {"u": u}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: {"X": s.X[:, :2]}, r"X has shape \(117, 2\), must be \(117, 3\)"),
        (lambda s: {"u": s.u[:2]}, r"u has shape \(2, 117, 3\)"),
        (lambda s: {"t": s.t[[0, 2, 1]]}, r"t must increase.*frame 2"),
        (lambda s: {"X": np.full_like(s.X, np.nan)}, "X must be finite"),
        (lambda s: {"outcome": s.outcome + 99}, "outcome 99 is not one of"),
        (lambda s: {"sigma": s.sigma * 0.0}, "frame 0, point 0 is VALID"),
        (first_point_not_finite, "frame 1, point 5 is VALID"),
    ],
)
def test_inconsistent_surfaces_are_refused(change, message):
    surface, _ = barrel()
    with pytest.raises(ValueError, match=message):
        replace(surface, **change(surface))


@pytest.mark.parametrize("half_width", [0.0, -1e-3, np.nan])
def test_a_strip_without_width_is_refused(half_width):
    with pytest.raises(ValueError, match="half_width must be a positive length"):
        centre_line(barrel()[0], half_width=half_width)


def test_an_axis_in_front_of_the_surface_is_refused():
    with pytest.raises(ValueError, match="check axis_Z"):
        centre_line(barrel()[0], half_width=1e-3, axis_Z=20e-3)
    for name in ("axis_x", "axis_Z"):
        with pytest.raises(ValueError, match=f"{name} must be finite, got nan"):
            centre_line(barrel()[0], half_width=1e-3, **{name: np.nan})
