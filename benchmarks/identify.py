"""Cost of an answer: processor time of `identify` and of other commands over that of 100 runs of the solver's
problem.

    python -m benchmarks.identify [--shot runs/open-05] [--parts free held wrong] [--threads N] [--json FILE]
        [--pictures FOLDER] [--specimen SPEC.toml] [--device cuda] [--target-cpu NAME]

The part "free" identifies all parameters that the data constrain (the default of `kolsky identify`). The part
"held" identifies the stiffness factor only. The part "wrong" is "free" with the force's sensitivity halved.
Each line gives batches, runs, element updates and processor time of one stage and mesh. The last column is
the time over that of `benchmarks.problem` on 16 x 22 bonded elements, 100 runs in fp64, in the same process,
before and after the part; "host" is the time outside the solver. `--pictures` adds `kolsky dic` and `kolsky
identify` of a shot with pictures, `--specimen` adds `kolsky specimen fit`. These are whole commands, start
and imports included. The part "start" is a program that only loads their libraries and starts the device. The
first run of a part or command may compile and does not count. Of a command, the median ratio of `ROUNDS` runs
counts. With `--threads N` these commands run on N cores of a Linux machine, as the unit does. Two threads of
one core would each take more processor time. Ratios depend less on the machine than times do; run nothing
else at the same time. On a GPU (`--device cuda`) the figures are wall times.
`--target-cpu haswell` compiles the kernels without AVX-512, as on a processor that lacks it.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import explicit
from benchmarks.problem import SAMPLING, model, samples
from kolsky.identification import identify
from kolsky.inverse.settings import Numerics, Settings
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel, Shot

PARTS = ("free", "held", "wrong")
WRONG = 2.0
"""Factor on the force of the part "wrong" [-]."""


@dataclass
class Cost:
    """Cost of the batches of one stage and mesh."""

    batches: int = 0
    runs: int = 0
    updates: float = 0.0
    """Element updates."""
    seconds: float = 0.0
    """Processor time of the solver [s]."""


@dataclass
class Ledger:
    """Costs by stage and mesh while `identify` runs."""

    stage: str = ""
    costs: dict[tuple[str, str], Cost] = field(default_factory=lambda: defaultdict(Cost))

    def told(self, stage: str, done: int, total: int) -> None:
        """Progress of `identify`."""
        self.stage = stage

    @property
    def updates(self) -> float:
        """Element updates over those of 100 runs of the solver's problem."""
        return sum(cost.updates for cost in self.costs.values()) / UPDATES

    def add(self, batch: explicit.Model, response: explicit.Response, seconds: float) -> None:
        """Add a finished batch."""
        mesh = batch.mesh
        one = self.costs[self.stage, f"{mesh.n_elements} {batch.element}"]
        one.batches += 1
        one.runs += response.n_samples
        one.updates += float(response.steps.sum()) * mesh.n_elements
        one.seconds += seconds

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Context in which every batch of the solver is counted."""
        alone, beside = explicit.run, explicit.run_side_by_side

        def run(batch: explicit.Model, *arguments: Any, **named: Any) -> explicit.Response:
            started = time.process_time()
            response = alone(batch, *arguments, **named)
            self.add(batch, response, time.process_time() - started)
            return response

        def side_by_side(problems: Sequence[explicit.Problem], **named: Any) -> list[explicit.Response]:
            started = time.process_time()
            responses = beside(problems, **named)
            taken = time.process_time() - started
            size = [
                float(r.steps.sum()) * p.model.mesh.n_elements
                for p, r in zip(problems, responses, strict=True)
            ]
            for problem, response, share in zip(problems, responses, size, strict=True):
                self.add(problem.model, response, taken * share / max(sum(size), 1.0))
            return responses

        explicit.run, explicit.run_side_by_side = run, side_by_side  # type: ignore[assignment]
        try:
            yield
        finally:
            explicit.run, explicit.run_side_by_side = alone, beside


def unit(threads: int | None) -> float:
    """Processor time of 100 runs of the solver's problem, the mean of three [s]."""
    problem, batch, started = model((16, 22), "bonded"), samples(100), 0.0
    for k in range(4):
        if k == 1:  # the first run compiles
            started = time.process_time()
        explicit.run(problem, batch, SAMPLING, threads=threads)
    return (time.process_time() - started) / 3.0


def wrong(shot: Shot) -> Shot:
    """The shot with its force multiplied."""
    assert isinstance(shot.force, ForceChannel)
    transducer = shot.force.transducer
    changed = replace(transducer, sensitivity=transducer.sensitivity / WRONG)
    return replace(shot, force=replace(shot.force, transducer=changed))


def measure(shot: Shot, part: str, numerics: Numerics) -> dict[str, Any]:
    """Processor time of one identification by stage and mesh [s], and its wall time [s]."""
    free = {"stiffness_factor": None} if part == "held" else None
    settings = Settings(free=free, numerics=numerics)
    asked = wrong(shot) if part == "wrong" else shot
    identify(asked, settings)  # the first run may compile
    ledger, started, begun = Ledger(), time.process_time(), time.perf_counter()
    with ledger.watching():
        found = identify(asked, settings, progress=ledger.told)
    wall, taken = time.perf_counter() - begun, time.process_time() - started
    m = found.estimates["stiffness_factor"]
    return {
        "seconds": taken,
        "wall": wall,
        "m": m.value,
        "sigma": m.sigma,
        "stages": [
            {"stage": stage, "mesh": mesh, **vars(cost)} for (stage, mesh), cost in ledger.costs.items()
        ],
    }


def commands(pictures: Path | None, specimen: Path | None, device: str) -> dict[str, list[str]]:
    """Arguments of the commands that are measured as a whole. Without arguments, only the libraries start."""
    found: dict[str, list[str]] = {}
    if pictures is not None:
        on = ["--device", device]
        found |= {"dic": ["dic", str(pictures), *on], "pictures": ["identify", str(pictures), *on]}
    if specimen is not None:
        found["specimen"] = ["specimen", "fit", str(specimen)]
    return {"start": [], **found} if found else {}


@contextmanager
def cores(count: int | None) -> Iterator[None]:
    """Context in which this process and the ones it starts run on so many cores; None: on all. Linux only."""
    if count is None or sys.platform != "linux":
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


ROUNDS = 3
"""Number of runs of a command. The median counts, because the speed of a shared machine varies by 15 %."""
COMPILE_FOR = """
import dic.correlation.kernels.launch
import explicit.simd.kernel
for module in (dic.correlation.kernels.launch, explicit.simd.kernel):
    module.FLAGS = module.FLAGS.replace("-march=native", "-target-cpu {cpu}")
"""
"""Code that makes the kernels for a chosen processor."""


START = """
import numpy, scipy.linalg, scipy.ndimage, scipy.optimize, cv2, h5py, pydantic, matplotlib.figure, warp
warp.init()
warp.zeros(1, device={device!r})
"""
"""Code that loads the libraries of a command and starts the device."""


def whole(arguments: list[str], cpu: str | None, device: str) -> dict[str, float]:
    """Processor time of a command and its processes and its wall time [s], into an empty folder. Without
    arguments, of `START`. ``cpu``: processor of the kernels; None: this one."""
    first = COMPILE_FOR.format(cpu=cpu) if cpu else ""
    out = tempfile.mkdtemp()
    before, begun = os.times(), time.perf_counter()
    code = f"{first}from kolsky.cli import main; main()" if arguments else START.format(device=device)
    line = [sys.executable, "-c", code, *arguments, "--out", out]
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
    after, wall = os.times(), time.perf_counter() - begun
    shutil.rmtree(out)
    return {"seconds": sum(after[2:4]) - sum(before[2:4]), "wall": wall}


def table(part: str, measured: dict[str, Any]) -> str:
    """Table with one line for each stage and mesh."""
    one = measured["unit"]
    lines = [f"\n{part}: m = {measured['m']:.5f} ± {2 * measured['sigma']:.5f}"]
    columns = f"{'batches':>8s} {'runs':>6s} {'updates':>9s} {'ratio':>7s}"
    lines.append(f"{'stage':12s} {'elements':>16s} {columns}")
    host = measured["seconds"]
    for row in measured["stages"]:
        host -= row["seconds"]
        lines.append(
            f"{row['stage']:12s} {row['mesh']:>16s} {row['batches']:8d} {row['runs']:6d} "
            f"{row['updates']:9.2e} {row['seconds'] / one:7.2f}"
        )
    lines.append(f"{'host':12s} {'':>42s} {host / one:7.2f}")
    lines.append(f"{'all':12s} {'':>42s} {measured['seconds'] / one:7.2f}")
    return "\n".join(lines)


WORDS = {
    "free": "m, ν, β",
    "held": "m",
    "wrong": "m, ν, β, a wrong input",
    "start": "nothing; only Python, its libraries and the device start",
    "dic": "`kolsky dic`",
    "pictures": "from pictures, m, ν, β",
    "specimen": "`kolsky specimen fit`",
}
"""What a part is called in a table."""
UPDATES = 7.04e7
"""Element updates of 100 runs of the solver's problem: 352 elements, 2000 steps."""


def summary(measured: dict[str, Any]) -> str:
    """Markdown table with one line for each part: runs, then updates and processor time over the solver's
    problem, or the wall time on a GPU."""
    if "unit" not in measured:
        return _wall_times(measured)
    lines = [
        "| free | runs | element updates | processor time | of it outside the solver |",
        "| --- " * 5 + "|",
    ]
    for part in (part for part in PARTS if part in measured):
        one, unit = measured[part], measured[part]["unit"]
        runs, updates, solver = (
            sum(row[key] for row in one["stages"]) for key in ("runs", "updates", "seconds")
        )
        host = one["seconds"] - solver
        lines.append(
            f"| {WORDS[part]} | {runs} | {updates / UPDATES:.1f} | {one['seconds'] / unit:.1f} "
            f"| {host / unit:.1f} |"
        )
    for part in (part for part in WORDS if part in measured and part not in PARTS):
        lines.append(f"| {WORDS[part]} | | | {measured[part]['seconds'] / measured[part]['unit']:.1f} | |")
    return "\n".join(lines)


def _wall_times(measured: dict[str, Any]) -> str:
    """Markdown table of wall times."""
    lines = ["| free | wall time (s) |", "| --- | --- |"]
    lines += [
        f"| {words} | {measured[part]['wall']:.1f} |" for part, words in WORDS.items() if part in measured
    ]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.identify",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--shot", type=Path, default=Path("runs/open-05"))
    parser.add_argument("--parts", nargs="*", choices=PARTS, default=PARTS)
    parser.add_argument("--threads", type=int, help="of the solver; all cores where it is left out")
    parser.add_argument("--pictures", type=Path, help="folder of a shot with pictures and without exports")
    parser.add_argument("--specimen", type=Path, help="file of a test of a whole specimen")
    parser.add_argument("--device", default="cpu", help="of the solver")
    parser.add_argument("--target-cpu", metavar="NAME", help="processor of the kernels, as LLVM calls it")
    parser.add_argument("--json", type=Path, help="write the figures here")
    given = parser.parse_args(arguments)
    if given.target_cpu:
        exec(COMPILE_FOR.format(cpu=given.target_cpu))
    shot, said = load_shot(given.shot), {}  # type: tuple[Shot, dict[str, Any]]
    units = [unit(given.threads)] if given.device == "cpu" else []

    def add(part: str, found: dict[str, Any]) -> None:
        """Add a part with the mean of the units before and after it."""
        if units:
            units.append(unit(given.threads))
            found["unit"] = (units[-2] + units[-1]) / 2.0
            said["unit"] = sum(units) / len(units)
        said[part] = found

    for part in given.parts:
        add(part, measure(shot, part, Numerics(threads=given.threads, device=given.device)))
        if units:
            print(table(part, said[part]), flush=True)
    for part, line in commands(given.pictures, given.specimen, given.device).items():
        rounds = []
        for k in range(1 + ROUNDS):
            with cores(given.threads):
                add(part, whole(line, given.target_cpu, given.device))
            if k:  # the first run compiles
                rounds.append(said[part])
        said[part] = sorted(rounds, key=lambda one: one["seconds"] / one.get("unit", 1.0))[ROUNDS // 2]
    if units:
        print(f"100 runs of 16 x 22 elements: {said['unit']:.2f} s of processor time")
    print(summary(said))
    if given.json:
        given.json.write_text(json.dumps(said, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
