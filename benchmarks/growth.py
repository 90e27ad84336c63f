"""Growth of the time with the number of elements of a mesh, runs of a batch, points of image correlation.

    python -m benchmarks.growth --json benchmarks/results/growth.json                 # one core of a CPU
    python -m benchmarks.growth --device cuda --json benchmarks/results/growth.json   # a GPU
    python -m benchmarks.growth --draw docs/images/growth.svg --json benchmarks/results/growth.json

The simulations are those of `benchmarks.problem` with Coulomb friction. Each ends after a number of steps
that gives about the same time (`UPDATES`). A rate of element updates needs no complete run. The number of
points is that of all frames of both cameras. Their work starts with pictures in memory and ends with gated
positions in space (`benchmarks.dic_large`). On a CPU the processor time of one thread is used, so other work
on the machine has little influence. On a GPU it is the wall time including the transfer to the host. The file
stores finished sizes; `--again` repeats them.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import explicit
from benchmarks.problem import END, model, samples
from explicit.device import select_device

MESHES = ((8, 11), (16, 22), (32, 44), (64, 86), (128, 176), (272, 368))
"""Elements across and along: 88 to 100 096 elements."""
RUNS = (1, 10, 100, 1_000, 10_000, 100_000)
"""Numbers of simulations of a batch, on 16 x 22 elements."""
POINTS = (1_000, 10_000, 100_000, 1_000_000, 4_000_000)
"""Numbers of points of all frames and cameras."""
FRAMES = 10
"""Number of frames of each camera."""
SIDE = 1500
"""Rows and columns of a picture [px]."""
UPDATES = {"cpu": 3e7, "cuda": 2e9}
"""Approximate element updates of a measurement."""
STEPS = (100, 1500)
"""Smallest and largest number of steps of a measurement. A complete run on the mesh of the batches has 2000
steps."""
LARGEST = {"cpu": {"runs": 10_000, "points": 100_000}, "cuda": {"runs": 100_000, "points": 4_000_000}}
"""Largest sizes that are measured by default."""
SAME = ("what", "size", "precision", "device", "where")
"""Fields that are equal for measurements of the same case."""
UNITS = {"elements": "element updates", "runs": "element updates", "points": "points"}
TITLES = {"elements": "elements of one run", "runs": "runs of a batch", "points": "points of a correlation"}


def steps_for(updates: float, elements: int, runs: int) -> int:
    """Number of steps within `STEPS` for about a given number of element updates."""
    return int(np.clip(round(updates / (elements * runs)), *STEPS))


def simulations(mesh: tuple[int, int], runs: int, precision: str, device: str) -> dict[str, Any]:
    """Minimum time of three batches, each ended after the same number of steps."""
    kind = "cpu" if device == "cpu" else "cuda"
    problem, batch = model(mesh, "coulomb"), samples(runs)
    steps = steps_for(UPDATES[kind], problem.mesh.n_elements, runs)
    times = np.linspace(0.0, END, 9)
    sampling = explicit.Sampling(times, times[1:], ledger_every=8)
    stepping = explicit.Stepping(precision=precision, max_steps=steps)  # type: ignore[arg-type]
    done: list[explicit.Response] = []

    def once() -> None:
        done[:] = [explicit.run(problem, batch, sampling, stepping=stepping, device=device, threads=1)]

    seconds = least(once, device)
    taken = float(done[0].steps.sum()) * problem.mesh.n_elements
    return {"steps": steps, "seconds": round(seconds, 5), "rate": round(taken / seconds)}


def points(count: int, device: str) -> dict[str, Any]:
    """Match, track, reconstruct and gate once; the kernels are compiled before."""
    import cv2

    from benchmarks.dic_large import whole

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)  # the time for making pictures is subtracted per thread
    try:
        whole(400, 200, 2, device)
        found = whole(SIDE, count // (2 * FRAMES), FRAMES, device)
    finally:
        cv2.setNumThreads(threads)
    seconds = found["processor_seconds" if device == "cpu" else "seconds"]
    taken = 2 * FRAMES * found["points"]
    return {"points": taken, "valid": found["valid"], "seconds": round(seconds, 3),
            "rate": round(taken / seconds)}  # fmt: skip


def least(work: Callable[[], None], device: str, repeats: int = 3) -> float:
    """Minimum time of some repeats after a first call that compiles [s]: processor time on a CPU, wall time
    on a GPU."""
    clock = time.process_time if device == "cpu" else time.perf_counter
    work()
    found = np.inf
    for _ in range(repeats):
        started = clock()
        work()
        found = min(found, clock() - started)
    return float(found)


def wanted(device: str, whats: Sequence[str], largest: dict[str, int]) -> list[dict[str, Any]]:
    """All requested measurements: kind, size, and for simulations the precision."""
    kind = "cpu" if device == "cpu" else "cuda"
    most = {**LARGEST[kind], **largest}
    found: list[dict[str, Any]] = []
    for precision in ("fp64", "fp32"):
        found += [{"what": "elements", "size": a * b, "precision": precision} for a, b in MESHES]
        found += [{"what": "runs", "size": n, "precision": precision} for n in RUNS if n <= most["runs"]]
    found += [{"what": "points", "size": n, "precision": ""} for n in POINTS if n <= most["points"]]
    return [one for one in found if one["what"] in whats]


def measured(one: dict[str, Any], device: str) -> dict[str, Any]:
    """The measurement of one size."""
    if one["what"] == "points":
        return points(one["size"], device)
    if one["what"] == "runs":
        return simulations((16, 22), one["size"], one["precision"], device)
    mesh = next(mesh for mesh in MESHES if mesh[0] * mesh[1] == one["size"])
    return simulations(mesh, 1, one["precision"], device)


def merged(kept: list[dict[str, Any]], new: dict[str, Any]) -> list[dict[str, Any]]:
    """The entries in order; a newer entry replaces the one of the same case."""
    entries = [one for one in kept if [one[key] for key in SAME] != [new[key] for key in SAME]]
    return sorted([*entries, new], key=lambda one: [str(one[k]) for k in ("what", "device", "precision")]
                  + [f"{one['size']:012d}"])  # fmt: skip


def table(entries: list[dict[str, Any]]) -> str:
    """Table with one row for each size and two columns for each machine: time and rate."""
    machines = list(dict.fromkeys((one["device"] != "cpu", one["where"], one["device"]) for one in entries))
    heads = [f"{where}{', one core' if device == 'cpu' else ''}" for _, where, device in sorted(machines)]
    columns = ["what grows", "size", "precision", "counted", *(f"{head}, s | a second" for head in heads)]
    lines = [f"| {' | '.join(columns)} |", "| --- " * (4 + 2 * len(heads)) + "|"]
    known = {(*_row(one), one["where"], one["device"]): one for one in entries}
    for what, precision, size in sorted({_row(one) for one in entries}):
        cells = [TITLES[what], f"{size:,}".replace(",", " "), precision or "–", UNITS[what]]
        for _, where, device in sorted(machines):
            one = known.get((what, precision, size, where, device))
            cells += ["–", "–"] if one is None else [f"{one['seconds']:.3g}", _rate(one["rate"])]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _rate(rate: float) -> str:
    """A rate as text with three digits."""
    if rate >= 1e6:
        return f"{rate / 1e6:.3g} million"
    return f"{float(f'{rate:.3g}'):,.0f}".replace(",", " ")


def _row(one: dict[str, Any]) -> tuple[str, str, int]:
    """Kind, precision and size of a measurement, the key of its row."""
    return one["what"], one["precision"], one["size"]


def draw(entries: list[dict[str, Any]], path: Path) -> None:
    """Draw a panel for each kind of size and a line for each device and precision."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    for axes, what in zip(figure.subplots(1, 3), TITLES, strict=True):
        for where, precision in dict.fromkeys(
            (one["where"], one["precision"]) for one in entries if one["what"] == what
        ):
            line = [
                one for one in entries
                if (one["what"], one["where"], one["precision"]) == (what, where, precision)
            ]  # fmt: skip
            label = " ".join(part for part in (where, precision) if part)
            axes.loglog([o["size"] for o in line], [o["rate"] for o in line], marker="o", ms=3, label=label)
        axes.set(xlabel=TITLES[what], ylabel=f"{UNITS[what]} a second")
        axes.legend(fontsize=6)
        axes.grid(alpha=0.3)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--what", nargs="+", choices=tuple(TITLES), default=list(TITLES))
    parser.add_argument("--largest-runs", type=int, help="largest batch")
    parser.add_argument("--largest-points", type=int, help="most points")
    parser.add_argument("--where", help="name of the machine; default the device's")
    parser.add_argument("--json", type=Path, required=True, help="file of the measurements, added to")
    parser.add_argument("--again", action="store_true", help="measure also what is there")
    parser.add_argument("--draw", type=Path, help="draw what is there, and measure nothing")
    o = parser.parse_args(arguments)
    entries = json.loads(o.json.read_text("utf-8")) if o.json.exists() else []
    if o.draw:
        draw(entries, o.draw)
        return
    where = o.where or select_device(o.device).name
    given = {"runs": o.largest_runs, "points": o.largest_points}
    largest = {name: value for name, value in given.items() if value is not None}
    for one in wanted(o.device, o.what, largest):
        known = {**one, "device": "cpu" if o.device == "cpu" else "cuda", "where": where}
        if not o.again and any([old[key] for key in SAME] == [known[key] for key in SAME] for old in entries):
            continue
        entries = merged(entries, {**known, **measured(one, o.device)})
        o.json.write_text(json.dumps(entries, indent=1) + "\n", "utf-8")
        print(f"{one['what']} {one['size']} {one['precision']}: done", flush=True)
    print(table(entries))


if __name__ == "__main__":
    main()
