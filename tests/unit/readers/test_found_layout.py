"""Tables without a declared layout, workbooks, headings, and units in every format."""

import csv
import shutil
import struct
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
import readerfiles as files
import xlwt
from kolsky_command import run_kolsky
from nptdms import ChannelObject, TdmsWriter
from readerfiles import CH1, FILES, INTERVAL, TIME, lvm
from scipy.io import savemat
from shot_folders import OPEN_01
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.readers import text
from kolsky.readers.header import heading_unit, name_without_unit, split_unit
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import list_channels, read_recordings
from kolsky.readers.table import PLAIN, Column, detect_layout, layout_in_words, read_table
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel

# Tables without a declared layout: files of spreadsheets of other countries are read exactly.

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
    plain = {f"c{i}": there.values(Column(column)) for i, column in enumerate(there.names)}
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
    assert len(here.names) == len(plain)
    for key, values in plain.items():
        np.testing.assert_array_equal(here.values(Column(f"/{key}" if ending == ".h5" else key)), values)
    with pytest.raises(InputError, match="'absent' is missing"):
        here.values(Column("absent"))


# Millivolts and microstrain in every format: by the unit in the file if it has one, and by declaration.

UNITS = [
    ("mV", "V", 1e-3), ("microstrain", "1", 1e-6), ("µε", "1", 1e-6), ("με", "1", 1e-6), ("ue", "1", 1e-6),
    ("kgf/cm2", "Pa", 98066.5), ("N/mm²", "Pa", 1e6), ("lbf", "N", 4.4482216152605),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "si", "factor"), UNITS[:2])
@pytest.mark.parametrize("name", FILES)
def test_a_declared_unit_is_taken_and_the_files_own_is_kept(tmp_path, name, unit, si, factor):
    made = FILES[name]
    path = made.written(tmp_path)
    own = None if made.layout.unit else read_recordings(path, made.channels[:1])[made.channels[0]]
    layout = replace(made.layout, unit=unit)
    found = read_recordings(path, made.channels[:1], layout=layout)[made.channels[0]]
    assert found.unit == si
    scale = 1.0 if own is None else np.ptp(own.value) / np.ptp(CH1)
    np.testing.assert_allclose(found.value, factor * CH1, atol=1e-6 * factor * max(scale, 1.0))
    assert found.note == ""
    if own is not None:
        assert own.unit == "V"
        assert found.file_unit == own.file_unit is not None  # what the shot's note compares


def in_excel(path, unit):
    book = openpyxl.Workbook()
    book.active.append(["Time (s)", f"CH1 ({unit})"])
    for row in zip(TIME, CH1, strict=True):
        book.active.append([float(x) for x in row])
    book.save(path / "a.xlsx")
    return path / "a.xlsx", f"CH1 ({unit})"


def in_text(path, unit):
    rows = [f"{t:.8e},{v:.10f}" for t, v in zip(TIME, CH1, strict=True)]
    (path / "a.csv").write_text("\n".join([f"Time (s),CH1 ({unit})", *rows]) + "\n", encoding="utf-8")
    return path / "a.csv", f"CH1 ({unit})"


def in_hdf5(path, unit):
    with h5py.File(path / "a.h5", "w") as file:
        file["CH1"] = CH1
        file["CH1"].attrs.update({"dt": INTERVAL, "t0": TIME[0], "units": unit})
    return path / "a.h5", "/CH1"


def in_tdms(path, unit):
    keys = {"wf_increment": INTERVAL, "wf_start_offset": TIME[0], "unit_string": unit}
    with TdmsWriter(path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("scope", "CH1", CH1, properties=keys)])
    return path / "a.tdms", "scope/CH1"


def in_lvm(path, unit):
    made = lvm(path / "a.lvm")
    made.write_bytes(made.read_bytes().replace(b"Volts", unit.encode("utf-8")))
    return made, "CH1"


@pytest.mark.parametrize(("unit", "si", "factor"), UNITS)
@pytest.mark.parametrize("write", [in_text, in_excel, in_hdf5, in_tdms, in_lvm])
def test_a_files_own_unit_is_taken(tmp_path, write, unit, si, factor):
    path, channel = write(tmp_path, unit)
    found = read_recordings(path, [channel])[channel]
    assert (found.unit, found.file_unit) == (si, unit)
    np.testing.assert_allclose(found.value, factor * CH1, atol=1e-9 * factor)


# Old and hostile workbooks, text files named .xls, and units in the last word of a heading.


def test_an_old_workbook_needs_one_filled_sheet_or_a_name(tmp_path):
    book = xlwt.Workbook()
    for title, factor in (("first", 1.0), ("second", 2.0)):
        sheet = book.add_sheet(title)
        for i, row in enumerate([["time_us", "CH1_mV"], *([0.1 * k, factor * k] for k in range(20))]):
            for j, cell in enumerate(row):
                sheet.write(i, j, cell)
    book.save(str(tmp_path / "a.xls"))
    with pytest.raises(InputError, match=r"has 2 sheets with data.*sheet ="):
        read_recordings(tmp_path / "a.xls", ["CH1_mV"])
    with pytest.raises(InputError, match=r"has no sheet 'third'; its sheets are \['first', 'second'\]"):
        read_recordings(tmp_path / "a.xls", ["CH1_mV"], layout=Layout(sheet="third"))
    found = read_recordings(tmp_path / "a.xls", ["CH1_mV"], layout=Layout(sheet="second"))["CH1_mV"]
    np.testing.assert_allclose(found.value, 2e-3 * np.arange(20), rtol=1e-15)
    assert found.unit == "V"
    np.testing.assert_allclose(found.time, 1e-7 * np.arange(20), rtol=1e-12)


def test_a_cell_far_out_ends_no_process(tmp_path):
    """A number at row and column 65 535 would take 10^11 bytes as a rectangle."""
    path = files.excel_97(tmp_path / "a.xls")
    data = path.read_bytes()
    number = struct.pack("<HHHH", 0x0203, 14, 101, 2)  # a NUMBER record: row 101, column 2
    assert data.count(number) == 1
    path.write_bytes(data.replace(number, struct.pack("<HHHH", 0x0203, 14, 65535, 65535)))
    with pytest.raises(InputError, match=r"is not a workbook that can be read \(memory allocation"):
        read_recordings(path, ["CH1_V"])


def test_a_cell_far_out_of_a_new_workbook_costs_no_memory(tmp_path):
    path = files.excel(tmp_path / "a.xlsx")
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = parts["xl/worksheets/sheet1.xml"]
    assert sheet.count(b'r="C402"') == 1
    parts["xl/worksheets/sheet1.xml"] = sheet.replace(b'r="C402"', b'r="XFD402"')
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    with pytest.raises(InputError, match="row 402"):
        read_recordings(path, ["CH2/V"])


def test_an_old_workbook_that_is_cut_off(tmp_path):
    path = files.excel_97(tmp_path / "a.xls")
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError, match="is not a workbook that can be read"):
        read_recordings(path, ["CH1_V"])


def test_text_that_is_called_xls_is_text(tmp_path):
    """LabVIEW writes tab-separated text and calls it .xls."""
    path = tmp_path / "a.xls"
    rows = [f"{1e-7 * k:.9f}\t{0.01 * k:.6f}" for k in range(30)]
    path.write_text("\n".join(["time_s\tCH1_V", *rows]))
    found = read_recordings(path, ["CH1_V"])["CH1_V"]
    assert found.unit == "V"
    np.testing.assert_allclose(found.value, 0.01 * np.arange(30), atol=1e-12)
    assert list_channels(path)[0].facts["format"] == "delimited"


@pytest.mark.parametrize(
    ("heading", "expected"),
    [
        ("time_s", ("time", "s")),
        ("Time_us", ("Time", "us")),
        ("elapsed_time_ms", ("elapsed_time", "ms")),
        ("Zeit in ms", ("Zeit", "ms")),
        ("t, µs", ("t", "µs")),
        ("timestamp_s", ("timestamp", "s")),
        ("CH1_mV", ("CH1", "mV")),
        ("CH2, V", ("CH2", "V")),
        ("incident_microstrain", ("incident", "microstrain")),
        ("gauge_1_µε", ("gauge_1", "µε")),
        ("force_kN", ("force", "kN")),
        # A letter that is no unit of what the column holds: channels, plurals, numbers.
        ("CH_A", ("CH_A", None)),
        ("CH_C", ("CH_C", None)),
        ("gauge_s", ("gauge_s", None)),
        ("CH_1", ("CH_1", None)),
        ("test_me", ("test_me", None)),
        ("incident_bar", ("incident_bar", None)),
        # The longest unit counts: the last word of a rate or a speed is no time.
        ("Rate/1/s", ("Rate/1/s", None)),
        ("Strain_gauge_1/V", ("Strain_gauge_1", "V")),
        ("Strain rate in 1/s", ("Strain rate in 1/s", None)),
        ("Speed in m/s", ("Speed", "m/s")),
        ("Speed/mm/s", ("Speed", "mm/s")),
        ("Druck/bar", ("Druck", "bar")),
        ("Stress/kgf/cm2", ("Stress", "kgf/cm2")),
        ("Spannung in N/mm²", ("Spannung", "N/mm²")),
        ("Load, kgf", ("Load", "kgf")),
    ],
)
def test_a_unit_is_found_in_the_last_word_of_a_heading(heading, expected):
    assert split_unit(heading) == expected


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("Weg (mm)", "Weg", "mm"), ("Weg/mm", "Weg", "mm"), ("Weg / mm", "Weg", "mm"),
        ("Weg in mm", "Weg", "mm"), ("Weg, mm", "Weg", "mm"), ("travel_mm", "travel", "mm"),
        ("Stress [kgf/cm2]", "Stress", "kgf/cm2"), ("Load, kgf/cm2", "Load", "kgf/cm2"),
        ("Area in mm²", "Area", "mm²"), ("Dehnung [-]", "Dehnung", "1"),
        ("incident_bar", "incident_bar", None), ("Kraft (oben)", "Kraft", None),
    ],
)  # fmt: skip
def test_a_unit_of_any_kind_wherever_a_heading_has_it(heading, name, unit):
    assert (name_without_unit(heading), heading_unit(heading)) == (name, unit)


@pytest.mark.parametrize("time", ["time_s", "Time_s", "t_s", "elapsed_time_s", "timestamp (s)"])
def test_a_time_column_by_its_last_word(tmp_path, time):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{time},CH1 (V)", *(f"{1e-6 * k:.9f},{0.1 * k}" for k in range(20))]))
    (found,) = list_channels(path)
    assert (found.name, found.interval) == ("CH1 (V)", pytest.approx(1e-6, rel=1e-12))


@pytest.mark.parametrize(("step", "known"), [(1e-7, True), (1.002e-7, False), (0.1, False)])
def test_the_headers_interval_tells_the_unit_of_a_time_column(tmp_path, step, known):
    """A scope's TIME has no unit, its Sample Interval has: equal steps are in seconds, others are refused."""
    path = tmp_path / "a.csv"
    head = ["Model,MSO44", "Sample Interval,1.0E-07,s", "TIME,CH1 (mV)"]
    path.write_text("\n".join([*head, *(f"{step * k:.9e},{k % 7}" for k in range(200))]))
    (found,) = list_channels(path)
    if known:
        assert found.interval == pytest.approx(1e-7, rel=1e-9)
    else:
        assert found.interval is None
        assert "has no unit" in found.time
