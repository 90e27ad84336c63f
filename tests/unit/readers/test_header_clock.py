"""The clock of a header: numbers, units and counts, each with its closed form, and rejected headers."""

from pathlib import Path

import pytest

from kolsky.base.errors import InputError
from kolsky.readers.contents import clock_words
from kolsky.readers.header import clock_unit, header_clock
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import list_channels, read_recordings

FILE = Path("a.csv")
SIGNAL = "\n".join(f"{(7 * i) % 11 / 8}" for i in range(40))


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("Hz", ("1/s", 1.0)), ("kHz", ("1/s", 1e3)), ("KHZ", ("1/s", 1e3)), ("mhz", ("1/s", 1e6)),
        ("MHz", ("1/s", 1e6)), ("mHz", ("1/s", 1e-3)), ("GHz", ("1/s", 1e9)), ("kS/s", ("1/s", 1e3)),
        ("MSa/s", ("1/s", 1e6)), ("samples/sec", ("1/s", 1.0)), ("ms", ("s", 1e-3)), ("us/pt", ("s", 1e-6)),
        ("µs", ("s", 1e-6)), ("Sekunden", ("s", 1.0)), ("mS/s", None), ("V", None), ("Hertha", None),
    ],
)  # fmt: skip
def test_a_unit_of_a_clock_is_a_time_or_a_rate(text: str, unit: tuple[str, float] | None) -> None:
    assert clock_unit(text) == unit


@pytest.mark.parametrize(
    ("key", "fields", "interval"),
    [
        ("Sample rate", ["800kHz"], 1.25e-6), ("Sample rate", ["800 kHz"], 1.25e-6),
        ("Sampling Frequency (kHz)", ["800"], 1.25e-6), ("fs_kHz", ["800"], 1.25e-6),
        ("Abtastrate", ["800", "kHz"], 1.25e-6), ("fs", ["800000"], 1.25e-6),
        ("Sample Rate", ["1.25 us"], 1.25e-6), ("Rate", ["800 kS/s"], 1.25e-6), ("dt [ms]", ["0.001"], 1e-6),
        ("dt/us", ["2.5"], 2.5e-6), ("Sample interval in us", ["2.5"], 2.5e-6),
        ("Sample interval", ["2,5 us"], 2.5e-6), ("Sample interval", ["2.5,us"], 2.5e-6),
        ("Delta_X", ["2,500000E-6"], 2.5e-6), ("Sample rate", ["1,000,000"], 1e-6),
    ],
)  # fmt: skip
def test_a_rate_or_interval_keeps_its_unit_wherever_it_stands(
    key: str, fields: list[str], interval: float
) -> None:
    clock = header_clock(FILE, {key: fields})
    assert clock.interval == pytest.approx(interval, rel=1e-12)
    assert clock.doubt == ""


@pytest.mark.parametrize(
    ("metadata", "decimal", "doubt"),
    [
        ({"Sample rate": ["1,000 kHz"]}, ".", "one between thousands"),
        ({"Sample rate": ["1.000 kHz"]}, ",", "one between thousands"),
        ({"Sample rate": ["800 furlongs"]}, ".", "unit 'furlongs'"),
        ({"Sample rate": ["800 mS/s"]}, ".", "unit 'mS/s'"),
        ({"dt [ms]": ["1 us"]}, ".", "two units, us and ms"),
        ({"Sample rate": ["800 kHz"], "dt": ["1.25 ms"]}, ".", "contradict each other"),
        ({"Sample rate": ["800 kHz"], "dt": ["1.3 us"]}, ".", "contradict each other"),  # by 4 %
        ({"Sample rate": ["800 (auto)"]}, ".", "is not a number that can be read"),
    ],
)
def test_a_clock_that_can_mean_two_things_is_none(
    metadata: dict[str, list[str]], decimal: str, doubt: str
) -> None:
    clock = header_clock(FILE, metadata, decimal=decimal)
    assert clock.interval is None
    assert doubt in clock.doubt


def test_one_sign_is_decimal_where_the_file_says_so() -> None:
    assert header_clock(FILE, {"Sample rate": ["1,000 kHz"]}, decimal=",").interval == pytest.approx(1e-3)
    assert header_clock(FILE, {"Sample rate": ["1.000 kHz"]}).interval == pytest.approx(1e-3)


@pytest.mark.parametrize(
    "metadata", [{"Rate": ["5 mm/min"]}, {"Rate": ["5"]}, {"Start": ["10:31:07"]}, {"Start": ["5 mm"]}, {}]
)
def test_words_of_other_things_are_no_clock(metadata: dict[str, list[str]]) -> None:
    clock = header_clock(FILE, metadata)
    assert (clock.interval, clock.start, clock.doubt) == (None, None, "")


def test_rate_and_interval_that_agree_are_one_clock() -> None:
    clock = header_clock(FILE, {"Sample rate": ["800 kHz"], "dt": ["1.25e-6 s"], "t0": ["-1 ms"]})
    assert clock.interval == pytest.approx(1.25e-6)
    assert clock.start == -1e-3


def test_samples_are_counted_from_the_start(tmp_path: Path) -> None:
    rows = "\n".join(f"{i},{(7 * i) % 11 / 8},," for i in range(40, 80))
    path = tmp_path / "a.csv"
    path.write_text(f"X,CH1,Start,Increment\nSequence,Volt,-2.0e-04,2.0e-06\n{rows}\n")
    time = read_recordings(path, ["CH1"])["CH1"].time
    assert time[0] == pytest.approx(-2e-4 + 40 * 2e-6, abs=1e-15)
    path.write_text(path.read_text().replace("\n47,", "\n48,"))
    assert "counts 48 after 46" in list_channels(path)[0].time


def test_a_declared_interval_is_checked_against_the_header(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"Sample rate: 800 kHz\nCH1 (V)\n{SIGNAL}\n")
    assert read_recordings(path, ["CH1 (V)"], layout=Layout(interval=1.25e-6))
    with pytest.raises(InputError, match=r"interval 1e-06 s, its header states 1.25e-06 s"):
        read_recordings(path, ["CH1 (V)"], layout=Layout(interval=1e-6))
    path.write_text(f"dt [ms],0.001\nCH1 (V)\n{SIGNAL}\n")  # one figure, which allows half of itself
    with pytest.raises(InputError, match=r"interval 1.2e-06 s, its header states 1e-06 s"):
        read_recordings(path, ["CH1 (V)"], layout=Layout(interval=1.2e-6))


def test_a_clock_in_doubt_is_named_where_no_column_has_the_times(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"Sample rate: 800 furlongs\nCH1 (V)\n{SIGNAL}\n")
    with pytest.raises(InputError, match="Sample rate = 800 furlongs has the unit 'furlongs'"):
        read_recordings(path, ["CH1 (V)"])


@pytest.mark.parametrize(
    ("interval", "samples", "words"),
    [
        (1.25e-6, 120, "800 kHz, 120 samples, 150 us"),
        (1e-3, 2000, "1 kHz, 2000 samples, 2 s"),
        (0.5, 40, "2 Hz, 40 samples, 20 s"),
        (1e-9, 7, "1 GHz, 7 samples, 7 ns"),
    ],
)
def test_a_clock_in_words(interval: float, samples: int, words: str) -> None:
    assert clock_words(interval, samples) == words


def test_waveforms_of_a_channel_are_joined_only_without_a_gap(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    import numpy as np

    def write(path: Path, gap: int) -> None:
        began = np.datetime64("2026-03-02T10:00:00.000000", "us")
        with nptdms.TdmsWriter(path) as writer:
            for i in range(2):
                later = began + np.timedelta64(i * (50 + gap), "us")
                values = np.sin(np.arange(50) + 50.0 * i)
                keys = {
                    "wf_start_time": later,
                    "wf_increment": 1e-6,
                    "wf_start_offset": 0.0,
                    "unit_string": "V",
                }
                writer.write_segment([nptdms.ChannelObject("G", "A", values, properties=keys)])

    write(tmp_path / "whole.tdms", 0)
    assert len(read_recordings(tmp_path / "whole.tdms", ["G/A"])["G/A"].time) == 100
    write(tmp_path / "gap.tdms", 150)
    with pytest.raises(InputError, match=r"sample 51 was taken 0.00015 s later"):
        read_recordings(tmp_path / "gap.tdms", ["G/A"])


def test_tabs_divide_names_that_hold_blanks(tmp_path: Path) -> None:
    """A short table below settings by channel: its samples divide between blanks too."""
    settings = [
        "Setting\tStrain gauge 1\tKraft A",
        *(f"{word}\t1\t1" for word in ("Coupling", "Probe", "Bandwidth")),
    ]
    samples = [f"{i}e-3\t{(7 * i) % 11}\t{(5 * i) % 13}" for i in range(12)]
    names = "Time [ms]\tStrain gauge 1 [kN]\tKraft A [mV]"
    path = tmp_path / "scope.txt"
    path.write_text(
        "\n".join(["Sampling Frequency: 1000000 S/s", "", *settings, "", names, *samples]), "utf-8"
    )
    assert [(c.name, c.unit) for c in list_channels(path)] == [
        ("Strain gauge 1 [kN]", "kN"),
        ("Kraft A [mV]", "mV"),
    ]
    path.write_text("\n".join(line.replace("\t", "  ") for line in samples), "utf-8")
    assert [c.facts["delimiter"] for c in list_channels(path)][:1] == ["blanks"]
