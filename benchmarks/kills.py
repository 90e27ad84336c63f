"""Test of killed commands: `python -m benchmarks.kills [--kills 100] [--workers 2] [--seed 1]`.

Every trial starts a command in a separate folder. It ends the command at a random time by SIGKILL, SIGTERM or
SIGINT, and starts the same command again. A command that has ended before the signal is started again and
ended earlier. The study counts unreadable files, hidden files, processes that continue, and lost or repeated
runs of a sweep. It also counts numbers that differ from two undisturbed runs. With `--out FOLDER` each row is
stored there, so an interrupted campaign can be continued; the table is written to
`benchmarks/results/kills.json`.
"""

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import psutil

from benchmarks.kill_contents import contents, ledger_runs, unreadable
from benchmarks.kill_watch import end_of, end_of_children
from benchmarks.small_cases import ROOT, small_shot, write_pictures

RESULT = Path(__file__).parent / "results" / "kills.json"
SIGNALS = {"SIGKILL": 0.5, "SIGTERM": 0.25, "SIGINT": 0.25}
"""Signals and their shares of the trials [-]."""
CHILDREN = 1.0
"""Time within which the children of a killed command must end [s]."""
STOPPED = 3.0
"""Time within which a command must end after a signal [s]."""
SOONER = 0.7
"""Factor on the time of the signal if the command had ended before it [-]."""
SHOWN = 1500
"""Largest number of characters of a traceback in a row."""
LONGEST = 1800.0
"""Time limit of a command [s]."""


@dataclass(frozen=True)
class Command:
    """A command that is killed."""

    words: tuple[str, ...]
    """Arguments of `kolsky`; FOLDER is its folder."""
    inputs: Callable[[Path], object]
    """Function that makes its inputs in its folder."""


@dataclass(frozen=True)
class Trial:
    """Result of one killed command."""

    number: int
    """Number of the trial."""
    command: str
    """Name of the command."""
    how: str
    """Name of the signal."""
    share: float
    """Time of the signal over the undisturbed duration [-]."""
    code: int
    """Exit code of the killed command."""
    stopped: float
    """Time from the signal to the command's end, without waits for a core [s]."""
    children: float
    """Time from the command's end to that of the last of its children, without waits for a core [s]."""
    problems: tuple[str, ...]
    """Problems; empty if there are none."""


def _shot(folder: Path) -> None:
    small_shot(folder / "shot")


def _answered(folder: Path) -> None:
    _shot(folder)
    done = _run(("identify", *_TINY), folder)
    if done.returncode != 0:
        raise SystemExit(done.stderr)


def _pictures(folder: Path) -> None:
    write_pictures(folder, frames=12, size=(120, 160))


def _bars(folder: Path) -> None:
    shutil.copytree(ROOT / "runs" / "bar-01", folder / "shot")


def _virtual(folder: Path) -> None:
    shutil.copy(ROOT / "runs" / "virtual" / "small.toml", folder)


def _specimen(folder: Path) -> None:
    text = (ROOT / "runs" / "specimen" / "silicone.toml").read_text()
    text = text.replace("elements = [40, 10, 2]", "elements = [10, 2, 2]")
    text = text.partition("[tests.biaxial]")[0]
    (folder / "strip.toml").write_text(text)
    shutil.copy(ROOT / "runs" / "specimen" / "uniaxial.csv", folder)


_TINY = ("FOLDER/shot", "--mesh", "4x6", "--free", "stiffness_factor", "--refined-mesh", "6x8",
         "--replicates", "2")  # fmt: skip
_SWEEP = ("sweep", "FOLDER/shot", "--design", "lhs", "--runs", "640", "--mesh", "6x8")
COMMANDS = {
    "sweep": Command(_SWEEP, _shot),
    "sweep over processes": Command((*_SWEEP, "--processes", "2"), _shot),
    "identify": Command(("identify", *_TINY), _shot),
    "report": Command(("report", "FOLDER/shot"), _answered),
    "dic": Command(("dic", "FOLDER"), _pictures),
    "waves": Command(("waves", "FOLDER/shot"), _bars),
    "virtual make": Command(
        ("virtual", "make", "FOLDER/small.toml", "--only", "1", "--out", "FOLDER/made"), _virtual
    ),
    "specimen fit": Command(("specimen", "fit", "FOLDER/strip.toml", "--out", "FOLDER/results"), _specimen),
}
"""Commands by name."""
MAKING = {name: threading.Lock() for name in COMMANDS}
"""Locks that are held while a command's inputs are made."""


def _start(words: tuple[str, ...], folder: Path) -> subprocess.Popen[str]:
    said = [word.replace("FOLDER", str(folder)) for word in words]
    return subprocess.Popen(
        [sys.executable, "-m", "kolsky.cli", *said],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        start_new_session=True,
    )


def _run(words: tuple[str, ...], folder: Path) -> subprocess.CompletedProcess[str]:
    run = _start(words, folder)
    _, said = run.communicate(timeout=LONGEST)
    return subprocess.CompletedProcess(words, run.returncode, "", said)


@dataclass(frozen=True)
class Undisturbed:
    """Result of a command that is not killed."""

    seconds: float
    """Duration [s]."""
    numbers: dict[str, str]
    """Digests of the common contents of two runs, by file and position."""
    runs: int
    """Runs in its ledger; 0 without one."""


def _inputs(name: str, base: Path, folder: Path) -> None:
    """Copy the inputs of a command into a new folder; they are made once for all trials."""
    made = base / f"{name.replace(' ', '-')}-inputs"
    with MAKING[name]:  # trials run in parallel: a second one waits until the inputs are complete
        if not made.exists():
            made.mkdir(parents=True)
            COMMANDS[name].inputs(made)
    shutil.copytree(made, folder)


def undisturbed(name: str, base: Path) -> Undisturbed:
    """Run a command twice and return the contents that do not depend on the time of the run."""
    found, seconds, runs = [], [], 0
    for number in range(2):
        folder = base / f"{name.replace(' ', '-')}-undisturbed-{number}"
        _inputs(name, base, folder)
        started = time.monotonic()
        done = _run(COMMANDS[name].words, folder)
        seconds.append(time.monotonic() - started)
        if done.returncode != 0:
            raise SystemExit(f"{name} ends with {done.returncode} undisturbed: {done.stderr}")
        found.append(contents(folder))
        runs = len(ledger_runs(folder))
        shutil.rmtree(folder)
    first, second = found
    common = {key: value for key, value in first.items() if second.get(key) == value}
    return Undisturbed(min(seconds), common, runs)


def _kept(name: str, base: Path, out: Path) -> Undisturbed:
    """Common contents of two undisturbed runs, read from the folder of the rows if stored."""
    place = out / f"{name.replace(' ', '-')}.json"
    if place.exists():
        return Undisturbed(**json.loads(place.read_text()))
    whole = undisturbed(name, base)
    place.write_text(json.dumps(asdict(whole)) + "\n")
    return whole


@dataclass(frozen=True)
class Killed:
    """A command that was sent a signal while it ran."""

    share: float
    """Time of the signal over the undisturbed duration [-]."""
    code: int
    """Its exit code."""
    said: str
    """Its standard error."""
    stopped: float
    """Time from the signal to its end, without waits for a core [s]."""
    children: float
    """Time from its end to that of its last child, without waits for a core [s]."""
    alive: int
    """Number of children that still existed ten seconds later."""


def killed(name: str, how: str, share: float, base: Path, folder: Path, whole: Undisturbed) -> Killed:
    """Start a command and send it a signal; if it has ended before, repeat with an earlier signal in a new
    folder."""
    while True:
        _inputs(name, base, folder)
        run = _start(COMMANDS[name].words, folder)
        time.sleep(share * whole.seconds)
        if run.poll() is None:
            break
        run.communicate()
        shutil.rmtree(folder)
        share *= SOONER
    children = psutil.Process(run.pid).children(recursive=True)
    signalled = time.monotonic()
    run.send_signal(getattr(signal, how))
    said, stopped = end_of(run, signalled, LONGEST)
    gone, alive = end_of_children(children)
    return Killed(share, run.returncode, said, stopped, gone, alive)


def _begun(one: Killed) -> bool:
    """Whether the command line had started; before that the interpreter handles the signal."""
    itself = one.code in (-2, -15) or (one.code == 1 and str(ROOT) not in one.said)
    return not itself or any("commandline.py" in l and l.endswith("in main") for l in one.said.splitlines())


def _of_the_end(one: Killed, how: str, folder: Path) -> list[str]:
    """Problems with the end of a command and with the files that it left."""
    problems = []
    if one.alive or one.children > CHILDREN:
        problems.append(f"{one.alive} children went on, the last for {one.children:.1f} s")
    told = how != "SIGKILL"
    if told and one.stopped > STOPPED:
        problems.append(f"ended {one.stopped:.1f} s after {how}")
    # 0: it had finished when the signal arrived.
    expected = {"SIGKILL": (-9, 0), "SIGTERM": (143, 0), "SIGINT": (130, 0)}[how]
    if _begun(one) and one.code not in expected:
        problems.append(f"exit code {one.code} after {how}")
    if told and _begun(one):
        if "Traceback" in one.said:
            _, _, told_of = one.said.partition("Traceback")
            problems.append(f"traceback after {how}: {' | '.join(told_of.strip().splitlines())[:SHOWN]}")
        problems += [f"left after {how}: {path.name}" for path in _hidden(folder)]
    return problems + [f"cannot be read after {how}: {what}" for what in unreadable(folder)]


def trial(number: int, name: str, how: str, share: float, base: Path, whole: Undisturbed) -> Trial:
    """Kill a command at a share of its duration, start it again, and check the result."""
    folder = base / f"trial-{number:03d}"
    one = killed(name, how, share, base, folder, whole)
    problems = _of_the_end(one, how, folder)
    before = ledger_runs(folder)
    again = _run(COMMANDS[name].words, folder)
    if again.returncode != 0:
        problems.append(f"the next run ends with {again.returncode}: {again.stderr.strip()[-300:]}")
    problems += [f"left after the next run: {path.name}" for path in _hidden(folder)]
    after = ledger_runs(folder)
    repeated = [key for key, seconds in before.items() if after.get(key) != seconds]
    if repeated:
        problems.append(f"{len(repeated)} of {len(before)} recorded runs were lost or run again")
    if whole.runs and len(after) != whole.runs:
        problems.append(f"{len(after)} runs in the ledger, {whole.runs} undisturbed")
    found = contents(folder)
    other = sorted(key for key, value in whole.numbers.items() if found.get(key) != value)
    if other:
        problems.append(f"{len(other)} of {len(whole.numbers)} numbers are others, the first: {other[0]}")
    if not problems:
        shutil.rmtree(folder)
    return Trial(number, name, how, one.share, one.code, one.stopped, one.children, tuple(problems))


def _hidden(folder: Path) -> list[Path]:
    return [path for path in folder.rglob(".*") if path.name not in (".", "..")]


def table(record: dict[str, Any]) -> str:
    """The record as a table."""
    lines = [
        "| command | undisturbed [s] | killed, told to end | wrong | longest stop [s] | longest child [s] |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, row in record["commands"].items():
        told = sum(count for how, count in row["kills"].items() if how != "SIGKILL")
        lines.append(
            f"| {name} | {row['undisturbed [s]']} | {row['kills'].get('SIGKILL', 0)}, {told} |"
            f" {row['wrong']} | {row['longest stop [s]']} | {row['longest child [s]']} |"
        )
    return "\n".join([*lines, "", f"{record['kills']} trials, {len(record['problems'])} problems."])


def recorded(seed: int, trials: list[Trial], seconds: dict[str, float]) -> dict[str, Any]:
    """The record: by command the numbers of signals of each kind, the undisturbed duration [s], and the
    problems."""
    rows = {}
    for name, duration in seconds.items():
        own = [one for one in trials if one.command == name]
        rows[name] = {
            "undisturbed [s]": round(duration, 2),
            "kills": dict(Counter(one.how for one in own)),
            "wrong": sum(bool(one.problems) for one in own),
            "longest stop [s]": round(max((one.stopped for one in own), default=0.0), 2),
            "longest child [s]": round(max((one.children for one in own), default=0.0), 2),
        }
    return {"seed": seed, "kills": len(trials), "commands": rows,
            "problems": [f"{t.number} {t.command}: {p}" for t in trials for p in t.problems]}  # fmt: skip


def main() -> int:
    """Run the campaign; returns 1 if there was a problem."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2, help="trials side by side")
    parser.add_argument("--only", default="", metavar="WORD", help="commands whose name holds it")
    parser.add_argument("--out", type=Path, help="folder of the rows; one that is there is not done again")
    parser.add_argument("--collect", action="store_true", help="only record the rows that are there")
    parser.add_argument("--record", type=Path, default=RESULT)
    said = parser.parse_args()
    if said.collect:
        if said.out is None:
            parser.error("--collect needs --out FOLDER")
        return _written(said, *_collected(said.out, said.seed))
    # A shell that starts this in the background sets SIGINT to be ignored, which child processes would
    # inherit.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    rng = random.Random(said.seed)
    names = [name for name in COMMANDS if said.only in name]
    drawn = [
        (n, names[n % len(names)], rng.choices(list(SIGNALS), list(SIGNALS.values()))[0], rng.random())
        for n in range(said.kills)
    ]
    out = said.out or Path(tempfile.mkdtemp(prefix="kills-"))
    out.mkdir(parents=True, exist_ok=True)
    base = out / "work"  # the commands' inputs stay there: all rows have the same inputs
    for left in (*base.glob("trial-*"), *base.glob("*-undisturbed-*")):
        shutil.rmtree(left)
    with ThreadPoolExecutor(said.workers) as pool:
        wholes = dict(zip(names, pool.map(lambda name: _kept(name, base, out), names), strict=True))

        def one(row: tuple[int, str, str, float]) -> Trial:
            number, name, how, share = row
            kept = out / f"{said.seed}-{number:04d}.json"
            if kept.exists():
                return _row(kept)
            made = trial(number, name, how, share, base, wholes[name])
            kept.write_text(json.dumps(asdict(made)) + "\n")
            right = "; ".join(made.problems) or "right"
            print(f"{number:3} {name:22} {how:8} {made.share:4.0%} {right}", flush=True)
            return made

        trials = list(pool.map(one, drawn))
    result = _written(said, trials, {name: whole.seconds for name, whole in wholes.items()})
    if result == 0:
        shutil.rmtree(base, ignore_errors=True)
    return result


def _row(path: Path) -> Trial:
    there = json.loads(path.read_text())
    return Trial(**{**there, "problems": tuple(there["problems"])})


def _collected(out: Path, seed: int) -> tuple[list[Trial], dict[str, float]]:
    """The stored rows of a campaign, and the undisturbed durations [s]."""
    trials = [_row(path) for path in sorted(out.glob(f"{seed}-*.json"))]
    kept = {name: out / f"{name.replace(' ', '-')}.json" for name in COMMANDS}
    return trials, {n: json.loads(p.read_text())["seconds"] for n, p in kept.items() if p.exists()}


def _written(said: argparse.Namespace, trials: list[Trial], seconds: dict[str, float]) -> int:
    """Write and print the record; returns 1 if there was a problem."""
    record = recorded(said.seed, trials, seconds)
    said.record.write_text(json.dumps(record, indent=1) + "\n")
    print(table(record))
    return 1 if record["problems"] else 0


if __name__ == "__main__":
    sys.exit(main())
