"""Readers: strict text in, SI arrays out, and one line for every kind of damage."""

import itertools
import os
from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.readers.measured_tables import read_frame_table
from kolsky.readers.recordings import read_scope
from kolsky.readers.table import Column, read_table

T, V = Column("t (ms)", 1e-3), Column("CH 2", 1e-3)


def scope_text(times: list[str], volts: list[str] | None = None) -> str:
    volts = volts or ["1.5"] * len(times)
    return "t (ms),CH 1,CH 2\n" + "".join(f"{t},x,{v}\n" for t, v in zip(times, volts, strict=True))


@pytest.fixture
def write(tmp_path: Path):
    def write(text: str | bytes, name: str = "scope.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def refused(path: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        read_scope(path, time=T, voltage=V)
    assert "\n" not in str(caught.value)
    return caught.value


def test_scope_channel_in_si_with_the_hash_of_its_bytes(write) -> None:
    path = write("t (ms),CH 1,CH 2\n-0.10,x,1.5\n-0.05,y,-2\n0.00,z,+3.25e0\n")
    recording = read_scope(path, time=T, voltage=V)
    np.testing.assert_allclose(recording.time, [-1e-4, -5e-5, 0.0], rtol=1e-15)  # one product
    np.testing.assert_allclose(recording.value, [1.5e-3, -2e-3, 3.25e-3], rtol=1e-15)
    assert (recording.channel, recording.unit, recording.path) == ("CH 2", "V", path)
    # printed by `sha256sum` for the same bytes
    assert recording.sha256 == "e0f1df4b9994363c3edcb1382fc49281d2360a7af3a271307532e36078f6ebab"


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("tail", [b"", b"\n\n  \n"])
def test_line_ends_byte_order_mark_and_trailing_blank_lines(
    write, ending: str, mark: bytes, tail: bytes
) -> None:
    text = scope_text(["1", "2", "3"]).replace("\n", ending)
    recording = read_scope(write(mark + text.encode() + tail), time=T, voltage=V)
    assert recording.time.size == 3


@pytest.mark.parametrize(
    ("text", "line", "fragments"),
    [
        (scope_text(["1", "2", "3"], ["1", "1.2.3", "1"]), 3, ["column 'CH 2' is not a number: '1.2.3'"]),
        (scope_text(["1", "2", "3"], ["1", "", "1"]), 3, ["is not a number: ''"]),
        (scope_text(["1", "2", "3"], ["1", "1_000", "1"]), 3, ["'1_000'"]),
        (scope_text(["1", "2", "3"], ["1", '"1"', "1"]), 3, ["is not a number"]),
        (scope_text(["1", "2", "3"], ["1", "nan", "1"]), 3, ["not a finite number: 'nan'"]),
        (scope_text(["1", "2", "3"], ["1", "1", "-inf"]), 4, ["not a finite number: '-inf'"]),
        (scope_text(["1", "2", "3"], ["1", "1", "1e999"]), 4, ["not a finite number"]),
        (scope_text(["1", "2", "2"]), 4, ["'t (ms)' repeats '2' after '2'"]),
        (scope_text(["1", "3", "2"]), 4, ["is not sorted: '2' after '3'"]),
        (scope_text(["1", "2"]), None, ["fewer than 3 samples"]),
        (scope_text(["1.0", "2.0", "4.0", "5.0"]), 4, ["the step is 0.002 s where the others are 0.001 s"]),
        (scope_text(["0.001", "0.002", "0.004", "0.005"]), 4,
         ["is rounded to 1e-06 s", "between 1e-06 and 2e-06"]),
        ("t (ms),CH 1,CH 2\n1,2\n", 2, ["has 2 fields, the header has 3"]),
        ("t (ms),CH 1,CH 2\n1,2,3,4\n", 2, ["has 4 fields"]),
        ("t (ms),CH 1,CH 2\n1,2,3\n\n3,4,5\n", 3, ["is an empty line"]),
        ("t (ms),CH 1,CH2\n1,2,3\n", 1, ["'CH 2' is missing", "'t (ms)', 'CH 1', 'CH2'"]),
        ("t (ms),CH 2,CH 2\n1,2,3\n2,2,3\n3,2,3\n", 1, ["'CH 2' is there 2 times"]),
        ("t (ms);CH 1;CH 2\n1;2;3\n", 1, ["'t (ms);CH 1;CH 2'", "separated by commas"]),
        ("t (ms),CH 1,CH 2\n1,2,3\n2,\r,3\n", 3, ["carriage return"]),
        ("t (ms),CH 1,CH 2\r1,2,3\r2,2,3\r", 1, ["carriage return"]),
        ("t (ms),CH 1,CH 2\n", None, ["header but no data"]),
        ("", None, ["is empty"]),
        (" \n\n", None, ["is empty"]),
        ("t (ms),CH 1,CH 2\n1,2,3\n2,µ,3\n".encode("latin-1"), 3,
         ["not UTF-8", "0xb5 at byte offset 25", "iconv"]),
        ("t (ms),CH 1,CH 2\n1,2,3\n".encode("utf-16"), 1, ["not UTF-8", "byte offset 0"]),
    ],
)  # fmt: skip
def test_damage_is_answered_with_its_line(
    write, text: str | bytes, line: int | None, fragments: list[str]
) -> None:
    error = refused(write(text))
    assert error.line == line
    for fragment in fragments:
        assert fragment in str(error)


def test_swapped_time_and_value_are_suspected(write) -> None:
    rng = np.random.default_rng(1)
    times = [f"{v:.4f}" for v in rng.normal(size=50)]
    assert "are two columns swapped?" in str(refused(write(scope_text(times))))


def test_a_step_rounded_in_the_last_digit_is_uniform(write) -> None:
    # 120 kHz sampling printed to 9 digits: the steps differ by one unit of the last digit.
    times = [f"{k / 120.0:.9f}" for k in range(200)]
    assert len({round(float(b) - float(a), 12) for a, b in itertools.pairwise(times)}) > 1
    recording = read_scope(write(scope_text(times)), time=T, voltage=V)
    np.testing.assert_allclose(np.diff(recording.time), 1e-3 / 120.0, rtol=2e-7)  # last digit over the step


@pytest.mark.parametrize(
    ("fields", "digit"),
    [
        (["-1.9950000e-04", "4.8e-18", "1.4700000e-03"], 1e-10),
        (["1.25", "1.5", "2"], 1e-2),
        (["10", "20"], 1.0),
        (["0.0e0", "0.0e0"], 0.1),
    ],
)
def test_last_printed_digit(write, fields: list[str], digit: float) -> None:
    table = read_table(write("t\n" + "\n".join(fields) + "\n"))
    assert table.printed_digit(Column("t", 1e-3)) == pytest.approx(
        1e-3 * digit, rel=1e-12, abs=0.0
    )  # powers of ten


def test_missing_file_folder_and_device(tmp_path: Path) -> None:
    assert "there is no such file" in str(refused(tmp_path / "nothing.csv"))
    assert "is a folder" in str(refused(tmp_path))
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)  # opening it would wait for ever
    assert "not a regular file" in str(refused(pipe))


def test_two_gigabytes_are_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "scope.csv"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # sparse: takes no disk
    assert "has 2000 MB, more than the 200 MB" in str(refused(path))


def test_frame_times(write) -> None:
    path = write("frame,time (ms),shutter\n3,-1.0,open\n4,0.0,open\n7,1.5,open\n", "frames.csv")
    frames = read_frame_table(path, frame=Column("frame"), time=Column("time (ms)", 1e-3), clock=True)
    assert frames.frame.tolist() == [3, 4, 7]
    assert frames.time.tolist() == [-1e-3, 0.0, 1.5e-3]
    assert frames.digit == pytest.approx(1e-4, rel=1e-12, abs=0.0)  # powers of ten


@pytest.mark.parametrize(
    ("body", "fragment"),
    [
        ("0,1.0\n0,2.0\n", "'frame' repeats '0'"),
        ("1,1.0\n0,2.0\n", "'frame' is not sorted: '0' after '1'"),
        ("0,1.0\n1,1.0\n", "'time (ms)' repeats"),
        ("0,1.0\n1.5,2.0\n", "'frame' is not a frame number: '1.5'"),
        ("0,1.0\n1e25,2.0\n", "'frame' is not a frame number: '1e25'"),
    ],
)
def test_frame_times_refuse(write, body: str, fragment: str) -> None:
    path = write("frame,time (ms)\n" + body, "frames.csv")
    with pytest.raises(InputError, match="line 3") as caught:
        read_frame_table(path, frame=Column("frame"), time=Column("time (ms)", 1e-3), clock=True)
    assert fragment in str(caught.value)


def test_flyer_with_and_without_a_time_column(write) -> None:
    path = write("frame,d,t\n0,0.5,1.00\n1,-2,2.00\n", "flyer.csv")
    frame, d = Column("frame"), Column("d", 1e-3)
    without = read_frame_table(path, frame=frame, columns={"d": d})
    with_time = read_frame_table(path, frame=frame, columns={"d": d}, time=Column("t"))
    np.testing.assert_allclose(without.columns["d"], [5e-4, -2e-3], rtol=1e-15)  # one product
    assert without.time.size == 0
    assert with_time.time.tolist() == [1.0, 2.0]
    assert with_time.digit == pytest.approx(0.01, rel=1e-12, abs=0.0)  # powers of ten


def test_centre_line_rows_of_several_frames(write) -> None:
    path = write("frame,y,Z,s\n0,1,4.5,0.01\n0,2,4.6,0.02\n2,1,4.7,0.03\n", "line.csv")
    columns = {"sigma": Column("s", 1e-3), "Z": None}
    table = read_frame_table(path, frame=Column("frame"), columns=columns, points=True)
    assert table.frame.tolist() == [0, 0, 2]
    np.testing.assert_allclose(table.columns["sigma"], [1e-5, 2e-5, 3e-5], rtol=1e-15)  # one product
    assert "Z" not in table.columns


@pytest.mark.parametrize(
    ("body", "fragment"),
    [
        ("1,1,4,0.1\n0,1,4,0.1\n", "'frame' is not sorted: 0 after 1"),
        ("0,1,4,0.1\n0,1,4,0\n", "'s' is '0'; it must be > 0"),
    ],
)
def test_centre_line_refuses(write, body: str, fragment: str) -> None:
    path = write("frame,y,Z,s\n" + body, "line.csv")
    with pytest.raises(InputError, match="line 3") as caught:
        read_frame_table(path, frame=Column("frame"), columns={"s": Column("s", bound="> 0")}, points=True)
    assert fragment in str(caught.value)


def test_uniaxial_percent_and_kilopascal(write) -> None:
    path = write("e,s\n0,0\n-50,-200\n", "curve.csv")
    table = read_table(path)
    assert table.values(Column("e", 0.01)).tolist() == [0.0, -0.5]
    assert table.values(Column("s", 1e3)).tolist() == [0.0, -2e5]
