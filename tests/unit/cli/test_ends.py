"""Commands after a signal: exit code, no incomplete files, no remaining worker."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from shot_folders import ordinary_rights

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

ROOT = Path(__file__).resolve().parents[3]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}

WAITING = """
import sys, time
from kolsky.base.files import filling
from kolsky.cli import commandline
from pathlib import Path

def app():
    with filling(Path(sys.argv[1])) as partial:
        (partial / "half.csv").write_text("half")
        print("there", flush=True)
        time.sleep(60)

commandline.app = app
commandline.main()
"""

WORKERS = """
import os, sys, time
from kolsky.base.process import process_pool

if __name__ == "__main__":
    with process_pool(2) as pool:
        print(*{pool.submit(os.getpid).result() for _ in range(8)}, flush=True)
        [pool.submit(time.sleep, 60) for _ in range(2)]
        time.sleep(0.2)
        if sys.argv[1] == "raise":
            raise SystemExit(7)
        time.sleep(60)
"""


def test_a_command_that_is_told_to_end_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "results"
    with subprocess.Popen(
        [sys.executable, "-c", WAITING, str(out)], stdout=subprocess.PIPE, env=ENVIRONMENT
    ) as run:
        assert run.stdout.readline() == b"there\n"
        run.send_signal(signal.SIGTERM)
        assert run.wait(timeout=20) == 143
    assert not out.exists()


DEAF = """
import hashlib, sys
from pathlib import Path
from kolsky.base.files import filling
from kolsky.cli import commandline

def app():
    with filling(Path(sys.argv[1])) as partial:
        (partial / "half.csv").write_text("half")
        print("there", flush=True)
        hashlib.pbkdf2_hmac("sha256", b"a", b"b", 2**31 - 1)  # takes minutes and no signal, as a simulation

commandline.app = app
commandline.main()
"""


def test_a_command_in_a_compiled_loop_ends_within_seconds(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DEAF, str(tmp_path)], stdout=subprocess.PIPE, env=ENVIRONMENT
    ) as run:
        assert run.stdout.readline() == b"there\n"
        run.send_signal(signal.SIGTERM)
        assert run.wait(timeout=20) == 143
    assert not list(tmp_path.iterdir())


LOADING = """
import os, signal, sys
from kolsky.cli import commandline

def app():
    try:
        os.kill(os.getpid(), getattr(signal, sys.argv[1]))
    except (KeyboardInterrupt, SystemExit):
        pass
    raise ImportError("a library was being loaded")

commandline.app = app
signal.signal(signal.SIGINT, signal.default_int_handler)
commandline.main()
"""


@pytest.mark.parametrize(("how", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGURG", 1)])
def test_a_signal_that_a_library_makes_an_error_of_its_own(how: str, code: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOADING, how], capture_output=True, text=True, env=ENVIRONMENT, check=False
    )
    assert done.returncode == code
    assert ("Traceback" in done.stderr) == (code == 1)  # without a signal it is a fault of the program


IGNORING = """
import os, signal, sys, time
from kolsky.cli import commandline

class Finalised:
    def __del__(self):
        os.kill(os.getpid(), getattr(signal, sys.argv[1]))
        time.sleep(0.01)  # here the signal becomes an exception, which Python ignores

def app():
    Finalised()
    time.sleep(20)

commandline.app = app
signal.signal(signal.SIGINT, signal.default_int_handler)
commandline.main()
"""


@pytest.mark.parametrize(("how", "code"), [("SIGINT", (130, -2)), ("SIGTERM", (143,))])
def test_a_signal_whose_exception_is_ignored_is_repeated(how: str, code: tuple[int, ...]) -> None:
    started = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", IGNORING, how], capture_output=True, text=True, env=ENVIRONMENT, check=False
    )
    assert done.returncode in code
    assert time.monotonic() - started < 15.0
    assert "Exception ignored" not in done.stderr


CLOSED = """
import sys
from pathlib import Path
from kolsky.base.files import filling
from kolsky.cli.commandline import refusing_bad_input

with refusing_bad_input():
    with filling(Path(sys.argv[1])) as partial:
        (partial / "kept.csv").write_text("later")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="capabilities of Linux")
@pytest.mark.parametrize("closed", ["results", "shot"])
def test_a_folder_that_nobody_may_write_to(closed: str, tmp_path: Path) -> None:
    out = tmp_path / "shot" / "results"
    out.mkdir(parents=True)
    (out / "kept.csv").write_text("earlier")
    folder = out if closed == "results" else out.parent
    folder.chmod(0o555)
    try:
        done = subprocess.run(
            [sys.executable, "-c", CLOSED, str(out if closed == "results" else out.parent / "new")],
            capture_output=True,
            text=True,
            env=ENVIRONMENT,
            preexec_fn=ordinary_rights,
            check=False,
        )
    finally:
        folder.chmod(0o755)
    assert done.returncode != 0
    assert "Cure: " in done.stderr.splitlines()[0]
    assert "Permission denied" in done.stderr or "not writable" in done.stderr
    assert [path.name for path in out.iterdir()] == ["kept.csv"]
    assert (out / "kept.csv").read_text() == "earlier"


@pytest.mark.parametrize("how", ["raise", "kill"])
def test_workers_end_with_their_parent(how: str, tmp_path: Path) -> None:
    script = tmp_path / "workers.py"
    script.write_text(WORKERS)
    with subprocess.Popen([sys.executable, script, how], stdout=subprocess.PIPE, env=ENVIRONMENT) as run:
        workers = [int(word) for word in run.stdout.readline().split()]
        assert workers
        if how == "kill":
            run.kill()
        assert run.wait(timeout=20) == (-signal.SIGKILL if how == "kill" else 7)
    started = time.monotonic()
    while any(map(_lives, workers)) and time.monotonic() - started < 20.0:
        time.sleep(0.05)
    assert not any(map(_lives, workers))


def _lives(process: int) -> bool:
    try:
        return "zombie" not in Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False
