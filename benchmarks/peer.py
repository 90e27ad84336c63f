"""The same problem in CalculiX: its time compared with the solver's in the same run, and its force.

CalculiX (`ccx`, G. Dhondt and K. Wittig) is used with implicit time integration, because its `*DYNAMIC,
EXPLICIT` stalls on elements that touch the axis. It simulates part of the time. The time of a complete run is
extrapolated with the same time per step (1400 steps: 31.1 s measured, 30.9 s extrapolated from the first
100). The force on the transmission platen is compared. This platen is at rest, so the force contains no
inertia of the face's nodes.
"""

import os
import re
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import explicit
from benchmarks.deck import WEDGE, deck
from benchmarks.problem import END, POISSON, FloatArray, model

STEP = 1e-6
"""[s]"""
WINDOW = 100e-6
"""Default simulated time [s]."""
LONGEST = 3600.0
"""Time limit of CalculiX [s]."""


class PeerError(RuntimeError):
    """CalculiX failed."""


@dataclass(frozen=True)
class Peer:
    """Time of CalculiX and comparison of its forces."""

    version: str
    """Version that the program reports."""
    window: float
    """Simulated time [s]."""
    step: float
    """Its time step [s]."""
    seconds: float
    """Wall time of the window [s]."""
    whole_run: float
    """Wall time of a run to the problem's end with the time per step of the window [s]."""
    largest_force: float
    """Largest force on the transmission platen within the window, of the solver [N]."""
    largest_difference: float
    """Largest difference of the two forces there [N]."""
    rms_difference: float
    """Root of its mean square [N]."""

    def cost(self, runs: int, cores: int) -> float:
        """Time of a number of runs with one core each [s]. A run of this size is not faster on more cores."""
        return float(np.ceil(runs / cores)) * self.whole_run


def program() -> str | None:
    """Path of `ccx`, or None if it is not installed."""
    return shutil.which("ccx")


def measure_peer(mesh: tuple[int, int], *, window: float = WINDOW, step: float = STEP) -> Peer:
    """Run the bonded, undamped problem in CalculiX and compare the forces.

    ``mesh``: elements across and along. ``window``, ``step``: simulated time and step [s]. PeerError if `ccx`
    is not on the PATH, fails, or does not print a force for every step.
    """
    path = program()
    if path is None:
        raise PeerError("no ccx on the PATH; Debian and Ubuntu have it as calculix-ccx")
    version = re.search(
        r"Version (\S+)", subprocess.run([path, "-v"], capture_output=True, text=True, check=False).stdout
    )
    problem = model(mesh, "bonded")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "peer.inp").write_text(deck(problem.mesh, end=window, step=step))
        started = time.perf_counter()
        said = _call([path, "-i", "peer"], Path(folder))
        seconds = time.perf_counter() - started
        times, force = forces((Path(folder) / "peer.dat").read_text())
    steps = round(window / step)
    if len(times) != steps:
        raise PeerError(f"ccx printed {len(times)} of {steps} forces; it ended with: {said.strip()[-200:]}")
    ours = explicit.run(
        problem, explicit.Samples.of(poisson=POISSON), explicit.Sampling(times, times[-1:])
    ).force_transmission[0]
    apart = force - ours
    return Peer(
        version=version[1] if version else "unknown",
        window=window,
        step=step,
        seconds=seconds,
        whole_run=seconds * END / window,
        largest_force=float(np.abs(ours).max()),
        largest_difference=float(np.abs(apart).max()),
        rms_difference=float(np.sqrt(np.mean(apart**2))),
    )


def forces(printed: str) -> tuple[FloatArray, FloatArray]:
    """Times [s] and compression-positive forces [N] on the lower face, from the text of a `.dat` file."""
    pattern = r"total force \(fx,fy,fz\) for set LOWER and time +(\S+)\s+(\S+) +(\S+) +(\S+)"
    found = np.array([[float(t), float(fy)] for t, _, fy, _ in re.findall(pattern, printed)]).reshape(-1, 2)
    return found[:, 0], WEDGE * found[:, 1]


def _call(command: list[str], folder: Path) -> str:
    """Standard output of a program on one core."""
    settings = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=settings, capture_output=True, text=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        raise PeerError(f"{' '.join(command)} took longer than {LONGEST:.0f} s") from None
    if done.returncode != 0:
        raise PeerError(f"{' '.join(command)} ended with {done.returncode}: {done.stdout.strip()[-200:]}")
    return done.stdout
