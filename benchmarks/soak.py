"""An hour of work in one process: `python -m benchmarks.soak --seconds 3600 [--workers N] [--record FILE]`.

Each worker is one process that sweeps, identifies and correlates in turn for so long, always the same
question. After each round it notes its resident memory, its open handles and the digest of the numbers.
Memory and handles must not grow from the second tenth of the rounds on, and every round of a worker must give
the same bits; `benchmarks/results/soak.json` keeps what was found. The counts over all workers are printed at
the end: sweep runs, identifications, correlations.
"""

import argparse
import hashlib
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from kolsky.base.process import process_pool

RESULT = Path(__file__).parent / "results" / "soak.json"
ROOT = Path(__file__).resolve().parents[1]
SETTLED = 0.1
"""Share of the rounds after which memory is taken as settled: libraries load and caches fill before."""
GROWTH = 0.02
"""Largest growth of the resident memory from then to the end, as a share of it; a leak of one array a round
is more than that in a hundred rounds."""
ROUND = {"sweep": 1000, "identify": 1, "dic": 1}
"""Sweep runs, identifications and correlations of a round; of the latter two see `every`."""


def _digest(*arrays: Any) -> str:
    total = hashlib.sha256()
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def tasks(folder: Path) -> dict[str, Callable[[], str]]:
    """What a round does: name -> a function that works and returns the digest of its numbers."""
    from benchmarks.kills import _pictures
    from doe import Box
    from doe.designs.space_filling import latin_hypercube
    from kolsky.identification import identify
    from kolsky.inverse.forward import Numerics
    from kolsky.inverse.settings import Settings
    from kolsky.results.hdf5 import write_identification
    from kolsky.shot.load import load_shot
    from kolsky.shot.measurement import measure_file, read_measurement
    from kolsky.studies.sweep import sweep

    shot = load_shot(ROOT / "runs" / "open-01")
    box = Box(("friction", "stiffness_factor"), (0.0, 0.8), (1.0, 1.3))
    design = latin_hypercube(box, ROUND["sweep"], rng=1)
    coarse = Numerics(mesh=(8, 11), threads=1)
    settings = Settings(free={"stiffness_factor": None}, numerics=coarse, refined_mesh=(16, 22), replicates=2)
    _pictures(folder)
    measurement = read_measurement(folder / "dic.toml")

    def swept() -> str:
        place = folder / "sweep.sqlite"
        place.unlink(missing_ok=True)
        table = sweep(shot, design, numerics=coarse, ledger=place).table
        return _digest(table.chi2_force, table.chi2_shape)

    def identified() -> str:
        found = identify(shot, settings)
        write_identification(folder / "identification.h5", found)
        return _digest([(e.value, e.sigma) for e in found.estimates.values()])

    def correlated() -> str:
        field = measure_file(measurement)
        return _digest(field.pixels, field.zncc, field.points)

    return {"sweep": swept, "identify": identified, "dic": correlated}


def work(number: int, seconds: float, every: dict[str, int]) -> list[dict[str, Any]]:
    """The rounds of one worker: what was done, memory [bytes], handles, digests."""
    process = psutil.Process()
    rounds: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="soak-") as place:
        made = tasks(Path(place))
        started = time.monotonic()
        while time.monotonic() - started < seconds or len(rounds) < 3:
            done = [name for name in made if len(rounds) % every[name] == 0]
            digests = {name: made[name]() for name in done}
            rounds.append(
                {
                    "worker": number,
                    "at": time.monotonic() - started,
                    "memory": process.memory_info().rss,
                    "handles": process.num_fds() if hasattr(process, "num_fds") else process.num_handles(),
                    "digests": digests,
                }
            )
    return rounds


def judged(rounds: list[dict[str, Any]]) -> dict[str, Any]:
    """Growth of memory and handles of one worker once settled, and how many digests each task gave.

    Parameters
    ----------
    rounds
        As `work` returns them.
    """
    settled = rounds[max(1, int(SETTLED * len(rounds))) :]
    memory = np.array([one["memory"] for one in settled], dtype=np.float64)
    handles = [one["handles"] for one in settled]
    third = max(1, len(settled) // 3)
    # Medians of the first and the last third: one round more or less under way is no growth.
    first, last = np.median(memory[:third]), np.median(memory[-third:])
    found: dict[str, set[str]] = {}
    for one in rounds:
        for name, digest in one["digests"].items():
            found.setdefault(name, set()).add(digest)
    return {
        "rounds": len(rounds),
        "memory [MB]": [round(float(first) / 1e6, 1), round(float(last) / 1e6, 1)],
        "growth": round(float(last / first) - 1.0, 4),
        "handles": [int(np.median(handles[:third])), int(np.median(handles[-third:]))],
        "different bits": {name: len(digests) for name, digests in found.items()},
        "done": {name: sum(name in one["digests"] for one in rounds) * ROUND[name] for name in found},
    }


def table(record: dict[str, Any]) -> str:
    """The record in words."""
    done = record["done"]
    workers = record["workers"]
    memory = [one["memory [MB]"] for one in workers]
    bits = record["tasks with different bits"]
    return (
        f"{len(workers)} processes for {record['seconds'] / 60:.0f} min: {done['sweep']} runs of sweeps,"
        f" {done['identify']} identifications, {done['dic']} correlations. Resident memory of a process"
        f" {min(memory)[0]:.0f} to {max(memory)[0]:.0f} MB once settled,"
        f" largest growth {100.0 * record['largest growth']:.1f} % to the end; processes that grew:"
        f" {len(record['workers that grew'])}; tasks whose bits differed: {len(bits)}."
    )


def main() -> int:
    """Work for so long and write the record; 1 if memory or handles grew or bits differed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--identify-every", type=int, default=1, metavar="ROUNDS")
    parser.add_argument("--dic-every", type=int, default=5, metavar="ROUNDS")
    parser.add_argument("--record", type=Path, default=RESULT)
    said = parser.parse_args()
    every = {"sweep": 1, "identify": said.identify_every, "dic": said.dic_every}
    with process_pool(said.workers) as pool:
        jobs = [pool.submit(work, number, said.seconds, every) for number in range(said.workers)]
        workers = [judged(job.result()) for job in jobs]
    bits = {name for one in workers for name, count in one["different bits"].items() if count > 1}
    grown = [
        n for n, one in enumerate(workers) if one["growth"] > GROWTH or one["handles"][1] > one["handles"][0]
    ]
    record = {
        "seconds": said.seconds,
        "done": {name: sum(one["done"].get(name, 0) for one in workers) for name in ROUND},
        "largest growth": max(one["growth"] for one in workers),
        "workers that grew": grown,
        "tasks with different bits": sorted(bits),
        "workers": workers,
    }
    said.record.write_text(json.dumps(record, indent=1) + "\n")
    print(json.dumps({key: value for key, value in record.items() if key != "workers"}, indent=1))
    return 1 if grown or bits else 0


if __name__ == "__main__":
    sys.exit(main())
