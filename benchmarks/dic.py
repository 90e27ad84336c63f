"""Points per second of the subset match, its bias and standard deviation, and those of other programs.

    python -m benchmarks.dic                                    # one core, and OpenCV's PyrLK
    python -m benchmarks.dic --peer ../peer/bin/python          # pyvale too, in its own environment
    python -m benchmarks.dic --device cuda --points 1000000     # a GPU
    python -m benchmarks.dic --device cuda --rates              # from 10 000 to 4 000 000 points a call
    python -m benchmarks.dic --whole ../shared/data/shots/open-01    # a whole shot, stage by stage
    python -m benchmarks.dic --whole ../shared/data/shots/open-01 --device cuda --repeats 1

The pictures are those of `benchmarks.dic_problem`: 512² px, speckles of 5 px, noise of 2 grey levels, subsets
of 21 px, guesses 0.3 px off. The preparation of the pictures is not timed. The time of a call of `correlate`
includes the transfer of its arrays to the device and back. On a CPU a rate is points per second of processor
time of one core. On a GPU it is points per second of wall time. Run nothing else at the same time.
"""

import argparse
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import dic_whole
from benchmarks.dic_peers import PeerError, Row, pyramid_lk, pyvale
from benchmarks.dic_problem import OFF, PAIRS, SIGMA, Problem, errors, problems
from benchmarks.table import is_busy
from dic.correlation import Correlation, Match, PictureStack, Shape, correlate

HEAD = "program                          motion             points/s   bias, mpx  std, mpx  found"
WHOLE = 3
"""Number of runs of a complete shot."""
RATES = (10_000, 100_000, 1_000_000, 4_000_000)
"""Numbers of points per call for `--rates`."""
CHOSEN = (
    Correlation(shape=Shape.RIGID),
    Correlation(shape=Shape.AFFINE),
    Correlation(shape=Shape.AFFINE, prefilter=0.5),
    Correlation(shape=Shape.QUADRATIC),
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.dic", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--points", type=int, default=20000, help="points of a timed call")
    parser.add_argument("--repeats", type=int, default=7, help="timed calls; the quickest counts")
    parser.add_argument("--peer", type=Path, help="the Python of an environment with pyvale")
    parser.add_argument("--json", type=Path, help="write the table here")
    parser.add_argument("--whole", type=Path, help="time `kolsky dic` on this shot's raw files instead")
    parser.add_argument(
        "--rates", type=int, nargs="*", metavar="N", help="rates of affine matches of so many points a call"
    )
    options = parser.parse_args(arguments)
    if is_busy():
        print("This machine has other work: rates are too low.\n")
    if options.whole:
        found = dic_whole.runs(options.whole, min(options.repeats, WHOLE), device=options.device)
        if options.json:
            dic_whole.put(options.json, whole=dic_whole.as_json(found))
        return
    if options.rates is not None:
        rates: dict[str, int] = {}
        for n in options.rates or RATES:
            row, _ = measure(problems()[0], Correlation(), options.device, n, min(options.repeats, WHOLE))
            rates[str(n)] = round(row.rate)
            print(f"{n:9d} points a call: {row.rate:12.0f} points/s, transfers included", flush=True)
        if options.json:
            dic_whole.put(options.json, rates=rates)
        return
    rows, calls = [], []
    print(HEAD)
    for problem in problems():
        for settings in CHOSEN:
            row, call = measure(problem, settings, options.device, options.points, options.repeats)
            calls.append(call)
            rows.append(row)
            print(line(row), flush=True)
        rows.append(pyramid_lk(problem, options.repeats))
        print(line(rows[-1]), flush=True)
        for prefilter in (True, False) if options.peer else ():
            try:
                rows.append(pyvale(options.peer, problem, prefilter=prefilter))
            except PeerError as trouble:
                parser.exit(1, f"{trouble}\n")
            print(line(rows[-1]), flush=True)
    if options.json:
        dic_whole.put(options.json, **as_json(options.device, rows, calls))


def measure(
    problem: Problem, settings: Correlation, device: str, n: int, repeats: int
) -> tuple[Row, dict[str, Any]]:
    """Time calls of `correlate` for n points (the problem's points, repeated) and summarise their errors."""
    first, second = (
        PictureStack.prepare(pictures, noise=SIGMA, prefilter=settings.prefilter, device=device)
        for pictures in (problem.first, problem.second)
    )
    every = PAIRS * len(problem.points)
    pair, which = np.divmod(np.arange(max(n, every)) % every, len(problem.points))
    points, guess = problem.points[which], problem.warp[which]
    guess[:, 0] -= OFF
    guess[:, 2:] = 0.0
    clock = time.process_time if device == "cpu" else time.perf_counter

    def call(k: int) -> Match:
        return correlate(
            first, second, points[:k], guess[:k], settings,
            reference_picture=pair[:k], deformed_picture=pair[:k], threads=1,
        )  # fmt: skip

    match, seconds = call(every), []  # the first one compiles or loads kernels
    for _ in range(repeats):
        began = clock()
        again = call(n)
        seconds.append(clock() - began)
    ok = match.outcome == 0
    name = f"{settings.shape.name.lower()}" + (
        f", prefilter {settings.prefilter:g} px" if settings.prefilter else ""
    )
    row = Row(
        f"dic, {name}", problem.name, n / min(seconds), errors(problem, points[:every][ok], match.warp[ok, 0])
    )
    return row, {
        "points": n,
        "seconds": round(min(seconds), 5),
        "iterations": round(float(again.iterations.mean()), 2),
    }


def line(row: Row) -> str:
    """One row of the table."""
    e = row.errors
    return (
        f"{row.program:32} {row.problem:16} {row.rate:10.0f} {1e3 * e.bias:11.2f} {1e3 * e.spread:9.2f}"
        f" {e.found:6.1%}"
    )


def as_json(device: str, rows: list[Row], calls: list[dict[str, Any]]) -> dict[str, Any]:
    """All measurements for `benchmarks/results`, without names of machines and dates."""
    ours = iter(calls)
    return {
        "machine": {"device": device, "processor": platform.machine(), "cores": os.cpu_count() or 1},
        "rows": [
            {
                "program": row.program,
                "problem": row.problem,
                "points_per_second": round(row.rate),
                **{f"{name}": round(value, 7) for name, value in asdict(row.errors).items()},
                **(next(ours) if row.program.startswith("dic") else {}),
            }
            for row in rows
        ],
    }


if __name__ == "__main__":
    main()
