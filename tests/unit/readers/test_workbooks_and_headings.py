"""Old and hostile workbooks, text files named .xls, and units in the last word of a heading."""

import struct
import zipfile

import numpy as np
import pytest
import readerfiles as files
import xlwt

from kolsky.base.errors import InputError
from kolsky.readers.contents import Layout
from kolsky.readers.header import heading_unit, name_without_unit, split_unit
from kolsky.readers.recordings import list_channels, read_recordings


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
        ("Weg (mm)", "Weg", "mm"),
        ("Weg/mm", "Weg", "mm"),
        ("Weg / mm", "Weg", "mm"),
        ("Weg in mm", "Weg", "mm"),
        ("Weg, mm", "Weg", "mm"),
        ("travel_mm", "travel", "mm"),
        ("Stress [kgf/cm2]", "Stress", "kgf/cm2"),
        ("Load, kgf/cm2", "Load", "kgf/cm2"),
        ("Area in mm²", "Area", "mm²"),
        ("Dehnung [-]", "Dehnung", "1"),
        ("incident_bar", "incident_bar", None),
        ("Kraft (oben)", "Kraft", None),
    ],
)
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
