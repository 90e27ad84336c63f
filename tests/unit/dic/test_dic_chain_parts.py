"""Single parts of the chain of pictures: inspection, rows of the outline, clock."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import warp as wp
from boards import averaged, dots, flat, pose
from memory_pictures import Memory
from scipy import ndimage
from scipy.special import ndtr
from speckle_pictures import render, speckle_pattern
from synthetic_dic import rig, synthetic_result
from threadpoolctl import threadpool_info, threadpool_limits

from dic import PointOutcome
from dic.basics import check_interval, check_shape, median
from dic.bodies.body_motion import MotionPrior, Observations, adjust
from dic.bodies.region import Region
from dic.calibration.bundle import View, derivatives, join_views, poses_of, project_points
from dic.calibration.dots import _upper, centroids, quantiles
from dic.calibration.targets import FiducialDots, TargetNotFound
from dic.calibration.views import detect, detect_in_background
from dic.camera import Camera
from dic.chain import ChainError, ChainSettings, Clock
from dic.chain.inputs import check_cameras, inspect_pictures
from dic.chain.test_frame import outline_of
from dic.correlation import Correlation, PictureStack, Shape, Templates, correlate
from dic.correlation.kernels.device import PAD, on_device, on_host, response, select_device
from dic.correlation.subsets import identity
from dic.images import PictureError
from dic.images.series import DecodedPictures, decode_once
from dic.outcome import FrameOutcome
from dic.stereo.diagnose import _median
from dic.stereo.geometry import inverse, largest_eigenvalue
from dic.surfaces.outline import outline
from dic.tracking.rigid import _in_view, _out_of_view
from kolsky.base.process import single_threaded_libraries

SHAPE = (96, 128)
FRAMES = 6
FLOOR, GAIN = 12.0, 0.25  # of the pictures' noise: variance FLOOR² + GAIN grey
SETTINGS = ChainSettings(toward_flyer="left", zero=(60.0, 90.0), strip_half_width=1e-3)
REGION = Region(((10.0, 10.0), (100.0, 10.0), (100.0, 80.0), (10.0, 80.0)))


def at_rest(*, seed: int, floor: float = FLOOR, gain: float = GAIN) -> Memory:
    """A specimen that rests, with known noise."""
    clean = render(speckle_pattern(SHAPE, seed=3), SHAPE, gain=8.0, offset=200.0)  # well within 12 bits
    rng = np.random.default_rng(seed)
    noise = np.sqrt(floor**2 + gain * clean) * rng.standard_normal((FRAMES, *SHAPE))
    return Memory(tuple(np.rint(clean + noise).astype(np.uint16)), bits=12)


def looked(first: Memory, second: Memory, *, frames: int = FRAMES):
    times, static = np.arange(frames) * 1e-3, np.ones(frames, dtype=bool)
    return inspect_pictures((first, second), static).with_cameras(rig(), SETTINGS, times, static)


def without(series: Memory, gone) -> Memory:
    return replace(
        series, frames=tuple(None if k in gone else frame for k, frame in enumerate(series.frames))
    )


def test_a_look_tells_what_is_usable_and_how_noisy_each_camera_is():
    given = looked(at_rest(seed=1), without(at_rest(seed=2, floor=6.0, gain=0.0), [4]))
    assert given.health[0].tolist() == [FrameOutcome.VALID] * FRAMES
    assert given.health[1].tolist() == [FrameOutcome.VALID] * 4 + [
        FrameOutcome.UNREADABLE,
        FrameOutcome.VALID,
    ]
    # A line through 12 288 pixels of five pairs has its slope to 3.6 %: three of these.
    assert given.noise[0].gain == pytest.approx(GAIN, rel=0.11)
    # Rounding adds 1/12 to a variance of 36; the median of four pairs knows sigma to 0.4 %: four of these.
    assert given.grey[1].sigma == pytest.approx(np.hypot(6.0, 12.0**-0.5), rel=0.015)


def test_a_noise_that_does_not_grow_with_the_grey_is_taken_as_one_number():
    given = looked(at_rest(seed=1), at_rest(seed=2))
    falling = replace(given, grey=(replace(given.grey[0], slope=-1e-3), given.grey[1]))
    assert (falling.noise[0].floor, falling.noise[0].gain) == (given.grey[0].sigma, 0.0)
    assert falling.noise[1].gain > 0.0


@pytest.mark.parametrize(
    ("camera", "change", "words"),
    [
        (
            1,
            lambda series: replace(series, frames=series.frames[:-1]),
            "camera 1 has 5 pictures, there are 6",
        ),
        (
            0,
            lambda series: without(series, range(1, FRAMES)),
            r"camera 0: .*5 of 6 pictures cannot be used \(5 unreadable\)",
        ),
        (
            1,
            lambda series: replace(series, frames=series.frames[:1] * FRAMES),
            "camera 1: .*equal to the last",
        ),
    ],
    ids=["too few", "one usable", "copies"],
)
def test_pictures_that_tell_nothing_are_refused_by_camera(camera, change, words):
    both = [at_rest(seed=1), at_rest(seed=2)]
    both[camera] = change(both[camera])
    with pytest.raises(ChainError, match=words):
        looked(*both)


def test_cameras_that_never_saw_the_same_frame_are_refused():
    given = looked(without(at_rest(seed=1), [0, 2, 4]), without(at_rest(seed=2), [1, 3, 5]))
    with pytest.raises(ChainError, match="no frame has a usable picture of both"):
        check_cameras(given, REGION)


def test_rows_of_the_outline_above_the_largest_sigma_are_counted():
    body = synthetic_result().specimen
    whole = outline(
        body.surface,
        body.points,
        half_width=SETTINGS.strip_half_width,
        subset=SETTINGS.subset,
        shape=Shape.QUADRATIC,  # that of the match between the cameras, the higher of both
    )
    assert SETTINGS.stereo.shape is Shape.QUADRATIC
    limit = float(np.median(whole.sigma))
    line, left_out = outline_of(body, replace(SETTINGS, largest_sigma=limit))
    assert left_out == np.sum(whole.sigma > limit) > 0
    for name in ("t", "frame", "y", "Z", "sigma"):
        np.testing.assert_array_equal(getattr(line, name), getattr(whole, name)[whole.sigma <= limit])
    assert outline_of(body, SETTINGS)[1] == 0


def test_a_direction_points_toward_the_flyer_in_the_picture():
    assert SETTINGS.direction == (-1.0, 0.0)  # x to the right, y down
    assert replace(SETTINGS, toward_flyer="down").direction == (0.0, 1.0)


def test_the_clock_has_the_stages_that_ended():
    clock = Clock()
    assert clock("one", lambda: 7) == 7
    with pytest.raises(KeyError):
        clock("two", lambda: {}["nothing"])
    assert list(clock.seconds) == ["one"]
    assert clock.seconds["one"] >= 0.0


SIDE = 96
HOLLOW = ((2, 2), (7, 2), (2, 5))
GRID = FiducialDots(columns=10, rows=8, pitch=1.2e-3, diameter=0.6e-3, hollow=HOLLOW, hole=0.28e-3)


class Counted:
    """A series in memory that counts how often it is read; frame 1 cannot be."""

    path, bits, crop_offset, times = "memory", 8, (0.0, 0.0), None

    def __init__(self, frames):
        self.frames, self.read = frames, 0
        self.n_frames, self.shape = len(frames), frames[0].shape

    def frame(self, index):
        self.read += 1
        if self.frames[index] is None:
            raise PictureError("memory", "is not there", frame=index)
        return self.frames[index]


def test_pictures_are_read_once_up_to_a_limit():
    grey = np.arange(64, dtype=np.uint8).reshape(8, 8)
    series = Counted([grey, None, grey + 1, grey + 2])
    found = DecodedPictures(series, most=2 * grey.nbytes)
    for _ in range(3):
        for index in (0, 2, 3):
            np.testing.assert_array_equal(found.frame(index), series.frames[index])
        with pytest.raises(PictureError, match="frame 1"):
            found.frame(1)
    assert series.read == 1 + 1 + 3 + 3  # two kept, one beyond the limit, one that fails
    assert not found.frame(0).flags.writeable
    assert decode_once(found) is found
    assert (found.n_frames, found.shape, found.bits) == (4, (8, 8), 8)


def pair(shift=0.3):
    pattern = speckle_pattern((SIDE, SIDE), seed=3)
    first = render(pattern, (SIDE, SIDE), noise=2.0, seed=1)
    second = render(pattern, (SIDE, SIDE), material=lambda x: x - shift, noise=2.0, seed=2)
    return [PictureStack.prepare(picture, noise=2.0) for picture in (first, second)]


def points():
    """Inside, at the rim and beyond it."""
    along = np.arange(2.0, SIDE, 9.0)
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def same(a, b):
    for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@pytest.mark.parametrize("shape", list(Shape))
def test_kept_templates_give_the_same_bits(shape):
    first, second = pair()
    where, settings = points(), Correlation(subset=15, shape=shape)
    mask = np.ones((SIDE, SIDE), dtype=bool)
    mask[:, :10] = False
    reference = identity(len(where))
    reference[:, 2] = 0.02
    options = {"reference_warp": reference, "mask": mask}
    guess = reference.copy()
    once = correlate(first, second, where, guess, settings, **options)
    templates = Templates.of(len(where), settings)
    for shift in (0.0, 0.2, 40.0):  # 40 px: most subsets leave the picture, and N is that of a part
        moved = guess.copy()
        moved[:, 0] += shift
        fresh = correlate(first, second, where, moved, settings, **options)
        same(fresh, correlate(first, second, where, moved, settings, templates=templates, **options))
    assert templates.known.any()
    rows = np.flatnonzero(once.outcome == PointOutcome.VALID)[::-2]
    part = {"reference_warp": reference[rows], "mask": mask}
    again = correlate(
        first, second, where[rows], guess[rows], settings, templates=templates, template_rows=rows, **part
    )
    np.testing.assert_array_equal(again.warp, once.warp[rows])


def test_templates_are_for_their_settings_and_rows_until_they_are_forgotten():
    first, second = pair()
    where, settings = np.array([[40.0, 40.0], [60.0, 50.0]]), Correlation(subset=15)
    templates = Templates.of(2, settings)
    correlate(first, second, where, identity(2), settings, templates=templates)
    stale = correlate(second, first, where, identity(2), settings, templates=templates)
    templates.forget(np.array([0]))
    found = correlate(second, first, where, identity(2), settings, templates=templates)
    fresh = correlate(second, first, where, identity(2), settings)
    assert np.any(stale.warp[0] != fresh.warp[0])  # so the templates are used
    np.testing.assert_array_equal(found.warp[0], fresh.warp[0])
    np.testing.assert_array_equal(found.warp[1], stale.warp[1])
    where, settings = np.array([[40.0, 40.0]]), Correlation(subset=15)
    templates = Templates.of(1, settings)
    with pytest.raises(ValueError, match="templates are for"):
        correlate(first, second, where, identity(1), Correlation(subset=17), templates=templates)
    with pytest.raises(ValueError, match="from 0 to 0"):
        correlate(first, second, where, identity(1), settings, templates=templates, template_rows=[1])
    assert Templates.of(10_000_000, settings) is None  # 10 GB


def test_a_search_that_cannot_end_is_not_continued():
    first, _ = pair()
    other = PictureStack.prepare(
        render(speckle_pattern((SIDE, SIDE), seed=8), (SIDE, SIDE), noise=2.0), noise=2.0
    )
    where = points()
    where = where[np.all((where > 20.0) & (where < SIDE - 20.0), axis=1)]
    settings = Correlation(subset=15, shape=Shape.QUADRATIC, max_iterations=100)
    found = correlate(first, other, where, identity(len(where)), settings)
    lost = found.outcome == PointOutcome.NOT_CONVERGED
    assert lost.any()
    assert np.all(found.iterations[lost] < 100)
    assert np.median(found.iterations[lost]) < 30  # its pace is judged from the seventh update on


def test_a_subset_beyond_the_picture_is_not_searched():
    first, second = pair()
    guess = identity(1)
    guess[0, 0] = 200.0
    found = correlate(first, second, [[40.0, 40.0]], guess, Correlation(subset=15))
    assert (found.outcome[0], found.iterations[0]) == (PointOutcome.OUT_OF_VIEW, 0)


def test_joined_stacks_share_their_coefficients():
    first, second = pair()
    both = PictureStack.join([first, second])
    assert both.coefficients[0] is first.coefficients[0]
    assert both.memory == first.memory + second.memory
    where = np.array([[40.0, 40.0], [60.0, 50.0]])
    options = {"settings": Correlation(subset=15), "guess": identity(2)}
    alone = correlate(first, second, where, **options)
    same(alone, correlate(both, both, where, reference_picture=0, deformed_picture=1, **options))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_quantiles_are_numpy_s(dtype):
    values = np.random.default_rng(1).integers(0, 200, 4999).astype(dtype)
    shares = (0.0, 0.013, 0.5, 0.987, 1.0)
    np.testing.assert_allclose(quantiles(values, shares), np.quantile(values, shares), rtol=1e-12)


def board(turn=(0.2, -0.3, 0.1), noise=1.0):
    R, t = pose(turn, (5.4e-3, 4.2e-3), 0.095)
    return averaged(flat(dots(10, 8, 1.2e-3, 0.6e-3, HOLLOW, 0.28e-3), R, t), noise=noise)


def test_a_centroid_does_not_depend_on_the_dots_located_with_it():
    y, x = np.mgrid[:80, :120]
    image = np.full((80, 120), 200.0)
    ellipses = np.array(
        [[20.3, 20.8, 13.0, 11.0, 30.0], [60.1, 40.4, 25.0, 25.0, 0.0], [100.0, 60.0, 9.0, 8.0, 0.0],
         [4.0, 70.0, 9.0, 9.0, 0.0]]
    )  # fmt: skip
    for x0, y0, a, b, angle in ellipses:
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        u, v = c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0)
        image -= 150.0 / (
            1.0 + np.exp(np.clip(4.0 * (np.hypot(2 * u / a, 2 * v / b) - 1.0) * b / 2, -50, 50))
        )
    together = centroids(image, ellipses, 0.5)
    apart = np.concatenate([centroids(image, ellipse[None], 0.5) for ellipse in ellipses])
    np.testing.assert_allclose(together, apart, rtol=1e-9)  # sums of differently padded rows
    # Each dot is symmetric about its centre, sampled at whole pixels: an edge of 0.5 px leaves some mpx.
    np.testing.assert_allclose(together[:3, :2], ellipses[:3, :2], atol=0.01)


def test_series_are_detected_as_picture_by_picture():
    blank = np.full((240, 320), 128, dtype=np.uint8)
    series = [Counted([board(), blank, board((0.1, 0.2, 0.3))]), Counted([board((0.0, 0.3, 0.0)), None])]
    told = []
    with detect_in_background(series, (GRID, GRID)) as views:
        found = views(lambda done, total: told.append((done, total)))
    assert [len(views) for views in found] == [3, 2]
    assert isinstance(found[0][1], TargetNotFound)
    assert isinstance(found[1][1], PictureError)
    assert told == [(k, 5) for k in range(1, 6)]
    for view, picture in ((found[0][2], series[0].frames[2]), (found[1][0], series[1].frames[0])):
        alone = detect(picture, GRID)
        np.testing.assert_array_equal(view.ids, alone.ids)
        np.testing.assert_array_equal(view.pixels, alone.pixels)


def test_views_joined_are_the_views_one_by_one():
    camera = Camera(fx=2000.0, fy=2010.0, cx=160.0, cy=120.0, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    g = GRID.geometry()
    poses = {k: pose((0.2 * k, 0.1, 0.05), (5.4e-3, 4.2e-3), 0.095) for k in range(3)}
    views = [
        View(k, 0, ids, g.points[ids], g.normals[ids], g.spread[ids], g.bend[ids], np.zeros((len(ids), 2)),
              np.ones(len(ids)))
        for k, ids in enumerate((np.arange(80), np.arange(5, 30), np.arange(1)))
    ]  # fmt: skip
    view, (R, t) = join_views(views), poses_of(views, poses)
    np.testing.assert_allclose(
        project_points(camera, view, R, t),
        np.concatenate([project_points(camera, v, *poses[v.pair]) for v in views]),
        rtol=1e-12,
    )
    for whole, parts in zip(
        derivatives(camera, view, R, t),
        zip(*(derivatives(camera, v, *poses[v.pair]) for v in views), strict=True),
        strict=True,
    ):
        np.testing.assert_allclose(whole, np.concatenate(parts), rtol=1e-9, atol=1e-9)


def test_poses_leave_out_what_is_far_off_and_settle():
    rng = np.random.default_rng(4)
    X, n, sigma = rng.uniform(-2e-3, 2e-3, (12, 3)), 5, 1e-6
    turn = np.linspace(0.0, 0.02, n)
    R = np.array([cv2.Rodrigues(np.array([0.0, 0.0, a]))[0] for a in turn])
    p = np.stack([1e-4 * np.arange(n), np.zeros(n), np.zeros(n)], axis=1)
    x = np.einsum("kab,ib->kia", R, X) + p[:, None] + rng.normal(0.0, sigma, (n, 12, 3))
    x[2, 5] += 40.0 * sigma
    valid = np.ones((n, 12), dtype=bool)
    W = np.broadcast_to(np.eye(3) / sigma**2, (n, 12, 3, 3))
    found = adjust(Observations(x, W, valid, ~valid, np.ones((n, 12))), MotionPrior(None, None), 5.0)
    assert found.count.tolist() == [12, 12, 11, 12, 12]
    relative = np.einsum("kab,cb->kac", found.R, found.R[0])
    # a direction over 12 points some mm apart is known to 1e-6 / (1.3e-3 sqrt 12) = 0.2 mrad; five of that
    np.testing.assert_allclose([cv2.Rodrigues(r)[0][2, 0] for r in relative], turn, atol=1.2e-3)


def blas_threads():
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_the_libraries_get_their_threads_back():
    assert blas_threads()  # NumPy has loaded one, or nothing would be tested
    usual, inside = cv2.getNumThreads(), []

    def fails():
        with single_threaded_libraries():
            inside.extend([cv2.getNumThreads(), *blas_threads()])
            raise RuntimeError

    cv2.setNumThreads(2)
    try:
        with threadpool_limits(limits=2, user_api="blas"):
            with pytest.raises(RuntimeError):
                fails()
            assert set(inside) == {1}
            assert {cv2.getNumThreads(), *blas_threads()} == {2}
    finally:
        cv2.setNumThreads(usual)


def test_subsets_that_cannot_be_in_view_are_those_the_search_finds_out_of_view():
    """No point that a match would have found is spared it, and what is spared has the match's own numbers."""
    first, _ = pair()
    where, settings = points(), Correlation(subset=15, shape=Shape.RIGID, least_pixels=0.4)
    spared = 0
    for along in np.arange(-110.0, 111.0, 11.0):
        guess = identity(len(where))
        guess[:, 1], guess[:, 2], guess[:, 5] = along, 0.05, -0.3  # flattened, as from another camera
        still = np.where(np.arange(12) == 1, 0.0, guess)
        match = correlate(first, first, where, guess, settings, reference_warp=still)
        out = ~_in_view(where, guess, first.shape, settings)
        spared += int(out.sum())
        empty = _out_of_view(guess)
        for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
            np.testing.assert_array_equal(getattr(match, name)[out], getattr(empty, name)[out])
    assert spared > 500


def test_normal_distribution_of_the_disc_fit():
    x = np.linspace(-12.0, 12.0, 4801, dtype=np.float32)
    found = _upper(x, np.exp(-0.5 * x * x))
    # Hastings' bound, 1.5e-7 of erf, halved; the rest is rounding to fp32.
    np.testing.assert_allclose(found, ndtr(-x.astype(np.float64)), atol=3e-7)


def test_two_by_two_matrices_in_closed_form_are_those_of_lapack():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(50, 2, 2))
    whole = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(2)
    part = np.diag([2.0, 0.5]) @ whole
    # conditions up to some hundred: what is lost to rounding is some hundred times 1e-16
    np.testing.assert_allclose(inverse(whole), np.linalg.inv(whole), rtol=1e-12)
    ratio = inverse(whole) @ part @ whole  # similar to a symmetric matrix: its eigenvalues are real
    expected = np.linalg.eigvals(ratio).real.max(axis=1)
    np.testing.assert_allclose(largest_eigenvalue(ratio), expected, rtol=1e-12)
    assert largest_eigenvalue(np.eye(2)[None]) == 1.0


@pytest.mark.parametrize("where", ["host", "device"])
@pytest.mark.parametrize("prefilter", [0.0, 0.8])
@pytest.mark.parametrize("shape", [(8, 8), (9, 40), (SIDE, SIDE)])
def test_coefficients_are_those_of_the_recursive_filter(shape, prefilter, where):
    grey = np.random.default_rng(7).uniform(3000.0, 4095.0, shape).astype(np.float32)
    smooth = grey.astype(np.float64)
    if prefilter:
        smooth = ndimage.gaussian_filter(smooth, prefilter, mode="mirror", truncate=4.0)
    plain = ndimage.spline_filter(smooth, order=5, mode="mirror")
    if where == "host":
        found = on_host(grey, prefilter)
    else:  # the kernels of a GPU, on the processor
        other = grey[::-1] + np.float32(40.0)  # each has a level of its own
        found = on_device([other, grey], prefilter, select_device("cpu")).numpy()[1]
    assert found.shape[1] % 16 == 0
    beyond = found.shape[1] - shape[1] - PAD  # a small picture is mirrored more than once
    expected = np.pad(plain, ((PAD, PAD), (PAD, beyond)), mode="reflect")
    # fp32 of a contrast of 550 grey, times the filter's 50 over both axes
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.01)
    if not prefilter:  # and a spline through them is the picture again
        again = ndimage.map_coordinates(
            found[PAD:-PAD, PAD : PAD + shape[1]].astype(np.float64),
            np.indices(shape, dtype=np.float64), order=5, mode="mirror", prefilter=False,
        )  # fmt: skip
        np.testing.assert_allclose(again, grey, rtol=0, atol=0.002)


def test_pictures_go_to_a_device_in_two_launches(monkeypatch):
    counted = []
    launch = wp.launch

    def noted(*given, **options):
        counted.append(1)
        return launch(*given, **options)

    monkeypatch.setattr(wp, "launch", noted)
    on_device([np.ones((40, 50), np.float32)] * 5, 0.0, select_device("cpu"))
    assert len(counted) == 2


def test_the_response_of_the_filter_adds_up_to_one_and_is_the_inverse_of_the_spline():
    side = response(0.0)
    whole = np.concatenate([side[:0:-1], side])
    assert whole.sum() == pytest.approx(1.0, abs=1e-14)
    spline = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0  # the quintic B-spline at whole numbers
    impulse = np.eye(1, len(whole) + 4, len(whole) // 2 + 2)[0]
    assert np.convolve(whole, spline) == pytest.approx(impulse, abs=1e-7)


@pytest.mark.filterwarnings("ignore:All-NaN")
@pytest.mark.parametrize("axis", [0, 1, -1])
def test_medians_are_those_of_the_numbers_that_are_there(axis):
    rng = np.random.default_rng(6)
    values = rng.normal(size=(31, 12, 5))
    values[rng.random(values.shape) < 0.4] = np.nan
    values[3], values[:, 4] = np.nan, np.nan
    np.testing.assert_array_equal(_median(values, axis), np.nanmedian(values, axis=axis))


@pytest.mark.parametrize("n", [1, 2, 7, 8])
def test_a_median_is_numpy_s(n):
    values = np.random.default_rng(n).standard_normal((n, 3))
    np.testing.assert_array_equal(median(values), np.median(values, axis=0))
    np.testing.assert_array_equal(median(values.T, axis=-1), np.median(values.T, axis=-1))
    assert float(median(values[:, 0])) == np.median(values[:, 0])


def test_the_ends_of_an_interval():
    for allowed, ends in (("[0, 1] s", (0.0, 1.0)), ("[0, 1)", (0.0,)), ("(0, 1]", (1.0,)), ("(0, 1)", ())):
        for value in (0.0, 1.0):
            if value in ends:
                check_interval(allowed, x=value)
            else:
                with pytest.raises(ValueError, match=f"got {value:g}$"):
                    check_interval(allowed, x=value)
    check_interval("(0, 1)", x=[], y=0.5)
    with pytest.raises(ValueError, match="y must be finite, got nan at 1, 0"):
        check_shape((2, 1), x=np.zeros((2, 1)), y=[[0.0], [np.nan]])
