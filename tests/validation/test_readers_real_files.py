"""Recorder files of other laboratories, compared with an independent parse of the same bytes."""

import csv
import gzip
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from kolsky_command import rows_of
from scipy.io import whosmat

from kolsky.base.errors import InputError
from kolsky.readers.child import NUMBERS
from kolsky.readers.dic_export import PointState, read
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import list_channels, read_contents, read_recordings, read_scope
from kolsky.readers.table import Column

YAO_INTERVAL = 80e-9
"""Interval of both samples [s]: what a straight line through the 20 000 times of sample 2 gives."""


def by_hand(path, skip=0, delimiter=",", encoding="utf-8"):
    with path.open(encoding=encoding, newline="") as stream:
        return [row for row in csv.reader(stream, delimiter=delimiter) if row][skip:]


def test_yao_sample_01(shared):
    path = shared / "data/bars/yao_epoxy/sample_01_raw_voltage.csv"
    names = ["incident_bar_signal/voltage", "transmission_bar_signal/voltage"]
    with pytest.raises(InputError, match=r"rounded .* suggest an interval of 7.9904e-08 s \(± 3e-10 s\)"):
        read_recordings(path, names, layout=Layout(unit="V"))
    found = read_recordings(path, names, layout=Layout(unit="V", interval=YAO_INTERVAL))
    rows = by_hand(path, skip=1)
    for column, name in enumerate(names, start=1):
        np.testing.assert_array_equal(found[name].value, [float(row[column]) for row in rows])
    # The times around 0 have 14 decimals, e.g. -6.98e-12 s of sample 2470; they place the first sample.
    place = next(i for i, row in enumerate(rows) if abs(float(row[0])) < 1e-9)
    start = float(rows[place][0]) - place * YAO_INTERVAL
    assert found[names[0]].time[0] == pytest.approx(start, abs=1e-3 * YAO_INTERVAL)


def test_yao_sample_02(shared):
    path = shared / "data/bars/yao_epoxy/sample_02_raw_voltage.xlsx"
    space = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
    with zipfile.ZipFile(path) as archive:
        sheet = ElementTree.fromstring(archive.read("xl/worksheets/sheet1.xml"))
    cells = [[float(c.find(f"{space}v").text) for c in row] for row in list(sheet.iter(f"{space}row"))[1:]]
    time, incident, transmitted = np.array(cells).T
    names = ["incident_bar_signal/voltage", "transmission_bar_signal/voltage"]
    found = read_recordings(path, names, layout=Layout(unit="V"))
    np.testing.assert_array_equal(found[names[0]].value, incident)
    np.testing.assert_array_equal(found[names[1]].value, transmitted)
    slope, start = np.polyfit(np.arange(time.size), time, 1)
    recording = found[names[0]]
    # The times are single precision, 6e-11 s at the end of the record: 1e-10 s over it.
    assert (recording.time.size - 1) * abs(np.diff(recording.time).mean() - slope) < 2e-10
    assert abs(recording.time[0] - start) < 1e-10
    assert slope == pytest.approx(YAO_INTERVAL, rel=1e-6)


def test_iith_bars_together(shared):
    path = shared / "data/bars/iith/disp_check.dat"
    found = read_recordings(path, ["Input bar signal", "Output bar signal"])
    rows = by_hand(path, skip=23)
    np.testing.assert_array_equal(found["Input bar signal"].value, [float(row[1]) for row in rows])
    np.testing.assert_array_equal(found["Output bar signal"].value, [float(row[2]) for row in rows])
    np.testing.assert_array_equal(found["Input bar signal"].time, 3.3e-7 * np.arange(2000))
    assert found["Input bar signal"].unit == "V"
    info = list_channels(path)[0]
    assert info.facts["header"] == "23"
    assert info.metadata["Operator"] == "syed"
    # The generic reader gets the same out of it.
    same = read_recordings(path, ["Input bar signal"], layout=Layout(format="delimited", unit="V"))
    np.testing.assert_array_equal(same["Input bar signal"].time, found["Input bar signal"].time)
    np.testing.assert_array_equal(same["Input bar signal"].value, found["Input bar signal"].value)


def test_lanl_copper_with_all_its_metadata(shared):
    (path,) = (shared / "data/bars/lanl_cu").glob("*.raw")
    contents = read_contents(path)
    rows = by_hand(path, delimiter="\t")
    names = [channel.name for channel in contents.channels]
    assert names == ["Incident/Reflected Waveform", "Transmitted Waveform"]
    found = read_recordings(path, names)
    for column, name in enumerate(names, start=2):
        np.testing.assert_array_equal(found[name].value, [float(row[column]) for row in rows[3:]])
        np.testing.assert_array_equal(found[name].time, -5e-5 + 1e-7 * np.arange(5000))
    expected = {row[0]: row[1] for row in rows if row[0]}
    assert contents.metadata == expected
    assert len(expected) == 54
    assert contents.metadata["Incident Bar Calibrated Gage Factor"] == "2.061"
    # The file is said to be cp1252; what was once a degree sign is the replacement character in valid UTF-8.
    assert contents.facts["encoding"] == "utf-8"


def test_open_01_as_the_strict_reader_has_it(shared):
    path = shared / "data/shots/open-01/scope.csv"
    strict = read_scope(path, time=Column("Time (s)"), voltage=Column("CH2 transmitted (V)"))
    found = read_recordings(path, ["CH2 transmitted (V)"])["CH2 transmitted (V)"]
    np.testing.assert_array_equal(found.value, strict.value)
    np.testing.assert_array_equal(found.time, -2e-4 + 5e-7 * np.arange(3341))
    # The printed times are exact to 1e-11 s.
    np.testing.assert_allclose(found.time, strict.time, rtol=0, atol=1e-11)
    assert found.sha256 == strict.sha256


def test_opencorr_on_the_stereo_challenge(shared, tmp_path):
    source = shared / "data/dic/stereo_challenge1_S3_dspecimen/OpenCorr_GT4-0273_result.csv.gz"
    path = tmp_path / "OpenCorr_GT4-0273_result.csv"
    path.write_bytes(gzip.decompress(source.read_bytes()))
    export = read([path], "opencorr")
    rows = rows_of(path)
    assert export.X.shape == (len(rows), 3) == (9997, 3)
    assert (export.state == PointState.VALID).all()
    here = np.array([[float(row[f"tar_{c}"]) for c in "xyz"] for row in rows]) * 1e-3
    # The file prints positions to 1e-8 mm in single precision (4e2 mm: 3e-5 mm).
    np.testing.assert_allclose(export.X + export.u[0], here, rtol=0, atol=5e-8)


def test_files_that_matlab_wrote(shared):
    files = sorted((shared / "data/dic/multidic_cylinder/calib_cylinder").glob("*.mat"))
    assert files
    for path in files:
        listed = {
            n: kind if len(shape) < 3 else "more than a table"
            for n, shape, kind in whosmat(str(path))
            if not n.startswith("__")
        }
        others = {n for n, kind in listed.items() if kind not in NUMBERS}
        if others == set(listed):
            with pytest.raises(InputError, match="holds no numeric array") as refused:
                read_contents(path)
            assert all(name in str(refused.value) for name in others)
            continue
        opened = {v.split(" ")[0] for v in read_contents(path).facts.get("not opened", "").split(", ")}
        assert others == opened - {""}
