"""Paths that are no regular files are rejected before they are opened: a pipe without a writer never
answers."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dic.camera_files.source import CameraFileError, Source
from dic.files import regular
from dic.images import open_pictures
from dic.images.photron import read_header
from dic.images.series import PictureError
from kolsky.base.errors import InputError
from kolsky.readers.contents import head_of
from kolsky.readers.hdf5 import inside
from kolsky.studies.sweep import read_design

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are pipes with names on POSIX only")


@pytest.fixture(autouse=True)
def _no_hang() -> Iterator[None]:
    """A reader that opens the pipe after all fails the test instead of stopping it."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("the pipe was opened"))
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


READERS: dict[str, tuple[Callable[[Path], object], type[Exception]]] = {
    "pictures": (open_pictures, PictureError),
    "camera file": (Source.open, CameraFileError),
    "Photron header": (read_header, PictureError),
    "HDF5": (inside, InputError),
    "design": (read_design, InputError),
}


@pytest.mark.parametrize("link", [False, True])
@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_is_refused(reader: str, link: bool, tmp_path: Path) -> None:
    path = tmp_path / "pipe.cih"
    os.mkfifo(path)
    if link:
        (tmp_path / "link.cih").symlink_to(path)
        path = tmp_path / "link.cih"
    read, refusal = READERS[reader]
    with pytest.raises(refusal, match="is a pipe, not a regular file"):
        read(path)
    assert head_of(path) == b""


@pytest.mark.parametrize(("path", "kind"), [("/dev/zero", "a device"), ("/tmp", "a folder")])
def test_other_kinds_are_named(path: str, kind: str) -> None:
    with pytest.raises(OSError, match=kind):
        regular(path)


def test_a_file_and_a_missing_one(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with pytest.raises(FileNotFoundError):
        regular(path)
    path.write_text("1")
    assert regular(path) == path
