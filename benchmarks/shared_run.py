"""One simulation on several threads of a CPU, in turn with one thread.

    python -m benchmarks.shared_run                              # 64 x 86 elements, fp64, 1 and 2 threads
    python -m benchmarks.shared_run --mesh 24x32 --repeats 30
    python -m benchmarks.shared_run --beside 1                   # another process works meanwhile

Prints wall and processor time of the least of the repeats and of the middle one, and whether all had the same
bits. The problem is that of `benchmarks.solver` with Coulomb friction. What else the machine does counts more
than anything: the least of many repeats is that of free cores, if they were ever free.
"""

import argparse
import multiprocessing
import os
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import explicit
from benchmarks.problem import SAMPLING, model, samples


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.shared_run",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--mesh", default="64x86")
    parser.add_argument("--element", choices=("one_point", "fbar"), default="one_point")
    parser.add_argument("--precision", choices=("fp64", "fp32"), default="fp64")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--beside", type=int, default=0, help="processes that work meanwhile")
    options = parser.parse_args(arguments)
    across, along = (int(part) for part in options.mesh.split("x"))
    problem = replace(model((across, along), "coulomb"), element=options.element)
    stepping = explicit.Stepping(precision=options.precision)
    context = multiprocessing.get_context("spawn")
    others = [context.Process(target=_work, daemon=True) for _ in range(options.beside)]
    for other in others:
        other.start()
    found: dict[int, list[tuple[float, float]]] = {threads: [] for threads in options.threads}
    forces, steps = [], 0
    for repeat in range(-1, options.repeats):  # the first of each compiles
        for threads in options.threads:
            wall, worked = time.perf_counter(), time.process_time()
            response = explicit.run(problem, samples(1), SAMPLING, stepping=stepping, threads=threads)
            wall, worked = time.perf_counter() - wall, time.process_time() - worked
            forces.append((response.force_transmission, response.energy.damping))
            steps = int(response.steps[0])
            if repeat >= 0:
                found[threads].append((wall, worked))
    for other in others:
        other.terminate()
    same = all(
        np.array_equal(a, b, equal_nan=True) for one in forces for a, b in zip(one, forces[0], strict=True)
    )
    print(
        f"{options.mesh} elements, {options.element}, {options.precision}, {steps} steps; "
        f"{os.cpu_count()} cores, {options.beside} busy processes beside; "
        f"bits {'the same' if same else 'DIFFER'}"
    )
    print("threads  least wall [s]  of the processor  middle wall [s]  of the processor")
    for threads, times in found.items():
        (least, with_least), (middle, with_middle) = min(times), sorted(times)[len(times) // 2]
        print(f"{threads:7d}  {least:14.4f}  {with_least:16.4f}  {middle:15.4f}  {with_middle:16.4f}")


def _work() -> None:
    """Keep a core busy."""
    numbers = np.linspace(0.0, 1.0, 1000)
    while True:
        numbers = np.cos(numbers)


if __name__ == "__main__":
    main()
