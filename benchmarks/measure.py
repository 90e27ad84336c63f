"""Wall time of batches of the benchmarks' problem."""

import time
from dataclasses import dataclass

import numpy as np
import warp as wp

import explicit
from benchmarks.problem import SAMPLING, model, samples
from explicit import Stepping


@dataclass(frozen=True)
class Measurement:
    """One batch: problem, time and results."""

    contact: str
    """Contact law of faces and side."""
    precision: str
    """ "fp64" or "fp32"."""
    runs: int
    """Simulations of the batch."""
    seconds: float
    """Minimum wall time [s], including all records and the transfer to the host."""
    time_loops: float
    """Time of the time loops of a further run on a GPU, summed over the parts of a batch [s]; NaN on a CPU.
    The difference to `seconds` is the time of the host and of the transfer."""
    updates: float
    """Element updates per second [1/s]."""
    same_bits: bool
    """Whether the forces of all repeats are bitwise equal."""
    first_call: float
    """Wall time of the first run of this kind [s]. It includes compilation or loading from the cache."""
    response: explicit.Response
    """The histories."""


def measure(
    mesh: tuple[int, int],
    contact: str,
    runs: int,
    precision: str,
    device: str,
    repeats: int,
    bound: str = Stepping.bound,
) -> Measurement:
    """Run a batch `repeats` times with a step bound of `explicit.Stepping`; the minimum time is used."""
    problem, batch = model(mesh, contact), samples(runs)
    stepping = Stepping(precision=precision, bound=bound)  # type: ignore[arg-type]
    seconds, results = [], []
    for _ in range(repeats):
        started = time.perf_counter()
        results.append(explicit.run(problem, batch, SAMPLING, stepping=stepping, device=device))
        seconds.append(time.perf_counter() - started)
    time_loops = float("nan")
    if device != "cpu":
        wp.timing_begin(wp.TIMING_KERNEL)
        explicit.run(problem, batch, SAMPLING, stepping=stepping, device=device)
        loops = [found.elapsed for found in wp.timing_end() if "time_loop" in found.name]
        time_loops = sum(loops) / 1e3
    first = results[0]
    return Measurement(
        contact=contact,
        precision=precision,
        runs=runs,
        seconds=min(seconds),
        time_loops=time_loops,
        updates=float(first.steps.sum()) * problem.mesh.n_elements / min(seconds),
        same_bits=all(
            np.array_equal(first.force_transmission, other.force_transmission, equal_nan=True)
            for other in results
        ),
        first_call=seconds[0],
        response=first,
    )
