"""The stereo match on rendered cylinders with a known answer for every ray."""

from dataclasses import fields, replace

import numpy as np
import pytest
from epipolar_numpy import points_along, shows
from epipolar_numpy import search as search_in_numpy
from numpy.typing import NDArray
from stereo_scene import CYLINDER, DISTANCE, FOCAL, NOISE, RADIUS, SHAPE, grid, pictures, rig, truth

from dic.camera import Camera, StereoRig
from dic.correlation import Correlation, Shape
from dic.correlation.subsets import Match, apply, identity
from dic.outcome import PointOutcome
from dic.stereo.epipolar_search import (
    Candidates,
    StereoGates,
    StereoSearch,
    distance_along,
    facet_geometry,
    fit_facet,
    gradient,
    ideal_box,
    normals,
    search,
    subsets,
    visible_piece,
)
from dic.stereo.geometry import directions, triangulate
from dic.stereo.match import (
    Gate,
    GateValues,
    StereoMatch,
    disagreement,
    failed_gates,
    match_stereo,
    neighbourhood,
    propagate,
)

QUADRATIC = Correlation(subset=21, shape=Shape.QUADRATIC)


def matched(angle: float = 12.5, settings: Correlation = QUADRATIC, **options: object) -> StereoMatch:
    return match_stereo(*pictures(angle), grid(), rig(angle), settings, noise=NOISE, **options)


@pytest.fixture(scope="module", params=[12.5, 30.0])
def case(request: pytest.FixtureRequest) -> tuple[float, StereoMatch]:
    return request.param, matched(request.param)


def test_every_point_is_found_on_the_cylinder_with_its_slope(case: tuple[float, StereoMatch]) -> None:
    angle, match = case
    exact = truth(grid(), angle)
    seen = np.all((exact > 10.0) & (exact < SHAPE[1] - 11.0), axis=1)  # whole subsets in both pictures
    assert match.valid[seen].all()
    assert seen.sum() > 80
    error = apply(match.points, match.warp) - exact
    sigma = np.sqrt(np.einsum("nii->ni", match.covariance))
    plain = seen & (match.gate_values.incidence < np.radians(40.0))
    scaled = error[plain] / sigma[plain]
    # 100 to 160 correlated points (subsets of 21 px every 8 px): the spread is known to about 15 %
    assert 0.8 < scaled.std() < 1.25
    # five standard errors of the mean of some twenty independent subsets, sigma = 4 mpx
    assert np.abs(error[plain].mean(axis=0)).max() < 5.0e-3
    # what a quadratic shape function leaves of the cylinder's steep flanks is below 0.05 px
    assert np.abs(error[match.valid]).max() < 0.05
    some = match.valid
    pixels = match.points[some], apply(match.points, match.warp)[some]
    X = triangulate(rig(angle), *pixels, np.eye(2) * 1e-6, match.covariance[some]).position
    off = np.hypot(X[:, 0], X[:, 2]) - RADIUS
    assert np.abs(off).max() < 8e-6  # noise 1.0 µm, five sigma; a false match is off by a speckle, 350 µm
    X = CYLINDER.hit(rig(angle).cameras[0], grid())
    n = CYLINDER.normal(X)
    to = [camera.centre - X for camera in rig(angle).cameras]
    exact = np.max([np.arccos(np.sum(n * t, axis=1) / np.linalg.norm(t, axis=1)) for t in to], axis=0)
    off = (match.gate_values.incidence - exact)[match.valid]
    # noise of the gradients over the angle between the cameras: 5e-4 / sin(12.5°) = 2e-3 rad, five sigma
    assert np.abs(off).max() < 1.5e-2


@pytest.mark.parametrize("subset", [15, 31])
def test_an_affine_shape_function_sees_the_cylinder_too_small_by_its_mean_sagitta(subset: int) -> None:
    match = matched(settings=Correlation(subset=subset))
    some = match.valid & (match.gate_values.incidence < np.radians(30.0))
    pixels = match.points[some], apply(match.points, match.warp)[some]
    X = triangulate(rig(), *pixels, np.eye(2) * 1e-6, match.covariance[some]).position
    bias = np.median(np.hypot(X[:, 0], X[:, 2])) - RADIUS
    width = subset * (0.3 - RADIUS) / 5400.0
    # a plane fitted to x²/2R over the width w lies w²/24R lower than the middle; the slope of the surface
    # lengthens w by up to 1/cos 30° and 13 % on average
    assert bias == pytest.approx(-(width**2) / (24.0 * RADIUS), rel=0.2)


def test_pictures_of_different_surfaces_have_no_match() -> None:
    other = pictures(seed=4)[1]
    eager = StereoSearch(least_zncc=0.0, distinct=0.999)
    anything = replace(QUADRATIC, least_zncc=0.0)
    match = match_stereo(pictures()[0], other, grid(step=6), rig(), anything, noise=NOISE, search=eager)
    assert not match.valid.any()


def test_a_pattern_that_repeats_is_not_unique() -> None:
    def stripes(arc: np.ndarray, height: np.ndarray) -> np.ndarray:
        return 0.5 + 0.2 * (np.sin(2e4 * arc) + np.sin(2e4 * height))  # 0.31 mm, 5.7 px

    views = [CYLINDER.picture(camera, SHAPE, stripes, oversample=2) for camera in rig().cameras]
    eager = StereoSearch(distinct=0.999)
    match = match_stereo(*views, grid(step=16), rig(), QUADRATIC, noise=NOISE, search=eager)
    converged = match.failed != Gate.CORRELATION
    assert converged.any()
    assert not match.valid.any()
    assert np.all(match.failed[converged] & int(Gate.UNIQUENESS) != 0)


def test_a_camera_that_has_turned_fails_the_epipolar_gate() -> None:
    first, second = rig().cameras
    roll = np.radians(1.0)
    turn = np.array([[np.cos(roll), -np.sin(roll), 0.0], [np.sin(roll), np.cos(roll), 0.0], [0.0, 0.0, 1.0]])
    turned = replace(second, rotation=turn @ second.rotation, translation=turn @ second.translation)
    wide = StereoGates(epipolar=3.0)
    wrong = StereoRig((first, turned))
    match = match_stereo(*pictures(), grid(), wrong, QUADRATIC, noise=NOISE, gates=wide)
    # the roll moves points by their distance from the axis times 1°, up to 48 px x 0.0175 = 0.84 px
    central = match.valid & (np.abs(match.points[:, 1] - 63.5) < 20.0)
    assert central.any()
    # the epipolar lines are level within the angle that they converge by, 1 px in 60
    off = match.gate_values.epipolar[central]
    np.testing.assert_allclose(
        np.abs(off), np.abs(apply(match.points, match.warp)[central, 0] - 63.5) * roll, atol=0.05
    )
    strict = match_stereo(*pictures(), grid(), wrong, QUADRATIC, noise=NOISE)
    far = np.abs(apply(match.points, match.warp)[:, 0] - 63.5) > 35.0  # 0.61 px: the gate and its sigmas
    assert far.any()
    assert not strict.valid[far].any()


def test_a_warp_of_camera_0_is_carried_through() -> None:
    shift = np.array([3.0, -2.0])
    plain = matched()
    warp = identity(len(grid()))
    warp[:, :2] = shift
    moved = match_stereo(*pictures(), grid() - shift, rig(), QUADRATIC, noise=NOISE, reference_warp=warp)
    assert np.array_equal(plain.valid, moved.valid)
    places = [apply(match.points, match.warp)[match.valid] for match in (plain, moved)]
    # the same subsets with another name; float32 and the tolerance of the search
    np.testing.assert_allclose(places[0], places[1], atol=2e-3)


def test_a_point_that_camera_0_has_lost_has_no_guess_and_changes_nothing_else() -> None:
    warp = identity(len(grid()))
    warp[5] = np.nan
    match = matched(reference_warp=warp)
    assert match.outcome[5] == PointOutcome.NO_FIRST_GUESS
    assert match.failed[5] == Gate.CORRELATION
    others = np.arange(len(warp)) != 5
    assert np.array_equal(match.outcome[others], matched().outcome[others])


def test_nothing_outside_the_declared_distances() -> None:
    along = matched().gate_values.distance
    middle = float(np.median(along[np.isfinite(along)]))
    match = matched(search=StereoSearch(distances=(middle, middle + 0.01)))
    assert match.valid.any()
    assert np.all(match.gate_values.distance[match.valid] >= middle)
    assert match.count()[Gate.DISTANCE] > 0


def test_a_mask_keeps_what_lies_outside_away() -> None:
    first, second = (picture.copy() for picture in pictures())
    rng = np.random.default_rng(8)
    first[:60], second[:60] = rng.random((2, 60, SHAPE[1]))  # something else, up to a line
    mask = np.zeros(SHAPE, dtype=bool)
    mask[61:] = True
    points = grid() + np.array([0.0, 2.0])
    points = points[points[:, 1] > 61.0]
    match = match_stereo(first, second, points, rig(), QUADRATIC, noise=NOISE, mask=mask)
    near_edge = points[:, 1] < 67.0
    exact = truth(points)
    seen = np.all((exact > 10.0) & (exact < SHAPE[1] - 11.0), axis=1)
    assert near_edge.any()
    assert match.valid[seen].all()
    # half a subset or a little more: twice the noise of a whole one, and five sigma
    assert np.abs(apply(points, match.warp) - exact)[seen].max() < 0.06


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"settings": Correlation(shape=Shape.RIGID)}, "AFFINE or QUADRATIC"),
        ({"reference_warp": np.zeros((3, 12))}, "reference_warp must have shape"),
    ],
)
def test_what_cannot_be_asked_is_refused(options: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        matched(**options)
    with pytest.raises(ValueError, match="points must be finite"):
        match_stereo(*pictures(), [[np.nan, 1.0]], rig(), QUADRATIC, noise=NOISE)


FloatArray = NDArray[np.float64]

PIXELS = np.array([[20.0, 30.0], [64.0, 64.0], [110.0, 15.0]])
DISTANCES = np.array([0.29, 0.297, 0.302])
NORMALS = np.array([[0.3, 0.1, 1.0], [-0.5, 0.2, 0.8], [0.0, -0.4, 1.0]])


def on_plane(pixels: FloatArray, X: FloatArray, n: FloatArray) -> FloatArray:
    """Where camera 1 sees what camera 0 sees at `pixels` of planes through X with normals n."""
    first, second = rig().cameras
    ideal = first.undistort(pixels)
    ray = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ first.rotation
    s = np.sum(n * (X - first.centre), axis=-1) / np.sum(n * ray, axis=-1)
    return second.project(first.centre + s[..., None] * ray)


def test_the_gradient_is_that_of_rays_cut_with_the_plane() -> None:
    seen = facet_geometry(rig(), PIXELS, DISTANCES)
    A = gradient(seen, DISTANCES, NORMALS)
    h = 0.01
    for k, step in enumerate(np.eye(2) * h):
        ends = [on_plane(PIXELS + sign * step, seen.X, NORMALS) for sign in (1.0, -1.0)]
        # central differences over 0.02 px: third order of the homography, 1e-4 px² of curvature
        np.testing.assert_allclose(A[..., k], (ends[0] - ends[1]) / (2.0 * h), atol=1e-7)


def test_a_gradient_gives_its_facet_back() -> None:
    A = gradient(facet_geometry(rig(), PIXELS, DISTANCES), DISTANCES, NORMALS)
    fit = fit_facet(rig(), PIXELS, DISTANCES, A)
    unit = NORMALS / np.linalg.norm(NORMALS, axis=1, keepdims=True)
    np.testing.assert_allclose(fit.normal, unit, atol=1e-9)  # round-off over the sine of 12.5°
    np.testing.assert_allclose(fit.across, 0.0, atol=1e-10)
    X = facet_geometry(rig(), PIXELS, DISTANCES).X
    for camera, angle in zip(rig().cameras, fit.incidence, strict=True):
        to = camera.centre - X
        cosine = np.sum(unit * to, axis=1) / np.linalg.norm(to, axis=1)
        np.testing.assert_allclose(np.cos(angle), cosine, atol=1e-9)


def test_a_turn_of_the_subset_is_no_facet() -> None:
    A = gradient(facet_geometry(rig(), PIXELS, DISTANCES), DISTANCES, NORMALS)
    turned = A.copy()
    turned[:, 1, 0] += 0.05  # the epipolar lines are level to a few degrees: this is across them
    across = fit_facet(rig(), PIXELS, DISTANCES, turned).across
    np.testing.assert_allclose(across, 0.05, rtol=0.02)


def test_normals_face_the_cameras_alike_and_turn_by_what_is_asked() -> None:
    X = facet_geometry(rig(), PIXELS, DISTANCES).X
    n = normals(rig(), X, np.radians([[0.0, 0.0], [30.0, 0.0], [0.0, 20.0]]))
    to = [camera.centre - X for camera in rig().cameras]
    cosines = [np.einsum("nhk,nk->nh", n, t / np.linalg.norm(t, axis=1, keepdims=True)) for t in to]
    np.testing.assert_allclose(cosines[0][:, 0], cosines[1][:, 0], atol=1e-12)
    np.testing.assert_allclose(np.sum(n[:, 0] * n[:, 1], axis=1), np.cos(np.radians(30.0)), atol=1e-12)
    np.testing.assert_allclose(np.sum(n[:, 0] * n[:, 2], axis=1), np.cos(np.radians(20.0)), atol=1e-12)
    base = rig().cameras[1].centre - rig().cameras[0].centre
    across = np.cross(X - rig().cameras[0].centre, base)
    np.testing.assert_allclose(np.sum(n[:, 1] * across, axis=1), 0.0, atol=1e-12)


def test_distance_is_measured_along_the_line_of_sight() -> None:
    X = facet_geometry(rig(), PIXELS, DISTANCES).X
    np.testing.assert_allclose(distance_along(rig(), PIXELS, X), DISTANCES, rtol=1e-12)
    np.testing.assert_allclose(rig().cameras[0].project(X), PIXELS, atol=1e-8)


def lattice(n: int = 6, step: float = 10.0) -> FloatArray:
    x = np.arange(n) * step
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


def bent(points: FloatArray) -> FloatArray:
    """Affine parts of the warps of a displacement of second order."""
    x, y = points.T
    warp = np.zeros((len(points), 12))
    warp[:, 0] = 3.0 + 0.1 * x - 0.05 * y + 1e-3 * x * x - 2e-3 * x * y
    warp[:, 1] = -1.0 + 0.02 * x + 5e-4 * y * y
    warp[:, 2], warp[:, 3] = 0.1 + 2e-3 * x - 2e-3 * y, -0.05 - 2e-3 * x
    warp[:, 4], warp[:, 5] = 0.02, 1e-3 * y
    return warp


def test_neighbours_agree_on_a_second_order_and_see_the_one_elsewhere() -> None:
    points = lattice()
    near, valid = neighbourhood(points, 8), np.ones(36, dtype=bool)
    np.testing.assert_allclose(disagreement(points, bent(points), near, valid), 0.0, atol=1e-12)
    points, warp = lattice(), bent(lattice())
    warp[14, :2] += (0.9, -1.2)
    valid = np.ones(36, dtype=bool)
    valid[0] = False
    off = disagreement(points, warp, neighbourhood(points, 8), valid)
    assert off[14] == pytest.approx(1.5)
    assert np.isinf(off[0])
    others = np.delete(np.arange(36), [0, 14])
    assert off[others].max() < 1e-12  # a median: one of eight does not move it


def test_the_best_neighbour_hands_on_first_and_islands_are_left() -> None:
    points = np.concatenate([lattice(3), lattice(2) + 500.0])
    warp = np.zeros((13, 12))
    match = Match(warp, np.zeros((13, 2, 2)), np.zeros(13), np.zeros(13, np.int64), np.zeros(13, np.int64))
    found = np.zeros(13, dtype=bool)
    found[[0, 8]] = True
    match.warp[0, 0], match.zncc[0] = 1.0, 0.8
    match.warp[8, 0], match.zncc[8] = 2.0, 0.9
    asked: list[tuple[int, float]] = []

    def attempt(rows: NDArray[np.int64], guess: FloatArray) -> tuple[Match, NDArray[np.bool_]]:
        asked.extend(zip(rows.tolist(), guess[:, 0].tolist(), strict=True))
        n = len(rows)
        result = Match(
            guess, np.zeros((n, 2, 2)), np.full(n, 0.95), np.ones(n, np.int64), np.zeros(n, np.int64)
        )
        return result, rows != 4

    guessed = propagate(match, points, neighbourhood(points, 8), 3, attempt, found)
    first = dict(reversed(asked))
    assert first[4] == 2.0  # the middle, beside both: the better correlated one leads
    assert sum(row == 4 for row, _ in asked) == 3  # never believed, given up after three
    assert found[[1, 2, 3, 5, 6, 7]].all()
    assert not found[4]
    assert guessed[:9].all()
    assert not guessed[9:].any()


GOOD = {
    "sigma": 0.01, "epipolar": 0.1, "epipolar_sigma": 0.01, "facet": 0.1, "incidence": 0.5,
    "back_match": 0.01, "neighbours": 0.02, "distinct": 0.1, "distance": 0.3, "unseen": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "value", "gate"),
    [
        ("epipolar", -0.55, Gate.EPIPOLAR),
        ("facet", 1.05, Gate.FACET),
        ("incidence", 1.35, Gate.FACET),
        ("back_match", 0.55, Gate.BACK_MATCH),
        ("neighbours", np.inf, Gate.NEIGHBOURS),
        ("distinct", 0.61, Gate.UNIQUENESS),
        ("distance", 0.41, Gate.DISTANCE),
        ("unseen", 0.2, Gate.VIEW),
    ],
)
def test_each_gate_closes_for_its_own_number_alone(name: str, value: float, gate: Gate) -> None:
    values = {field.name: np.array([GOOD[field.name], GOOD[field.name]]) for field in fields(GateValues)}
    assert set(values) == set(GOOD)
    values[name][1] = value
    assert failed_gates(GateValues(**values), StereoGates(), (0.2, 0.4)).tolist() == [0, gate]
    values[name][1] = np.nan
    if name not in ("sigma", "epipolar_sigma"):
        assert failed_gates(GateValues(**values), StereoGates(), (0.2, 0.4))[1] == gate


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: StereoSearch(distances=(0.4, 0.3)), "distances must be two positive lengths"),
        (lambda: StereoSearch(stretching_turns=()), "turns must be at least one"),
        (lambda: StereoSearch(seeds=0), "seeds must be at least 1, got 0"),
        (lambda: StereoSearch(subset=20), "subset must be odd"),
        (lambda: StereoGates(epipolar=0.0), "epipolar must be a positive distance"),
        (lambda: StereoGates(distinct=1.5), "distinct must be above 0, at most 1, got 1.5"),
        (lambda: StereoGates(incidence=95.0), "incidence must be above 0, at most 90"),
    ],
)
def test_settings_out_of_range_are_refused(make, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


LIMITS = (0.015, 6.0)


def _side_by_side(focal: float, baseline: float, columns: int) -> StereoRig:
    """Parallel cameras along x, the principal points in the middle."""
    cameras = [
        Camera(focal, focal, 0.5 * (columns - 1), 0.5 * (columns - 1), translation=np.array([-x, 0.0, 0.0]))
        for x in (0.0, baseline)
    ]
    return StereoRig((cameras[0], cameras[1]))


def test_parallel_cameras_show_disparities_from_zero_to_the_border() -> None:
    focal, baseline, columns = 6000.0, 0.08, 101
    pair = _side_by_side(focal, baseline, columns)
    d = directions(pair.cameras[0], np.array([[50.0, 50.0], [80.0, 50.0]]))
    piece = visible_piece(pair, d, (columns, columns), (1.0, 1000.0))
    # x1 = x0 - f b q: from the farthest limit to the left border, which lies 2 % of the width farther out
    room = 0.02 * (columns - 1)
    np.testing.assert_allclose(piece[0], [1e-3, (50.0 + room) / (focal * baseline)], rtol=1e-4)
    np.testing.assert_allclose(piece[1, 1], (80.0 + room) / (focal * baseline), rtol=1e-4)


@pytest.mark.parametrize("angle", [4.0, 12.5, 30.0])
def test_all_that_a_dense_walk_sees_lies_in_the_piece(angle: float) -> None:
    pair, pixels = rig(angle), grid(24, 8)
    piece = visible_piece(pair, directions(pair.cameras[0], pixels), SHAPE, LIMITS)
    q = np.broadcast_to(np.linspace(1.0 / LIMITS[1], 1.0 / LIMITS[0], 20000), (len(pixels), 20000))
    seen = shows(pair.cameras[1], points_along(pair, pixels, 1.0 / q), SHAPE)
    assert seen.any(axis=1).sum() > 8
    for row in np.flatnonzero(seen.any(axis=1)):
        where = q[row, seen[row]]
        assert piece[row, 0] <= where[0]
        assert where[-1] <= piece[row, 1]
        # the box is larger by 2 % of the picture on each side, the lens bends it by as much again
        room = 0.06 * SHAPE[1] / (FOCAL * 2.0 * DISTANCE * np.sin(0.5 * np.radians(angle)))
        assert piece[row, 1] - piece[row, 0] < 1.2 * (where[-1] - where[0]) + room


def test_a_ray_that_the_picture_does_not_show_has_no_piece() -> None:
    pair = _side_by_side(6000.0, 0.08, 101)
    piece = visible_piece(pair, np.array([[0.0, 0.5, np.sqrt(0.75)]]), (101, 101), LIMITS)
    assert piece[0, 0] == piece[0, 1] == 1.0 / LIMITS[1]


def test_without_a_box_a_place_behind_the_camera_is_in_no_piece() -> None:
    # the lens folds on the border; camera 1 stands 0.2 m ahead of camera 0: what is nearer lies behind it
    folding = {"distortion": (-0.6, 0.0, 0.0, 0.0, 0.0)}
    first = Camera(60.0, 60.0, 50.0, 50.0, **folding)
    second = Camera(60.0, 60.0, 50.0, 50.0, translation=np.array([0.0, 0.0, -0.2]), **folding)
    assert ideal_box(second, (101, 101)) is None
    piece = visible_piece(StereoRig((first, second)), np.array([[0.0, 0.0, 1.0]]), (101, 101), (0.15, 200.0))
    np.testing.assert_allclose(piece[0], [1.0 / 200.0, 1.0 / 0.2], rtol=1e-12)


@pytest.mark.parametrize("angle", [6.0, 12.0, 18.0, 24.0])
def test_surfaces_are_found_whatever_the_angle(angle: float) -> None:
    pair, points = rig(angle), grid(32, 32)
    images = [picture.astype(np.float32) for picture in pictures(angle)]
    wanted = subsets(images[0], points, identity(len(points)), 25, None)
    found = search(pair, wanted, images[1], limits=None, turns=StereoSearch().turns)
    assert np.isfinite(found.distance).all()  # no curve passes the picture by
    exact = distance_along(pair, points, CYLINDER.hit(pair.cameras[0], points))
    assert np.median(np.abs(found.distance - exact)) < 1e-3


POINTS = grid(16, 4)  # at the rim a part of the subset is out of the picture
EPIPOLAR_SEARCH_LIMITS = (0.29, 0.305)
# OpenCV's bilinear weights are whole 1/32; the kernel's are exact
ROUNDED = 0.02


def _wanted(mask: np.ndarray | None = None):
    images = [picture.astype(np.float32) for picture in pictures()]
    return subsets(images[0], POINTS, identity(len(POINTS)), 25, mask), images[1]


def _agree(found: Candidates, expected: Candidates) -> None:
    nowhere = np.isnan(expected.distance)
    np.testing.assert_array_equal(np.isnan(found.distance), nowhere)
    np.testing.assert_array_equal(found.zncc[nowhere], -1.0)
    fine = ~nowhere & (expected.zncc > 0.8) & (expected.second_peak < 0.7)  # one place stands out
    assert fine.sum() > 20
    np.testing.assert_allclose(found.zncc[fine], expected.zncc[fine], atol=ROUNDED)
    np.testing.assert_allclose(found.second_peak[fine], expected.second_peak[fine], atol=ROUNDED)
    same = np.abs(found.distance - expected.distance)[fine] < 1e-12
    assert same.mean() > 0.9  # at the others two steps are as good
    np.testing.assert_allclose(found.warp[fine][same], expected.warp[fine][same], atol=1e-9)


@pytest.mark.parametrize("limits", [None, EPIPOLAR_SEARCH_LIMITS])
def test_turned_facets_are_compared_at_every_step(limits: tuple[float, float] | None) -> None:
    wanted, picture = _wanted()
    turns = StereoSearch(stretching_turns=(-25.0, 0.0, 25.0), shearing_turns=(0.0, 25.0)).turns
    _agree(
        search(rig(), wanted, picture, limits=limits, turns=turns),
        search_in_numpy(rig(), wanted, picture, limits=limits, turns=turns),
    )


def test_gradients_of_the_points_own_are_used_all_along_a_curve() -> None:
    mask = np.ones(SHAPE, dtype=bool)
    mask[:, :30] = False
    wanted, picture = _wanted(mask)
    seen = facet_geometry(rig(), POINTS, np.full(len(POINTS), 0.297))
    A = gradient(seen, np.full(len(POINTS), 0.297), normals(rig(), seen.X, np.zeros((1, 2)))[:, 0])
    _agree(
        search(rig(), wanted, picture, limits=EPIPOLAR_SEARCH_LIMITS, gradients=A),
        search_in_numpy(rig(), wanted, picture, limits=EPIPOLAR_SEARCH_LIMITS, gradients=A),
    )


def test_the_best_place_is_that_of_the_surface() -> None:
    wanted, picture = _wanted()
    found = search(rig(), wanted, picture, limits=EPIPOLAR_SEARCH_LIMITS, turns=StereoSearch().turns)
    from stereo_scene import CYLINDER

    exact = distance_along(rig(), POINTS, CYLINDER.hit(rig().cameras[0], POINTS))
    inside = np.all(np.abs(POINTS - 63.5) < 40.0, axis=1)
    # a step of 2 px along the curve is 0.5 mm along the ray, the cameras 12.5° apart
    assert np.abs(found.distance - exact)[inside].max() < 0.4e-3


def test_no_points_give_no_candidates() -> None:
    wanted, picture = _wanted()
    none = wanted.take(np.zeros(0, dtype=np.int64))
    assert search(rig(), none, picture, limits=None).zncc.shape == (0,)


def test_a_curve_longer_than_its_room_is_walked_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    from dic.correlation.kernels import curve

    wanted, picture = _wanted()
    whole = search(rig(), wanted, picture, limits=None)
    monkeypatch.setattr(curve, "LONGEST", 8)
    again = search(rig(), wanted, picture, limits=None)
    for one, other in zip(whole, again, strict=True):
        np.testing.assert_array_equal(one, other)
