"""Wall time of batches of the benchmarks' problem."""

import time
from dataclasses import dataclass

import numpy as np

import explicit
from benchmarks.problem import SAMPLING, model, samples
from explicit import Stepping


@dataclass(frozen=True)
class Measurement:
    """One batch: what was run, how long it took, and what came out."""

    contact: str
    """Contact law of faces and side."""
    precision: str
    """ "fp64" or "fp32"."""
    runs: int
    """Simulations of the batch."""
    seconds: float
    """Best wall time [s], to the host and with everything recorded."""
    updates: float
    """Element updates a second [1/s]."""
    same_bits: bool
    """Whether the repeats gave the same forces, bit for bit."""
    first_call: float
    """Wall time of the first run of this kind, compilation or its cache included [s]."""
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
    """Run a batch `repeats` times, with the step bound of `explicit.Stepping`; the best time counts."""
    problem, batch = model(mesh, contact), samples(runs)
    stepping = Stepping(precision=precision, bound=bound)  # type: ignore[arg-type]
    seconds, results = [], []
    for _ in range(repeats):
        started = time.perf_counter()
        results.append(explicit.run(problem, batch, SAMPLING, stepping=stepping, device=device))
        seconds.append(time.perf_counter() - started)
    first = results[0]
    return Measurement(
        contact=contact,
        precision=precision,
        runs=runs,
        seconds=min(seconds),
        updates=float(first.steps.sum()) * problem.mesh.n_elements / min(seconds),
        same_bits=all(
            np.array_equal(first.force_transmission, other.force_transmission, equal_nan=True)
            for other in results
        ),
        first_call=seconds[0],
        response=first,
    )
