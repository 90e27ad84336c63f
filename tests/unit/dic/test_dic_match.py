"""The match of subsets, compared with a float64 twin and with motions in closed form."""

from dataclasses import replace
from functools import cache

import correlation_twin as twin
import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern
from synthetic_dic import synthetic_result

from dic import PointOutcome, SurfaceHistory, centre_line
from dic.correlation import Correlation, Noise, PictureStack, Shape, correlate
from dic.correlation import subsets as warps
from dic.correlation.kernels import launch
from dic.correlation.kernels import search as search_source
from dic.correlation.subsets import overlap_correlation
from dic.surfaces.outline import outline, rows_of
from dic.surfaces.surface_history import noise_floor

SIDE = 128
CENTRE = (SIDE - 1) / 2
ROTATION = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])


def total(F, shift, points):
    """Warps of the motion x = c + F (X - c) + shift."""
    warp = np.zeros((len(points), 12))
    warp[:, :2] = (points - CENTRE) @ (F - np.eye(2)).T + shift
    warp[:, 2:6] = (F - np.eye(2)).ravel()
    return warp


def moved(F, shift, **options):
    """The picture after that motion."""
    back = np.linalg.inv(F)
    return render(
        pattern(), (SIDE, SIDE), material=lambda x: (x - CENTRE - shift) @ back.T + CENTRE, **options
    )


def grid(low, high, step):
    a = np.arange(low, high, step, dtype=np.float64)
    return np.stack(np.meshgrid(a, a), axis=-1).reshape(-1, 2)


@cache
def pattern():
    return speckle_pattern((SIDE, SIDE), seed=3)


@cache
def still(noise=0.0):
    return render(pattern(), (SIDE, SIDE), noise=noise, seed=1)


def stack(picture, noise=1.0, **options):
    return PictureStack.prepare(picture, noise=noise, **options)


@pytest.mark.parametrize("parameters", list(Shape))
@pytest.mark.parametrize("read_between", [False, True])
def test_against_the_float64_twin(parameters, read_between):
    F, shift = ROTATION @ np.diag([1.1, 0.7]), np.array([0.3, -0.45])
    f, g = still(2.0), moved(F, shift, noise=2.0, seed=2)
    points = np.array([[52.0, 57.0], [63.4, 66.7], [74.0, 50.2]])
    guess = total(F, shift + 0.2, points)
    references = None
    if read_between:  # the template is read from the deformed picture, and found in the undeformed one
        f, g, references, guess = g, f, total(F, shift, points), total(np.eye(2), 0.2, points)
    # noise 0 declared: the twin knows no bias of a template read between pixels
    settings = Correlation(shape=parameters, tolerance=1e-6, max_iterations=100)
    found = correlate(stack(f, 0.0), stack(g, 0.0), points, guess, settings, reference_warp=references)
    assert np.all(found.outcome == PointOutcome.VALID)
    f, g = twin.Picture(f), twin.Picture(g)
    for i, point in enumerate(points):
        reference = None if references is None else references[i]
        warp, zncc = twin.match(f, g, point, guess[i], subset=21, parameters=parameters, reference=reference)
        # fp32 in the kernels: places to 1e-6 px, grey values to 1e-5; measured 4e-7 px, 1e-7, 2e-8 /px, 7e-8
        np.testing.assert_allclose(found.warp[i, :2], warp[:2], atol=2e-6)
        np.testing.assert_allclose(found.warp[i, 2:6], warp[2:6], atol=5e-7)
        np.testing.assert_allclose(found.warp[i, 6:], warp[6:], atol=1e-7)
        np.testing.assert_allclose(found.zncc[i], zncc, atol=3e-7)


def test_affine_motion_in_closed_form():
    F, shift = ROTATION @ np.diag([1.05, 0.8]), np.array([1.3, -0.6])
    points = grid(50, 80, 7)
    true = total(F, shift, points)
    found = correlate(
        stack(still()), stack(moved(F, shift)), points, true + 0.05 * (np.arange(12) < 2), Correlation()
    )
    assert np.all(found.outcome == PointOutcome.VALID)
    # a spline of 6 px speckles that are compressed to 4 px: a hundredth of a grey level, some 0.5 mpx
    np.testing.assert_allclose(found.warp[:, :2], true[:, :2], atol=3e-3)
    np.testing.assert_allclose(found.warp[:, 2:6], true[:, 2:6], atol=6e-4)
    assert np.abs(found.warp[:, :2] - true[:, :2]).mean() < 1e-3


def test_steps_of_a_slow_search_are_lengthened(monkeypatch):
    """Noise of 30 grey levels makes the steps shrink by some 0.4 instead of 0.05."""
    noise = 30.0 * np.random.default_rng(3).normal(size=(SIDE, SIDE))
    picture = stack(moved(np.eye(2), np.array([0.4, -0.3])) + noise, 30.0)
    points = grid(40, 90, 6)
    settings = Correlation(shape=Shape.QUADRATIC, tolerance=1e-5, max_iterations=100)
    found = {}
    for slowest in (search_source.SLOWEST, 0.0):
        monkeypatch.setattr(search_source, "SLOWEST", slowest)
        launch.search_kernel.cache_clear()
        start = total(np.eye(2), np.array([0.9, 0.2]), points)
        found[slowest] = correlate(stack(still()), picture, points, start, settings)
    launch.search_kernel.cache_clear()
    series, plain = found.values()
    both = (series.outcome == PointOutcome.VALID) & (plain.outcome == PointOutcome.VALID)
    assert both.mean() > 0.8
    assert series.iterations[both].mean() < 0.9 * plain.iterations[both].mean()  # 0.8 was measured
    # Steps that shrink by up to 0.9 leave ten times the tolerance.
    np.testing.assert_allclose(series.warp[both, :2], plain.warp[both, :2], atol=1e-4)


def test_steps_from_afar_are_not_lengthened(monkeypatch):
    """Of searches from 3.6 px away two thirds arrive. Lengthened steps would lose every seventh of them."""
    shift, points = np.array([0.4, -0.3]), grid(40, 90, 2)
    still_, picture = stack(still(), 2.0), stack(moved(np.eye(2), shift, noise=2.0, seed=2), 2.0)
    start = total(np.eye(2), shift + np.array([3.0, 2.0]), points)
    arrived = {}
    for slowest, near in ((search_source.SLOWEST, search_source.NEAR), (0.0, 1.0), (0.9, 1e9)):
        monkeypatch.setattr(search_source, "SLOWEST", slowest)
        monkeypatch.setattr(search_source, "NEAR", near)
        launch.search_kernel.cache_clear()
        found = correlate(still_, picture, points, start, Correlation(shape=Shape.QUADRATIC))
        arrived[slowest, near] = int(np.sum(found.outcome == PointOutcome.VALID))
    launch.search_kernel.cache_clear()
    used, plain, far = arrived.values()
    assert abs(used - plain) < 0.02 * plain  # 420 and 418 of 625 were measured
    assert far < 0.9 * plain  # or these searches could not tell


def test_the_way_left_is_within_the_tolerance(monkeypatch):
    """A search whose steps shrink fast needs half a step less, and ends within the tolerance."""
    noise = 10.0 * np.random.default_rng(3).normal(size=(SIDE, SIDE))
    picture, points = stack(moved(np.eye(2), np.array([0.4, -0.3])) + noise, 10.0), grid(40, 90, 4)
    found = {}
    for tolerance, shrunk in ((2e-5, 0.0), (1e-3, 0.0), (1e-3, search_source.SHRUNK)):
        monkeypatch.setattr(search_source, "SHRUNK", shrunk)
        launch.search_kernel.cache_clear()
        settings = Correlation(shape=Shape.QUADRATIC, tolerance=tolerance, max_iterations=100)
        start = total(np.eye(2), np.array([0.6, -0.2]), points)
        found[tolerance, shrunk] = correlate(stack(still()), picture, points, start, settings)
        assert np.all(found[tolerance, shrunk].outcome == PointOutcome.VALID)
    launch.search_kernel.cache_clear()
    _, plain, used = found.values()
    assert used.iterations.mean() < plain.iterations.mean() - 0.4  # 4.26 and 4.76 were measured
    # of a subset of 21 px
    corners = 10.0 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])[:, None]
    places = [warps.apply(points + np.zeros((4, 1, 1)), one.warp, corners) for one in found.values()]
    left = [np.linalg.norm(one - places[0], axis=-1).max(axis=0) for one in places[1:]]
    # Without the factor of 2 it is 1.4 times the tolerance. A search that stops a step later leaves a fifth.
    assert np.quantile(left[1], 0.95) < 1e-3
    assert np.quantile(left[1], 0.95) > 2.0 * np.quantile(left[0], 0.95)


def test_quadratic_motion_in_closed_form():
    bend = np.array([4e-4, -3e-4, 2e-4, -2e-4, 5e-4, 3e-4])  # uxx to vyy [1/px]

    def forward(X):
        x, y = (X - CENTRE)[..., 0], (X - CENTRE)[..., 1]
        terms = np.stack([x * x / 2, x * y, y * y / 2], axis=-1)
        return X + np.stack([terms @ bend[:3], terms @ bend[3:]], axis=-1) + np.array([0.4, 0.2])

    def material(x):
        X = x.copy()
        for _ in range(60):  # a contraction: gradients are below 0.1
            X = X - (forward(X) - x)
        return X

    g = render(pattern(), (SIDE, SIDE), material=material)
    points = np.array([[CENTRE, CENTRE], [55.0, 70.0], [72.0, 49.0]])
    true = np.zeros((3, 12))
    true[:, :2] = forward(points) - points
    x, y = (points - CENTRE).T
    true[:, 2:6] = np.stack([bend[0] * x + bend[1] * y, bend[1] * x + bend[2] * y,
                             bend[3] * x + bend[4] * y, bend[4] * x + bend[5] * y], axis=1)  # fmt: skip
    true[:, 6:] = bend
    guess = np.zeros((3, 12))
    guess[:, :2] = np.round(true[:, :2])
    settings = Correlation(shape=Shape.QUADRATIC, subset=31)
    found = correlate(stack(still()), stack(g), points, guess, settings)
    assert np.all(found.outcome == PointOutcome.VALID)
    # interpolation again; over half a subset of 15 px a first derivative is worth 15, a second one 110 px
    np.testing.assert_allclose(found.warp[:, :2], true[:, :2], atol=2e-3)
    np.testing.assert_allclose(found.warp[:, 2:6], true[:, 2:6], atol=2e-4)
    np.testing.assert_allclose(found.warp[:, 6:], true[:, 6:], atol=3e-5)
    affine = correlate(stack(still()), stack(g), points, guess, Correlation(subset=31))
    assert np.abs(affine.warp[:, :2] - true[:, :2]).max() > 5e-3  # an affine subset cannot follow


def test_grey_range_brightness_and_contrast_do_not_matter():
    f, g = still(2.0), moved(np.eye(2), np.array([0.3, 0.1]), noise=2.0, seed=4)
    points, guess = grid(30, 100, 23), warps.identity(16)
    plain = correlate(stack(f, 2.0), stack(g, 2.0), points, guess, Correlation())
    other = correlate(
        stack(16 * f, 32.0), stack(16 * (0.6 * g + 40), 16 * 0.6 * 2.0), points, guess, Correlation()
    )
    np.testing.assert_allclose(other.warp, plain.warp, atol=1e-5)  # fp32, as against the twin
    np.testing.assert_allclose(other.covariance, plain.covariance, rtol=1e-4)


def test_results_do_not_depend_on_threads_or_batch():
    f, g = still(2.0), moved(np.eye(2), np.array([0.3, 0.1]), noise=2.0, seed=4)
    points = grid(20, 108, 2.5)
    assert len(points) > 1024  # more than the shares of both threads
    guess = warps.identity(len(points))
    one = correlate(stack(f), stack(g), points, guess, Correlation(), threads=1)
    two = correlate(stack(f), stack(g), points, guess, Correlation(), threads=2)
    some = correlate(stack(f), stack(g), points[700:710], guess[700:710], Correlation())
    for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
        np.testing.assert_array_equal(getattr(one, name)[700:710], getattr(some, name))


def test_every_point_uses_its_own_pictures():
    shifts = np.array([0.0, 0.25, 0.5])
    pictures = PictureStack.prepare((moved(np.eye(2), np.array([s, 0.0])) for s in shifts), noise=1.0)
    assert pictures.n_pictures == 3
    assert pictures.memory >= 3 * 4 * SIDE**2
    points = np.full((9, 2), 60.0)
    a, b = np.divmod(np.arange(9), 3)
    reference = total(np.eye(2), np.zeros(2), points)
    reference[:, 0] = shifts[a]
    found = correlate(
        pictures, pictures, points, reference, Correlation(),
        reference_picture=a, deformed_picture=b, reference_warp=reference,
    )  # fmt: skip
    np.testing.assert_allclose(found.warp[:, 0], shifts[b], atol=1e-3)  # interpolation


def test_mask_keeps_the_other_body_out():
    still_side = still()
    both = np.where(np.arange(SIDE) < 64, moved(np.eye(2), np.array([0.0, 0.8])), still_side)
    points = np.stack([np.full(9, 57.0), np.linspace(30, 98, 9)], axis=1)
    mask = np.zeros((SIDE, SIDE), dtype=bool)
    mask[:, :64] = True
    guess = warps.identity(9)
    guess[:, 1] = 0.6
    masked = correlate(stack(still_side), stack(both), points, guess, Correlation(), mask=mask)
    assert np.all(masked.outcome == PointOutcome.VALID)
    np.testing.assert_allclose(masked.warp[:, :2], np.tile([0.0, 0.8], (9, 1)), atol=5e-3)  # the seam is seen
    without = correlate(stack(still_side), stack(both), points, guess, Correlation())
    assert np.abs(without.warp[:, 1] - 0.8).max() > 0.05
    less = correlate(
        stack(still_side), stack(both), points + np.array([8.0, 0.0]), guess, Correlation(), mask=mask
    )
    assert np.all(less.outcome == PointOutcome.OUT_OF_VIEW)  # 9 of 21 columns are left


def test_a_subset_that_leaves_the_picture():
    points = np.array([[116.0, 60.0], [116.0, 60.0]])
    f, g = stack(still()), stack(moved(np.eye(2), np.array([6.3, 0.0])))
    guess = total(np.eye(2), np.array([6.0, 0.0]), points)
    partly = correlate(f, g, points, guess, Correlation())  # 15 of its 21 columns are left
    assert np.all(partly.outcome == PointOutcome.VALID)
    np.testing.assert_allclose(partly.warp[:, 0], 6.3, atol=3e-3)  # interpolation at the mirrored edge
    gone = correlate(f, g, points, guess, Correlation(least_pixels=0.8))
    assert np.all(gone.outcome == PointOutcome.OUT_OF_VIEW)
    far = correlate(f, g, points, guess + 1e9, Correlation())
    assert np.all(far.outcome == PointOutcome.OUT_OF_VIEW)


def test_little_contrast_is_told_from_noise():
    rng = np.random.default_rng(5)
    grain = 100.0 + rng.normal(0.0, 2.0, (64, 64))
    point, guess = np.array([[31.0, 31.0]]), warps.identity(1)

    def outcome(f, g, noise):
        return PointOutcome(
            correlate(stack(f, noise), stack(g, noise), point, guess, Correlation()).outcome[0]
        )

    assert outcome(grain, grain, 2.0) is PointOutcome.LOW_CONTRAST  # nothing but its own noise
    assert outcome(grain, grain, 0.5) is PointOutcome.VALID  # the same, said to be a pattern
    assert outcome(np.full((64, 64), 80.0), grain, 0.5) is PointOutcome.LOW_CONTRAST
    assert outcome(grain, np.full((64, 64), 80.0), 0.5) is PointOutcome.LOW_CONTRAST
    stripes = np.tile(100.0 + 30.0 * np.sin(np.arange(64) / 2.0), (64, 1))
    assert outcome(stripes, stripes, 0.5) is PointOutcome.LOW_CONTRAST  # located across them only


def test_what_is_not_there_is_not_found():
    points = grid(25, 105, 10)
    other = render(speckle_pattern((SIDE, SIDE), seed=99), (SIDE, SIDE))
    lost = correlate(stack(still()), stack(other), points, warps.identity(len(points)), Correlation())
    assert not np.any(lost.outcome == PointOutcome.VALID)
    assert np.any(lost.outcome == PointOutcome.LOW_CORRELATION)
    hurried = correlate(
        stack(still()), stack(moved(np.eye(2), np.array([0.4, 0.0]))), points, warps.identity(len(points)),
        Correlation(max_iterations=1),
    )  # fmt: skip
    assert np.all(hurried.outcome == PointOutcome.NOT_CONVERGED)
    assert np.all(hurried.iterations == 1)


def test_points_without_a_guess_do_not_touch_their_neighbours():
    points = grid(40, 90, 20)
    guess = warps.identity(len(points))
    guess[4, 3] = np.nan
    found = correlate(stack(still()), stack(still()), points, guess, Correlation())
    assert found.outcome[4] == PointOutcome.NO_FIRST_GUESS
    assert np.all(np.delete(found.outcome, 4) == PointOutcome.VALID)


def test_noise_that_grows_with_the_grey_value():
    points, guess = grid(30, 100, 10), warps.identity(49)
    f, g = still(), moved(np.eye(2), np.array([0.3, 0.0]))
    flat = correlate(stack(f, 3.0), stack(g, 3.0), points, guess, Correlation())
    photons = Noise(0.0, gain=9.0 / pattern().level)  # the same at the mean grey value
    counted = correlate(stack(f, photons), stack(g, photons), points, guess, Correlation())
    ratio = counted.covariance[:, 0, 0] / flat.covariance[:, 0, 0]
    brightness = np.array([f[int(y) - 10 : int(y) + 11, int(x) - 10 : int(x) + 11].mean() for x, y in points])
    # the noise of the mean grey value; what noise adds to gradients, up to 10 % of them, goes with it too
    np.testing.assert_allclose(ratio, brightness / pattern().level, rtol=0.07)
    assert np.ptp(brightness) / pattern().level > 0.3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": np.zeros((3, 3))}, "points must have shape"),
        ({"points": np.full((2, 2), np.inf)}, "points must be finite"),
        ({"guess": np.zeros((2, 6))}, "guess must have shape"),
        ({"reference_warp": np.zeros((1, 12))}, "reference_warp must have shape"),
        ({"reference_picture": 1}, "reference_picture must be from 0 to 0, got 1"),
        ({"deformed_picture": np.zeros(5, dtype=int)}, "deformed_picture must be a whole number"),
        ({"mask": np.ones((4, 4))}, "mask must be true or false"),
        ({"settings": Correlation(prefilter=0.5)}, "prepared with prefilter 0.0 px"),
    ],
)
def test_wrong_arguments(change, message):
    arguments = {"points": np.full((2, 2), 50.0), "guess": np.zeros((2, 12)), "settings": Correlation()}
    arguments.update(change)
    pictures = stack(still())
    with pytest.raises(ValueError, match=message):
        correlate(pictures, pictures, **arguments)


@pytest.mark.parametrize(
    ("pictures", "options", "message"),
    [
        ([np.zeros((20, 20)), np.zeros((20, 21))], {}, r"picture 1 has shape \(20, 21\)"),
        ([np.zeros((7, 20))], {}, "at least 8|8 px or more"),
        ([], {}, "at least one picture"),
        (np.full((20, 20), np.nan), {}, "not finite"),
        (np.zeros((2, 20, 20)), {"noise": [1.0]}, "noise must be one value or 2"),
        (np.zeros((20, 20)), {"noise": -1.0}, "floor of the noise"),
        (np.zeros((20, 20)), {"prefilter": 9.0}, "prefilter must be from 0 to 5"),
        (np.zeros((20, 20)), {"device": "abacus"}, "device must be one of"),
    ],
)
def test_wrong_pictures(pictures, options, message):
    with pytest.raises(ValueError, match=message):
        PictureStack.prepare(pictures, **{"noise": 1.0, **options})


def test_no_points_are_no_error():
    found = correlate(stack(still()), stack(still()), np.zeros((0, 2)), np.zeros((0, 12)), Correlation())
    assert found.warp.shape == (0, 12)
    assert found.covariance.shape == (0, 2, 2)


def at_rest(u: np.ndarray, sigma: float = 2e-6) -> SurfaceHistory:
    """Points that seem to move by u [n_frames, n_points] in every direction, twice and three times as much
    along y and Z."""
    n_frames, n_points = u.shape
    return SurfaceHistory(
        t=np.arange(n_frames) * 1e-3, X=np.zeros((n_points, 3)), u=u[..., None] * np.array([1.0, 2.0, 3.0]),
        sigma=np.full((n_frames, n_points, 3), sigma), outcome=np.zeros((n_frames, n_points), dtype=np.int64),
    )  # fmt: skip


def test_motion_of_the_cameras_and_noise_in_space_are_told_apart():
    u = 1e-6 * np.array([-1.0, 0.0, 1.0])[:, None] * np.ones(5)
    found = noise_floor(at_rest(u), np.ones(3, dtype=bool))
    # (1 + 0 + 1) / (3 - 1) = 1; nothing is left between the points.
    np.testing.assert_allclose(found.time, [1e-6, 2e-6, 3e-6], rtol=1e-12)
    np.testing.assert_allclose(found.common, [1e-6, 2e-6, 3e-6], rtol=1e-12)
    np.testing.assert_allclose(found.space, 0.0, atol=1e-18)
    np.testing.assert_allclose(found.ratio, [0.5, 1.0, 1.5], rtol=1e-12)
    assert (found.n_frames, found.n_points) == (3, 5)
    u = 1e-6 * np.array([[1.0, -1.0], [-1.0, 1.0], [0.0, 0.0]])
    found = noise_floor(at_rest(u), np.ones(3, dtype=bool))
    np.testing.assert_allclose(found.time[0], 1e-6, rtol=1e-12)  # (1 + 1 + 0) / 2 of either point
    np.testing.assert_allclose(found.common[0], 0.0, atol=1e-18)
    # Squares 4e-12, by 3/2 for the mean through the frames, over 3 frames of 2 - 1 points each.
    np.testing.assert_allclose(found.space[0], np.sqrt(4.0 * 1.5 / 3.0) * 1e-6, rtol=1e-12)


def test_lost_points_and_moving_frames_do_not_count():
    u = 1e-6 * np.array([[-1.0, 50.0], [0.0, 70.0], [1.0, 90.0], [1e3, 1e3]])
    surface = at_rest(u)
    outcome = surface.outcome.copy()
    outcome[1, 1] = 1
    found = noise_floor(replace(surface, outcome=outcome), np.array([True, True, True, False]))
    np.testing.assert_allclose(found.time[0], 1e-6, rtol=1e-12)
    assert (found.n_frames, found.n_points) == (3, 1)
    with pytest.raises(ValueError, match="needs 3 static frames with points, got 2"):
        noise_floor(surface, np.array([True, True, False, False]))


def test_strain_noise_is_that_of_points_with_a_strain_in_every_static_frame():
    result = synthetic_result()
    value = np.zeros_like(result.strain.value)
    rest = np.flatnonzero(result.static)
    ramp = np.zeros(len(rest))
    ramp[:2] = 1e-3 * np.array([1.0, -1.0])
    value[rest] = ramp[:, None, None] * np.array([1.0, 2.0, 3.0])
    value[rest[0], 3] = np.nan  # left out, whatever it says elsewhere
    value[rest[1], 3] = 1.0
    found = replace(result, strain=replace(result.strain, value=value)).strain_noise
    expected = 1e-3 * np.sqrt(2.0 / (len(rest) - 1))
    np.testing.assert_allclose(found, expected * np.array([1.0, 2.0, 3.0]), rtol=1e-12)


RADIUS, HEIGHT, SCALE = 4.75e-3, 6.5e-3, 1.0 / 18e3
NOISE = np.array([1e-6, 1e-6, 4e-6])
SUBSET = 21.0


def symmetry_grid(step=5.0, half=50.0):
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
    points = symmetry_grid()
    place, _ = barrel(points, 0.7e-3)
    found = outline(history(points, place[None]), points, half_width=1.2e-3, subset=SUBSET)
    assert found.Z.size == 20
    assert (np.diff(found.y) > 0.0).all()
    true = RADIUS + 0.7e-3 * (1.0 - (2.0 * found.y / HEIGHT - 1.0) ** 2)
    np.testing.assert_allclose(found.Z, true, atol=1e-12)  # rows of one y on a body of revolution: round-off


def test_the_sigma_of_the_outline_is_that_of_its_errors_and_no_promise_of_dense_columns():
    points = symmetry_grid()
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
    dense = symmetry_grid(step=2.5)
    place, _ = barrel(dense, 0.7e-3)
    more = outline(history(dense, place[None]), dense, half_width=1.2e-3, subset=SUBSET)
    assert more.sigma.mean() == pytest.approx(found.sigma.mean(), rel=0.06)  # the same pixels again


def test_rows_are_those_of_the_picture_whichever_way_the_axis_runs():
    points = symmetry_grid()
    surface = history(points, barrel(points, 0.0)[0][None])
    rows = rows_of(surface, points)
    np.testing.assert_array_equal(rows, np.repeat(np.arange(20), 21))
    upside_down = points * [1.0, -1.0]
    np.testing.assert_array_equal(rows_of(surface, upside_down), rows)
    np.testing.assert_array_equal(rows_of(surface, points[:, ::-1]), rows)


def test_lost_points_leave_the_mean_and_are_counted():
    points = symmetry_grid()
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
    points = symmetry_grid()
    surface = history(points, barrel(points, 0.0)[0][None])
    with pytest.raises(ValueError, match=r"must be"):
        outline(surface, points, **({"half_width": 1e-3, "subset": SUBSET} | options))
