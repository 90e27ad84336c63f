"""Other programs on the benchmark's pictures: pyvale in a separate environment, and OpenCV's PyrLK."""

import json
import os
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.dic_problem import MARGIN, OFF, STEP, SUBSET, Errors, FloatArray, Problem, errors

LONGEST = 600.0
"""Time limit of another program [s]."""

# Runs in the peer's environment: pictures in, points and displacements out.
_PYVALE = """
import json, sys, time
from importlib.metadata import version
from pathlib import Path
import numpy as np
import pyvale.dic as dic

folder, margin, subset, step, kernel = Path(sys.argv[1]), *map(int, sys.argv[2:])
given = np.load(folder / "pictures.npz", allow_pickle=False)
roi = np.zeros(given["first"].shape[1:], dtype=bool)
roi[margin:-margin, margin:-margin] = True
middle = [side // 2 for side in roi.shape]
clock = time.process_time()
for pair, (first, second) in enumerate(zip(given["first"], given["second"])):
    dic.calculate_2d(
        first, second, roi, middle[::-1], subset_size=subset, subset_step=step, image_filter_kernel=kernel,
        max_displacement=16, num_threads=1, print_level=0, output_basepath=folder,
        output_prefix=f"pair{pair}_",
    )
spent = {"cpu": time.process_time() - clock, "version": version("pyvale")}
(folder / "spent.json").write_text(json.dumps(spent))
"""


class PeerError(RuntimeError):
    """Another program failed."""


@dataclass(frozen=True)
class Row:
    """One program on one problem."""

    program: str
    """Program with its version and settings."""
    problem: str
    """Name of the problem."""
    rate: float
    """Points per second of one core's time [1/s]."""
    errors: Errors
    """Errors of the displacement along x."""


def pyvale(python: Path, problem: Problem, *, prefilter: bool) -> Row:
    """pyvale's `calculate_2d`, affine, on one thread; PeerError if it fails or writes no points.

    Its processor time includes its own first guesses and the files it writes.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.savez(folder / "pictures.npz", first=problem.first, second=problem.second)
        script = folder / "script.py"
        script.write_text(_PYVALE)
        numbers = [MARGIN - SUBSET // 2, SUBSET, STEP, 5 if prefilter else 1]
        command = [str(python), str(script), name, *map(str, numbers)]
        try:
            done = subprocess.run(
                command, env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": ""},
                cwd=folder,  # the program writes a log into its working folder
                capture_output=True, text=True, timeout=LONGEST, check=False,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as problem_met:
            raise PeerError(f"pyvale could not be run by {python}: {problem_met}") from None
        tables = sorted(folder.glob("pair*.csv"))
        if done.returncode != 0 or len(tables) != len(problem.first):
            said = (done.stderr or done.stdout).strip()[-300:]
            raise PeerError(f"pyvale ended with {done.returncode}: {said}")
        spent = json.loads((folder / "spent.json").read_text())
        read = np.concatenate([_columns(path) for path in tables])
    x, y, u, converged = read.T
    points = np.stack([x, y], axis=1)
    ok = (converged == 1) & np.isin(x, problem.points[:, 0]) & np.isin(y, problem.points[:, 1])
    return Row(
        f"pyvale {spent['version']}, {'its' if prefilter else 'no'} prefilter",
        problem.name,
        len(read) / spent["cpu"],
        errors(problem, points[ok], u[ok]),
    )


def _columns(path: Path) -> FloatArray:
    """x, y, u and convergence flag of every row of a table written by pyvale."""
    with path.open(encoding="utf-8") as lines:
        names = [name.strip().strip('"') for name in next(lines).split(",")]
        wanted = [names.index(name) for name in ("subset_x", "subset_y", "disp_u", "converged")]
        return np.loadtxt(lines, delimiter=",", usecols=wanted, ndmin=2)


def pyramid_lk(problem: Problem, repeats: int) -> Row:
    """OpenCV's `calcOpticalFlowPyrLK` with the subset as its window, one level, on one thread."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    begin = problem.points.astype(np.float32)[:, None]
    guess = (problem.points + problem.warp[:, :2]).astype(np.float32)[:, None]
    guess[..., 0] -= OFF
    times, points, u = [], [], []
    try:
        for first, second in list(zip(problem.first, problem.second, strict=True)) * repeats:
            clock = time.process_time()
            end, status, _ = cv2.calcOpticalFlowPyrLK(
                first, second, begin, guess.copy(), winSize=(SUBSET, SUBSET), maxLevel=0,
                criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 1e-3),
                flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            )  # fmt: skip
            times.append(time.process_time() - clock)
            ok = status[:, 0] == 1
            points.append(problem.points[ok])
            u.append((end - begin)[ok, 0, 0].astype(np.float64))
    finally:
        cv2.setNumThreads(threads)
    n = len(problem.first)
    return Row(
        f"OpenCV {cv2.__version__} PyrLK",
        problem.name,
        len(begin) / min(times),
        errors(problem, np.concatenate(points[:n]), np.concatenate(u[:n])),
    )
