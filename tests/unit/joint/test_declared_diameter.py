"""The diameters of several shots, where an outline moves with its own."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from kolsky.uncertainty.budgets import outlines_with_diameter


def test_only_outlines_placed_by_a_radius_move() -> None:
    """Two shots of a force bin and two outline points each; 0.1 % of 10 mm and 0.2 % of 8 mm."""
    shots: list[Any] = [
        SimpleNamespace(axis_by_radius=placed, specimen=SimpleNamespace(diameter=diameter))
        for placed, diameter in ((False, 10e-3), (True, 8e-3))
    ]
    data: list[Any] = [SimpleNamespace(objective=SimpleNamespace(n_force=1))] * 2
    change = np.array([3.0, 6e-6, 7e-6, 4.0, 9e-6, 8e-6, 5.0])
    found = outlines_with_diameter(change, shots, data, (3, 6), np.array([1e-3, 2e-3]))
    np.testing.assert_allclose(found, [3.0, 6e-6, 7e-6, 4.0, 1e-6, 0.0, 5.0], atol=1e-18)
