"""A Dask scheduler with workers, started as by a user."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def dask_processes(folder: Path, *sources: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers as separate processes. Yields the scheduler's file and the workers.

    The workers import modules from the repository, from this folder and from `sources`.
    """
    file = folder / "scheduler.json"
    folders = (ROOT, Path(__file__).parent, *sources)
    paths = os.pathsep.join(map(str, folders))
    environment = {**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"}
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    worker = ["worker", *common, "--no-nanny", "--nthreads", "1", "--local-directory", str(folder)]
    commands = [["scheduler", *common, "--host", "127.0.0.1", "--port", "0"], worker, worker]
    with (folder / "dask.log").open("wb") as log:
        started = [
            subprocess.Popen(
                [sys.executable, "-m", "dask", *command], env=environment, stdout=log, stderr=log, cwd=folder
            )
            for command in commands
        ]
        try:
            while not file.exists():
                assert started[0].poll() is None, (folder / "dask.log").read_text()
                time.sleep(0.05)
            yield str(file), started[1:]
        finally:
            for process in started:
                process.kill()
                process.wait()
