"""A sweep of 4000 quick runs that can be killed: LEDGER LOG; 4 bytes go to LOG before a chunk returns."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from doe import Box, latin_hypercube
from doe.ledger import Ledger, Run, run_chunks

N, CHUNK, KEEPS = 4_000, 25, 3
MODEL = b"\x07" * 32
POINTS = latin_hypercube(Box(("a", "b"), (0.1, 1e-6), (2.0, 1e-4), (False, True)), N, rng=5).points
ROW = {point.tobytes(): i for i, point in enumerate(POINTS)}


def oscillator(points: NDArray[np.float64]) -> list[Run]:
    """A damped oscillation at three times; a run with much damping "fails"."""
    runs = []
    for a, b in points:
        fails = b > 9e-5
        results = np.array([np.nan] * KEEPS) if fails else np.exp(-b * 1e4) * np.sin(a * np.arange(1.0, 4.0))
        runs.append(Run(not fails, "LOST" if fails else "DONE", results, "too much damping" if fails else ""))
    return runs


# They are here and not in the test file, because a new process imports the file that contains them.
def mortal(marker: Path, points: NDArray[np.float64]) -> list[Run]:
    """The oscillator, in a worker that dies once."""
    if np.any(np.all(points == POINTS[150], axis=1)) and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return oscillator(points)


def hopeless(points: NDArray[np.float64]) -> list[Run]:
    """Dies at once."""
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def main(ledger: Path, log: Path) -> None:
    with log.open("ab", buffering=0) as file, Ledger(ledger, MODEL) as book:

        def logged(points: NDArray[np.float64]) -> list[Run]:
            rows = np.array([ROW[point.tobytes()] for point in points], dtype="<i4")
            os.write(file.fileno(), rows.tobytes())
            time.sleep(0.002)  # a sweep of about a second: it can be killed in the middle
            return oscillator(points)

        run_chunks(logged, POINTS, chunk=CHUNK, ledger=book)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
