"""Frame times of the cameras: frame number and time."""

from dataclasses import dataclass
from pathlib import Path

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.readers.table import Column, read_table


@dataclass(frozen=True)
class FrameTimes:
    """When each frame was taken, on the clock of the file."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    frame: IntArray
    """Frame numbers, increasing, shape [n_frames]."""
    time: FloatArray
    """Frame times, increasing [s], shape [n_frames]."""
    digit: float
    """The last printed digit of the times [s]."""


def read(path: Path, *, frame: Column, time: Column) -> FrameTimes:
    """Read frame numbers and times.

    Raises
    ------
    InputError
        If the file is not such a table, a frame number is not whole, or numbers or times do not increase.
    """
    table = read_table(path)
    numbers = table.integers(frame)
    table.check_increasing(frame, numbers)
    times = table.values(time)
    table.check_increasing(time, times)
    return FrameTimes(
        path=path, sha256=table.sha256, frame=numbers, time=times, digit=table.printed_digit(time)
    )
