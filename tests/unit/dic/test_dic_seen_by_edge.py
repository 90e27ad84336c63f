"""A flyer of which the first frames show the edge strip alone: what its rows share, at rest and in motion."""

from dataclasses import replace

import numpy as np
import pytest
from test_dic_scene_size import FRAME, FRAMES, STATIC, moving

from dic.bodies import axial_displacement
from dic.bodies import axial_displacement as subject
from dic.bodies.edge_registration import RegisteredEdge
from dic.outcome import PointOutcome

FIRST = 8
"""First frame in which its points are seen."""
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

    monkeypatch.setattr(axial_displacement, "registered_edges", registered)
    static = np.arange(FRAMES) < STATIC
    pictures = (None, None)
    result = subject.axial_displacement(body, rig, FRAME, TIMES, static, subset=5, pictures=pictures)
    assert result is not None
    return result


def test_what_the_rows_are_off_by_is_in_the_sigma_of_a_frame_that_moves(monkeypatch):
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


def test_where_nothing_is_shared_a_moving_frame_is_known_as_one_at_rest(monkeypatch):
    result = found(monkeypatch, {k: (0.2e-6, 0.0) for k in range(FIRST)})
    np.testing.assert_allclose(result.sigma[:FIRST], 0.2e-6 / np.sqrt(2.0))
