"""Common parts of all studies: the command line, the processes, and the folder that stores every answer.

A study calls `answers` with a function that answers one experiment. Each answer is stored when it is
finished. An interrupted study therefore continues at its next call.
"""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

from scipy.stats import binomtest

from kolsky.base.process import process_pool
from kolsky.inverse.settings import Numerics, Settings
from kolsky.virtual.specification import Series, SpecificationFile, read_specification

RESULTS = Path(__file__).parent / "results"
"""Folder of the published results."""
LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
USUAL = Settings()
"""Default settings."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Settings of a study. Studies with equal settings have the same experiments and the same answers."""

    mesh: tuple[int, int] = USUAL.numerics.mesh
    """Mesh of the search."""
    refined_mesh: tuple[int, int] = USUAL.refined_mesh
    """Mesh of the answer."""
    device: str = "cpu"
    """Device of the identifications."""
    seed: int = 1
    """Seed of the truths and of all noise."""

    @property
    def threads(self) -> int | None:
        """Threads of an identification: one on a CPU, because processes share the cores."""
        return 1 if self.device == "cpu" else None

    @classmethod
    def of(cls, given: argparse.Namespace, **more: Any) -> Self:
        """Settings from the options with a field's name, and ``more``."""
        names = {field.name for field in fields(cls)} & vars(given).keys() - more.keys()
        return cls(**{name: getattr(given, name) for name in names}, **more)


@dataclass(frozen=True, kw_only=True)
class TruthStudy(Study):
    """Settings of a study that simulates its truths."""

    truth_mesh: tuple[int, int] = (96, 129)
    """Mesh of the truth."""
    truth_device: str = "cpu"
    """Device of the truths."""

    @classmethod
    def of(cls, given: argparse.Namespace, **more: Any) -> Self:
        """As `Study.of`. Truths are simulated on the device of the identifications, if no other is given."""
        device = getattr(given, "truth_device", None) or given.device
        return super().of(given, truth_device=device, **more)


@dataclass(frozen=True, kw_only=True)
class ShotStudy(Study):
    """Settings of the identification of stored shots, in one process or in several."""

    threads: int | None = None  # type: ignore[misc]
    """Threads of an identification; None: all cores."""

    @classmethod
    def of(cls, given: argparse.Namespace, **more: Any) -> Self:
        """As `Study.of`, with one thread for each of several processes on a CPU."""
        more.setdefault("threads", 1 if given.workers > 1 and given.device == "cpu" else None)
        return super().of(given, **more)


def command(
    doc: str | None, *, seed: int | None = None, out: bool = True, table: Callable[[Any], str] | None = None
) -> argparse.ArgumentParser:
    """Options of every study: folder, processes, device, and the seed if the study has one.

    With ``table``, `--show FILE ...` prints the tables of results files and ends.
    """

    class Show(argparse.Action):
        def __call__(self, parser: Any, namespace: Any, files: Any, option_string: Any = None) -> None:
            for path in files:
                print(f"{path.name}\n\n{table(json.loads(path.read_text('utf-8')))}\n")  # type: ignore[misc]
            parser.exit()

    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if out:
        words = "folder of the answers; a study that it holds is continued"
        parser.add_argument("--out", type=Path, required=True, help=words)
    parser.add_argument("--workers", type=int, default=1, help="processes that share the experiments")
    parser.add_argument("--device", default="cpu", help="where the experiments are answered")
    if seed is not None:
        parser.add_argument("--seed", type=int, default=seed, help="of the population")
    if table is not None:
        words = "print the tables of these results, and do nothing else"
        parser.add_argument("--show", type=Path, nargs="+", metavar="FILE.json", action=Show, help=words)
    return parser


def add_meshes(parser: argparse.ArgumentParser, *, truth: tuple[int, int] | None = None) -> None:
    """Options `--mesh`, `--refined-mesh` and, with a default of it, `--truth-mesh` and `--truth-device`."""
    add = partial(parser.add_argument, type=mesh, metavar="24x32")
    add("--mesh", default=USUAL.numerics.mesh, help="elements across and along, of the surrogate")
    add("--refined-mesh", default=USUAL.refined_mesh, help="of the answer")
    if truth is not None:
        add("--truth-mesh", default=truth, help="of the truth")
        words = "of the truths; that of the identifications if left out"
        parser.add_argument("--truth-device", help=words)


def mesh(text: str) -> tuple[int, int]:
    """Elements across the radius and along the length from a text like "24x32"."""
    across, along = map(int, text.split("x"))
    return across, along


def numbers(text: str) -> list[int]:
    """Numbers of experiments from "FIRST:STOP" or "FIRST:STOP:STEP"."""
    return list(range(*map(int, text.split(":"))))


def settings(study: Study, kind: Any = Settings, **more: Any) -> Any:
    """Settings of an identification on a study's meshes and device, `Settings` or `JointSettings`."""
    numerics = Numerics(mesh=study.mesh, device=study.device, threads=study.threads)
    return kind(numerics=numerics, refined_mesh=study.refined_mesh, **more)


def population(spec: Path | str, *, seed: int | None = None, **tables: Mapping[str, Any]) -> Series:
    """A population of the virtual laboratory with another seed and other values in tables of its file."""
    file = read_specification(spec).file
    content = dict(file.content) | ({} if seed is None else {"seed": seed})
    for name, values in tables.items():
        content[name] = {**content.get(name, {}), **values}
    file = replace(file, content=content)
    return Series(file, file.validated(SpecificationFile))


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
        "machine": {"device": given.device, "processor": platform.machine(), "cores": os.cpu_count() or 1},
        "study": asdict(study),
        "workers": given.workers,
    }


def picture_study(
    doc: str | None,
    populations: Iterable[str],
    scenes: int,
    measure: Callable[..., Any],
    table: Callable[[list[Any]], str],
) -> None:
    """Main function of a study of rendered scenes. Prints its table and stores it in the folder.

    ``measure``: answer to a population, a scene's number and a device. ``table``: text of all answers.
    """
    parser = command(doc)
    parser.add_argument("--population", choices=tuple(populations), default="judged")
    parser.add_argument("--n", type=int, default=scenes, help="scenes")
    given = parser.parse_args()
    name = given.population
    jobs = {given.out / f"{name}-{k:04d}.json": (name, k, given.device) for k in range(given.n)}
    words = table(answers(measure, jobs, workers=given.workers))
    (given.out / f"{name}.md").write_text(words + "\n", "utf-8")
    print(words)


def markdown(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table with one row for each sequence of cells."""
    lines = [f"| {' | '.join(map(str, cells))} |" for cells in (heads, ["---"] * len(heads), *rows)]
    return "\n".join([lines[0].replace("|  |", "| |"), *lines[1:]])


def on_meshes(study: Mapping[str, Any]) -> str:
    """Text: meshes and truth of a stored study. Without an entry, the truth is of F-bar elements."""
    meshes = " → ".join(f"{study[key][0]} × {study[key][1]}" for key in ("mesh", "refined_mesh"))
    words = {"fbar": "F-bar", "one_point": "one point", "middle": "the middle of both elements"}
    element = words[study.get("truth_element", "fbar")]
    truth = " × ".join(map(str, study["truth_mesh"]))
    return f"meshes {meshes}; truth {truth}, {element}, graded {study['truth_grading']:g} to 1"


def share(count: int, of: int) -> dict[str, Any]:
    """A count with the exact 95 % interval of its proportion (Clopper and Pearson 1934)."""
    if not of:
        return {"count": 0, "of": 0, "interval": [0.0, 1.0]}
    ends = binomtest(count, of).proportion_ci(0.95, method="exact")
    return {"count": count, "of": of, "interval": [float(ends.low), float(ends.high)]}


def counted(one: Mapping[str, Any], digits: int = 0) -> str:
    """Text of a `share`."""
    low, high = (100.0 * end for end in one["interval"])
    return f"{one['count']} of {one['of']} ({low:.{digits}f} to {high:.{digits}f} %)" if one["of"] else "–"
