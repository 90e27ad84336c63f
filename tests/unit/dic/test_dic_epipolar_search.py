"""The kernel of the search along epipolar curves, held to the same written out in NumPy."""

import numpy as np
import pytest
from epipolar_numpy import search as search_in_numpy
from stereo_scene import SHAPE, grid, pictures, rig

from dic.correlation.subsets import identity
from dic.stereo.epipolar_search import (
    Candidates,
    StereoSearch,
    distance_along,
    facet_geometry,
    gradient,
    normals,
    search,
    subsets,
)

POINTS = grid(16, 4)  # at the rim a part of the subset is out of the picture
LIMITS = (0.29, 0.305)
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


@pytest.mark.parametrize("limits", [None, LIMITS])
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
        search(rig(), wanted, picture, limits=LIMITS, gradients=A),
        search_in_numpy(rig(), wanted, picture, limits=LIMITS, gradients=A),
    )


def test_the_best_place_is_that_of_the_surface() -> None:
    wanted, picture = _wanted()
    found = search(rig(), wanted, picture, limits=LIMITS, turns=StereoSearch().turns)
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
