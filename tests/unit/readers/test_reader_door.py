"""The registry of readers: a new reader needs one file and one entry of FORMATS."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import readerfiles as files
from kolsky_command import run_kolsky
from module_files import module_at

from kolsky.readers.recordings import FORMATS, read_recordings

ROOT = Path(__file__).resolve().parents[3]
BATTERY = ("test_readers_recordings.py", "test_readers_malformed.py")

NEW_READER = '''
"""A made-up recorder: a mark, start and interval, then the samples of two channels in volts."""

import struct

import numpy as np

from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Contents, file_hash, head_of, stated_clock

HEAD = struct.Struct("<4sddI")


def sniff(path):
    return head_of(path, 4) == b"MADE" or path.suffix == ".made"


def read(path, layout):
    sha256, data = file_hash(path), path.read_bytes()
    if len(data) < HEAD.size or data[:4] != b"MADE":
        raise InputError(path, "is no record of this make", cure="copy it again")
    _, start, interval, samples = HEAD.unpack_from(data)
    if len(data) != HEAD.size + 16 * samples or samples < 2 or not interval > 0.0 or not np.isfinite(start):
        raise InputError(path, "is damaged or cut off", cure="copy it again")
    values = np.frombuffer(data, "<f8", offset=HEAD.size).reshape(2, samples)
    channels = tuple(
        Channel(name, number, "V", samples, row.copy, lambda: stated_clock(interval, start, "head"))
        for number, (name, row) in enumerate(zip(("CH1", "CH2"), values), start=1)
    )
    return Contents(path, sha256, channels, {"format": "madeup"})
'''

ITS_FILE_AND_LINE = '''
"""For the batteries: what writes a file of the made-up recorder, and the registry's line."""

import struct

import new_reader


def write(path):
    import readerfiles as files

    head = new_reader.HEAD.pack(b"MADE", files.START, files.INTERVAL, files.SAMPLES)
    path.write_bytes(head + files.CH1.astype("<f8").tobytes() + files.CH2.astype("<f8").tobytes())
    return path


def pytest_configure(config):
    import readerfiles as files
    from kolsky.readers.recordings import FORMATS

    FORMATS["madeup"] = new_reader
    files.FILES["madeup"] = files.Made(write, "a.made", ("CH1", "CH2"))
'''


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "new_reader.py").write_text(NEW_READER, "utf-8")
    (tmp_path / "madeup_plugin.py").write_text(ITS_FILE_AND_LINE, "utf-8")
    return tmp_path


def test_the_battery_of_the_readers_runs_for_a_new_one(folder: Path) -> None:
    """The tests of the readers are collected with the format's name and pass; none of them is edited."""
    run = subprocess.run(
        [
            sys.executable, "-m", "pytest", "-q", "-p", "madeup_plugin",
            "-p", "no:cacheprovider", "-k", "madeup",
            *(str(Path(__file__).parent / name) for name in BATTERY),
        ],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-2000:]
    passed = int(run.stdout.rpartition(" passed")[0].split()[-1])
    assert passed >= 9  # samples and clock, NaN, constant, clipped, at full scale, cut off thrice, empty
    assert "failed" not in run.stdout


def test_commands_and_recordings_know_a_new_reader(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    module = module_at(folder / "new_reader.py")
    monkeypatch.setitem(FORMATS, "madeup", module)
    path = tmp_path / "a.made"
    head = module.HEAD.pack(b"MADE", files.START, files.INTERVAL, files.SAMPLES)
    path.write_bytes(head + files.CH1.astype("<f8").tobytes() + files.CH2.astype("<f8").tobytes())
    np.testing.assert_array_equal(read_recordings(path, ["CH2"])["CH2"].value, files.CH2)
    run = run_kolsky("channels", path)
    assert "format: madeup" in run.stdout
    refused = run_kolsky("channels", path, "--format", "wav", code=2)
    assert "madeup" in refused.output  # among the formats that may be said
