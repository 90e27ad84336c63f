"""Regions by hand: rejected inputs, the edit of the TOML text, the session of a page."""

import re
import tomllib

import cv2
import numpy as np
import pytest

from dic.bodies.region import Region
from dic.images.series import PicturesInMemory
from kolsky.base.errors import InputError
from kolsky.base.toml import CannotEdit, value_end, with_values
from kolsky.pictures.regions import (
    DRAWABLES_OF_SHOT,
    Session,
    crossing_sides,
    drawables_of_measurement,
    png_of,
    polygon_area,
    problems_of,
)

ROWS, COLUMNS, FRAMES = 40, 60, 3
SQUARE = [[10, 10], [30, 10], [30, 30], [10, 30]]
TEXT = """# a shot
title = "x" # kept

[dic] # kept too
flyer_side = "up"
specimen = { x = [1, 2], y = [3, 4] }  # from the sketch
strip_half_width = "0.5 mm"

[force]
specimen = 3
"""


def drawn(corners, frame=0):
    return {"specimen": [Region(tuple(map(tuple, corners)), frame)]}


def said(corners, frame=0, wanted=DRAWABLES_OF_SHOT):
    return problems_of(drawn(corners, frame), wanted, shape=(ROWS, COLUMNS), n_frames=FRAMES)


def test_a_square_can_be_saved():
    assert said(SQUARE) == []
    assert polygon_area(np.array(SQUARE, dtype=float)) == 400.0


@pytest.mark.parametrize(
    ("corners", "frame", "why"),
    [
        ([[10, 10], [70, 10], [30, 30]], 0, r"\(70, 10\) lies outside the picture of 60 x 40 px"),
        ([[10, 10], [30, -0.5], [30, 30]], 0, "lies outside"),
        ([[10, 10], [30, 30], [30, 10], [10, 30]], 0, "crosses itself: sides 1 and 3"),
        ([[10, 10], [30, 10]], 0, "has 2 corners"),
        ([], 0, "has 0 corners"),
        ([[10, 10], [30, 10], [20, 10]], 0, "holds 0 px²"),
        ([[10, 10], [13, 10], [13, 14]], 0, "holds 6 px²"),
        ([[10, 10], [30, 10], [10, 10], [10, 30]], 0, "one corner twice"),
        ([[10, 10], [30, 10], [20, 10], [20, 30]], 0, "crosses itself"),
        ([[float("nan"), 10], [30, 10], [20, 30]], 0, "not a number"),
        (SQUARE, 3, "frame 3 does not exist"),
    ],
)
def test_a_bad_region_is_refused(corners, frame, why):
    found = said(corners, frame)
    assert len(found) == 1
    assert re.search(why, found[0])


def test_one_region_where_one_is_wanted_and_each_in_its_frame():
    two = {"specimen": [Region(tuple(map(tuple, SQUARE)), 0)] * 2}
    assert "may have one" in problems_of(two, DRAWABLES_OF_SHOT, shape=(ROWS, COLUMNS), n_frames=FRAMES)[0]
    other = {"region": [Region(tuple(map(tuple, SQUARE)), 1)]}
    assert (
        "belongs into frame 0"
        in problems_of(other, drawables_of_measurement(0), shape=(ROWS, COLUMNS), n_frames=FRAMES)[0]
    )
    assert problems_of(other, drawables_of_measurement(1), shape=(ROWS, COLUMNS), n_frames=FRAMES) == []
    edge = {"transmission_edge": [Region(((1.0, 2.0), (3.0, 4.0)), 0)]}
    assert "one place" in problems_of(edge, DRAWABLES_OF_SHOT, shape=(ROWS, COLUMNS), n_frames=FRAMES)[0]
    assert problems_of({}, DRAWABLES_OF_SHOT, shape=(ROWS, COLUMNS), n_frames=FRAMES) == ["nothing is drawn"]


def test_sides_that_only_share_a_corner_do_not_cross():
    star = np.array([[20, 2], [24, 14], [38, 14], [27, 22], [31, 36], [20, 27], [9, 36], [13, 22], [2, 14]])
    assert crossing_sides(star.astype(float)) is None
    assert crossing_sides(star[[0, 2, 4, 6, 8]].astype(float)) is None
    assert crossing_sides(star[[0, 4, 8, 2, 6]].astype(float)) is not None


def test_only_the_value_changes_in_the_text():
    new = with_values(TEXT, "dic", {"specimen": "{ polygon = [[1, 2], [3, 4], [5, 6]], frame = 1 }"})
    expected = TEXT.replace("{ x = [1, 2], y = [3, 4] }", "{ polygon = [[1, 2], [3, 4], [5, 6]], frame = 1 }")
    assert new == expected
    added = with_values(TEXT, "dic", {"flyer": "{ x = [1, 2], y = [3, 4] }"})
    assert added == TEXT.replace('"0.5 mm"\n', '"0.5 mm"\nflyer = { x = [1, 2], y = [3, 4] }\n')


@pytest.mark.parametrize(
    "text",
    [
        '[dic]\nspecimen.x = [1, 2] # a\nspecimen.y = [3, 4]\nother = "#[" # b\n[z]\na = 1\n',
        '[dic]\nother = "#["\n[dic.specimen]\nx = [1, 2]\ny = [3, 4]\n# c\n[z]\na = 1\n',
        "[dic]\nspecimen = { polygon = [\n  [1, 2], # a ]\n  [3, 4],\n  [5, 6],\n] }\n"
        "other = '''\n[z]\n'''\n[z]\na = 1",
        '[dic]\r\nspecimen = "outline"\r\nother = 1\r\n',
        "[z]\na = 1\n[dic]",
    ],
)
def test_every_way_to_write_a_region_is_replaced(text):
    content = tomllib.loads(text)
    new = with_values(text, "dic", {"specimen": "{ x = [7, 8], y = [9, 10] }"})
    assert tomllib.loads(new) == {
        **content,
        "dic": {**content["dic"], "specimen": {"x": [7, 8], "y": [9, 10]}},
    }
    assert new.count("[z]") == text.count("[z]")


@pytest.mark.parametrize("text", ["dic = { flyer = 1 }\n", "dic.flyer = 1\n", "[other]\n"])
def test_a_text_that_cannot_be_edited_is_refused(text):
    with pytest.raises(CannotEdit, match="dic"):
        with_values(text, "dic", {"specimen": "[1, 2]"})


def test_a_value_ends_before_its_comment():
    for value in ('"a # b"', "[1, [2, 3]]", "'it''s'", '{ x = "]" }', "12.5", '"""two\n"lines" """'):
        text = f" {value}  # end\nnext = 1"
        assert text[: value_end(text, 0)] == f" {value}"


@pytest.fixture
def session(tmp_path):
    path = tmp_path / "shot.toml"
    path.write_text(TEXT)
    rng = np.random.default_rng(0)
    pictures = PicturesInMemory(
        [rng.integers(0, 255, (ROWS, COLUMNS), dtype=np.uint8) for _ in range(FRAMES)]
    )

    def valid(place):
        if "refuse" in place.read_text():
            raise InputError(place, "is refused")

    return Session(path, pictures, DRAWABLES_OF_SHOT, valid)


def test_frames_are_shown_as_pictures(session):
    picture = cv2.imdecode(np.frombuffer(png_of(session.pictures, 1), np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (ROWS, COLUMNS)
    assert isinstance(png_of(session.pictures, 9), str)


def test_a_region_goes_from_the_page_into_the_file(session):
    content = {**drawn(SQUARE, 2), "transmission_edge": [Region(((20, 39),), 0)]}
    assert session.problems(content) == []
    assert session.path.read_text() == TEXT
    assert session.save(content) == []
    assert session.saved == ("specimen", "transmission_edge")
    text = session.path.read_text()
    dic = tomllib.loads(text)["dic"]
    assert dic["specimen"] == {"polygon": SQUARE, "frame": 2}
    assert dic["transmission_edge"] == [20, 39]
    assert "# kept too" in text
    assert "# from the sketch" in text


@pytest.mark.parametrize(
    "content", [drawn([[10, 10], [70, 10], [30, 30]]), drawn([[10, 10], [30, 30], [30, 10], [10, 30]]), {}]
)
def test_what_is_refused_leaves_the_file_as_it_was(session, content):
    assert session.save(content)
    assert session.path.read_text() == TEXT
    assert [path.name for path in session.path.parent.iterdir()] == ["shot.toml"]


def test_a_file_that_would_be_wrong_or_was_changed_is_left_alone(session):
    content = drawn(SQUARE)
    changed = TEXT + "# by another hand\n"
    session.path.write_text(changed)
    assert "changed meanwhile" in session.save(content)[0]
    assert session.path.read_text() == changed
    session.path.write_text(TEXT + "# refuse\n")
    again = Session(session.path, session.pictures, DRAWABLES_OF_SHOT, session.validate)
    assert "is refused" in again.save(content)[0]
    assert session.path.read_text() == TEXT + "# refuse\n"
    assert [path.name for path in session.path.parent.iterdir()] == ["shot.toml"]


def test_an_edit_that_says_something_else_is_refused(monkeypatch):
    from kolsky.base import toml

    monkeypatch.setattr(toml, "_with_value", lambda text, table, key, value, newline: text)
    with pytest.raises(CannotEdit, match="value by value"):
        with_values(TEXT, "dic", {"specimen": "[1, 2]"})
