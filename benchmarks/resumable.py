"""Studies of drawn scenes that go on where they stopped: a file of answers a scene; their command line."""

import argparse
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from kolsky.base.process import process_pool

Measure = Callable[[str, int, str], Any]
"""Population, number of the scene and device to what JSON can hold."""


def answers(
    measure: Measure,
    population: str,
    n: int,
    out: Path,
    *,
    workers: int = 1,
    device: str = "cpu",
    say: Callable[[str], Any] = print,
) -> list[Any]:
    """Answers of all scenes; those whose file is there already are read.

    Parameters
    ----------
    measure
        What gives the answer of one scene; a function of a module, as processes of their own call it.
    population
        Name of the population.
    n
        Number of scenes.
    out
        Folder of the files.
    workers
        Processes.
    device
        Where pictures are correlated.
    say
        Told of each answer.
    """
    out.mkdir(parents=True, exist_ok=True)
    files = {number: out / f"{population}-{number:04d}.json" for number in range(n)}
    missing = [number for number, file in files.items() if not file.exists()]
    with process_pool(workers) as pool:
        jobs = {number: pool.submit(measure, population, number, device) for number in missing}
        for number, job in jobs.items():
            files[number].write_text(json.dumps(job.result()) + "\n")
            say(f"{population} {number}")
    return [json.loads(file.read_text()) for file in files.values()]


def asked(doc: str | None, populations: Sequence[str], n: int) -> argparse.Namespace:
    """Options of a study: population, number of scenes (`n` if not said), folder, processes, device."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--population", choices=tuple(populations), default="judged")
    parser.add_argument("--n", type=int, default=n, help="scenes")
    parser.add_argument("--out", type=Path, required=True, help="folder of the answers")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--device", default="cpu")
    return parser.parse_args()


def told(options: argparse.Namespace, table: str) -> None:
    """Print a table and keep it beside the answers."""
    (options.out / f"{options.population}.md").write_text(table + "\n")
    print(table)
