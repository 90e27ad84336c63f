"""Endurance test of one process: `python -m benchmarks.soak --seconds 3600 [--workers N] [--record FILE]`.

Each worker is one process that repeats sweeps, identifications and correlations for the given time. The tasks
are always the same and small (see `tasks`), because leaks depend on the number of calls. After each round the
worker writes a line to `--rows FOLDER`: resident memory, open handles and digests of the numbers. An
interrupted test keeps these lines; `--collect` evaluates them. Memory and handles must not grow after the
first tenth of the rounds, and every round of a worker must give the same bits. `benchmarks/results/soak.json`
stores the results and the number of calls.
"""

import argparse
import hashlib
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.small_cases import END, small_shot, write_pictures
from kolsky.base.process import process_pool

RESULT = Path(__file__).parent / "results" / "soak.json"
SETTLED = 0.1
"""Memory must be constant after this share of the rounds [-]. Before, libraries load and caches fill."""
GROWTH = 0.02
"""Largest relative growth of the resident memory after `SETTLED` [-]. A leak of one array per round exceeds
it in a hundred rounds."""
ROUND = {"sweep": 1000, "identify": 1, "outline": 1, "dic": 1}
"""Numbers of sweep runs, identifications without and with an outline, and correlations of a round; see
`EVERY`."""
EVERY = {"sweep": 1, "identify": 1, "outline": 20, "dic": 5}
"""Interval, in rounds, at which each task is done."""
MESH, REFINED = (4, 6), (6, 8)
"""Elements across the radius and along the length: mesh of the runs and of the answer."""


def _digest(*arrays: Any) -> str:
    total = hashlib.sha256()
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def tasks(folder: Path) -> dict[str, Callable[[], str]]:
    """Tasks of a round by name: functions that run and return the digest of their numbers."""
    from doe import Box
    from doe.designs.space_filling import latin_hypercube
    from kolsky.identification import identify
    from kolsky.inverse.settings import Numerics, Settings
    from kolsky.pictures.measurement import measure_file, read_measurement
    from kolsky.results.hdf5 import write_identification
    from kolsky.shot.load import load_shot
    from kolsky.shot.records import Shot
    from kolsky.studies.sweep import sweep

    place = small_shot(folder / "shot")
    box = Box(("friction", "stiffness_factor"), (0.0, 0.8), (1.0, 1.3))
    design = latin_hypercube(box, ROUND["sweep"], rng=1)
    coarse = Numerics(mesh=MESH, threads=1)
    settings = Settings(
        free={"stiffness_factor": None},
        numerics=coarse,
        refined_mesh=REFINED,
        replicates=2,
        replicate_mesh=MESH,
    )
    write_pictures(folder, frames=8, size=(90, 120))

    def loaded(*, outline: bool) -> Shot:
        shot = load_shot(place)
        if not isinstance(shot, Shot):
            raise TypeError("open-01 has exports")
        return shot if outline else replace(shot, centre_line=None)

    def swept() -> str:
        ledger = folder / "sweep.sqlite"
        ledger.unlink(missing_ok=True)
        table = sweep(loaded(outline=False), design, numerics=coarse, ledger=ledger).table
        return _digest(table.chi2_force)

    def identified(*, outline: bool) -> str:
        found = identify(loaded(outline=outline), settings)
        write_identification(folder / "identification.h5", found)
        return _digest([(e.value, e.sigma) for e in found.estimates.values()])

    def correlated() -> str:
        field = measure_file(read_measurement(folder / "dic.toml"))
        return _digest(field.pixels, field.zncc, field.points)

    return {
        "sweep": swept,
        "identify": lambda: identified(outline=False),
        "outline": lambda: identified(outline=True),
        "dic": correlated,
    }


def work(number: int, seconds: float, least: int, rows: Path) -> None:
    """Run the rounds of one worker for `seconds` [s], but at least `least` rounds. Each round writes one
    line: tasks, memory [bytes], handles, digests."""
    process = psutil.Process()
    count = 0
    with tempfile.TemporaryDirectory(prefix="soak-") as place:
        made = tasks(Path(place))
        started = time.monotonic()
        while time.monotonic() - started < seconds or count < least:
            digests = {name: made[name]() for name in made if count % EVERY[name] == 0}
            row = {
                "at": round(time.monotonic() - started, 2),
                "memory": process.memory_info().rss,
                "handles": process.num_fds() if hasattr(process, "num_fds") else process.num_handles(),
                "digests": digests,
            }
            with (rows / f"{number:03d}.jsonl").open("a") as file:
                file.write(json.dumps(row) + "\n")
            count += 1


def collected(rows: Path) -> list[list[dict[str, Any]]]:
    """The rounds of every worker with lines in a folder."""
    files = sorted(rows.glob("*.jsonl"))
    return [[json.loads(line) for line in file.read_text().splitlines()] for file in files]


def judged(rounds: list[dict[str, Any]]) -> dict[str, Any]:
    """Growth of memory and handles of one worker after the first rounds, and number of different digests of
    each task."""
    settled = rounds[max(1, int(SETTLED * len(rounds))) :]
    memory = np.array([one["memory"] for one in settled], dtype=np.float64)
    handles = [one["handles"] for one in settled]
    third = max(1, len(settled) // 3)
    # Medians of the first and the last third: a single round has no influence.
    first, last = np.median(memory[:third]), np.median(memory[-third:])
    found: dict[str, set[str]] = {}
    for one in rounds:
        for name, digest in one["digests"].items():
            found.setdefault(name, set()).add(digest)
    return {
        "rounds": len(rounds),
        "seconds": round(rounds[-1]["at"]),
        "memory [MB]": [round(float(first) / 1e6, 1), round(float(last) / 1e6, 1)],
        "growth": round(float(last / first) - 1.0, 4),
        "handles": [int(np.median(handles[:third])), int(np.median(handles[-third:]))],
        "different bits": {name: len(digests) for name, digests in found.items()},
        "done": {name: sum(name in one["digests"] for one in rounds) * ROUND[name] for name in found},
    }


def recorded(workers: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """Results over all workers, from the rounds that `work` writes, with growth and differences."""
    found = [judged(rounds) for rounds in workers]
    # The same task must also have the same result in all processes.
    digests: dict[str, set[str]] = {}
    for one in (one for rounds in workers for one in rounds):
        for name, digest in one["digests"].items():
            digests.setdefault(name, set()).add(digest)
    return {
        "seconds": max(one["seconds"] for one in found),
        "mesh": list(MESH),
        "refined mesh": list(REFINED),
        "done": {name: sum(one["done"].get(name, 0) for one in found) for name in ROUND},
        "largest growth": max(one["growth"] for one in found),
        "workers that grew": [
            number
            for number, one in enumerate(found)
            if one["growth"] > GROWTH or one["handles"][1] > one["handles"][0]
        ],
        "tasks with different bits": sorted(name for name, some in digests.items() if len(some) > 1),
        "workers": found,
    }


def table(record: dict[str, Any]) -> str:
    """The record as text."""
    done = record["done"]
    workers = record["workers"]
    memory = [one["memory [MB]"] for one in workers]
    handles = [one["handles"] for one in workers]
    bits = record["tasks with different bits"]
    minutes = sorted(round(one["seconds"] / 60) for one in workers)
    counted = "One process" if len(workers) == 1 else f"{len(workers)} processes"
    each = f"{minutes[-1]} min" if minutes[0] == minutes[-1] else f"{minutes[0]} to {minutes[-1]} min each"
    return (
        f"{counted}, {each}: {done['sweep']} runs of sweeps"
        f" ({' × '.join(map(str, record['mesh']))} elements, {END}),"
        f" {done['identify']} identifications by the force alone and {done['outline']} by force and outline"
        f" (answers on {' × '.join(map(str, record['refined mesh']))} elements), {done['dic']} correlations"
        f" of 8 pictures. Resident memory once settled {min(memory)[0]:.0f} MB, at the end"
        f" {max(memory, key=lambda pair: pair[1])[1]:.0f} MB (largest growth of a process"
        f" {100.0 * record['largest growth']:.1f} %, allowed {100.0 * GROWTH:.0f} %); open handles"
        f" {max(pair[0] for pair in handles)}, at the end {max(pair[1] for pair in handles)}; processes that"
        f" grew: {len(record['workers that grew'])}; tasks whose bits differed: {len(bits)}."
    )


def main() -> int:
    """Run the test and write the record; returns 1 if memory or handles grew or bits differed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--rounds", type=int, default=3, help="rounds that a worker makes at least")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rows", type=Path, help="folder of the lines; default: a temporary one")
    parser.add_argument("--collect", action="store_true", help="only judge the lines of --rows")
    parser.add_argument("--record", type=Path, default=RESULT)
    said = parser.parse_args()
    if said.collect and said.rows is None:
        parser.error("--collect needs --rows FOLDER")
    rows = said.rows or Path(tempfile.mkdtemp(prefix="soak-rows-"))
    rows.mkdir(parents=True, exist_ok=True)
    if not said.collect:
        if list(rows.glob("*.jsonl")):
            parser.error(f"{rows} holds lines of another run: choose another folder")
        with process_pool(said.workers) as pool:
            jobs = [pool.submit(work, n, said.seconds, said.rounds, rows) for n in range(said.workers)]
            for job in jobs:
                job.result()
    record = recorded(collected(rows))
    said.record.write_text(json.dumps(record, indent=1) + "\n")
    print(json.dumps({key: value for key, value in record.items() if key != "workers"}, indent=1))
    return 1 if record["workers that grew"] or record["tasks with different bits"] else 0


if __name__ == "__main__":
    sys.exit(main())
