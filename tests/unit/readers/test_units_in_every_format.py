"""Millivolts and microstrain in every format: by the unit in the file if it has one, and by declaration."""

import h5py
import numpy as np
import openpyxl
import pytest
from nptdms import ChannelObject, TdmsWriter
from readerfiles import CH1, FILES, INTERVAL, TIME, UNITLESS, lvm

from kolsky.readers.contents import Layout
from kolsky.readers.recordings import read_recordings

ALL = FILES | UNITLESS
UNITS = [
    ("mV", "V", 1e-3),
    ("microstrain", "1", 1e-6),
    ("µε", "1", 1e-6),
    ("με", "1", 1e-6),
    ("ue", "1", 1e-6),
    ("kgf/cm2", "Pa", 98066.5),
    ("N/mm²", "Pa", 1e6),
    ("lbf", "N", 4.4482216152605),
]


@pytest.mark.parametrize(("unit", "si", "factor"), UNITS[:2])
@pytest.mark.parametrize("name", ALL)
def test_a_declared_unit_is_taken_and_the_files_own_is_kept(tmp_path, name, unit, si, factor):
    made = ALL[name]
    path = made.write(tmp_path / made.name)
    own = None if name in UNITLESS else read_recordings(path, made.channels[:1])[made.channels[0]]
    # An export of LeCroy does not say what its times are in.
    layout = Layout(unit=unit, time_unit="s" if name == "lecroy_csv" else None)
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
