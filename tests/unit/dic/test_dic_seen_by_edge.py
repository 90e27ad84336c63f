"""A flyer whose first frames show only the edge strip: common errors of its rows at rest and in motion."""

from dataclasses import replace

import numpy as np
import pytest
from test_dic_triangulate import TRACKED_RIG as RIG
from test_dic_triangulate import followed

from dic.bodies import axial_displacement as subject
from dic.bodies.axial_displacement import AxialDisplacement, from_rest, translations
from dic.bodies.edge_registration import RegisteredEdge
from dic.bodies.follow import TrackedBody
from dic.camera import StereoRig
from dic.chain.follow_bodies import subsample
from dic.outcome import PointOutcome
from dic.stereo.reconstruction import reconstruct
from dic.surfaces.cylinder import SpecimenFrame

STATIC, FRAMES = 4, 16
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))


def moving(scale: float) -> tuple[TrackedBody, StereoRig]:
    """A body that moves along y, out of camera 1's sight in some frames, two of its points false."""
    cameras = [replace(camera, translation=scale * camera.translation) for camera in RIG.cameras]
    rig = replace(RIG, cameras=(cameras[0], cameras[1]))
    x, y = np.meshgrid(np.linspace(-6e-4, 6e-4, 5), np.linspace(-6e-4, 6e-4, 4))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    moved = 20e-6 * np.maximum(np.arange(FRAMES) - STATIC + 1, 0)
    X = points + moved[:, None, None] * np.array([0.05, -1.0, 0.0])
    rng = np.random.default_rng(2)
    tracks = [followed(camera, X, 0.02) for camera in RIG.cameras]  # pixels: the same for every size
    for track in tracks:
        track.warp[..., :2] += 0.02 * rng.standard_normal((*track.warp.shape[:2], 2))
        track.warp[8:, 3, :2] += 0.8
        track.warp[5, 7, :2] -= 5.0
    tracks[1].outcome[11:13] = PointOutcome.LOW_CORRELATION
    body = TrackedBody(
        points=tracks[0].points, cell=np.zeros((x.size, 2), dtype=np.int64), mask=np.ones((4, 4), dtype=bool),
        material=0, stereo=None, tracks=(tracks[0], tracks[1]),
        reconstruction=reconstruct(rig, tracks[0], tracks[1]), common=None,
    )  # fmt: skip
    return body, rig


def displacement(scale: float) -> AxialDisplacement:
    """Of that body."""
    body, rig = moving(scale)
    static = np.arange(FRAMES) < STATIC
    time = np.arange(FRAMES) * 1e-5
    moved = translations(body, rig, FRAME, time, static, subset=5)
    found = from_rest(moved, None, rig, FRAME, time, static, None)
    assert found is not None
    return found


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_the_flyers_displacement_is_in_proportion(scale: float) -> None:
    usual, found = displacement(1.0), displacement(scale)
    expected = 20e-6 * np.maximum(np.arange(FRAMES) - STATIC + 1, 0)
    # 0.02 px of 60 µm over some twenty points, and the mean at rest
    np.testing.assert_allclose(usual.displacement, expected, atol=1.5e-6)
    assert found.frame.tolist() == usual.frame.tolist() == list(range(FRAMES))
    assert found.n_points.tolist() == usual.n_points.tolist()
    np.testing.assert_allclose(found.displacement / scale, usual.displacement, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.sigma / scale, usual.sigma, rtol=1e-4)
    assert found.rest_sigma / scale == pytest.approx(usual.rest_sigma, rel=1e-4)


def test_a_body_of_many_points_is_thinned_evenly_and_all_that_is_known_of_them_with_it() -> None:
    body, rig = moving(1.0)
    assert subsample(body, len(body.points)) is body
    few = subsample(body, 7)  # of 20: every third
    assert few.points.tolist() == body.points[::3].tolist()
    assert len(few.points) == len(few.cell) == 7
    for track in few.tracks:
        assert track.warp.shape == (FRAMES, 7, 12)
    again = reconstruct(rig, *few.tracks)
    np.testing.assert_allclose(few.reconstruction.position, again.position, rtol=1e-9)
    np.testing.assert_array_equal(few.reconstruction.outcome, again.outcome)
    np.testing.assert_array_equal(few.reconstruction.pixels[1], again.pixels[1])


FIRST = 8  # first frame in which its points are seen
TIMES = np.arange(FRAMES) * 1e-5


def at(frame: int) -> float:
    """True place of the body [m]."""
    return -20e-6 * max(frame - STATIC + 1, 0)


def found(
    monkeypatch: pytest.MonkeyPatch, edges: dict[int, tuple[float, float]]
) -> subject.AxialDisplacement:
    """Displacement with the edge strip registered in some frames, with sigma and common sigma [m] each."""
    body, rig = moving(1.0)
    reconstruction = replace(body.reconstruction, outcome=body.reconstruction.outcome.copy())
    for outcome in (reconstruction.outcome, *(track.outcome for track in body.tracks)):
        outcome[:FIRST] = PointOutcome.LOW_CORRELATION
    body = replace(body, reconstruction=reconstruction, material=FIRST)

    def registered(*_: object) -> list[tuple[int, RegisteredEdge]]:
        return [
            (k, RegisteredEdge(y=at(k), sigma=own, common=common, clear=False, zncc=1.0, n_pixels=100))
            for k, (own, common) in sorted(edges.items(), reverse=True)
        ]

    monkeypatch.setattr(subject, "registered_edges", registered)
    static = np.arange(FRAMES) < STATIC
    pictures = (None, None)
    moved = translations(body, rig, FRAME, TIMES, static, subset=5, pictures=pictures)
    result = from_rest(moved, None, rig, FRAME, TIMES, static, None)
    assert result is not None
    return result


def test_what_the_rows_share_is_in_the_sigma_of_a_frame_that_moves(monkeypatch):
    """0.2 um of noise, half of its variance the reference's, and 1.2 um of the row at the region's end."""
    edges = {k: (0.2e-6, 1.2e-6 if k < 6 else 0.05e-6) for k in range(FIRST)}
    result = found(monkeypatch, edges)
    assert result.frame.tolist() == list(range(FRAMES))
    own = 0.2e-6 / np.sqrt(2.0)
    # at rest all frames show the same rows: what those share is in the place at rest, once
    np.testing.assert_allclose(result.sigma[:STATIC], own)
    assert 1.2e-6 < result.rest_sigma < 1.6e-6
    np.testing.assert_allclose(result.sigma[STATIC:6], np.sqrt(own**2 + 1.2e-6**2))
    np.testing.assert_allclose(result.sigma[6:FIRST], np.sqrt(own**2 + 0.05e-6**2))
    result = found(monkeypatch, {k: (0.2e-6, 0.0) for k in range(FIRST)})
    np.testing.assert_allclose(result.sigma[:FIRST], 0.2e-6 / np.sqrt(2.0))
