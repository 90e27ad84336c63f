"""The page of `kolsky check` for a test between bars, and its figure where pictures are not read yet."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
from barrecord import classical_shot
from matplotlib import pyplot as plt
from shot_folders import OPEN_01

from kolsky.pictures.picture_set import PictureChanges
from kolsky.report.figures import CHECKS, PICTURE_CHECKS, figures_of
from kolsky.report.pages.check import render
from kolsky.shot.load import load_shot
from kolsky.shot.records import PicturedShot, ShotBase


def test_a_test_between_bars_has_no_outline() -> None:
    shot = classical_shot(0)
    page = render(shot)
    assert "The velocity of the front face on the same clock" in page
    assert "(c) The outline at three times" not in page
    assert figures_of(shot) == CHECKS


def test_pictures_that_are_not_correlated_show_when_they_change() -> None:
    loaded: Any = load_shot(OPEN_01)
    base = {field.name: getattr(loaded, field.name) for field in fields(ShotBase)}
    found = PictureChanges(
        time=np.linspace(-50e-6, 1e-3, 5),
        change=np.array([[0.0, 0.01, 0.02, 0.03, 0.04], [0.0, 0.0, np.nan, 0.0, 0.0]]),
        rest_end=25e-6,
        shown=((-50e-6, np.zeros((4, 5))), (25e-6, np.ones((4, 5)))),
    )
    pictures: Any = SimpleNamespace(changes=found)
    shot = PicturedShot(**base, pictures=pictures)
    assert figures_of(shot) == PICTURE_CHECKS
    (kind,) = PICTURE_CHECKS.values()
    assert "are not measured" in kind.caption(shot)
    names = list(dict.fromkeys(name for row in kind.panels(shot) for name in row))
    figure, axes = plt.subplots(len(names))
    panels = dict(zip(names, axes, strict=True))
    kind.draw(shot, panels)
    camera_0 = panels["motion"].lines[0]
    np.testing.assert_allclose(camera_0.get_xdata(), 1e3 * found.time, rtol=1e-12)
    np.testing.assert_allclose(camera_0.get_ydata(), [0.0, 1.0, 2.0, 3.0, 4.0], atol=1e-12)
    assert panels["motion"].get_xlim() == panels["force"].get_xlim()  # one clock
    assert [panels[name].get_title(loc="right") for name in ("first", "static", "last")] == [
        "−0.050 ms", "0.025 ms", "",
    ]  # fmt: skip
    assert [len(panels[name].images) for name in ("first", "static", "last")] == [1, 1, 0]
    plt.close(figure)
