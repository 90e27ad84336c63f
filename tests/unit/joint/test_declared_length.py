"""The heights of several shots' outlines, where they go with lengths that the pictures have a part in."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from kolsky.base.records import CentreLine
from kolsky.uncertainty.budgets import _place_change


def test_a_higher_outline_is_compared_with_a_wider_model() -> None:
    """Two shots of a force bin and three outline points each, on cones of slopes 0.2 and 0.5; the second
    outline is 3 um too high."""
    y = np.array([1e-3, 2e-3, 3e-3])
    data: list[Any] = []
    for slope in (0.2, 0.5):
        line = CentreLine(np.zeros(3), np.zeros(3, dtype=np.int64), y, 5e-3 + slope * y, np.full(3, 1e-6))
        seen = SimpleNamespace(centre_line=line)
        counted = np.ones(3, dtype=bool)
        data.append(SimpleNamespace(objective=SimpleNamespace(n_force=1), observations=seen, counted=counted))
    stack = SimpleNamespace(data=np.zeros(8), shots=data, ends=(4, 8))
    problem: Any = SimpleNamespace(stack=stack)
    moved = _place_change(problem, np.array([0.0, 3e-6]), "y_offset")
    np.testing.assert_allclose(moved, [0.0] * 5 + [1.5e-6] * 3, rtol=1e-9, atol=1e-18)
    axis = _place_change(problem, np.array([1e-6, 0.0]), "Z_offset")
    np.testing.assert_allclose(axis, [0.0] + [-1e-6] * 3 + [0.0] * 4, atol=1e-18)
