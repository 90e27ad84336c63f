"""How commands end when they are told to: exit code, nothing half-made, no worker left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

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
        assert run.stdout is not None
        assert run.stdout.readline() == b"there\n"
        run.send_signal(signal.SIGTERM)
        assert run.wait(timeout=20) == 143
    assert not out.exists()


@pytest.mark.parametrize("how", ["raise", "kill"])
def test_workers_end_with_their_parent(how: str, tmp_path: Path) -> None:
    script = tmp_path / "workers.py"
    script.write_text(WORKERS)
    with subprocess.Popen([sys.executable, script, how], stdout=subprocess.PIPE, env=ENVIRONMENT) as run:
        assert run.stdout is not None
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
