"""The stereo match on rendered cylinders, where the answer is known ray by ray."""

from dataclasses import replace

import numpy as np
import pytest
from stereo_scene import CYLINDER, NOISE, RADIUS, SHAPE, grid, pictures, rig, truth

from dic.camera import StereoRig
from dic.correlation import Correlation, Shape
from dic.correlation.subsets import apply, identity
from dic.outcome import PointOutcome
from dic.stereo.epipolar_search import StereoGates, StereoSearch
from dic.stereo.geometry import triangulate
from dic.stereo.match import Gate, StereoMatch, match_stereo

QUADRATIC = Correlation(subset=21, shape=Shape.QUADRATIC)


def matched(angle: float = 12.5, settings: Correlation = QUADRATIC, **options: object) -> StereoMatch:
    return match_stereo(*pictures(angle), grid(), rig(angle), settings, noise=NOISE, **options)


@pytest.fixture(scope="module", params=[12.5, 30.0])
def case(request: pytest.FixtureRequest) -> tuple[float, StereoMatch]:
    return request.param, matched(request.param)


def test_every_point_that_both_cameras_see_is_found_where_it_is(case: tuple[float, StereoMatch]) -> None:
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


def test_no_accepted_point_is_off_the_cylinder(case: tuple[float, StereoMatch]) -> None:
    angle, match = case
    some = match.valid
    pixels = match.points[some], apply(match.points, match.warp)[some]
    X = triangulate(rig(angle), *pixels, np.eye(2) * 1e-6, match.covariance[some]).position
    off = np.hypot(X[:, 0], X[:, 2]) - RADIUS
    assert np.abs(off).max() < 8e-6  # noise 1.0 µm, five sigma; a false match is off by a speckle, 350 µm


def test_the_facets_slope_is_the_surfaces(case: tuple[float, StereoMatch]) -> None:
    angle, match = case
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
