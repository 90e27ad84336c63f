"""The page of `kolsky check` for a test between bars, and its figure where pictures are not read yet."""

from dataclasses import fields
from typing import Any

from barrecord import classical_shot
from matplotlib import pyplot as plt
from shot_folders import OPEN_01

from kolsky.report.figures import CHECKS, figures_of
from kolsky.report.pages.check import render
from kolsky.shot.load import load_shot
from kolsky.shot.records import PicturedShot, ShotBase


def test_a_test_between_bars_has_no_outline() -> None:
    shot = classical_shot(0)
    page = render(shot)
    assert "The velocity of the front face on the same clock" in page
    assert "(c) The outline at three times" not in page
    assert figures_of(shot) == CHECKS


def test_pictures_that_are_not_correlated_show_the_force_alone() -> None:
    loaded: Any = load_shot(OPEN_01)
    base = {field.name: getattr(loaded, field.name) for field in fields(ShotBase)}
    unread: Any = None
    shot = PicturedShot(**base, pictures=unread)
    (kind,) = CHECKS.values()
    assert "still in the pictures" in kind.caption(shot)
    figure, axes = plt.subplots(3)
    kind.draw(shot, dict(zip(("force", "motion", "outline"), axes, strict=True)))
    assert len(axes[0].lines) == 1
    assert len(axes[1].lines) == len(axes[2].lines) == 0
    plt.close(figure)
