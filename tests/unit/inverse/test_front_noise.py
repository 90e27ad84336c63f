"""Modes of the front face's noise against the covariance of the replicates they are made of."""

import numpy as np

from kolsky.inverse.observations import Prediction
from kolsky.inverse.path_noise import data_change, front_modes


def test_modes_have_the_replicates_mean_square() -> None:
    rng = np.random.default_rng(2)
    noise = np.array([0.3, 0.3, 2e-6, 2e-6, 2e-6])
    change = rng.normal(size=(64, 3)) @ rng.normal(size=(3, 5)) * noise
    modes = front_modes(change, noise)
    assert modes.shape == (3, 5)
    np.testing.assert_allclose(modes.T @ modes, change.T @ change / 64, rtol=1e-9, atol=1e-18)


def test_a_mode_far_below_the_noise_is_left_out() -> None:
    noise = np.ones(4)  # 1.41 and 0.14 of it
    change = np.array([[2.0, 0.0, 0.0, 0.0], [0.0, 0.2, 0.0, 0.0]])
    modes = front_modes(change, noise)
    np.testing.assert_allclose(np.abs(modes), [[np.sqrt(2.0), 0.0, 0.0, 0.0]], atol=1e-12)


def test_changes_are_from_the_reference_and_of_all_points() -> None:
    prediction = Prediction(
        force=np.zeros((2, 3)),
        force_bins=np.array([[1.0, 2.0], [1.5, 2.0]]),
        Z=np.array([[5.0, 6.0], [5.0, np.nan]]),
        inside=np.array([[True, True], [True, False]]),
    )
    np.testing.assert_array_equal(data_change(prediction), [[0.0] * 4, [0.5, 0.0, 0.0, 0.0]])
