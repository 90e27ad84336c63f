"""Editing of a shot file in a page: single changes, comments, undo, conflicts, the start from raw files."""

from __future__ import annotations

import json
import shutil
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from laboratory_files import OPEN_05, TYPED, laboratory
from nicegui import ui
from nicegui.testing import User
from simulated import walk

from kolsky.app import signals
from kolsky.app.draft import Conflict, Draft, choices, fields_of, optional_keys, series_toml
from kolsky.base.errors import InputError
from kolsky.shot.load import check_shot
from kolsky.survey.blank_file import write_new
from kolsky.survey.new_file import fill_in

SMALL = """# a shot
format = 1

[specimen] # round
diameter = "9.5 mm"   # measured twice
length = ""           # > 0
# density = "1 g/cm^3" # weigh it
"""


def draft(folder: Path, text: str = SMALL) -> Draft:
    (folder / "shot.toml").write_text(text, encoding="utf-8")
    return Draft(folder / "shot.toml")


def test_fields_have_their_remarks() -> None:
    found = {e.dotted: e for e in fields_of(SMALL)}
    assert list(found) == ["format", "specimen.diameter", "specimen.length"]
    assert found["specimen.diameter"].display == "9.5 mm"
    assert found["specimen.diameter"].remark == "measured twice"
    assert found["specimen.length"].blank
    assert not found["specimen.diameter"].blank
    assert optional_keys(SMALL, "specimen") == ["density"]


def test_choices_are_those_of_the_schema() -> None:
    assert choices("force.compression") == ("positive", "negative")
    assert "bonded" in choices("interface.faces")
    assert choices("model.damping_kind") == ("deviatoric", "full")
    assert choices("specimen.length") == ()
    assert choices("nothing.here") == ()


def test_a_change_keeps_everything_else_and_undo_gives_the_same_bytes(tmp_path: Path) -> None:
    one = draft(tmp_path)
    one.enter("specimen.length", "6.5 mm")
    one.enter("specimen.density", "870 kg/m^3")
    text = (tmp_path / "shot.toml").read_text("utf-8")
    assert text == SMALL.replace('length = ""           #', 'length = "6.5 mm"           #').replace(
        '# density = "1 g/cm^3" # weigh it', 'density = "870 kg/m^3"                # weigh it'
    )
    assert one.undo()
    assert one.undo()
    assert (tmp_path / "shot.toml").read_bytes() == SMALL.encode()
    assert not one.undo()


@pytest.mark.parametrize(
    ("key", "typed", "toml"),
    [
        ("frames.static", "12", "12"),
        ("model.poisson", "0.499", "0.499"),
        ("specimen.length", "6.5 mm", '"6.5 mm"'),
        ("specimen.length", "", '""'),
        ("specimen.length", '6.5 "', '"6.5 \\""'),
        ("force.baseline", '["0 us", "1 us"]', '["0 us", "1 us"]'),
    ],
)
def test_what_is_typed_becomes_what_the_schema_wants(key: str, typed: str, toml: str, tmp_path: Path) -> None:
    one = draft(tmp_path, (OPEN_05 / "shot.toml").read_text("utf-8"))
    assert one.as_toml(key, typed) == toml


def test_two_tabs_cannot_overwrite_each_other(tmp_path: Path) -> None:
    one, other = draft(tmp_path), Draft(tmp_path / "shot.toml")
    one.enter("specimen.length", "6.5 mm")
    with pytest.raises(Conflict, match="was changed by another page"):
        other.enter("specimen.length", "7 mm")
    assert tomllib.loads((tmp_path / "shot.toml").read_text())["specimen"]["length"] == "6.5 mm"
    with pytest.raises(Conflict):
        other.write("format = 1\n")
    other.reload()
    other.enter("specimen.length", "7 mm")
    with pytest.raises(Conflict):
        one.undo()
    assert tomllib.loads((tmp_path / "shot.toml").read_text())["specimen"]["length"] == "7 mm"


def test_of_many_tabs_at_once_no_change_is_lost_or_torn(tmp_path: Path) -> None:
    """Each enters its own key again and again; a refused one reads the file and enters it then."""
    keys = [f"key_{i}" for i in range(4)]
    path = draft(tmp_path, "# many\n" + "".join(f'{key} = "0"  # of {key}\n' for key in keys)).path

    def enter(key: str) -> int:
        mine, refused = Draft(path), 0
        for number in range(1, 9):
            while True:
                try:
                    mine.set_values({key: f'"{number}"'})
                    break
                except Conflict:
                    refused += 1
                    mine.reload()
        return refused

    with ThreadPoolExecutor(len(keys)) as tabs:
        list(tabs.map(enter, keys))
    lines = path.read_text("utf-8").splitlines()
    assert [line.split() for line in lines[1:]] == [[key, "=", '"8"', "#", "of", key] for key in keys]
    assert lines[0] == "# many"
    assert list(tmp_path.iterdir()) == [path]  # no part of a file is left


def test_a_text_that_is_no_toml_is_not_written(tmp_path: Path) -> None:
    one = draft(tmp_path)
    with pytest.raises(InputError, match="is not valid TOML"):
        one.write(SMALL + "x = \n")
    assert (tmp_path / "shot.toml").read_text() == SMALL


def test_long_signals_keep_their_peaks() -> None:
    x = np.arange(100_003.0)
    y = np.sin(x)
    y[77_777] = 5.0
    fewer, values = signals.thinned(x, y)
    assert fewer.size <= signals.MOST_POINTS + 2
    assert values.max() == 5.0
    assert (np.diff(fewer) > 0.0).all()
    assert fewer[-1] == x[-1]


def test_plots_follow_signs_units_and_clocks() -> None:
    text = (OPEN_05 / "shot.toml").read_text("utf-8")
    content = tomllib.loads(text)
    force = signals.force_signal(OPEN_05, content)
    moved = signals.motion_signal(OPEN_05, content)
    curve = signals.curve_signal(OPEN_05, content)
    assert force is not None
    assert moved is not None
    assert curve is not None
    assert signals.interval_of(content, "force", "baseline") == pytest.approx((-200.0, 0.0))
    assert signals.interval_of(content, "window", "start", "end") is None
    other = tomllib.loads(
        text.replace('compression = "positive"', 'compression = "negative"')
        .replace('clock_offset = "0 us"', 'clock_offset = "10 us"', 1)
        .replace('positive = "toward specimen"', 'positive = "away from specimen"')
        .replace('convention = "tension positive"', 'convention = "compression positive"')
    )
    turned = signals.force_signal(OPEN_05, other)
    assert turned is not None
    np.testing.assert_allclose(turned.x - force.x, 10.0, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(turned.y, -force.y)
    assert "Minus" in turned.y_name
    np.testing.assert_array_equal(getattr(signals.motion_signal(OPEN_05, other), "y", None), -moved.y)
    np.testing.assert_array_equal(getattr(signals.curve_signal(OPEN_05, other), "y", None), -curve.y)


def test_a_motion_follows_the_clock_of_its_frames() -> None:
    text = (OPEN_05 / "shot.toml").read_text("utf-8")
    content = tomllib.loads(text)
    moved = signals.motion_signal(OPEN_05, content)
    assert moved is not None
    few = signals.Signal(moved.x[:3], moved.y[:3], "", "")
    now = signals.on_clock(OPEN_05, content, few)
    assert now is not None
    times = np.loadtxt(OPEN_05 / "frames.csv", delimiter=",", skiprows=1)[:3, 1]
    np.testing.assert_allclose(now.x, 1e6 * times, rtol=1e-12)
    before, frames, after = text.partition("[frames]")
    late = before + frames + after.replace('clock_offset = "0 us"', 'clock_offset = "-7 us"', 1)
    later = signals.on_clock(OPEN_05, tomllib.loads(late), few)
    assert later is not None
    np.testing.assert_allclose(later.x - now.x, -7.0, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(later.y, few.y)
    assert signals.on_clock(OPEN_05, content, signals.Signal(np.array([1e4]), np.zeros(1), "", "")) is None


RAW_FRAMES, RAW_SIDE, STEP = 8, 32, 10
"""Pictures of each camera; from frame 4 on, camera 0 is brighter by so many grey values a frame."""


def pictures_of_two_cameras(folder: Path) -> Path:
    """Raw pictures and the times of their frames, no shot file."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(2)
    for camera in (0, 1):
        ground = rng.integers(20, 100, (RAW_SIDE, RAW_SIDE))
        for k in range(RAW_FRAMES):
            brighter = STEP * max(k - 3, 0) if camera == 0 else 0
            cv2.imwrite(str(folder / f"cam{camera}_{k:02d}.png"), (ground + brighter).astype(np.uint8))
    lines = "".join(f"{k},{1e-5 * k}\n" for k in range(RAW_FRAMES))
    (folder / "frames.csv").write_text(f"frame,time (s)\n{lines}", encoding="utf-8")
    (folder / "rig.xml").write_text("<rig/>", encoding="utf-8")
    return folder


def test_pictures_are_offered_and_compared(tmp_path: Path) -> None:
    folder = pictures_of_two_cameras(tmp_path / "one")
    assert [one.name for one in signals.picture_series(folder)] == ["cam0_*.png", "cam1_*.png"]
    assert signals.rig_files(folder) == ["frames.csv", "rig.xml"]
    assert series_toml("pattern", "cam0_*.png", ["192", " "]) == (
        '{ pattern = "cam0_*.png", crop_offset = [192, ""] }'
    )
    content = {
        "pictures": {
            f"camera_{i}": tomllib.loads(f"value = {series_toml('pattern', f'cam{i}_*.png', ['0', '0'])}")[
                "value"
            ]
            for i in (0, 1)
        }
    }
    series = signals.declared_series(folder, content)
    found = signals.changes(series)
    assert found is not None
    signal = signals.change_signal(found)
    brighter = [0, 0, 0, 0, *(STEP * k for k in range(1, RAW_FRAMES - 3))]
    np.testing.assert_allclose(signal.y, 100.0 * np.array(brighter) / 255.0, rtol=1e-12)
    np.testing.assert_array_equal(signal.x, np.arange(RAW_FRAMES))
    content["pictures"]["camera_1"] = {"pattern": "none_*.png", "crop_offset": [0, 0]}
    assert signals.declared_series(folder, content) == []
    assert signals.changes([]) is None


def test_frames_at_rest_are_chosen_over_the_pictures(tmp_path: Path) -> None:
    folder = pictures_of_two_cameras(tmp_path / "root" / "one")
    write_new(folder, pictures=True)
    path = folder / "shot.toml"
    remarks = [line.partition("#")[2] for line in path.read_text("utf-8").splitlines()]

    def declared() -> dict[str, dict[str, object]]:
        return tomllib.loads(path.read_text("utf-8"))

    async def steps(user: User) -> None:
        await user.open("/setup?shot=one")
        (slider,) = user.find(marker="static-slider").elements
        slider.set_value(4)
        await user.should_see("Frame 3, the last one at rest")
        user.find(marker="static-slider").trigger("change")
        assert declared()["frames"]["static"] == 4
        (field,) = user.find(marker="frames.static").elements
        assert field.value == "4"
        fill(user, "pictures.camera_0.x", "192")
        fill(user, "pictures.camera_0.y", "64")
        assert declared()["pictures"]["camera_0"] == {"pattern": "cam0_*.png", "crop_offset": [192, 64]}
        fill(user, "pictures.camera_0", "cam1_*.png")
        assert declared()["pictures"]["camera_0"] == {"pattern": "cam1_*.png", "crop_offset": [192, 64]}
        fill(user, "calibration.file", "rig.xml")
        assert declared()["calibration"]["file"] == "rig.xml"
        user.find("Undo").click()
        user.find("Undo").click()
        assert declared()["pictures"]["camera_0"] == {"pattern": "cam0_*.png", "crop_offset": [192, 64]}

    walk(tmp_path / "root", tmp_path / "main.py", steps)
    assert [line.partition("#")[2] for line in path.read_text("utf-8").splitlines()] == remarks


def test_a_dragged_stretch_stands_in_the_fields_and_problems_at_theirs(tmp_path: Path) -> None:
    root = tmp_path / "root"
    shutil.copytree(OPEN_05, root / "one")

    async def steps(user: User) -> None:
        await user.open("/setup?shot=one")
        (plot,) = user.find(marker="plot-force").elements
        assert [one["name"] for one in plot.options["series"]] == ["signal", "flyer"]
        user.find(marker="plot-force").trigger(
            "chart:brushEnd", {"areas": [{"coordRange": [-50.07, -150.02]}]}
        )
        content = tomllib.loads((root / "one" / "shot.toml").read_text("utf-8"))
        assert content["force"]["baseline"] == ["-150 us", "-50.1 us"]  # inward, to a tenth of a microsecond
        (end,) = user.find(marker="force.baseline.1").elements
        assert end.value == "-50.1 us"
        (area,) = plot.options["series"][0]["markArea"]["data"]
        assert (area[0]["xAxis"], area[1]["xAxis"]) == pytest.approx((-150.0, -50.1))
        fill(user, "force.baseline.1", "-160 us")
        user.find(kind=ui.button, content="Check").click()
        await user.should_see("The check found 1 problem", retries=100)
        (label,) = (one for one in user.find(marker="problem-force.baseline").elements)
        assert "ends before it begins" in label.text

    walk(root, tmp_path / "main.py", steps)


def test_a_chosen_file_brings_its_columns() -> None:
    assert (
        signals.assigned("curve", signals.entry(OPEN_05, "quasi_static.csv"))["curve.file"]
        == '"quasi_static.csv"'
    )
    assert "nominal strain" in str(
        signals.assigned("curve", signals.entry(OPEN_05, "quasi_static.csv"))["curve.strain"]
    )
    with pytest.raises(InputError, match="is not there"):
        signals.entry(OPEN_05, "none.csv")


def fill(user: User, key: str, typed: str) -> None:
    """Type or choose a value in the form, as a person does."""
    (element,) = user.find(marker=key).elements
    if isinstance(element, ui.select):
        element.set_value(typed)
        return
    element.set_value(typed)
    user.find(marker=key).trigger("blur")


@pytest.mark.slow  # surveys and checks 372 exports three times
def test_from_raw_files_to_a_shot_that_passes_the_check(tmp_path: Path) -> None:
    """A German scope file, VIC-3D's series and a workbook; nothing is typed but what no file holds."""
    folder = laboratory(tmp_path / "root" / "shot5")
    twin = tmp_path / "twin"
    shutil.copytree(folder, twin)

    async def steps(user: User) -> None:
        await user.open("/setup?shot=shot5")
        user.find("Look at the files and write shot.toml").click()
        await user.should_see("values are not filled in", retries=300)
        await user.should_see("11 values are not filled in")
        for key, toml in TYPED.items():
            value = json.loads(toml)
            if isinstance(value, list):
                for i, one in enumerate(value):
                    fill(user, f"{key}.{i}", one)
            else:
                fill(user, key, str(value))
        await user.should_see("Every value is filled in")
        user.find(kind=ui.button, content="Check").click()
        await user.should_see("The check passed", retries=400)

    walk(tmp_path / "root", tmp_path / "main.py", steps)
    write_new(twin)  # as `kolsky new` writes it; a person fills it in an editor
    text = fill_in((twin / "shot.toml").read_text("utf-8"), TYPED)
    made = (folder / "shot.toml").read_text("utf-8")
    assert tomllib.loads(made) == tomllib.loads(text)
    assert [line.partition("#")[2] for line in made.splitlines()] == [
        line.partition("#")[2] for line in text.splitlines()
    ]
    assert check_shot(folder).name


def test_a_second_tab_is_told(tmp_path: Path) -> None:
    root = tmp_path / "root"
    shutil.copytree(OPEN_05, root / "one")

    async def steps(user: User) -> None:
        await user.open("/setup?shot=one")
        await user.should_see("Every value is filled in")
        path = root / "one" / "shot.toml"
        path.write_text(path.read_text("utf-8") + "# by hand\n", encoding="utf-8")
        fill(user, "specimen.length", "7 mm")
        await user.should_see("was changed by another page or program")
        assert path.read_text("utf-8").endswith("# by hand\n")
        assert tomllib.loads(path.read_text("utf-8"))["specimen"]["length"] == "6.5 mm"
        user.find("Read the file again").click()
        fill(user, "specimen.length", "7 mm")
        await user.should_see("Every value is filled in")
        assert tomllib.loads(path.read_text("utf-8"))["specimen"]["length"] == "7 mm"
        user.find("Undo").click()
        assert tomllib.loads(path.read_text("utf-8"))["specimen"]["length"] == "6.5 mm"
        fill(user, "force.compression", "negative")
        assert tomllib.loads(path.read_text("utf-8"))["force"]["compression"] == "negative"
        fill(user, "specimen.length", "7 furlongs per")
        await user.should_see("1 values cannot be used yet")

    walk(root, tmp_path / "main.py", steps)
