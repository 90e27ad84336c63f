"""Inputs that must not be accepted or end in a traceback, used as by a user."""

import ast
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from damaged_shots import Mutation, toml
from kolsky_command import run_kolsky
from shot_folders import ROOT, state
from typer.testing import CliRunner

from benchmarks.small_cases import small_shot
from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.readers.recordings import list_channels, read_recordings
from kolsky.shot.load import load_shot
from tests.fuzz.hostile import ANYWHERE, IN_TEXT, OWN, traps
from tests.fuzz.named import CORPUS, KINDS, table


def _point(value: str) -> Mutation:
    """Another distance from the axis in one row of the outline."""

    def change(folder: Path) -> None:
        path = folder / "centreline.csv"
        rows = path.read_text().splitlines()
        cells = rows[1000].split(",")
        rows[1000] = ",".join([*cells[:3], value, *cells[4:]])
        path.write_text("\n".join(rows) + "\n")

    return change


REFUSED: dict[str, tuple[Mutation, tuple[str, ...]]] = {
    "a length of 65 mm": (toml('length = "6.5 mm"', 'length = "65 mm"'),
     ("centreline.csv", "length of 65 mm", "reaches 5.881 mm")),
    "a length of 6.5 m": (toml('length = "6.5 mm"', 'length = "6.5 m"'),
     ("shot.toml line", "is 6500 mm, which is not the size of a specimen",
     'specimen.length = "6.5 mm" would fit')),
    "the time as the voltage": (toml('"CH2 transmitted (V)"', '"Time (s)"'),
     ("shot.toml line 34", "Time (s)", "rises from each of its")),
    "1e308 in the outline": (_point("1e308"), ("centreline.csv line 1001", "Z")),
    "ten radii in the outline": (_point("47.5"), ("centreline.csv line 1001", "47.5 mm")),
}  # fmt: skip
"""What is changed in a sound shot, and what the refusal names."""


@pytest.mark.parametrize("what", REFUSED)
def test_a_shot_with_it_is_refused(what: str, shot: Path) -> None:
    change, words = REFUSED[what]
    change(shot)
    with pytest.raises(InputError) as raised:
        load_shot(shot)
    said = str(raised.value)
    assert all(word in said for word in words), said
    assert "Cure: " in said
    assert "\n" not in said


def test_the_command_refuses_in_one_line_and_writes_nothing(shot: Path) -> None:
    _point("47.5")(shot)
    before = state(shot)
    done = run_kolsky("check", shot, code=2)
    assert len(done.stderr.splitlines()) == 1
    assert state(shot) == before


def test_a_refused_merge_leaves_no_ledger(shot: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.sqlite"
    other.write_bytes(b"SQLite format 3\x00" + bytes(2000))
    before = state(shot)
    for merged in (tmp_path / "none.sqlite", other):
        words = ["sweep", str(shot), "--design", "lhs", "--runs", "4", "--merge", str(merged)]
        done = run_kolsky(*words, code=2)
        assert merged.name in done.stderr
        assert state(shot) == before


def test_a_name_of_control_characters_does_not_reach_the_terminal(shot: Path) -> None:
    toml("format = 1", 'format = 1\nname = "a\\u001b]0;owned\\u0007b"')(shot)
    path = shot / "scope.csv"
    text = path.read_text().replace("CH1 incident (V)", "CH1\x1b[31m incident (V)", 1)
    path.write_text(text)
    for words in (["channels", str(path)], ["check", str(shot)]):
        done = CliRunner().invoke(app, words)
        assert not set(done.stdout + done.stderr) & set("\x1b\x07"), words


def test_a_wave_speed_of_1e300_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "bar"
    shutil.copytree(ROOT / "runs" / "bar-01", folder)
    toml('wave_speed = "5000 m/s"  ', 'wave_speed = "1e300 m/s"  ')(folder)
    done = run_kolsky("waves", folder, code=2)
    (line,) = done.stderr.splitlines()
    assert "wave_speed" in line
    assert "shot.toml" in line


@pytest.mark.parametrize("kind", ["u1", "S12", "M8[ns]", "m8[ns]", "c16", "?"])
def test_times_of_odd_types_in_hdf5(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    times = np.arange(200) * 1000
    with h5py.File(path, "w") as file:
        file["t"] = times.astype(kind).view("i8") if kind[1:].startswith("8[") else times.astype(kind)
        if kind[1:].startswith("8["):
            del file["t"]
            space = h5py.h5s.create_simple((200,))
            h5py.h5d.create(file.id, b"t", h5py.h5t.UNIX_D64LE, space)
        file["CH1"] = np.sin(np.arange(200.0))
        file["CH1"].attrs["units"] = "V"
        file["t"].attrs["units"] = "s"
    try:
        list_channels(path)
        read_recordings(path, ["/CH1"])
    except InputError as error:
        assert "a.h5" in str(error)  # noqa: PT017
        assert "Cure: " in str(error)  # noqa: PT017


@pytest.mark.slow
def test_one_stray_frame_does_not_move_the_answer(tmp_path: Path) -> None:
    """One frame of the flyer 5.9 mm off: named, and m moves no more than a frame less may move it."""
    from kolsky.identification import identify
    from kolsky.inverse.settings import Numerics, Settings

    coarse = Numerics(mesh=(8, 11), threads=1)
    settings = Settings(
        free={"stiffness_factor": None}, numerics=coarse, refined_mesh=(12, 16), replicates=2,
        replicate_mesh=(8, 11),
    )  # fmt: skip
    folder = small_shot(tmp_path / "shot")
    answers = []
    for stray in (0.0, 5.9):
        path = folder / "flyer.csv"
        lines = path.read_text().splitlines()
        row = next(k for k, line in enumerate(lines) if line.startswith("24,"))
        cells = lines[row].split(",")
        lines[row] = ",".join([*cells[:-1], f"{float(cells[-1]) + stray:.4f}"])
        path.write_text("\n".join(lines) + "\n")
        shot = load_shot(folder)
        assert [note for note in shot.flyer.notes if "frame 24" in note] == list(shot.flyer.notes)
        assert len(shot.flyer.notes) == (stray > 0.0)
        found = identify(replace(shot, centre_line=None), settings)
        answers.append(found.estimates["stiffness_factor"])
    # One of some 170 frames has no weight: a root of 1/170 of sigma in the mean, here twice that.
    assert abs(answers[1].value - answers[0].value) < 0.15 * answers[0].sigma


TRAPS = {*ANYWHERE, *IN_TEXT, *OWN}


def is_there(place: str) -> bool:
    """Whether a place of the table is a test function of its file, or a trap."""
    file, _, name = place.partition("::")
    if not name:
        return place.removeprefix(f"{CORPUS}: ") in TRAPS
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return any(isinstance(one, ast.FunctionDef) and one.name == name for one in tree.body)


@pytest.mark.parametrize("kind", KINDS)
def test_every_place_is_there(kind: str) -> None:
    lost = [place for one in KINDS[kind] for place in one.places if not is_there(place)]
    assert not lost
    assert all(one.places for one in KINDS[kind])


def test_the_look_can_say_no() -> None:
    assert not is_there(f"{CORPUS}: no such trap")
    assert not is_there("tests/fuzz/test_named_inputs.py::test_that_is_not")
    assert is_there("tests/fuzz/test_named_inputs.py::test_the_look_can_say_no")


def test_every_trap_of_its_own_is_named_or_in_the_corpus() -> None:
    assert {trap.name for trap in traps()} == TRAPS


def test_the_table_has_a_row_each() -> None:
    rows = table().splitlines()
    assert len(rows) == 2 + sum(map(len, KINDS.values()))
    assert all(row.count(" | ") == 2 for row in rows)
