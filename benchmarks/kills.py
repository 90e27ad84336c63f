"""Commands that are killed: `python -m benchmarks.kills [--kills 100] [--workers 2] [--seed 1]`.

Every trial starts a command in a folder of its own, ends it at a moment drawn over its duration (by SIGKILL,
SIGTERM or SIGINT), and starts the same command again. Counted are: files that cannot be read, hidden files
left, processes that go on, runs of a sweep that were lost or repeated, and numbers that differ from those
that two undisturbed runs have in common. With `--out FOLDER` each row is kept there, and a campaign goes on
where it stopped; the table is written to `benchmarks/results/kills.json`.
"""

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import psutil

from benchmarks.kill_contents import contents, ledger_runs, unreadable

ROOT = Path(__file__).resolve().parents[1]
RESULT = Path(__file__).parent / "results" / "kills.json"
SIGNALS = {"SIGKILL": 0.5, "SIGTERM": 0.25, "SIGINT": 0.25}
"""How a command is ended, with its share of the trials."""
CHILDREN = 1.0
"""Time within which the children of a killed command end [s]."""
STOPPED = 3.0
"""Time within which a command that is told to end has ended [s]."""
LONGEST = 1800.0
"""Time after which a command is given up [s]."""


@dataclass(frozen=True)
class Command:
    """A command that is killed."""

    words: tuple[str, ...]
    """What stands behind `kolsky`; FOLDER is its folder."""
    inputs: Callable[[Path], object]
    """Puts what it reads into its folder."""


@dataclass(frozen=True)
class Trial:
    """What became of one killed command."""

    number: int
    """Of the trial."""
    command: str
    """Which one."""
    how: str
    """The signal."""
    share: float
    """When it came, as a share of the undisturbed duration [-]."""
    code: int
    """Exit code of the killed command."""
    stopped: float
    """Time from the signal to the command's end [s]."""
    children: float
    """Time from the command's end to that of the last of its children [s]."""
    problems: tuple[str, ...]
    """What is wrong; nothing if all is as it should be."""


def _shot(folder: Path) -> None:
    shutil.copytree(ROOT / "runs" / "open-01", folder / "shot")


def _answered(folder: Path) -> None:
    _shot(folder)
    done = _run(("identify", *_TINY), folder)
    if done.returncode != 0:
        raise SystemExit(done.stderr)


def _pictures(folder: Path) -> None:
    import cv2
    import numpy as np

    speckles = cv2.GaussianBlur(np.random.default_rng(4).normal(128.0, 400.0, (160, 220)), (0, 0), 2.0)
    for number in range(24):
        moved = np.float32([[1, 0, 0.25 * number], [0, 1, -0.1 * number]])
        picture = cv2.warpAffine(
            speckles, moved, (220, 160), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
        )
        cv2.imwrite(str(folder / f"cam_{number:03d}.png"), np.clip(picture, 0, 255).astype(np.uint8))
    (folder / "dic.toml").write_text(
        '[dic]\nkind = "plane"\nscale = "0.1 mm"\n[pictures]\ncamera_0 = { pattern = "cam_*.png" }\n'
    )


def _bars(folder: Path) -> None:
    shutil.copytree(ROOT / "runs" / "bar-01", folder / "shot")


def _virtual(folder: Path) -> None:
    shutil.copy(ROOT / "runs" / "virtual" / "small.toml", folder)


def _specimen(folder: Path) -> None:
    text = (ROOT / "runs" / "specimen" / "silicone.toml").read_text()
    text = text.replace("elements = [40, 10, 2]", "elements = [20, 4, 2]")
    text = text.partition("[tests.biaxial]")[0]
    (folder / "strip.toml").write_text(text)
    shutil.copy(ROOT / "runs" / "specimen" / "uniaxial.csv", folder)


_TINY = ("FOLDER/shot", "--mesh", "8x11", "--free", "stiffness_factor", "--refined-mesh", "16x22",
         "--replicates", "2")  # fmt: skip
_SWEEP = ("sweep", "FOLDER/shot", "--design", "lhs", "--runs", "640", "--mesh", "16x22")
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
    """What a command does when nobody ends it."""

    seconds: float
    """How long it takes [s]."""
    numbers: dict[str, str]
    """Digests of what two runs of it have in common, by file and place."""
    runs: int
    """Runs in its ledger; 0 without one."""


def undisturbed(name: str, base: Path) -> Undisturbed:
    """Run a command twice and keep what does not depend on when it ran."""
    found, seconds, runs = [], [], 0
    for number in range(2):
        folder = base / f"{name.replace(' ', '-')}-undisturbed-{number}"
        folder.mkdir(parents=True)
        COMMANDS[name].inputs(folder)
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


def trial(number: int, name: str, how: str, share: float, base: Path, whole: Undisturbed) -> Trial:
    """Kill a command at a share of its duration, start it again, and look at what there is."""
    folder = base / f"trial-{number:03d}"
    folder.mkdir(parents=True)
    command = COMMANDS[name]
    command.inputs(folder)
    problems = []
    run = _start(command.words, folder)
    time.sleep(share * whole.seconds)
    children = [] if run.poll() is not None else psutil.Process(run.pid).children(recursive=True)
    signalled = time.monotonic()
    if run.poll() is None:
        run.send_signal(getattr(signal, how))
    _, said = run.communicate(timeout=LONGEST)
    ended = time.monotonic()
    _, alive = psutil.wait_procs(children, timeout=10.0)
    gone = time.monotonic() - ended if children else 0.0
    if alive or gone > CHILDREN:
        problems.append(f"{len(alive)} processes of {len(children)} went on for {gone:.1f} s")
    told = how != "SIGKILL"
    if told and ended - signalled > STOPPED:
        problems.append(f"ended {ended - signalled:.1f} s after {how}")
    expected = {"SIGKILL": (-9, 0), "SIGTERM": (143, 0, -15), "SIGINT": (130, 0, 1, -2)}[how]
    if run.returncode not in expected:
        problems.append(f"exit code {run.returncode} after {how}")
    if told and "Traceback" in said and run.returncode not in (-2, -15):
        problems.append(f"traceback after {how}: {said.strip().splitlines()[-1]}")
    if told and run.returncode not in (-2, -15):
        problems += [f"left after {how}: {path.name}" for path in _hidden(folder)]
    problems += [f"cannot be read after {how}: {what}" for what in unreadable(folder)]
    before = ledger_runs(folder)
    again = _run(command.words, folder)
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
    return Trial(number, name, how, share, run.returncode, ended - signalled, gone, tuple(problems))


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


def main() -> int:
    """Run the campaign; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2, help="trials side by side")
    parser.add_argument("--only", default="", metavar="WORD", help="commands whose name holds it")
    parser.add_argument("--out", type=Path, help="folder of the rows; one that is there is not done again")
    parser.add_argument("--record", type=Path, default=RESULT)
    said = parser.parse_args()
    rng = random.Random(said.seed)
    names = [name for name in COMMANDS if said.only in name]
    drawn = [
        (
            number,
            names[number % len(names)],
            rng.choices(list(SIGNALS), list(SIGNALS.values()))[0],
            rng.random(),
        )
        for number in range(said.kills)
    ]
    out = said.out or Path(tempfile.mkdtemp(prefix="kills-"))
    out.mkdir(parents=True, exist_ok=True)
    base = Path(tempfile.mkdtemp(prefix="kills-work-"))
    with ThreadPoolExecutor(said.workers) as pool:
        wholes = dict(zip(names, pool.map(lambda name: undisturbed(name, base), names), strict=True))

        def one(row: tuple[int, str, str, float]) -> Trial:
            number, name, how, share = row
            kept = out / f"{said.seed}-{number:04d}.json"
            if kept.exists():
                return Trial(
                    **{
                        **json.loads(kept.read_text()),
                        "problems": tuple(json.loads(kept.read_text())["problems"]),
                    }
                )
            made = trial(number, name, how, share, base, wholes[name])
            kept.write_text(json.dumps(asdict(made)) + "\n")
            print(
                f"{number:3} {name:22} {how:8} {share:4.0%} {'; '.join(made.problems) or 'right'}", flush=True
            )
            return made

        trials = list(pool.map(one, drawn))
    table = {
        name: {
            "undisturbed [s]": round(wholes[name].seconds, 2),
            "kills": dict(Counter(one.how for one in trials if one.command == name)),
            "wrong": sum(bool(one.problems) for one in trials if one.command == name),
            "longest stop [s]": round(max((t.stopped for t in trials if t.command == name), default=0.0), 2),
            "longest child [s]": round(
                max((t.children for t in trials if t.command == name), default=0.0), 2
            ),
        }
        for name in names
    }
    record = {"seed": said.seed, "kills": len(trials), "commands": table,
              "problems": [f"{t.command}: {p}" for t in trials for p in t.problems]}  # fmt: skip
    said.record.write_text(json.dumps(record, indent=1) + "\n")
    print(json.dumps(record, indent=1))
    shutil.rmtree(base, ignore_errors=True)
    return 1 if record["problems"] else 0


if __name__ == "__main__":
    sys.exit(main())
