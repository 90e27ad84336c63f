"""Parts of the stereo match: facets, epipolar curves, neighbours, gates."""

from dataclasses import fields, replace

import numpy as np
import pytest
from epipolar_numpy import correlation, curve_distances, points_along
from numpy.typing import NDArray
from speckle_pictures import RenderedCylinder
from stereo_scene import SHAPE, rig

from dic.correlation.subsets import Match
from dic.stereo.epipolar_search import (
    StereoGates,
    StereoSearch,
    distance_along,
    facet_geometry,
    fit_facet,
    gradient,
    normals,
)
from dic.stereo.geometry import epipolar_distance
from dic.stereo.match import Gate, GateValues, disagreement, failed_gates, neighbourhood, propagate

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


def test_a_curve_is_walked_in_equal_steps_from_rim_to_rim() -> None:
    s = curve_distances(rig(), PIXELS, SHAPE, None, 1.0)
    for k, row in enumerate(s):
        row = row[np.isfinite(row)]
        assert np.all(np.diff(row) > 0.0)
        places = rig().cameras[1].project(points_along(rig(), PIXELS[k : k + 1], row[None])[0])
        # cut out of the whole curve to the next of 64 knots, 2.0 px apart
        assert np.sort(places[[0, -1], 0]) == pytest.approx([0.0, SHAPE[1] - 1.0], abs=2.5)
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        np.testing.assert_allclose(steps, 1.0, atol=0.01)  # linear between the knots
        off = epipolar_distance(rig(), np.repeat(PIXELS[k : k + 1], len(places), axis=0), places)
        np.testing.assert_allclose(off, 0.0, atol=1e-9)


def test_a_lens_model_that_folds_back_shows_nothing_twice() -> None:
    first, second = rig().cameras
    folding = replace(second, distortion=(-60.0, 0.0, 0.0, 0.0, 0.0))  # turns at r = 0.075, 400 px
    folded = replace(rig(), cameras=(first, folding))
    s = curve_distances(folded, PIXELS, SHAPE, None, 1.0)
    places = folding.project(points_along(folded, PIXELS, np.nan_to_num(s, nan=0.3)))[np.isfinite(s)]
    assert np.all((places > -3.0) & (places < SHAPE[1] + 2.0))
    assert np.isfinite(s).sum(axis=1).max() < 1.3 * SHAPE[1]


def test_declared_distances_are_kept() -> None:
    s = curve_distances(rig(), PIXELS, SHAPE, (0.29, 0.305), 1.0)
    assert np.nanmin(s) >= 0.29
    assert np.nanmax(s) == pytest.approx(0.305)


def test_distance_is_measured_along_the_line_of_sight() -> None:
    X = facet_geometry(rig(), PIXELS, DISTANCES).X
    np.testing.assert_allclose(distance_along(rig(), PIXELS, X), DISTANCES, rtol=1e-12)
    np.testing.assert_allclose(rig().cameras[0].project(X), PIXELS, atol=1e-8)


def test_correlation_is_that_of_the_samples_with_weight() -> None:
    rng = np.random.default_rng(2)
    g, t = rng.random((2, 7, 50)).astype(np.float32)
    weight = (rng.random((7, 50)) < 0.6).astype(np.float32)
    some = weight > 0.0
    expected = [np.corrcoef(a[k], b[k])[0, 1] for a, b, k in zip(g, t, some, strict=True)]
    np.testing.assert_allclose(correlation(g, t, weight), expected, atol=1e-5)  # single precision
    assert correlation(np.ones((1, 50), np.float32), t[:1], weight[:1])[0] == -1.0


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


def test_neighbours_agree_on_a_displacement_of_second_order() -> None:
    points = lattice()
    near, valid = neighbourhood(points, 8), np.ones(36, dtype=bool)
    np.testing.assert_allclose(disagreement(points, bent(points), near, valid), 0.0, atol=1e-12)


def test_neighbours_see_the_one_that_is_elsewhere() -> None:
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
    "sigma": 0.01,
    "epipolar": 0.1,
    "epipolar_sigma": 0.01,
    "facet": 0.1,
    "incidence": 0.5,
    "back_match": 0.01,
    "neighbours": 0.02,
    "distinct": 0.1,
    "distance": 0.3,
    "unseen": 0.0,
}


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


def test_a_rendered_ray_ends_on_the_cylinder() -> None:
    cylinder = RenderedCylinder(4.75e-3, x=1e-4, z=-2e-4)
    camera = rig().cameras[0]
    X = cylinder.hit(camera, PIXELS)
    np.testing.assert_allclose(np.hypot(X[:, 0] - 1e-4, X[:, 2] + 2e-4), 4.75e-3, rtol=1e-12)
    np.testing.assert_allclose(camera.project(X), PIXELS, atol=1e-8)
    assert np.all(np.sum(cylinder.normal(X) * (camera.centre - X), axis=1) > 0.0)  # the near side
    assert np.isnan(cylinder.hit(camera, np.array([[400.0, 64.0]]))).all()
    flat = cylinder.picture(camera, SHAPE, lambda arc, height: np.full(arc.shape, 0.7), oversample=2)
    np.testing.assert_allclose(flat, 0.7, rtol=1e-12)
