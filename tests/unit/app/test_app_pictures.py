"""Pictures in a page: frames, regions drawn by clicks and as text, accuracy of a subset."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from nicegui import ui
from nicegui.testing import User
from simulated import walk
from speckle_pictures import PLANE_TOML, plane

from kolsky.app.pictures import open_all, quality_of, subset_words


def test_a_subset_says_its_noise(tmp_path: Path) -> None:
    opened = open_all(plane(tmp_path / "one"))
    quality = quality_of(opened)
    assert quality.noise == pytest.approx(
        2.0, rel=0.15
    )  # of 16 384 pixels of two frames, rounded to grey steps
    words = subset_words(quality, (60.0, 60.0))
    floor = quality.floor[60, 60]
    assert f"{floor[0]:.4f} px along x, {floor[1]:.4f} px along y" in words
    assert "Subset of 21 px at (60, 60)" in words
    assert "lies half outside" in subset_words(
        SimpleNamespace(subset=21, size=(4.0, 4.0), floor=np.full((9, 9, 2), np.nan)),  # type: ignore[arg-type]
        (3.0, 4.0),
    )


def test_speckles_are_counted_by_their_size() -> None:
    """Twice the width at half height is a period: 21 px hold (21 / 8)² of 4 px."""
    quality = SimpleNamespace(subset=21, size=(4.0, 4.0), floor=np.full((9, 9, 2), 0.01))
    assert "about 7 speckles of 4.0 px" in subset_words(quality, (3.0, 4.0))  # type: ignore[arg-type]


def test_a_region_is_drawn_changed_and_saved(tmp_path: Path) -> None:
    folder = plane(tmp_path / "root" / "one")

    async def steps(user: User) -> None:
        await user.open("/pictures?shot=one")
        await user.should_see("Camera 0", retries=100)
        (image,) = user.find(ui.interactive_image).elements
        assert str(image.source).startswith("data:image/png;base64,")
        (text,) = user.find(marker="corners").elements
        assert len(text.value.splitlines()) == 4
        user.find("Clear").click()
        view = {"mouse_event_type": "mousedown", "button": 0, "buttons": 1}
        for x, y in ((20.0, 20.0), (100.0, 20.0), (100.0, 90.0)):
            user.find(ui.interactive_image).trigger("mouse", {**view, "image_x": x, "image_y": y})
            user.find(ui.interactive_image).trigger("mouse", {**view, "mouse_event_type": "mouseup"})
        assert text.value.splitlines() == ["20, 20", "100, 20", "100, 90"]
        for kind, x in (("mousedown", 100.5), ("mousemove", 105.0), ("mouseup", 105.0), ("mousemove", 60.0)):
            user.find(ui.interactive_image).trigger(
                "mouse", {"mouse_event_type": kind, "image_x": x, "image_y": 90.0}
            )
        assert text.value.splitlines()[-1] == "105, 90"
        user.find("Check").click()
        await user.should_see("The regions can be saved.")
        assert (folder / "dic.toml").read_text("utf-8") == PLANE_TOML
        user.find("Save into dic.toml").click()
        await user.should_see("saved into dic.toml: region")
        made = tomllib.loads((folder / "dic.toml").read_text("utf-8"))["dic"]
        assert made["region"] == {"polygon": [[20, 20], [100, 20], [105, 90]]}
        text.set_value("1, 2\nthree")
        user.find(marker="corners").trigger("blur")
        await user.should_see("'three' is not a corner")

    walk(tmp_path / "root", tmp_path / "main.py", steps)
    assert (folder / "dic.toml").read_text("utf-8").startswith("# a plane\n")


def test_a_shot_without_pictures_says_so(tmp_path: Path) -> None:
    (tmp_path / "root" / "one").mkdir(parents=True)

    async def steps(user: User) -> None:
        await user.open("/pictures?shot=one")
        await user.should_see("has no shot.toml", retries=50)

    walk(tmp_path / "root", tmp_path / "main.py", steps)
