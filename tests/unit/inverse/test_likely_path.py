"""The front face's path as a nuisance: amplitudes by hand, and a frequency that patterns would hold fast."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_objective import objective
from test_several_parameters import COARSE, NOISE, TIME, TRUTH, MadeUp, ringing

from kolsky.bars.flyer.path import FlyerPath
from kolsky.inverse.likely_path import PathModes, credible, likely_amplitudes
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.settings import Settings
from kolsky.inverse.surrogate_mesh_search import MeshOptimum, follow_front

REST = FlyerPath(np.arange(3.0), np.zeros(2), np.eye(2), 0.0, 1.0, 1.0, 10.0, 1.0)


def test_modes_move_path_and_data_alike() -> None:
    rng = np.random.default_rng(0)
    deviations, response = rng.normal(size=(30, 2)), rng.normal(size=(2, 9))
    noise = rng.uniform(0.1, 0.3, 9)
    modes = PathModes.of(deviations @ response, noise, deviations)
    assert modes.patterns.shape == (2, 9)
    # Their outer products are the replicates' mean square.
    change = deviations @ response
    np.testing.assert_allclose(modes.patterns.T @ modes.patterns, change.T @ change / 30, atol=1e-12)
    moved = modes.moved(REST, np.array([1.5, -2.0]))
    np.testing.assert_allclose(moved.jerk @ response, np.array([1.5, -2.0]) @ modes.patterns, atol=1e-12)


def test_amplitudes_are_the_posterior_mean() -> None:
    rng = np.random.default_rng(5)
    patterns = rng.normal(size=(2, 12))
    one = objective(np.zeros(12), np.empty(0))
    one = replace(one, observations=replace(one.observations, front_noise=patterns), force_discrepancy=0.4)
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
        self.prepared = SimpleNamespace(path=REST, forward=self.prepared.forward)
        self.draws = np.random.default_rng(8).standard_normal((replicates, 2))

    def rings(self, x: np.ndarray) -> np.ndarray:
        turns = 2.0 * np.pi * 0.5 * np.sqrt(x[0] / (1.0 - 2.0 * x[1]))
        return 3.0 * np.exp(-TIME) * np.stack([np.sin(turns * TIME), np.cos(turns * TIME)])

    def predicted(self, points: np.ndarray, mesh: tuple[int, int], jerks: Any = None) -> Prediction:
        jerks = np.tile(self.prepared.path.jerk, (len(points), 1)) if jerks is None else jerks
        force = np.array([ringing(x)[0] + j @ self.rings(x) for x, j in zip(points, jerks, strict=True)])
        empty = np.empty((len(points), 0))
        return Prediction(empty, force, empty, empty.astype(bool))

    def under_other_motions(self, points: np.ndarray, n: int, numerics: Any) -> Any:
        jerks = self.prepared.path.jerk + np.concatenate([np.zeros((1, 2)), self.draws])
        return [self.predicted(np.repeat(x[None], len(jerks), axis=0), COARSE, jerks) for x in points]

    def front_deviations(self, n: int) -> np.ndarray:
        return self.draws

    def know_front_noise(self, modes: np.ndarray, offset: np.ndarray | None = None) -> None:
        self.observations = replace(self.observations, front_noise=modes, front_offset=offset)

    def move_front(self, path: FlyerPath, moved: float) -> None:
        self.prepared.path, self.front_moved = path, moved


def off_by(share: float) -> MeshOptimum:
    """A point whose oscillations are behind by a share of one over the test."""
    turns = 0.5 * np.sqrt(TRUTH[0] / (1.0 - 2.0 * TRUTH[1])) * TIME[-1]
    nu = 0.5 * (1.0 - (1.0 - 2.0 * TRUTH[1]) / (1.0 - share / turns) ** 2)
    return MeshOptimum(np.array([TRUTH[0], nu]), np.array([1e-3, 1e-6]), 0.0, True)


def test_the_path_goes_where_the_data_put_it_and_the_frequency_with_it() -> None:
    made: Any = Onset(np.array([4.0, -3.0]))
    one = Objective(made.observations, np.empty(0, dtype=bool))
    found = follow_front(made, one, made.settings.numerics, off_by(0.2))
    assert (np.abs(found.x - TRUTH) < 4.0 * found.sigma).all()
    # A prior of unit variance and a noise that is small beside the rings: what was planted, nearly.
    np.testing.assert_allclose(made.prepared.path.jerk, [4.0, -3.0], rtol=0.1)
    # Two amplitudes whose replicates scatter by nearly one: 4 and 3 have a root mean square of 3.5.
    assert made.front_moved == pytest.approx(12.5**0.5, rel=0.3)
    # Its prediction counts as if the path had not moved.
    seen = Objective(made.observations, np.empty(0, dtype=bool)).vectors(made.predicted(TRUTH[None], COARSE))
    np.testing.assert_allclose(seen[0], ringing(TRUTH)[0], atol=1.5)  # of rings of 15


def test_a_path_that_is_off_by_little_is_left_to_the_patterns() -> None:
    made: Any = Onset(np.array([1.5, -1.5]))
    one = Objective(made.observations, np.empty(0, dtype=bool))
    found = follow_front(made, one, made.settings.numerics, off_by(0.0))
    assert made.prepared.path is REST
    assert made.observations.front_offset is None
    assert (np.abs(found.x - TRUTH) < 4.0 * found.sigma).all()


def test_a_wrong_path_is_left_where_its_record_puts_it() -> None:
    made: Any = Onset(np.array([40.0, -30.0]))
    one, before = Objective(made.observations, np.empty(0, dtype=bool)), off_by(0.0)
    assert follow_front(made, one, made.settings.numerics, before) is before
    assert made.prepared.path is REST
    assert made.observations.front_offset is None
    assert made.observations.front_noise is not None


def test_a_lost_replicate_leaves_the_path() -> None:
    made: Any = Onset(np.array([4.0, -3.0]))
    made.draws = made.draws[:-1]
    one, before = Objective(made.observations, np.empty(0, dtype=bool)), off_by(0.0)
    assert follow_front(made, one, made.settings.numerics, before) is before
    assert made.prepared.path is REST
    assert len(made.observations.front_noise) == pytest.approx(2)
