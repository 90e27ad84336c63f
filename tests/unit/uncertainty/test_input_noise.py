"""The inputs' part of an interval in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from kolsky.inverse.objective import FrontNoise
from kolsky.inverse.run_table import Replicates
from kolsky.uncertainty.budgets import InputChanges, input_changes, replicate_uncertainty

GAIN = np.array([[2.0, 0.0, 0.0], [0.0, 1.0, -1.0]])


def test_replicates_scatter_about_the_reference_not_about_their_mean() -> None:
    moves = np.array([[2.0, 0.0], [6.0, 3.0]])
    # sqrt((4 + 36) / 2) and sqrt(9 / 2)
    np.testing.assert_allclose(replicate_uncertainty(moves), np.sqrt([20.0, 4.5]), rtol=1e-15)


def test_each_source_goes_through_the_map_it_is_given() -> None:
    changes = InputChanges(
        {"flyer motion": np.array([[1.0, 0.0, 0.0]]), "material curve": np.array([[0.0, 3.0, 0.0]])},
        {"motion scale": np.array([0.5, 0.0, 0.0])},
    )
    found = changes.parts(GAIN)
    assert list(found) == ["motion scale", "flyer motion", "material curve"]
    np.testing.assert_allclose(found["motion scale"], [1.0, 0.0])
    np.testing.assert_allclose(found["flyer motion"], [2.0, 0.0])
    np.testing.assert_allclose(found["material curve"], [0.0, 3.0])
    np.testing.assert_allclose(changes.parts(GAIN)["motion scale"], [1.0, 0.0])
    np.testing.assert_allclose(changes.parts(-0.5 * GAIN)["flyer motion"], [1.0, 0.0])


def made_up(force_sigma_gain: float) -> tuple[Any, Replicates]:
    """An objective of three entries, and a replicate of each kind."""
    vectors = np.array([[5.0, 5.0, 5.0], [6.0, 5.0, 5.0], [5.0, 8.0, np.nan], [5.5, 5.0, 5.0]])
    row = np.arange(4)
    objective = SimpleNamespace(
        observations=SimpleNamespace(force_sigma_gain=force_sigma_gain),
        front=FrontNoise(),
        front_noise=np.array([[0.3, 0.0, 0.0], [0.0, 0.4, 0.0]]),
        scale_error=np.array([0.5, 0.0, 0.0]),
        outline_errors=np.zeros((0, 3)),
        vectors=lambda prediction: prediction,
    )
    prediction: Any = vectors
    return objective, Replicates(prediction, row == 1, row < 0, row == 2, row == 3, lost=2)


def test_sources_are_those_that_are_there() -> None:
    objective, replicates = made_up(0.01)
    found = input_changes(objective, replicates)
    assert list(found.parts(GAIN)) == ["force scale", "motion scale", "flyer motion", "material curve"]
    np.testing.assert_array_equal(found.replicates["flyer motion"], [[1.0, 0.0, 0.0]])
    # A point that a replicate leaves adds nothing.
    np.testing.assert_array_equal(found.replicates["material curve"], [[0.0, 3.0, 0.0]])
    np.testing.assert_array_equal(found.scales["motion scale"], [0.5, 0.0, 0.0])
    assert list(input_changes(objective, None).parts(GAIN)) == ["force scale"]
    unscaled = replace(replicates, scale=np.zeros(4, dtype=bool))
    parts = input_changes(made_up(0.0)[0], unscaled).parts(GAIN)
    assert list(parts) == ["flyer motion", "material curve"]
    assert input_changes(made_up(0.0)[0], None).parts(GAIN) == {}


def test_where_no_motion_is_drawn_the_patterns_of_its_noise_are_its_part() -> None:
    objective, replicates = made_up(0.0)
    replicates = replace(replicates, flyer=np.zeros(4, dtype=bool))
    found = input_changes(objective, replicates)
    # Two patterns of a standard deviation each: 2 x 0.3, and 1 x 0.4.
    np.testing.assert_allclose(found.parts(GAIN)["flyer motion"], [0.6, 0.4], rtol=1e-12)
    np.testing.assert_allclose(found.parts(GAIN)["material curve"], [0.0, 3.0])  # that of its replicates
    objective.front_noise = np.zeros((0, 3))
    np.testing.assert_allclose(input_changes(objective, replicates).parts(GAIN)["flyer motion"], [0.0, 0.0])
