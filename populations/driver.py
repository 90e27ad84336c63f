"""Common parts of all studies: the command line, the processes, and the folder that stores every answer.

A study calls `answers` with a function that answers one experiment. Each answer is stored when it is
finished. An interrupted study therefore continues at its next call.
"""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import as_completed
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from kolsky.base.process import process_pool
from kolsky.inverse.settings import Numerics, Settings

RESULTS = Path(__file__).parent / "results"
"""Folder of the published results."""
LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
USUAL = Settings()
"""Default settings."""


def command(doc: str | None, *, seed: int | None = None, out: bool = True) -> argparse.ArgumentParser:
    """Options of every study: folder, processes, device, and the seed if the study has one."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if out:
        words = "folder of the answers; a study that it holds is continued"
        parser.add_argument("--out", type=Path, required=True, help=words)
    parser.add_argument("--workers", type=int, default=1, help="processes that share the experiments")
    parser.add_argument("--device", default="cpu", help="where the experiments are answered")
    if seed is not None:
        parser.add_argument("--seed", type=int, default=seed, help="of the population")
    return parser


def add_meshes(parser: argparse.ArgumentParser, *, truth: tuple[int, int] | None = None) -> None:
    """Options `--mesh`, `--refined-mesh` and, with a default for it, `--truth-mesh`."""
    add = partial(parser.add_argument, type=mesh, metavar="24x32")
    add("--mesh", default=USUAL.numerics.mesh, help="elements across and along, of the surrogate")
    add("--refined-mesh", default=USUAL.refined_mesh, help="of the answer")
    if truth is not None:
        add("--truth-mesh", default=truth, help="of the truth")


def mesh(text: str) -> tuple[int, int]:
    """Elements across the radius and along the length from a text like "24x32"."""
    across, along = map(int, text.split("x"))
    return across, along


def numbers(text: str) -> list[int]:
    """Numbers of experiments from "FIRST:STOP" or "FIRST:STOP:STEP"."""
    return list(range(*map(int, text.split(":"))))


def settings(study: Any, threads: int | None, **more: Any) -> Settings:
    """Settings of an identification on a study's meshes and device."""
    numerics = Numerics(mesh=study.mesh, device=study.device, threads=threads)
    return Settings(numerics=numerics, refined_mesh=study.refined_mesh, **more)


def results(work: Callable[..., Any], jobs: Iterable[tuple[Any, ...]], workers: int) -> Iterator[Any]:
    """Results of a function for each job's arguments, in the order of completion.

    With one worker the function runs in this process. Several workers use one thread each for linear algebra,
    because more threads than cores are slower. ``work`` must then be a module-level function.
    """
    if workers == 1:
        yield from (work(*job) for job in jobs)
        return
    for name in LIBRARY_THREADS:
        os.environ.setdefault(name, "1")
    with process_pool(workers) as pool:
        for done in as_completed([pool.submit(work, *job) for job in jobs]):
            yield done.result()


def answers(
    work: Callable[..., Any],
    jobs: Mapping[Path, tuple[Any, ...]],
    *,
    workers: int = 1,
    line: Callable[[Any], str] | None = None,
) -> list[Any]:
    """Answers to all jobs in order. Existing files are read and not recomputed.

    ``line`` returns the printed text of a finished answer; by default it is the name of the file.
    """
    missing = [(work, path, job) for path, job in jobs.items() if not path.exists()]
    for path, answer in results(_kept, missing, workers):
        print(path.stem if line is None else line(answer), flush=True)
    return [json.loads(path.read_text("utf-8")) for path in jobs]


def _kept(work: Callable[..., Any], path: Path, job: tuple[Any, ...]) -> tuple[Path, Any]:
    """Answer a job and store the answer."""
    answer = work(*job)
    write(path, answer)
    return path, answer


def write(path: Path, content: Any, *, indent: int | None = None) -> None:
    """Write a JSON file completely or not at all. Makes its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial_file = path.with_suffix(".part")
    partial_file.write_text(json.dumps(content, indent=indent) + "\n", "utf-8")
    partial_file.replace(path)


def hold(study: Any, folder: Path) -> None:
    """Write a study's settings into its folder. ValueError if the folder has other settings; devices are not
    compared."""
    content = {key: value for key, value in asdict(study).items() if "device" not in key}
    path = folder / "study.json"
    if path.exists():
        kept = json.loads(path.read_text("utf-8"))
        if {key: kept.get(key) for key in content} != json.loads(json.dumps(content)):
            raise ValueError(f"{path} is of another study: {kept}; give another --out")
    write(path, content)


def about(study: Any, given: argparse.Namespace) -> dict[str, Any]:
    """Header of a summary: the machine and the settings."""
    return {
        "machine": {
            "device": given.device,
            "processor": platform.machine(),
            "cores": os.cpu_count() or 1,
        },
        "study": asdict(study),
        "workers": given.workers,
    }


def print_tables(table: Callable[[Any], str]) -> None:
    """Print the table of every results file on the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE.json")
    for path in parser.parse_args().files:
        print(f"{path.name}\n\n{table(json.loads(path.read_text('utf-8')))}\n")
