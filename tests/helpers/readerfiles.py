"""One record of two channels in the formats of many recorders, written from their public descriptions."""

import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import xlwt
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from kolsky.readers.layout import Layout
from kolsky.readers.recordings import FORMATS

START, INTERVAL, SAMPLES = -5e-6, 1e-7, 400
TIME = START + INTERVAL * np.arange(SAMPLES)
_PULSE = np.exp(-(((np.arange(SAMPLES) - 180) / 40.0) ** 2))
_NOISE = np.random.default_rng(7).normal(0.0, 0.004, (2, SAMPLES))
# Codes of 1/1024 V: every format stores them without loss.
CH1 = np.round((-0.8 * _PULSE + _NOISE[0]) * 1024) / 1024
CH2 = np.round((0.3 * _PULSE + _NOISE[1]) * 1024) / 1024


def text(
    path: Path,
    above: list[str],
    *,
    delimiter: str = ",",
    decimal: str = ".",
    time: str | None = "{:.8e}",
    scale: float = 1.0,
    front: str = "",
    back: str = "",
    encoding: str = "utf-8",
    end: str = "\r\n",
    index: bool = False,
) -> Path:
    """Lines of samples below the lines `above`."""
    lines = list(above)
    for i in range(SAMPLES):
        fields = [] if time is None else [time.format(TIME[i] * scale)]
        fields = [str(i)] if index else fields
        row = delimiter.join([*fields, f"{CH1[i]:.10f}", f"{CH2[i]:.10f}"])
        lines.append(front + row.replace(".", decimal) + back)
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


def plain(path: Path) -> Path:
    return text(path, ["Time (s),CH1 (V),CH2 (V)"])


def german(path: Path) -> Path:
    above = ["Prüfer;Müller", "Temperatur;21,5 °C", "", "Zeit [µs];CH1 [V];CH2 [V]"]
    return text(path, above, delimiter=";", decimal=",", scale=1e6, time="{:.4f}", encoding="cp1252")


def utf16_tabs(path: Path) -> Path:
    return text(
        path, ["Time (ms)\tCH1 (V)\tCH2 (V)"], delimiter="\t", scale=1e3, time="{:.7f}", encoding="utf-16"
    )


def blanks(path: Path) -> Path:
    return text(path, ["# made by hand", "# t(s) CH1(V) CH2(V)"], delimiter="   ", front="  ", end="\n")


def tektronix_mso(path: Path) -> Path:
    above = [
        "Model,MSO54", "Firmware Version,1.28", "", "Waveform Type,ANALOG,,", "Horizontal Units,s,,",
        f"Sample Interval,{INTERVAL:.6E},,", f"Record Length,{SAMPLES},,", "Zero Index,5.00E+01,,", "",
        "Labels,,", "TIME,CH1 (V),CH2 (V)",
    ]  # fmt: skip
    # The times are printed with few digits, as the instrument prints them; the header has the interval.
    return text(path, above, time="{:.6e}")


def rigol(path: Path) -> Path:
    above = ["X,CH1,CH2,Start,Increment,", f"Sequence,Volt,Volt,{START:e},{INTERVAL:e}"]
    return text(path, above, index=True, back=",,")


def keysight(path: Path) -> Path:
    return text(path, ["x-axis,CH1,CH2", "second,Volt,Volt"], time="{:+.10E}")


def picoscope(path: Path) -> Path:
    return text(path, ["Time,CH1,CH2", "(us),(V),(V)", ""], scale=1e6, time="{:.8f}")


def yokogawa(path: Path) -> Path:
    above = [
        '"Model Name","DL850"', '"TraceName","CH1","CH2"', f'"BlockSize",{SAMPLES},{SAMPLES}',
        '"VUnit","V","V"',
        f'"SampleRate",{1 / INTERVAL:.1f},{1 / INTERVAL:.1f}', f'"HResolution",{INTERVAL:e},{INTERVAL:e}',
        f'"HOffset",{START:e},{START:e}', '"HUnit","s","s"', "",
    ]  # fmt: skip
    return text(path, above, time=None, front=",")


def lecroy_csv(path: Path) -> Path:
    above = [
        "LECROYHDO6104,12345,Waveform", f"Segments,1,SegmentSize,{SAMPLES}",
        "Segment,TrigTime,TimeSinceSegment1",
        "#1,21-Nov-2026 10:11:12,0", "Time,CH1,CH2",
    ]  # fmt: skip
    return text(path, above, time="{:.9e}")


def two_clocks(path: Path) -> Path:
    """A time column for each channel."""
    rows = [f"{t:.7e},{a:.10f},{t:.7e},{b:.10f}" for t, a, b in zip(TIME, CH1, CH2, strict=True)]
    path.write_text("\n".join(["Time 1 (s),CH1 (V),Time 2 (s),CH2 (V)", *rows]) + "\n")
    return path


def tektronix_tds(path: Path) -> Path:
    def keys(source: str) -> list[str]:
        return [
            f"Record Length,{SAMPLES:e},", f"Sample Interval,{INTERVAL:e},", "Trigger Point,5.0e+01,", ",,",
            ",,", ",,", f"Source,{source},", "Vertical Units,V,", "Vertical Scale,5.0e-01,",
            "Vertical Offset,0.0e+00,", "Horizontal Units,s,", "Horizontal Scale,4e-06,", "Probe Atten,1.0,",
            "Model Number,TDS2014,", "Firmware Version,FV:v10.10,",
        ]  # fmt: skip

    lines = []
    for i in range(SAMPLES):
        first, second = [k[i] if i < len(k) else ",," for k in (keys("CH1"), keys("CH2"))]
        lines.append(f"{first},{TIME[i]:015.9f},{CH1[i]:.10f},{second},{TIME[i]:015.9f},{CH2[i]:.10f},")
    path.write_text("\r\n".join(lines) + "\r\n")
    return path


def lvm(path: Path, *, separator: str = "\t", decimal: str = ".", columns: str = "One") -> Path:
    s = separator
    above = [
        f"LabVIEW Measurement{s}", f"Writer_Version{s}2", f"Reader_Version{s}2",
        f"Separator{s}{'Tab' if s == chr(9) else 'Comma'}", f"Decimal_Separator{s}{decimal}",
        f"Multi_Headings{s}Yes", f"X_Columns{s}{columns}", "***End_of_Header***", s,
        f"Channels{s}2{s}{s}", f"Samples{s}{SAMPLES}{s}{SAMPLES}{s}", f"Y_Unit_Label{s}Volts{s}Volts{s}",
        f"X_Dimension{s}Time{s}Time{s}", f"X0{s}{START:E}{s}{START:E}{s}".replace(".", decimal),
        f"Delta_X{s}{INTERVAL:E}{s}{INTERVAL:E}{s}".replace(".", decimal), f"***End_of_Header***{s}{s}{s}",
        s.join(["X_Value", "CH1", *(["X_Value", "CH2"] if columns == "Multi" else ["CH2", "Comment"])]),
    ]  # fmt: skip
    rows = []
    for t, a, b in zip(TIME, CH1, CH2, strict=True):
        values = {"One": [t, a, b], "Multi": [t, a, t, b], "No": ["", a, b]}[columns]
        rows.append(s.join(v if v == "" else f"{v:.10f}" for v in values).replace(".", decimal))
    path.write_bytes(("\r\n".join([*above, *rows]) + "\r\n").encode())
    return path


def lanl(path: Path) -> Path:
    keys = [("Test Date", "12/1/2006"), ("System ID", "HE"), ("Test Temperature(°C)", "23"), ("Gain", "200")]
    rows = [("CH1", "CH2"), (START, START), (INTERVAL, INTERVAL), *zip(CH1, CH2, strict=True)]
    lines = []
    for i, row in enumerate(rows):
        key, value = keys[i] if i < len(keys) else ("", "")
        lines.append("\t".join([key, value, *(x if isinstance(x, str) else f"{x:.12g}" for x in row)]))
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode("cp1252"))
    return path


def excel(path: Path) -> Path:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Record"
    sheet.append(["made by", "hand"])
    sheet.append(["Time/s", "CH1/V", "CH2/V"])
    for row in zip(TIME, CH1, CH2, strict=True):
        sheet.append([float(x) for x in row])
    book.create_sheet("notes")
    book.save(path)
    return path


def excel_97(path: Path) -> Path:
    book = xlwt.Workbook()
    sheet = book.add_sheet("Record")
    rows = [["made by", "hand"], ["time_s", "CH1_V", "CH2_V"], *zip(TIME, CH1, CH2, strict=True)]
    for i, row in enumerate(rows):
        for j, cell in enumerate(row):
            sheet.write(i, j, cell if isinstance(cell, str) else float(cell))
    book.add_sheet("notes")
    book.save(str(path))
    return path


def mat(path: Path) -> Path:
    savemat(
        path, {"CH1": CH1, "CH2": CH2[:, None], "Tstart": START, "Tinterval": INTERVAL, "note": "by hand"}
    )
    return path


def mat73(path: Path) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in {"CH1": CH1, "CH2": CH2, "time": TIME}.items():
            file[name] = value[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    data = bytearray(path.read_bytes())
    data[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(data)
    return path


def hdf5(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        group = file.create_group("scope")
        group.attrs["dt"], group.attrs["t0"] = INTERVAL, START
        for name, value in {"CH1": CH1, "CH2": CH2}.items():
            group[name] = value
            group[name].attrs["units"] = "V"
    return path


def tdms(path: Path) -> Path:
    properties = {"wf_increment": INTERVAL, "wf_start_offset": START, "unit_string": "V"}
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [ChannelObject("scope", n, v, properties) for n, v in (("CH1", CH1), ("CH2", CH2))]
        )
    return path


def lecroy_trc(path: Path, channel: int = 0) -> Path:
    """One channel, template LECROY_2_3 of the WAVEDESC block, 16 bits, little-endian."""
    block = bytearray(346)
    codes = np.round((CH1, CH2)[channel] * 1024).astype("<i2")

    def put(offset: int, form: str, *values: object) -> None:
        struct.pack_into("<" + form, block, offset, *values)

    put(0, "16s", b"WAVEDESC")
    put(16, "16s", b"LECROY_2_3")
    put(32, "hh", 1, 1)  # words, low byte first
    put(36, "i", 346)
    put(60, "i", codes.nbytes)
    put(76, "16s", b"LECROYHDO6104")
    put(116, "i", SAMPLES)
    put(156, "ff", 1.0 / 1024, 0.0)  # gain and offset: volts = gain * code - offset
    put(164, "ff", 32767.0, -32768.0)
    put(176, "fd", INTERVAL, START)
    put(196, "48s", b"V")
    put(244, "48s", b"S")
    put(328, "f", 1.0)
    put(344, "h", channel)
    path.write_bytes(bytes(block) + codes.tobytes())
    return path


def tektronix_isf(path: Path) -> Path:
    """One channel, ASCII header and a curve of two bytes a point, high byte first."""
    codes = np.round(CH1 * 1024).astype(">i2")
    head = (
        ":WFMP:BYT_N 2;BIT_N 16;ENC BIN;BN_F RI;BYT_O MSB;NR_P "
        + str(SAMPLES)
        + ';WFI "Ch1, DC coupling";PT_F Y;'
        f'XUN "s";XIN {INTERVAL:E};XZE {START:E};PT_O 0;YUN "V";YMU {1 / 1024:.10E};YOF 0.0E0;YZE 0.0E0;'
        ":CURV #"
    )
    count = str(codes.nbytes)
    path.write_bytes(head.encode() + f"{len(count)}{count}".encode() + codes.tobytes())
    return path


def tektronix_wfm(path: Path) -> Path:
    """One channel, WFM#003, 16 bits, little-endian (Tektronix 077-0220: offsets of the header's parts)."""
    head = bytearray(838)
    codes = np.round(CH1 * 1024).astype("<i2")

    def put(offset: int, form: str, *values: object) -> None:
        struct.pack_into("<" + form, head, offset, *values)

    put(0, "H1s7s", 0x0F0F, b":", b"WFM#003")
    put(10, "Bi", 8, len(head) + codes.nbytes - 15)
    put(15, "Bi", 2, len(head))  # bytes a point, where the curve begins
    put(76, "H", 838)
    put(114, "II", 1, 1)  # dimensions
    put(122, "i", 2)  # vectors of volts
    put(142, "I", 1)  # one curve
    put(168, "ddI20s", 1.0 / 1024, 0.0, 65536, b"V")  # volts = scale * code + offset
    put(240, "i", 0)  # 16-bit integers
    put(488, "ddI20s", INTERVAL, START, SAMPLES, b"s")
    put(808 + 10, "IIIII", 0, 0, codes.nbytes, codes.nbytes, codes.nbytes)  # all of the buffer is valid
    path.write_bytes(bytes(head) + codes.tobytes())
    return path


def yokogawa_wfm(path: Path) -> Path:
    """One channel of single-precision volts behind two lines of text."""
    line = f"WFM BIT:32,BYT:4,NR_PT:{SAMPLES},PT_O:50,XIN:{INTERVAL:E},YMU:1.0,YOF:0.0"
    path.write_bytes(f"Yokogawa\r\n{line}\r\n".encode() + CH1.astype("<f4").tobytes())
    return path


def rohde_schwarz(path: Path) -> Path:
    """Two channels: an XML header, and the samples in .Wfm.bin next to it."""
    stop = START + SAMPLES * INTERVAL
    values = {
        "SignalFormat": "eRS_SIGNAL_FORMAT_FLOAT", "TraceType": "eRS_TRACE_TYPE_NORMAL",
        "NumberOfAcquisitions": 1, "SignalHardwareRecordLength": SAMPLES, "RecordLength": SAMPLES,
        "LeadingSettlingSamples": 0, "XStart": START, "XStop": stop, "MultiChannelExport": "eRS_ONOFF_ON",
        "VerticalScale": 0.1, "Source": "eRS_SIGNAL_SOURCE_CH1_TR1",
    }  # fmt: skip
    rows = [f'<Prop Name="{key}" Value="{value}"/>' for key, value in values.items()]
    rows += [
        '<Prop Name="MultiChannelExportState" I_0="eRS_ONOFF_ON" I_1="eRS_ONOFF_ON" I_2="eRS_ONOFF_OFF"/>',
        '<Prop Name="MultiChannelSource" I_0="eRS_SIGNAL_SOURCE_CH1_TR1" I_1="eRS_SIGNAL_SOURCE_CH2_TR1"/>',
        '<Prop Name="MultiChannelVerticalScale" I_0="0.1" I_1="0.1" StepFactor="10"/>',
    ]
    head = '<?xml version="1.0"?>\n<Database FWVersion="1.0"><Group SaveItemType="Data">'
    path.write_text(head + "\n".join(rows) + "</Group></Database>")
    samples = np.stack([CH1, CH2], axis=1).astype("<f4")
    path.with_suffix(".Wfm.bin").write_bytes(struct.pack("<II", 4, SAMPLES) + samples.tobytes())
    return path


@dataclass(frozen=True)
class Made:
    """A format: its writer, its file name, and the names of its channels."""

    write: Callable[[Path], Path]
    name: str
    channels: tuple[str, ...]
    layout: Layout = field(default_factory=Layout)
    """What a user must declare, because the file does not say it."""

    def written(self, folder: Path) -> Path:
        """The file in a folder."""
        return self.write(folder / self.name)


FILES = {
    "plain": Made(plain, "a.csv", ("CH1 (V)", "CH2 (V)")),
    "german": Made(german, "a.csv", ("CH1 [V]", "CH2 [V]")),
    "utf16_tabs": Made(utf16_tabs, "a.txt", ("CH1 (V)", "CH2 (V)")),
    "blanks": Made(blanks, "a.dat", ("CH1(V)", "CH2(V)")),
    "tektronix_mso": Made(tektronix_mso, "a.csv", ("CH1 (V)", "CH2 (V)")),
    "rigol": Made(rigol, "a.csv", ("CH1", "CH2")),
    "keysight": Made(keysight, "a.csv", ("CH1", "CH2")),
    "picoscope": Made(picoscope, "a.csv", ("CH1", "CH2")),
    "yokogawa": Made(yokogawa, "a.csv", ("CH1", "CH2")),
    "two_clocks": Made(two_clocks, "a.csv", ("CH1 (V)", "CH2 (V)")),
    "tektronix_tds": Made(tektronix_tds, "a.csv", ("CH1", "CH2")),
    "lvm": Made(lvm, "a.lvm", ("CH1", "CH2")),
    "lanl": Made(lanl, "a.raw", ("CH1", "CH2")),
    "excel": Made(excel, "a.xlsx", ("CH1/V", "CH2/V")),
    "excel_97": Made(excel_97, "a.xls", ("CH1_V", "CH2_V")),
    "hdf5": Made(hdf5, "a.h5", ("/scope/CH1", "/scope/CH2")),
    "tdms": Made(tdms, "a.tdms", ("scope/CH1", "scope/CH2")),
    "lecroy_trc": Made(lecroy_trc, "a.trc", ("CH1",)),
    "tektronix_isf": Made(tektronix_isf, "a.isf", ("CH1",)),
    "tektronix_wfm": Made(tektronix_wfm, "a.wfm", ("CH1",)),
    "yokogawa_wfm": Made(yokogawa_wfm, "a.wfm", ("CH1",)),
    "rohde_schwarz": Made(rohde_schwarz, "a.bin", ("CH1", "CH2")),
    "lecroy_csv": Made(lecroy_csv, "a.csv", ("CH1", "CH2"), Layout(unit="V", time_unit="s")),
    "mat": Made(mat, "a.mat", ("CH1", "CH2"), Layout(unit="V")),
    "mat73": Made(mat73, "a.mat", ("CH1", "CH2"), Layout(unit="V")),
}
"""The formats by name."""


def is_binary(made: Made) -> bool:
    """Whether the detected format of a file is a binary format."""
    with tempfile.TemporaryDirectory() as folder:
        path = made.written(Path(folder))
        found = next(name for name, form in FORMATS.items() if form.sniff(path))
        return found not in ("lvm", "tektronix", "lanl", "delimited")
