"""Tables without a declared layout: files of spreadsheets of other countries are read exactly."""

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
from kolsky_command import run_kolsky
from scipy.io import savemat
from shot_folders import OPEN_01
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.readers import text
from kolsky.readers.table import PLAIN, Column, detect_layout, layout_in_words, read_table
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel

TABLES = ("scope.csv", "frames.csv", "flyer.csv", "centreline.csv", "quasi_static.csv")


def _german(rows: list[list[str]]) -> bytes:
    """Excel with German settings, "CSV (Trennzeichen-getrennt)"."""
    return "\r\n".join(";".join(cell.replace(".", ",") for cell in row) for row in rows).encode("cp1252")


def _french(rows: list[list[str]]) -> bytes:
    """Excel with French settings, "CSV UTF-8 (délimité par des virgules)", which are semicolons there."""
    return "\r\n".join(";".join(cell.replace(".", ",") for cell in row) for row in rows).encode("utf-8-sig")


def _unicode_text(rows: list[list[str]]) -> bytes:
    """Excel, "Unicode Text" with German settings."""
    return "\r\n".join("\t".join(cell.replace(".", ",") for cell in row) for row in rows).encode("utf-16")


def _titled(rows: list[list[str]]) -> bytes:
    """A title and the line that tells Excel the delimiter, above the header."""
    return b"sep=;\r\n" + "Versuch 7, Stößel\r\n".encode("cp1252") + _german(rows)


def _american(rows: list[list[str]]) -> bytes:
    """Commas and points in the code page of Windows, with a title line."""
    return "Test 7, 25 µs\r\n".encode("cp1252") + "\r\n".join(",".join(row) for row in rows).encode("cp1252")


WRITERS: dict[Callable[[list[list[str]]], bytes], str] = {
    _german: "semicolons, decimal commas",
    _french: "semicolons, decimal commas",
    _unicode_text: "tabs, decimal commas, utf-16-le",
    _titled: "semicolons, decimal commas, cp1252, header in line 3",
    _american: "commas, decimal points, cp1252, header in line 2",
}
"""How a spreadsheet writes a table, and what is said of it."""


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_shot_of_such_exports_works_unattended(
    write: Callable[[list[list[str]]], bytes], tmp_path: Path
) -> None:
    folder = tmp_path / "shot"
    folder.mkdir()
    shutil.copy(OPEN_01 / "shot.toml", folder)
    for name in TABLES:
        with (OPEN_01 / name).open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
        (folder / name).write_bytes(write(rows))
    ours, theirs = load_shot(folder), load_shot(OPEN_01)
    assert isinstance(ours.force, ForceChannel)
    assert isinstance(theirs.force, ForceChannel)
    assert ours.centre_line is not None
    assert theirs.centre_line is not None
    for here, there in (
        (ours.force.recording.time, theirs.force.recording.time),
        (ours.force.recording.value, theirs.force.recording.value),
        (ours.flyer.time, theirs.flyer.time),
        (ours.flyer.displacement, theirs.flyer.displacement),
        (ours.centre_line.Z, theirs.centre_line.Z),
        (ours.centre_line.time, theirs.centre_line.time),
        (ours.curve.stress, theirs.curve.stress),
        (ours.curve.stretch, theirs.curve.stretch),
    ):
        np.testing.assert_array_equal(here, there)
    said = CliRunner().invoke(app, ["check", str(folder), "--json"]).stdout
    assert f'"value": "{WRITERS[write]}"' in said


def test_plain_tables_are_what_they_were_and_nothing_is_said(tmp_path: Path) -> None:
    for name in TABLES:
        assert detect_layout(OPEN_01 / name, (OPEN_01 / name).read_bytes()) is PLAIN
        assert layout_in_words(OPEN_01 / name) == ""
    (tmp_path / "one.csv").write_text("F\n1\n2\n3\n", encoding="utf-8")  # one column has no delimiter
    assert detect_layout(tmp_path / "one.csv", b"F\n1\n2\n3\n") is PLAIN


ROWS = [f"{i};0,{10 + i}" for i in range(12)]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([*ROWS[:4], "4;", *ROWS[5:]], "line 6: column 't (s)' is not a number: ''"),
        ([*ROWS[:4], "4;0,6;7", *ROWS[5:]], "line 6: has 3 fields, the header has 2"),
        ([*ROWS[:4], "4;0.6", *ROWS[5:]], "line 6: column 't (s)' is not a number: '0.6'"),  # two signs
        ([row.replace("0,", "1.234,") for row in ROWS], "line 13: most fields between its semicolons"),
        ([f"{row} s" for row in ROWS], "not plain numbers: '11;0,21 s'. Cure: export numbers without"),
    ],
)
def test_what_is_no_table_is_refused_with_its_place(rows: list[str], words: str, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("\n".join(["frame;t (s)", *rows]), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_table(path).values(Column("t (s)"))
    assert words in str(refused.value)


def test_units_below_the_header_are_no_data(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("\n".join(["Zeit;Weg", "s;mm", *ROWS]), encoding="utf-8")
    table = read_table(path)
    np.testing.assert_allclose(
        table.values(Column("Weg", 1e-3)), 1e-3 * np.round(np.linspace(0.1, 0.21, 12), 2), rtol=1e-15
    )
    assert table.first_line == 3
    assert layout_in_words(path) == "semicolons, decimal commas, units in line 2"


@pytest.mark.parametrize(
    "delimiter", [*text.DELIMITERS, text.Delimiter("pipe", "|", "pipes")], ids=lambda d: d.name
)
def test_a_delimiter_is_one_line_of_the_registry(
    delimiter: text.Delimiter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A table with it is found by `channels` and `check`, and a wrong column is refused by name."""
    if delimiter not in text.DELIMITERS:
        monkeypatch.setattr(text, "DELIMITERS", (*text.DELIMITERS, delimiter))
    shutil.copytree(OPEN_01, tmp_path / "shot", ignore=shutil.ignore_patterns("results"))
    table = tmp_path / "shot" / "frames.csv"
    with table.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    bare = [[name.split(" ")[0] for name in names], *rows]
    toml = tmp_path / "shot" / "shot.toml"
    above, header, frames = toml.read_text("utf-8").partition("\n[frames]")
    for name, plain in zip(names, bare[0], strict=True):
        frames = frames.replace(f'"{name}"', f'"{plain}"', 1)
    table.write_text("\n".join(delimiter.character.join(row) for row in bare), "utf-8")
    channels = run_kolsky("channels", table, "--json")
    assert f'"delimiter": "{delimiter.name}"' in channels.output
    found = layout_in_words(table)
    assert found == "" if delimiter == text.COMMA else found.startswith(delimiter.plural)
    with pytest.raises(InputError, match=f"separated by {delimiter.plural}"):
        read_table(table).values(Column("absent"))
    toml.write_text(above + header + frames, "utf-8")
    checked = run_kolsky("check", tmp_path / "shot")
    assert delimiter.plural in checked.output or delimiter == text.COMMA


@pytest.mark.parametrize("name", ["frames.csv", "quasi_static.csv"])
@pytest.mark.parametrize("ending", [".xlsx", ".mat", ".h5"])
def test_a_workbook_or_arrays_stand_for_a_text(name: str, ending: str, tmp_path: Path) -> None:
    """The same numbers to the last bit, by the same door."""
    there = read_table(OPEN_01 / name)
    plain = {f"c{i}": there.values(Column(column)) for i, column in enumerate(there.header)}
    path = tmp_path / f"table{ending}"
    if ending == ".xlsx":
        book = openpyxl.Workbook()
        assert book.active is not None
        for row in ([*plain], *zip(*(x.tolist() for x in plain.values()), strict=True)):
            book.active.append(row)
        book.save(path)
    elif ending == ".mat":
        savemat(path, plain)
    else:
        with h5py.File(path, "w") as file:
            for key, values in plain.items():
                file[key] = values
    here = read_table(path)
    assert len(here.header) == len(plain)
    for key, values in plain.items():
        np.testing.assert_array_equal(here.values(Column(f"/{key}" if ending == ".h5" else key)), values)
    with pytest.raises(InputError, match="'absent' is missing"):
        here.values(Column("absent"))
