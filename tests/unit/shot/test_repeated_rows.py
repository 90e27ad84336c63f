"""A row of the outline that an export holds several times is one measurement, and is named."""

from pathlib import Path

from shot_folders import shot_in

from kolsky.shot.load import load_shot


def test_an_outline_row_that_stands_five_hundred_times_is_counted_once(tmp_path: Path) -> None:
    folder = shot_in(tmp_path / "shot")
    sound = load_shot(folder)
    assert sound.notes == ()
    path = folder / "centreline.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:1001], *[rows[1000]] * 499, *rows[1001:]]) + "\n")
    found = load_shot(folder)
    for name in ("time", "frame", "y", "Z", "sigma"):
        assert (getattr(found.centre_line, name) == getattr(sound.centre_line, name)).all()
    frame = rows[1000].split(",")[0]
    (note,) = found.notes
    assert note.startswith(f"centreline.csv line 1001: the point of frame {frame} stands 500 times")
