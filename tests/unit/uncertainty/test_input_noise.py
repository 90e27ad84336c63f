"""The inputs' part of an interval in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.uncertainty.input_noise import (
    input_noise,
    replicate_parts,
    replicate_uncertainty,
    scale_uncertainty,
)

GAIN = np.array([[2.0, 0.0, 0.0], [0.0, 1.0, -1.0]])


def test_replicates_scatter_about_the_reference_not_about_their_mean() -> None:
    moves = np.array([[2.0, 0.0], [6.0, 3.0]])
    # sqrt((4 + 36) / 2) and sqrt(9 / 2)
    np.testing.assert_allclose(replicate_uncertainty(moves), np.sqrt([20.0, 4.5]), rtol=1e-15)


def test_a_scale_moves_by_the_steepest_of_the_slopes() -> None:
    change = np.array([0.1, 0.2, 0.6])
    # 0.2 and 0.4 by the first slope, 0.1 and 0.6 by the second: parameter by parameter the larger.
    other = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(scale_uncertainty(change, [GAIN, other]), [0.2, 0.6], rtol=1e-12)


def parts(scaled: bool) -> dict[str, Any]:
    vectors = np.array([[5.0, 5.0, 5.0], [6.0, 5.0, 5.0], [5.0, 8.0, np.nan], [5.5, 5.0, 5.0]])
    n = 4 if scaled else 3
    row = np.arange(n)
    return {
        "vectors": vectors[:n],
        "flyer": row == 1,
        "curve": row == 2,
        "scale": row == 3,
        "gain": GAIN,
        "gains": [GAIN, 3.0 * GAIN],
    }


def test_each_source_has_its_rows() -> None:
    found = replicate_parts(**parts(scaled=True))
    assert list(found) == ["motion scale", "flyer motion", "material curve"]
    np.testing.assert_allclose(found["motion scale"], [3.0, 0.0])  # 0.5 x 2 x the steeper slope's 3
    np.testing.assert_allclose(found["flyer motion"], [2.0, 0.0])
    np.testing.assert_allclose(found["material curve"], [0.0, 3.0])  # a point that is left adds nothing
    assert list(replicate_parts(**parts(scaled=False))) == ["flyer motion", "material curve"]


def made_up(force_sigma_gain: float, replicates: int) -> tuple[Any, Any]:
    """An identification whose objective's gain is the slope's transpose, and whose replicates are `parts`."""
    given = parts(scaled=True)
    rows = SimpleNamespace(
        prediction=given["vectors"], lost=2, **{k: given[k] for k in ("flyer", "curve", "scale")}
    )
    stages = SimpleNamespace(
        observations=SimpleNamespace(force_sigma_gain=force_sigma_gain),
        settings=SimpleNamespace(replicates=replicates),
        replicate=lambda x: rows,
    )
    objective = SimpleNamespace(
        gain=lambda slope: slope.T,
        scale_error=np.array([0.5, 0.0, 0.0]),
        vectors=lambda prediction: prediction,
    )
    fine = SimpleNamespace(objective=objective, slopes=(GAIN.T, 3.0 * GAIN.T), jacobian=GAIN.T, x=np.zeros(2))
    return stages, fine


@pytest.mark.parametrize(
    ("gain", "replicates", "expected"),
    [
        (0.0, 0, {}),
        (0.01, 0, {"force scale": [3.0, 0.0]}),
        (0.0, 16, {"motion scale": [3.0, 0.0], "flyer motion": [2.0, 0.0], "material curve": [0.0, 3.0]}),
    ],
)
def test_sources_are_those_that_are_there(gain: float, replicates: int, expected: dict[str, Any]) -> None:
    found, lost = input_noise(*made_up(gain, replicates))
    assert list(found) == list(expected)
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value)
    assert lost == (2 if replicates else 0)
