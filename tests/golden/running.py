"""Run a case in a copy of its files and store its output."""

import glob
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

from tests.golden.canonical import Content, changes, content_of, masked_text
from tests.golden.cases import Case

LIMIT_S = 300.0  # wall time of one command [s]

LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")

SHARED = "shared/"


@dataclass(frozen=True)
class Places:
    """Where the program and its data are.

    ``shared``: folder of the large data, of cases whose inputs begin with `shared/`.
    """

    source: Path
    shared: Path

    def find(self, place: str) -> Path:
        """Return where an input lies."""
        return self.shared / place.removeprefix(SHARED) if place.startswith(SHARED) else self.source / place


def program(source: Path) -> list[str]:
    """Return the beginning of a command line that calls `kolsky`: the entry that pyproject.toml names."""
    named = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))
    module, name = named["project"]["scripts"]["kolsky"].split(":")
    call = f"import sys; from {module} import {name}; sys.argv[0] = 'kolsky'; sys.exit({name}())"
    return [sys.executable, "-c", call]


def environment(source: Path) -> dict[str, str]:
    """Return the variables of the commands: packages of `source` first, threads, no colours."""
    fixed = {
        "PYTHONPATH": str(source), "MPLBACKEND": "Agg", "COLUMNS": "160", "NO_COLOR": "1", "TERM": "dumb",
    }  # fmt: skip
    fixed |= {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1", "TZ": "UTC"}
    return {**os.environ, **fixed, **dict.fromkeys(LIBRARY_THREADS, "1")}


def imported(source: Path) -> Path:
    """Return the file of the package `kolsky` that the commands import."""
    call = [sys.executable, "-c", "import kolsky; print(kolsky.__file__)"]
    with tempfile.TemporaryDirectory() as folder:
        said = subprocess.run(
            call, cwd=folder, env=environment(source), capture_output=True, text=True, check=True, timeout=120
        )
    return Path(said.stdout.strip())


def run_case(case: Case, places: Places, kept: Path) -> float:
    """Run the commands of a case and keep their output and the files they wrote.

    ``case``: the case. ``places``: where program and inputs are. ``kept``: folder of the case's results; made
    anew. Returns: wall time [s].
    """
    shutil.rmtree(kept, ignore_errors=True)
    (kept / "files").mkdir(parents=True)
    with tempfile.TemporaryDirectory(prefix="golden_") as name:
        work = Path(name).resolve()
        for place in case.inputs:
            _copy(places.find(place), work / place)
        for place, text in case.before:
            (work / place).write_text(text, encoding="utf-8")
        before = {path: path.stat().st_mtime_ns for path in work.rglob("*") if path.is_file()}
        started = time.perf_counter()
        outputs = [_run(line, work, places.source) for line in case.commands]
        seconds = time.perf_counter() - started
        masks = {str(work): "<work>", str(places.source): "<source>", str(places.shared): "<shared>"}
        for i, one in enumerate(outputs):
            for stream in ("stdout", "stderr"):
                text = masked_text(str(one.pop(stream)), masks)
                (kept / f"{stream}_{i}.txt").write_text(text + "\n", encoding="utf-8")
        for path in sorted(work.rglob("*")):
            if path.is_file() and before.get(path) != path.stat().st_mtime_ns:
                target = kept / "files" / path.relative_to(work)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.move(path, target)
    facts = {"commands": outputs, "seconds": round(seconds, 1), "places": masks}
    (kept / "case.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return seconds


def compare_case(old: Path, new: Path) -> list[str]:
    """Return what differs between the kept results of a case and new ones, a line each."""
    said = []
    facts = [json.loads((folder / "case.json").read_text(encoding="utf-8")) for folder in (old, new)]
    codes = [[one["code"] for one in fact["commands"]] for fact in facts]
    if codes[0] != codes[1]:
        said.append(f"exit codes {codes[0]} became {codes[1]}")
    names = [{p.relative_to(folder) for p in folder.rglob("*") if p.is_file()} for folder in (old, new)]
    said += [f"{name}: is missing" for name in sorted(names[0] - names[1])]
    said += [f"{name}: is new" for name in sorted(names[1] - names[0])]
    for name in sorted(names[0] & names[1]):
        if name != Path("case.json"):
            contents: list[Content] = [
                content_of(folder / name, fact["places"])
                for folder, fact in zip((old, new), facts, strict=True)
            ]
            said += [f"{name}: {one.key}: {one.said}" for one in changes(*contents)]
    return said


def _copy(origin: Path, target: Path) -> None:
    """Copy a file or folder so that its copy can be changed; results of earlier runs stay behind."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if origin.is_file():
        shutil.copyfile(origin, target)
        return
    target.mkdir(exist_ok=True)
    for path in sorted(origin.iterdir()):
        if path.name not in {"results", "__pycache__"}:
            _copy(path, target / path.name)


def _run(line: str, work: Path, source: Path) -> dict[str, str | int]:
    """Run one command line; a word with a star is replaced by the files that it matches."""
    words: list[str] = []
    for word in shlex.split(line):
        found = sorted(glob.glob(word, root_dir=work)) if word.endswith("*") else []
        words += found or [word]
    first = {"kolsky": program(source), "python": [sys.executable]}[words[0]]
    try:
        done = subprocess.run(
            [*first, *words[1:]], cwd=work, env=environment(source), stdin=subprocess.DEVNULL,
            capture_output=True, text=True, timeout=LIMIT_S,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return {"line": line, "code": -1, "stdout": "", "stderr": f"ended after {LIMIT_S:.0f} s"}
    return {"line": line, "code": done.returncode, "stdout": done.stdout, "stderr": done.stderr}
