"""The arc of a specimen's end above a bare platen: planted arcs, and an end that a spot hides in a block."""

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern

from dic.bodies.edges import BLOCKS, block_edge, end_arc

SHAPE = (140, 160)


def planted(bend: float, *, level: float = 60.0, hidden: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Speckles that end at an arc above a platen of one grey level; the picture and the arc."""
    x = np.linspace(-1.0, 1.0, SHAPE[1])
    arc = 90.3 + 0.4 * x + bend * x**2
    row = np.arange(SHAPE[0])[:, None]
    lower = np.clip(row + 0.5 - arc, 0.0, 1.0)
    picture = (1.0 - lower) * render(speckle_pattern((200, 200), seed=4), SHAPE) + lower * level
    if hidden:  # in one block the last rows look like the platen
        picture[80:, 60:80] = level
    return picture + np.random.default_rng(1).normal(0.0, 1.0, SHAPE), arc


@pytest.mark.parametrize("level", [60.0, 128.0])
@pytest.mark.parametrize("bend", [0.0, 4.0, -4.0])
def test_an_arc_is_found(bend: float, level: float) -> None:
    picture, arc = planted(bend, level=level)
    found = end_arc(picture, float(arc.mean()))
    assert found is not None
    # the edge falls between row centres, which count from 0.5 above; spots end early by a part of a pixel
    assert np.abs(found - arc).max() < 1.0
    assert found[len(found) // 2] == pytest.approx(arc[len(arc) // 2], abs=0.7)
    assert found.min() == pytest.approx(arc.min(), abs=0.8)


def test_one_block_that_ends_early_does_not_move_the_arc() -> None:
    picture, arc = planted(4.0, hidden=True)
    found = end_arc(picture, float(arc.mean()))
    assert np.abs(found - arc).max() < 1.2  # least squares would be 4 px off


def test_an_edge_lies_where_the_departure_falls_to_half() -> None:
    block = np.full((40, 10), 50.0)
    block[:20] += np.where(np.arange(10) % 2, 30.0, -30.0)
    block[20] += np.where(np.arange(10) % 2, 12.0, -12.0)
    # from 30 in row 19 to 12 in row 20: half of 30 at 19 + 15 / 18
    assert block_edge(block, 28) == pytest.approx(19.0 + 15.0 / 18.0, rel=1e-12)


def test_too_little_of_a_platen_or_too_few_columns() -> None:
    picture, _ = planted(0.0)
    assert end_arc(picture[:96], 90.3) is None
    assert end_arc(picture[:, : 8 * BLOCKS - 1], 90.3) is None
