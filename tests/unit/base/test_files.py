"""Complete files or none: files of a killed process are removed, files of a running process are kept."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dic import files
from dic.files import HIDDEN, alone_in, replacing, scratch
from kolsky.base.errors import InputError
from kolsky.base.files import filling

pytestmark = pytest.mark.skipif(os.name != "posix", reason="folders are locked on POSIX")
ROOT = Path(__file__).resolve().parents[3]
WRITING = """
import sys, time
from pathlib import Path
from dic.files import scratch
with scratch(Path(sys.argv[1])) as folder:
    (folder / "half.csv").write_text("half")
    print("there", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def _not_looked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "_looked", set())


def _hidden(folder: Path) -> list[Path]:
    return sorted(folder.glob(f"{HIDDEN}*"))


@pytest.mark.parametrize("how", ["replacing", "filling"])
def test_what_a_killed_process_left_is_removed_by_the_next(how: str, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", WRITING, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as run:
        assert run.stdout.readline() == b"there\n"
        (tmp_path / "results.csv").write_text("old")
        with scratch(tmp_path):  # while it lives its folder stays
            assert len(_hidden(tmp_path)) == 2
        assert len(_hidden(tmp_path)) == 1
        run.send_signal(signal.SIGKILL)
    assert len(_hidden(tmp_path)) == 1
    files._looked.clear()
    if how == "replacing":
        with replacing(tmp_path / "results.csv") as partial:
            partial.write_text("new")
    else:
        with filling(tmp_path) as folder:
            (folder / "results.csv").write_text("new")
    assert (tmp_path / "results.csv").read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["results.csv"]


def test_links_of_such_a_name_are_left_alone(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "a.csv").write_text("mine")
    (tmp_path / f"{HIDDEN}x").symlink_to(kept)
    with scratch(tmp_path):
        pass
    assert (kept / "a.csv").read_text() == "mine"


def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("old")

    def fail() -> None:
        with replacing(tmp_path / "a.csv") as partial:
            partial.write_text("half")
            raise RuntimeError("full")

    with pytest.raises(RuntimeError, match="full"):
        fail()
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    assert (tmp_path / "a.csv").read_text() == "old"


def test_a_second_process_waits_until_the_files_are_in_their_places(tmp_path: Path) -> None:
    import fcntl

    handle = os.open(tmp_path, os.O_RDONLY)  # as another process would have it: locks belong to handles
    try:
        with alone_in(tmp_path), pytest.raises(BlockingIOError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        os.close(handle)


def test_a_full_disk_is_one_line_and_no_remains(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("old")

    def fail() -> None:
        with filling(tmp_path) as folder:
            (folder / "a.csv").write_text("new")
            raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left") as caught:
        fail()
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    assert (tmp_path / "a.csv").read_text() == "old"


def test_results_are_put_in_their_places_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import fcntl

    held = []
    replace = os.replace

    def look(old: Path, new: Path) -> None:
        handle = os.open(tmp_path, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            held.append(False)
        except BlockingIOError:
            held.append(True)
        finally:
            os.close(handle)
        replace(old, new)

    monkeypatch.setattr(os, "replace", look)
    with filling(tmp_path) as folder:
        (folder / "a.csv").write_text("1")
        (folder / "b.csv").write_text("2")
    assert held == [True, True]


FILLING = """
import os, sys, time
from pathlib import Path
from kolsky.base.files import filling

replace, word, pause = os.replace, sys.argv[2], float(sys.argv[3])

def slowly(old, new):
    replace(old, new)
    print("put", flush=True)
    time.sleep(pause)

os.replace = slowly
with filling(Path(sys.argv[1])) as folder:
    for name in ("a.csv", "b.csv", "c.csv"):
        (folder / name).write_text(word)
"""


def test_of_two_commands_in_one_folder_the_second_waits(tmp_path: Path) -> None:
    """The first is half-way through its files when the second comes: at the end all are the second's."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}

    def filled(word: str, pause: float) -> subprocess.Popen[bytes]:
        words = [sys.executable, "-c", FILLING, str(tmp_path), word, str(pause)]
        return subprocess.Popen(words, stdout=subprocess.PIPE, env=environment)

    with filled("first", 0.7) as first:
        assert first.stdout.readline() == b"put\n"
        with filled("second", 0.0) as second:
            assert second.wait(timeout=60) == 0
        assert first.wait(timeout=60) == 0
    found = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert found == {"a.csv": "second", "b.csv": "second", "c.csv": "second"}
