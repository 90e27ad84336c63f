"""Regions found in the pictures of the known-answer shots, beside what the renderer's bodies are."""

import numpy as np
import pytest

from dic.bodies.region import find_regions
from dic.images import open_pictures

TRUE = {"open-01": (5.04, 122.18, 69.39), "open-02": (1.93, 118.84, 58.33)}
"""Rows of camera 0, half-way across, where the cameras of truth.json put the specimen's ends at rest and the
flyer's edge in the last frame [px]."""


@pytest.mark.parametrize("name", TRUE)
def test_regions_are_a_pixel_clear_of_the_true_edges(shared, name):
    folder = shared / "data" / "shots" / name
    if not folder.is_dir():
        pytest.skip(f"no {folder}: its pictures are not shipped")
    pictures = open_pictures(folder / "cam0.tif", bits=12)
    n = pictures.n_frames
    found = find_regions(pictures, np.arange(n) < 12, np.ones(n, dtype=bool), toward="up")
    top, bottom, edge = TRUE[name]
    (x0, y0), _, (x1, y1), _ = found.specimen.corners
    assert (x0, x1) == (0.0, pictures.shape[1] - 1)  # the sides of the specimen are out of view
    assert 0.9 <= y0 - top <= 2.0
    assert 0.5 <= bottom - y1 <= 2.0
    assert found.edge[1] == pytest.approx(bottom, abs=1.0)  # the chain looks for it within 2 px
    assert found.flyer.frame == n - 1
    assert 0.9 <= edge - found.flyer.corners[2][1] <= 2.0
