"""Parallel identifications of a campaign: `python -m benchmarks.campaign --workers 1 2 --json FILE`.

A pool of processes of this machine identifies the shot `runs/open-01` with the seeds 1, 2, ... of its random
draws. `--each` gives the number of
identifications per worker (weak scaling). `--total` gives the number that all workers share. Before the
measurement each worker identifies the shot once, to compile kernels and load libraries. An answer must depend
on its seed only; the table shows whether the answers are bitwise equal. The file stores finished numbers of
workers, so an interrupted command continues with the next one.

On a machine with GPUs `--device cuda` distributes them over the processes; `--gpus N` makes N of them
visible.
"""

import argparse
import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kolsky.base.process import process_pool

SHOT = Path(__file__).resolve().parents[1] / "runs" / "open-01"
ALIKE = ("where", "device", "hold", "mesh", "refined")
"""Fields that are equal for identifications of the same problem."""
SAME = ("gpus", "workers", "each", *ALIKE)
"""Fields that are equal for measurements of the same case."""
WARM_UP = -1
"""Seed of a first identification. Its answer is not stored."""
FIRST_WAIT = 0.2
"""Time for which a worker waits after its first identification [s], so that it does not take a second one."""


@dataclass(frozen=True)
class Question:
    """Settings of one identification."""

    seed: int
    """Seed of its random draws; `WARM_UP` for a first one."""
    device: str
    """Device on which it runs."""
    hold: tuple[str, ...]
    """Parameters that are fixed in addition to those of the shot."""
    mesh: tuple[int, int]
    """Mesh of the surrogate."""
    refined: tuple[int, int]
    """Mesh of the answer."""
    shot: Path = SHOT
    """The shot's folder."""


@dataclass(frozen=True)
class Answer:
    """Result of one identification."""

    m: str
    """The stiffness factor with all bits."""
    process: str
    """Machine and process that identified it."""


def identified(question: Question) -> Answer:
    """Identify a shot with one thread, in a worker."""
    from kolsky.identification import identify
    from kolsky.inverse.settings import Numerics, Settings
    from kolsky.shot.load import load_shot

    numerics = Numerics(mesh=question.mesh, device=question.device, threads=1)
    settings = Settings(
        hold=question.hold, numerics=numerics, refined_mesh=question.refined, seed=max(question.seed, 1)
    )
    found = identify(load_shot(question.shot), settings)
    if question.seed == WARM_UP:
        time.sleep(FIRST_WAIT)
    return Answer(found.estimates["stiffness_factor"].value.hex(), f"{os.uname().nodename} {os.getpid()}")


def campaign(questions: Sequence[Question], workers: int) -> dict[str, Any]:
    """Run all identifications with a number of workers, after a first identification by each worker;
    RuntimeError if fewer workers took part."""
    with process_pool(workers) as pool:
        first = replace(questions[0], seed=WARM_UP)
        started = time.perf_counter()
        warm = list(pool.map(identified, [first] * workers))
        ready = time.perf_counter() - started
        started = time.perf_counter()
        answers = list(pool.map(identified, questions))
        seconds = time.perf_counter() - started
    there = {one.process for one in answers}
    if len(there) > workers or (len(there) < workers and len(questions) >= 4 * workers):
        raise RuntimeError(f"{workers} workers were meant to answer, {len(there)} did")
    return {
        "identifications": len(answers),
        "seconds": round(seconds, 6),
        "seconds_of_starting": round(ready, 2),
        "processes": len(there),
        "answers": {str(q.seed): answer.m for q, answer in zip(questions, answers, strict=True)},
        "warm": len(warm),
    }


def same_bits(entries: Sequence[dict[str, Any]], one: dict[str, Any]) -> bool:
    """Whether the answers of every seed equal those of the other entries of the same problem and device."""
    others = [other for other in entries if all(other[key] == one[key] for key in ALIKE)]
    return all(other["answers"].get(seed, m) == m for other in others for seed, m in one["answers"].items())


def merged(kept: Sequence[dict[str, Any]], new: dict[str, Any]) -> list[dict[str, Any]]:
    """The entries in order; a newer entry replaces the one of the same case."""
    rest = [one for one in kept if [one[key] for key in SAME] != [new[key] for key in SAME]]
    return sorted([*rest, new], key=lambda one: (one["where"], one["device"], one["gpus"], one["workers"]))


def table(entries: Sequence[dict[str, Any]]) -> str:
    """Table with one row for each number of workers; efficiency is the rate per worker over that with the
    fewest workers."""
    lines = [
        "| where | GPUs | workers | identifications | seconds | a minute | efficiency | same bits |",
        "| --- " * 8 + "|",
    ]
    for one in entries:
        alike = [o for o in entries if all(o[key] == one[key] for key in ALIKE)]
        least = min(alike, key=lambda o: (o["workers"], o["gpus"]))
        rate, base = (o["identifications"] / o["seconds"] / o["workers"] for o in (one, least))
        cells = (
            one["where"], one["gpus"] or "–", one["workers"], one["identifications"],
            f"{one['seconds']:.3g}", f"{60.0 * one['identifications'] / one['seconds']:.3g}",
            f"{rate / base:.2f}", "yes" if same_bits(entries, one) else "no",
        )  # fmt: skip
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.campaign",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    share = parser.add_mutually_exclusive_group()
    share.add_argument("--each", type=int, help="identifications of each worker; default 4")
    share.add_argument("--total", type=int, help="identifications of all workers together")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--gpus", type=int, default=0, help="show the processes so many GPUs; default all")
    parser.add_argument("--hold", nargs="*", default=["poisson", "damping"])
    parser.add_argument("--mesh", default="24x32")
    parser.add_argument("--refined", default="64x86")
    parser.add_argument("--where", default="here", help="name of the machine")
    parser.add_argument("--json", type=Path, required=True, help="file of the measurements, added to")
    parser.add_argument("--again", action="store_true", help="measure also what is there")
    o = parser.parse_args(arguments)
    if o.gpus:
        os.environ["CUDA_VISIBLE_DEVICES"] = ",".join(map(str, range(o.gpus)))
    entries = json.loads(o.json.read_text("utf-8")) if o.json.exists() else []
    mesh, refined = ((int(a), int(b)) for a, b in (text.split("x") for text in (o.mesh, o.refined)))
    for workers in o.workers:
        count = o.total or (o.each or 4) * workers
        known = {"device": o.device, "gpus": o.gpus, "workers": workers, "each": count / workers,
                 "hold": o.hold, "mesh": o.mesh, "refined": o.refined, "where": o.where}  # fmt: skip
        if not o.again and any([old[key] for key in SAME] == [known[key] for key in SAME] for old in entries):
            continue
        questions = [Question(seed, o.device, tuple(o.hold), mesh, refined) for seed in range(1, count + 1)]
        entries = merged(entries, {**known, **campaign(questions, workers)})
        o.json.write_text(json.dumps(entries, indent=1) + "\n", "utf-8")
        print(f"{workers} workers: done", flush=True)
    print(table(entries))


if __name__ == "__main__":
    main()
