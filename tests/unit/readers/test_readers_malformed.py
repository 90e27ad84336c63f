"""Files without a measurement: each is rejected with one line that names file, place and cure."""

import zipfile
from dataclasses import replace

import h5py
import numpy as np
import openpyxl
import pytest
import readerfiles as files
from scipy.io import savemat

from kolsky.base.errors import InputError
from kolsky.readers import contents, excel
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import list_channels, read_recordings

BINARY = [name for name, made in files.FILES.items() if files.is_binary(made)]
TEXT = [name for name in files.FILES if name not in BINARY]
CODES = ("lecroy_trc", "tektronix_isf", "tektronix_wfm")  # whole numbers: no NaN
COLUMNS = [  # formats with printed times that are read
    "plain", "german", "utf16_tabs", "blanks", "tektronix_mso", "keysight", "picoscope", "two_clocks",
    "tektronix_tds", "excel", "lecroy_csv",
]  # fmt: skip


def refused(name, path):
    """The one line by which a file is refused."""
    made = files.FILES[name]
    with pytest.raises(InputError) as caught:
        read_recordings(path, made.channels[:1], layout=made.layout)
    line = str(caught.value)
    assert "\n" not in line
    assert path.name in line
    assert "Cure: " in line
    return line


def lines_of(name, path):
    encoding = {"german": "cp1252", "utf16_tabs": "utf-16", "lanl": "cp1252"}.get(name, "utf-8")
    return path.read_bytes().decode(encoding).splitlines(), encoding


def rewrite(path, lines, encoding):
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode(encoding))


@pytest.mark.parametrize("name", [n for n in files.FILES if n not in CODES])
def test_nan(name, tmp_path, monkeypatch):
    damaged = files.CH1.copy()
    damaged[100] = np.nan
    monkeypatch.setattr(files, "CH1", damaged)
    path = files.FILES[name].written(tmp_path)
    line = refused(name, path)
    assert (
        "not a finite number" in line
        or "sample 101 is nan" in line
        or "cell" in line
        or "not a number" in line
    )
    if name in TEXT:  # the line of the file, header counted
        lines, _ = lines_of(name, path)
        number = next(i for i, text in enumerate(lines, start=1) if "nan" in text.lower())
        assert f"{path.name} line {number}:" in line
    list_channels(path)  # looking at it is allowed


@pytest.mark.parametrize("name", files.FILES)
def test_a_constant_channel(name, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "CH1", np.full(files.SAMPLES, 0.125))
    assert "is 0.125 in all 400 samples" in refused(name, files.FILES[name].written(tmp_path))


@pytest.mark.parametrize("name", files.FILES)
def test_a_clipped_channel(name, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "CH1", np.maximum(files.CH1, -0.5))
    line = refused(name, files.FILES[name].written(tmp_path))
    assert "is clipped" in line
    assert "at its extreme -0.5 V" in line


@pytest.mark.parametrize("name", files.FILES)
def test_full_scale_decides_where_it_is_given(name, tmp_path):
    made = files.FILES[name]
    said = replace(made.layout, full_scale=float(np.abs(files.CH1).max()))
    with pytest.raises(InputError, match=r"is clipped: .* at or beyond full scale"):
        read_recordings(made.written(tmp_path), made.channels[:1], layout=said)


@pytest.mark.parametrize("name", TEXT)
def test_a_text_that_is_cut_off(name, tmp_path):
    path = files.FILES[name].written(tmp_path)
    lines, encoding = lines_of(name, path)
    kept = lines[:-100]
    rewrite(path, [*kept, lines[-100][: len(lines[-100]) * (40 if name == "lanl" else 55) // 100]], encoding)
    line = refused(name, path)
    assert "cut off" in line or "fields" in line or "not a number" in line
    assert f"line {len(kept) + 1}" in line or "promises" in line


@pytest.mark.parametrize("name", ["tektronix_mso", "tektronix_tds", "lecroy_csv", "yokogawa", "lvm"])
def test_a_header_that_promises_more_samples(name, tmp_path):
    path = files.FILES[name].written(tmp_path)
    lines, encoding = lines_of(name, path)
    rewrite(path, lines[:-100], encoding)  # whole lines are missing: only the header knows
    assert "ends after 300 samples; its header promises" in refused(name, path)


@pytest.mark.parametrize("name", BINARY)
@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_a_binary_file_that_is_cut_off(name, share, tmp_path):
    path = files.FILES[name].written(tmp_path)
    if name == "rohde_schwarz" and share > 0.1:
        companion = path.with_suffix(".Wfm.bin")
        companion.write_bytes(companion.read_bytes()[: int(share * companion.stat().st_size)])
        refused(name, path)
        return
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    refused(name, path)


@pytest.mark.parametrize("name", files.FILES)
def test_an_empty_file(name, tmp_path):
    path = files.FILES[name].written(tmp_path)
    path.write_bytes(b"")
    refused(name, path)


@pytest.mark.parametrize("name", TEXT)
def test_a_field_that_is_no_number(name, tmp_path):
    path = files.FILES[name].written(tmp_path)
    lines, encoding = lines_of(name, path)
    number = len(lines) - 150
    value = f"{files.CH1[-151]:.10f}" if name != "lanl" else f"{files.CH1[-151]:.12g}"
    decimal = "," if name == "german" else "."
    assert lines[number - 1].count(value.replace(".", decimal)) == 1
    lines[number - 1] = lines[number - 1].replace(value.replace(".", decimal), "1.2.3")
    rewrite(path, lines, encoding)
    line = refused(name, path)
    assert f"line {number}: column '{files.FILES[name].channels[0]}' is not a number: '1" in line


@pytest.mark.parametrize("name", TEXT)
def test_a_line_with_a_field_too_many(name, tmp_path):
    path = files.FILES[name].written(tmp_path)
    lines, encoding = lines_of(name, path)
    number = len(lines) - 150
    lines[number - 1] += {
        "german": ";1",
        "utf16_tabs": "\t1",
        "blanks": "  1",
        "lvm": "\t\t1",
        "lanl": "\t1",
    }.get(name, ",1")
    rewrite(path, lines, encoding)
    assert f"line {number}: has " in refused(name, path)


@pytest.mark.parametrize("name", TEXT)
def test_an_empty_line_between_samples(name, tmp_path):
    path = files.FILES[name].written(tmp_path)
    lines, encoding = lines_of(name, path)
    number = len(lines) - 150
    rewrite(path, [*lines[: number - 1], "", *lines[number - 1 :]], encoding)
    assert f"line {number}" in refused(name, path)


@pytest.mark.parametrize("name", COLUMNS)
def test_times_that_are_not_sorted(name, tmp_path, monkeypatch):
    time = files.TIME.copy()
    time[[200, 203]] = time[[203, 200]]
    monkeypatch.setattr(files, "TIME", time)
    line = refused(name, files.FILES[name].written(tmp_path))
    assert "is not sorted" in line or "contradicts" in line


@pytest.mark.parametrize("name", ["plain", "excel", "mat73"])
def test_a_gap_in_the_times(name, tmp_path, monkeypatch):
    time = files.TIME.copy()
    time[250:] += 3.0 * files.INTERVAL
    monkeypatch.setattr(files, "TIME", time)
    line = refused(name, files.FILES[name].written(tmp_path))
    assert "the step is 4e-07 s where the others are 1e-07 s" in line or "is not uniform" in line


@pytest.mark.parametrize(
    ("name", "delimiter"), [("plain", "semicolon"), ("german", "tab"), ("utf16_tabs", ","), ("blanks", ";")]
)
def test_a_wrong_delimiter(name, delimiter, tmp_path):
    path = files.FILES[name].written(tmp_path)
    with pytest.raises(InputError, match=r"delimiter") as caught:
        read_recordings(path, [files.FILES[name].channels[0]], layout=Layout(delimiter=delimiter))
    assert "Cure: " in str(caught.value)


def test_a_wrong_header_line(tmp_path):
    path = files.german(tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"a.csv line 1: has 2 fields here, the samples below have 3"):
        read_recordings(path, ["CH1 [V]"], layout=Layout(header_line=1))


def test_a_damaged_first_line_is_not_taken_for_a_header(tmp_path):
    path = files.plain(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    lines[1] = lines[1].replace("-5.0", "-5.O", 1)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"line 2: cannot be read as a header or as samples: '-5.O"):
        read_recordings(path, ["CH1 (V)"])


def test_an_unknown_encoding_and_a_wrong_one(tmp_path):
    path = files.german(tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"is declared to be encoded as 'klingon'; it must be one of utf-8"):
        read_recordings(path, ["CH1 [V]"], layout=Layout(encoding="klingon"))
    with pytest.raises(InputError, match=r"line 1: is not utf-8 text: byte 0xfc at byte offset 2"):
        read_recordings(path, ["CH1 [V]"], layout=Layout(encoding="utf-8"))


def test_a_second_segment_of_an_lvm_file(tmp_path):
    path = files.lvm(tmp_path / "a.lvm")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines, "", *lines[9:]]) + "\n")
    with pytest.raises(InputError, match=f"line {len(lines) + 8}: has a second segment"):
        read_recordings(path, ["CH1"])


def test_a_workbook_that_unpacks_to_too_much(tmp_path, monkeypatch):
    path = files.excel(tmp_path / "a.xlsx")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/media/zeros.bin", bytes(3_000_000))
    assert path.stat().st_size < 100_000
    monkeypatch.setattr(excel, "UNPACKED_LIMIT", 2_000_000)
    with pytest.raises(InputError, match=r"unpacks to more than 2 MB"):
        read_recordings(path, ["CH1/V"])


def test_a_workbook_with_xml_entities(tmp_path):
    path = files.excel(tmp_path / "a.xlsx")
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = parts["xl/worksheets/sheet1.xml"]
    parts["xl/worksheets/sheet1.xml"] = b'<!DOCTYPE a [<!ENTITY b "c">]>' + sheet
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    with pytest.raises(InputError, match=r"declares XML entities in xl/worksheets/sheet1.xml"):
        read_recordings(path, ["CH1/V"])


def test_formulas_without_a_value_and_errors_in_cells(tmp_path):
    path = files.excel(tmp_path / "a.xlsx")
    for content, words in (("=1/3", "not a number|row 103"), ("#DIV/0!", "row 103: a cell holds the error")):
        book = openpyxl.load_workbook(path)
        book["Record"]["B103"] = content
        book.save(path)
        with pytest.raises(InputError, match=words):
            read_recordings(path, ["CH1/V"])


def test_what_is_no_array_in_matlab_is_not_opened(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"s": {"CH1": files.CH1}, "c": np.array([files.CH1, "x"], dtype=object)})
    with pytest.raises(InputError, match=r"holds no numeric array, but s \(struct\), c \(cell\)"):
        read_recordings(path, ["s"])


def test_links_out_of_an_hdf5_file_are_refused(tmp_path):
    files.hdf5(tmp_path / "other.h5")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["CH1"] = h5py.ExternalLink("other.h5", "/scope/CH1")
    with pytest.raises(InputError, match=r"'/CH1' is a link"):
        read_recordings(tmp_path / "a.h5", ["/CH1"])
    with h5py.File(tmp_path / "b.h5", "w") as file:
        layout = h5py.VirtualLayout(shape=(files.SAMPLES,), dtype="f8")
        layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "/scope/CH1", shape=(files.SAMPLES,))
        file.create_virtual_dataset("CH1", layout)
    with pytest.raises(InputError, match=r"'/CH1' lies in another file"):
        read_recordings(tmp_path / "b.h5", ["/CH1"])


def test_arrays_that_promise_too_many_samples(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "a.h5", "w") as file:  # a few kB on disk
        file.create_dataset("CH1", shape=(60_000_000,), dtype="f8", chunks=(1_000_000,), compression="gzip")
    assert (tmp_path / "a.h5").stat().st_size < 100_000
    with pytest.raises(InputError, match=r"60000000 samples, more than the 20000000 that are read"):
        list_channels(tmp_path / "a.h5")
    path = files.tdms(tmp_path / "a.tdms")
    monkeypatch.setattr(contents, "SAMPLES_LIMIT", 300)
    with pytest.raises(InputError, match=r"400 samples, more than the 300"):
        list_channels(path)


def test_an_xml_header_with_entities(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><Database SaveItemType="Data"/>')
    with pytest.raises(InputError, match=r"declares XML entities"):
        read_recordings(path, ["CH1"])


def test_a_file_of_no_format(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("hello")
    with pytest.raises(InputError, match=r"seems to be text, and its name ends in '.xyz'"):
        list_channels(path)
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"is of no known format"):
        list_channels(path)
    with pytest.raises(InputError, match=r"is declared to have the format 'wav'; it must be one of"):
        list_channels(path, layout=Layout(format="wav"))
    with pytest.raises(InputError, match=r"there is no such file"):
        list_channels(tmp_path / "b.csv")


def test_a_quiet_baseline_is_not_clipping(tmp_path):
    # Coarse codes and little noise: half the record is the smallest value, like many a baseline.
    pulse = np.round(20 * np.exp(-(((np.arange(1000) - 700) / 60.0) ** 2))) / 20
    path = tmp_path / "a.csv"
    path.write_text("t (us),v (V)\n" + "".join(f"{i / 10:.1f},{v}\n" for i, v in enumerate(pulse)))
    np.testing.assert_array_equal(read_recordings(path, ["v (V)"])["v (V)"].value, pulse)
