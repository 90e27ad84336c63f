"""The front face's path as a nuisance: amplitudes by hand, and a frequency that patterns would fix."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_objective import objective
from test_several_parameters import COARSE, NOISE, TIME, TRUTH, MadeUp, ringing

from doe import Box
from kolsky.bars.flyer.path import FlyerPath
from kolsky.inverse import surrogate_mesh_search
from kolsky.inverse.coarse_search import CoarseOptimum, CorrectedSurrogate, search
from kolsky.inverse.objective import FrontNoise, Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.path_noise import (
    FrontPath,
    MovedFront,
    PathModes,
    credible,
    data_change,
    drawn_modes,
    likely_amplitudes,
    rms_amplitude,
)
from kolsky.inverse.settings import Settings
from kolsky.inverse.surrogate_mesh_search import MeshOptimum, follow_front, search_meshes_for_one

REST = FlyerPath(np.arange(3.0), np.zeros(2), np.eye(2), 0.0, 1.0, 1.0, 1.0)
REST_4 = FlyerPath(np.arange(5.0), np.zeros(4), np.eye(4), 0.0, 1.0, 1.0, 1.0)


def test_modes_move_path_and_data_alike() -> None:
    rng = np.random.default_rng(0)
    deviations, response = rng.normal(size=(30, 2)), rng.normal(size=(2, 9))
    noise = rng.uniform(0.1, 0.3, 9)
    modes = PathModes.of(deviations @ response, noise, deviations)
    assert modes.patterns.shape == (2, 9)
    # Their outer products are those of the changes.
    change = deviations @ response
    np.testing.assert_allclose(modes.patterns.T @ modes.patterns, change.T @ change, atol=1e-12)
    moved = MovedFront(REST, modes, np.array([1.5, -2.0])).path
    np.testing.assert_allclose(moved.jerk @ response, np.array([1.5, -2.0]) @ modes.patterns, atol=1e-12)


def test_amplitudes_are_the_posterior_mean() -> None:
    rng = np.random.default_rng(5)
    patterns = rng.normal(size=(2, 12))
    one = objective(np.zeros(12), np.empty(0))
    one = replace(one, front=FrontNoise(patterns), force_discrepancy=0.4)
    C = np.diag(one.own_sigma**2) + patterns.T @ patterns
    r = rng.normal(size=12)
    np.testing.assert_allclose(likely_amplitudes(one, r), patterns @ np.linalg.solve(C, r), rtol=1e-9)


def test_a_path_that_is_off_by_more_than_noise_is_not_followed() -> None:
    assert credible(np.array([4.0, -4.0]))
    assert not credible(np.array([4.1, -4.1]))
    assert credible(np.array([8.0, 0.0, 0.0, 0.0]))
    assert not credible(np.empty(0))


class Onset(MadeUp):
    """A test whose front face rings the specimen by two numbers of its path, at the specimen's frequency."""

    def __init__(self, jerk: np.ndarray, replicates: int = 20) -> None:
        super().__init__()
        self.settings = replace(Settings(), numerics=self.settings.numerics, replicates=replicates)
        noise = NOISE * np.random.default_rng(3).standard_normal(TIME.size)
        data = ringing(TRUTH)[0] + jerk @ self.rings(TRUTH) + noise
        self.observations = objective(data, np.empty(0)).observations
        self.front = FrontPath(REST)
        self.lost = 0

    def rings(self, x: np.ndarray) -> np.ndarray:
        turns = 2.0 * np.pi * 0.5 * np.sqrt(x[0] / (1.0 - 2.0 * x[1]))
        return 3.0 * np.exp(-TIME) * np.stack([np.sin(turns * TIME), np.cos(turns * TIME)])

    def predicted(self, points: np.ndarray, mesh: tuple[int, int], jerks: Any = None) -> Prediction:
        jerks = np.tile(self.front.path.jerk, (len(points), 1)) if jerks is None else jerks
        force = np.array([ringing(x)[0] + j @ self.rings(x) for x, j in zip(points, jerks, strict=True)])
        empty = np.empty((len(points), 0))
        return Prediction(empty, force, empty, empty.astype(bool))

    def under_other_motions(self, points: np.ndarray, deviations: np.ndarray, numerics: Any) -> Any:
        came = deviations[: len(deviations) - self.lost]
        jerks = self.front.path.jerk + np.concatenate([np.zeros((1, 2)), came])
        return [self.predicted(np.repeat(x[None], len(jerks), axis=0), COARSE, jerks) for x in points]

    @property
    def front_jerks(self) -> np.ndarray:
        return np.eye(2)


def off_by(share: float) -> MeshOptimum:
    """A point whose oscillations are behind by a share of one over the test."""
    turns = 0.5 * np.sqrt(TRUTH[0] / (1.0 - 2.0 * TRUTH[1])) * TIME[-1]
    nu = 0.5 * (1.0 - (1.0 - 2.0 * TRUTH[1]) / (1.0 - share / turns) ** 2)
    return MeshOptimum(np.array([TRUTH[0], nu]), np.array([1e-3, 1e-6]), np.array([1e-3, 1e-6]))


def test_the_path_goes_where_the_data_put_it_and_the_frequency_with_it() -> None:
    made: Any = Onset(np.array([4.0, -3.0]))
    one = Objective(made.observations, np.empty(0, dtype=bool))
    found, front = follow_front(made, one, made.settings.numerics, off_by(0.2))
    assert (np.abs(found.x - TRUTH) < 4.0 * found.sigma).all()
    # A prior of unit variance and a noise that is small beside the rings: what was planted, nearly.
    np.testing.assert_allclose(front.path.jerk, [4.0, -3.0], rtol=0.1)
    # 4 and 3 have a root mean square of 3.5.
    assert front.moved is not None
    assert rms_amplitude(front.moved.amplitudes) == pytest.approx(12.5**0.5, rel=0.1)
    # Its prediction counts as if the path had not moved.
    seen = made.objective(np.empty(0, dtype=bool)).vectors(made.predicted(TRUTH[None], COARSE))
    np.testing.assert_allclose(seen[0], ringing(TRUTH)[0], atol=1.5)  # of rings of 15


@pytest.mark.parametrize("other", ["poisson", "damping"])
def test_a_path_that_is_off_by_little_is_followed(other: str) -> None:
    """Patterns that stay where they were made hold the frequency there, and leave a phase error to m."""
    made: Any = Onset(np.array([1.5, -1.5]))
    made.box = Box.of({"stiffness_factor": (0.75, 1.5), other: (0.49, 0.4999)})
    one = Objective(made.observations, np.empty(0, dtype=bool))
    found, front = follow_front(made, one, made.settings.numerics, off_by(0.2))
    np.testing.assert_allclose(front.path.jerk, [1.5, -1.5], atol=0.2)
    assert (np.abs(found.x - TRUTH) < 4.0 * found.sigma).all()


def test_modes_take_the_place_of_the_changes_they_are_made_of() -> None:
    rng = np.random.default_rng(2)
    deviations, response = rng.normal(size=(30, 4)), rng.normal(size=(4, 9))
    response[2:] *= 1e-4  # two of the four numbers of a path that the data do not see
    modes = PathModes.of(deviations @ response, np.full(9, 0.2), deviations)
    assert len(modes.patterns) == 2
    amplitudes = np.array([1.5, -2.0])
    fewer, shares = modes.own_jerks, modes.amplitudes(amplitudes @ modes.shares)
    # Two runs, the same path, and the same patterns.
    np.testing.assert_allclose(shares @ fewer, MovedFront(REST_4, modes, amplitudes).path.jerk, atol=1e-12)
    again = PathModes.of(fewer @ response, np.full(9, 0.2), fewer)
    np.testing.assert_allclose(
        again.patterns.T @ again.patterns, modes.patterns.T @ modes.patterns, atol=1e-12
    )


class Alone(Onset):
    """The stiffness factor by itself, Poisson's ratio held at its true value."""

    def __init__(self, jerk: np.ndarray) -> None:
        super().__init__(jerk)
        self.box = Box.of({"stiffness_factor": (0.75, 1.5)})
        self.replicated: list[tuple[float, bool]] = []

    def predicted(self, points: np.ndarray, mesh: tuple[int, int], jerks: Any = None) -> Prediction:
        whole = np.column_stack([points, np.full(len(points), TRUTH[1])])
        return super().predicted(whole, mesh, jerks)

    def vectors(self, stage: str, points: np.ndarray, numerics: Any, one: Objective) -> np.ndarray:
        return one.vectors(self.predicted(points, numerics.mesh))

    def replicate(self, x: np.ndarray, *, lesson: bool = True) -> None:
        self.replicated.append((float(x[0]), lesson))


def test_one_parameter_follows_the_path_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ringing that a moved onset brings would pull the stiffness factor by itself."""
    made: Any = Alone(np.array([4.0, -3.0]))
    one = Objective(made.observations, np.empty(0, dtype=bool))

    class Response:
        def predict(self, points: np.ndarray, *, extrapolate: bool) -> np.ndarray:
            whole = np.column_stack([points, np.full(len(points), TRUTH[1])])
            return np.concatenate([ringing(x) for x in whole])

    surrogate: Any = Response()
    plain = search(made.box, one, CorrectedSurrogate(surrogate).predict, start=TRUTH[:1])
    coarse = CoarseOptimum(made.box, surrogate, plain.objective, plain.x)
    meshes = search_meshes_for_one(made, coarse)
    (found,), front = meshes.optima.values(), meshes.front
    assert abs(found.x[0] - TRUTH[0]) < 4.0 * found.sigma[0]
    assert abs(plain.x[0] - TRUTH[0]) > 10.0 * found.sigma[0]
    np.testing.assert_allclose(front.path.jerk, [4.0, -3.0], rtol=0.1)
    # The replicates that judge the interval are made where it ended, and teach no weights.
    assert made.replicated == [(found.x[0], False)]
    # On the coarse meshes a frame's points count as one value.
    monkeypatch.setattr(surrogate_mesh_search, "follow_meshes", lambda runner, weights, *rest: weights)
    weights: Any = search_meshes_for_one(made, coarse)
    assert weights.balanced


@pytest.mark.parametrize("lost", [False, True])
def test_a_wrong_path_and_a_lost_replicate_leave_the_path(lost: bool) -> None:
    made: Any = Onset(np.array([4.0, -3.0]) if lost else np.array([40.0, -30.0]))
    made.lost = int(lost)
    one, before = Objective(made.observations, np.empty(0, dtype=bool)), off_by(0.0)
    found, front = follow_front(made, one, made.settings.numerics, before)
    assert found is before
    np.testing.assert_array_equal(front.path.jerk, REST.jerk)
    assert (front.path is REST) == lost  # another object: no run so far serves a surrogate
    assert front.moved is None
    assert front.noise.offset is None
    assert (front.noise.patterns is None) == lost  # then the interval rests on draws of the motion


def test_modes_have_the_replicates_mean_square() -> None:
    rng = np.random.default_rng(2)
    noise = np.array([0.3, 0.3, 2e-6, 2e-6, 2e-6])
    change = rng.normal(size=(64, 3)) @ rng.normal(size=(3, 5)) * noise
    modes = drawn_modes(change, noise)
    assert modes.shape == (3, 5)
    np.testing.assert_allclose(modes.T @ modes, change.T @ change / 64, rtol=1e-9, atol=1e-18)


def test_a_mode_far_below_the_noise_is_left_out() -> None:
    noise = np.ones(4)  # 1.41 and 0.14 of it
    change = np.array([[2.0, 0.0, 0.0, 0.0], [0.0, 0.2, 0.0, 0.0]])
    modes = drawn_modes(change, noise)
    np.testing.assert_allclose(np.abs(modes), [[np.sqrt(2.0), 0.0, 0.0, 0.0]], atol=1e-12)


def test_changes_are_from_the_reference_and_of_all_points() -> None:
    prediction = Prediction(
        force=np.zeros((2, 3)),
        force_bins=np.array([[1.0, 2.0], [1.5, 2.0]]),
        Z=np.array([[5.0, 6.0], [5.0, np.nan]]),
        inside=np.array([[True, True], [True, False]]),
    )
    np.testing.assert_array_equal(data_change(prediction), [[0.0] * 4, [0.5, 0.0, 0.0, 0.0]])
