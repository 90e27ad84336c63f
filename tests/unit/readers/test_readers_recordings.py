"""One record in many formats: the same samples, a uniform clock, the detected facts."""

from dataclasses import replace

import h5py
import numpy as np
import openpyxl
import pytest
import readerfiles as files
from scipy.io import savemat

from kolsky.base.errors import InputError
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import list_channels, read_contents, read_recordings


@pytest.mark.parametrize("name", files.FILES)
def test_a_record_comes_back_as_it_was(name, tmp_path):
    made = files.FILES[name]
    path = made.written(tmp_path)
    info = list_channels(path, layout=made.layout)[0]
    found = read_recordings(path, (*made.channels, str(info.number)), layout=made.layout)
    written = (*(files.CH1, files.CH2)[: len(made.channels)], files.CH1)  # the last one asked for by number
    for (channel, recording), samples in zip(found.items(), written, strict=True):
        # Codes of 1/1024 V have ten decimals: every format holds them exactly.
        np.testing.assert_array_equal(recording.value, samples)
        assert recording.unit == "V"
        assert recording.channel == (channel if channel in made.channels else info.name)
        # 1e-12: start and interval are decimal numbers in all files, a few roundings of floats apart.
        np.testing.assert_allclose(
            recording.time, files.TIME, rtol=0, atol=1e-12 * files.INTERVAL * files.SAMPLES
        )
    # Start plus multiples of the interval, to the last bit.
    np.testing.assert_array_equal(found[info.name].time, info.start + info.interval * np.arange(info.samples))
    with pytest.raises(InputError, match=r"'CH9' is missing") as caught:
        read_recordings(path, ["CH9"], layout=made.layout)
    assert made.channels[0] in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [name for name, made in files.FILES.items() if made.layout.unit])
def test_a_unit_that_nobody_says_is_not_guessed(name, tmp_path):
    made = files.FILES[name]
    with pytest.raises(InputError, match=r'does not state the unit.*unit = "V"'):
        read_recordings(made.written(tmp_path), made.channels[:1], layout=replace(made.layout, unit=None))


def test_a_stated_unit_scales_the_samples(tmp_path):
    path = files.lecroy_csv(tmp_path / "a.csv")
    found = read_recordings(path, ["CH1"], layout=Layout(unit="mV", time_unit="s"))["CH1"]
    np.testing.assert_allclose(found.value, files.CH1 * 1e-3, rtol=1e-15)  # one rounding
    assert found.unit == "V"


@pytest.mark.parametrize(
    ("name", "facts"),
    [
        ("plain", {"format": "delimited", "encoding": "utf-8", "delimiter": "comma", "header": "1"}),
        ("german", {"encoding": "cp1252", "delimiter": "semicolon", "decimal": ",", "header": "4"}),
        ("utf16_tabs", {"encoding": "utf-16-le with a byte order mark", "delimiter": "tab"}),
        ("blanks", {"delimiter": "blanks", "header": "2", "first samples": "3"}),
        ("picoscope", {"header": "1", "units": "2", "first samples": "4"}),
        ("excel", {"format": "excel", "sheet": "Record", "header": "2", "counted in": "rows"}),
    ],
)
def test_what_was_found_is_told(name, facts, tmp_path):
    found = list_channels(files.FILES[name].written(tmp_path))[0].facts
    assert {key: found[key] for key in facts} == facts


def test_metadata_are_kept(tmp_path):
    german = read_contents(files.german(tmp_path / "a.csv")).metadata
    assert german == {"Prüfer": "Müller", "Temperatur": "21,5 °C"}
    lanl = read_contents(files.lanl(tmp_path / "a.raw"))
    assert lanl.metadata["Test Temperature(°C)"] == "23"
    assert lanl.facts["encoding"] == "cp1252"


@pytest.mark.parametrize(
    ("separator", "decimal", "columns"),
    [("\t", ".", "One"), ("\t", ",", "One"), (",", ".", "One"), ("\t", ".", "Multi"), ("\t", ".", "No")],
)
def test_kinds_of_lvm(separator, decimal, columns, tmp_path):
    path = files.lvm(tmp_path / "a.dat", separator=separator, decimal=decimal, columns=columns)
    found = read_recordings(path, ["CH1", "CH2"])
    np.testing.assert_array_equal(found["CH2"].value, files.CH2)
    assert found["CH2"].time[0] == files.START


def test_the_time_column_of_a_channel_may_be_stated(tmp_path):
    rows = [f"{t:.7e},{t + 1e-3:.7e},{a}" for t, a in zip(files.TIME, files.CH1, strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Time A (s),Time B (s),CH1 (V)", *rows]) + "\n")
    assert read_recordings(path, ["CH1 (V)"])["CH1 (V)"].time[0] == pytest.approx(1e-3 + files.START)
    said = Layout(time={"CH1 (V)": "Time A (s)"})
    assert read_recordings(path, ["CH1 (V)"], layout=said)["CH1 (V)"].time[0] == files.START


def test_a_file_without_header_has_numbered_columns(tmp_path):
    path = files.text(tmp_path / "a.csv", [])
    with pytest.raises(InputError, match=r"no time column that is recognised"):
        read_recordings(path, ["2"], layout=Layout(unit="V"))
    found = read_recordings(path, ["2", "3"], layout=Layout(unit="V", time=1, time_unit="s"))
    np.testing.assert_array_equal(found["3"].value, files.CH2)
    assert found["3"].time[0] == files.START


def test_a_start_beside_a_stated_interval_is_narrowed_by_all_times(tmp_path):
    # Times rounded to 1 us, ten samples to each: together they tell the start to a fraction of a sample.
    path = files.text(tmp_path / "a.csv", ["Time (s),CH1 (V),CH2 (V)"], time="{:.6f}")
    with pytest.raises(InputError, match=r"rounded to 1e-06 s.*suggest an interval of 1.00"):
        read_recordings(path, ["CH1 (V)"])
    found = read_recordings(path, ["CH1 (V)"], layout=Layout(interval=files.INTERVAL))["CH1 (V)"]
    # Where the rounding turns tells the start to half a sample.
    assert abs(found.time[0] - files.START) < 0.51 * files.INTERVAL
    with pytest.raises(InputError, match=r"contradicts the interval 1.1e-07 s"):
        read_recordings(path, ["CH1 (V)"], layout=Layout(interval=1.1e-7))


def test_a_header_that_contradicts_its_times_is_refused(tmp_path):
    path = files.tektronix_mso(tmp_path / "a.csv")
    path.write_text(
        path.read_text().replace(f"Sample Interval,{files.INTERVAL:.6E}", "Sample Interval,2.0E-07")
    )
    with pytest.raises(InputError, match=r"contradicts the interval 2e-07 s .header: Sample Interval"):
        read_recordings(path, ["CH1 (V)"])


def test_a_workbook_with_several_filled_sheets_needs_one_named(tmp_path):
    path = files.excel(tmp_path / "a.xlsx")
    book = openpyxl.load_workbook(path)
    book["notes"].append(["not", "a", "record"])
    book.save(path)
    with pytest.raises(InputError, match=r"has 2 sheets with data.*sheet ="):
        read_recordings(path, ["CH1/V"])
    found = read_recordings(path, ["CH1/V"], layout=Layout(sheet="Record"))
    np.testing.assert_array_equal(found["CH1/V"].value, files.CH1)


def test_keysight_hdf5_codes_become_volts(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("Waveforms/Channel 1")
        for key, value in {
            "XInc": files.INTERVAL,
            "XOrg": files.START,
            "YInc": 1 / 1024,
            "YOrg": 0.25,
        }.items():
            group.attrs[key] = value
        group["Channel 1 Data"] = np.round(files.CH1 * 1024).astype(np.int16)
    name = "/Waveforms/Channel 1/Channel 1 Data"
    found = read_recordings(path, [name], layout=Layout(unit="V"))[name]
    np.testing.assert_array_equal(found.value, files.CH1 + 0.25)  # powers of two: exact
    assert found.time[0] == files.START


def test_the_columns_of_a_matrix_are_channels(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["signals"] = np.stack([files.CH1, files.CH2], axis=1)
        file["time"] = files.TIME
    found = read_recordings(path, ["/signals[2]"], layout=Layout(unit="V"))["/signals[2]"]
    np.testing.assert_array_equal(found.value, files.CH2)
    np.testing.assert_allclose(
        found.time, files.TIME, atol=1e-9 * files.INTERVAL
    )  # float round-off of the times


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_arrays_are_those_that_were_written(compressed, tmp_path):
    path = tmp_path / "a.mat"
    random = np.random.default_rng(5)
    written = {
        "double": random.normal(size=300),
        "single": random.normal(size=(1, 300)).astype(np.float32),
        "codes": random.integers(-3000, 3000, 300).astype(np.int16),
        "a_long_name_of_a_variable": random.integers(0, 255, (300, 1)).astype(np.uint8),
        "table": random.normal(size=(300, 3)),
        "fs": 1e7,
        "few": np.array([1, 2, 3], dtype=np.int8),
        "waves": random.normal(size=300) + 1j,
        "text": "shot 7",
        "settings": {"gain": 10.0},
    }
    savemat(path, written, do_compression=compressed)
    contents = read_contents(path)
    assert contents.facts["without numbers"] == "waves (complex), text (char), settings (struct)"
    values = {channel.name: channel.values() for channel in contents.channels}
    for name in ("double", "single", "codes", "a_long_name_of_a_variable", "few"):
        np.testing.assert_array_equal(values[name], np.ravel(written[name]))
    recording = read_recordings(path, ["table[2]"], layout=Layout(unit="V"))["table[2]"]
    np.testing.assert_array_equal(recording.value, written["table"][:, 1])
    np.testing.assert_array_equal(recording.time, 1e-7 * np.arange(300))
