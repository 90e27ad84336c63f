"""Plant one fault at a time in a copy of the sources and run the tests there."""

import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from enum import StrEnum
from multiprocessing import get_context
from multiprocessing.util import Finalize
from pathlib import Path

from tests.mutants.fault import Fault
from tests.mutants.sources import ROOT, sources

PRELOADED = (
    "numpy", "scipy.optimize", "scipy.stats", "h5py", "warp", "cv2", "pydantic", "pint", "typer", "pytest",
)  # fmt: skip
"""Libraries that are imported once, before the processes of the trials part; none of them is mutated."""


class Fate(StrEnum):
    """What became of a fault."""

    KILLED = "killed"
    SURVIVED = "survived"
    BROKEN = "tests fail without it"


@contextlib.contextmanager
def copied_sources() -> Iterator[Path]:
    """A copy of the tracked and new files, where faults can be planted; `shared` lies beside it as here."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if listed.returncode == 0:
        names = [name for name in listed.stdout.split("\0") if name]
    else:  # an unpacked archive, without git
        names = [
            str(path.relative_to(ROOT))
            for path in ROOT.rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        ]
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        copy = Path(scratch) / ROOT.name
        for name in names:
            if (ROOT / name).is_file():
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / name, copy / name)
        if (ROOT.parent / "shared").is_dir():
            (Path(scratch) / "shared").symlink_to(ROOT.parent / "shared")
        yield copy


def tests_fail(copy: Path, tests: Sequence[str]) -> bool:
    """Run tests in a process of their own, on the sources of the copy; True if one of them fails."""
    sys.stdout.flush()
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            os._exit(_run(copy, tests))
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said.seek(0)
        text = said.read().decode(errors="replace")
    if code not in (0, 1):
        raise RuntimeError(f"pytest ended with {code} on {', '.join(tests)}:\n{text[-3000:]}")
    return code == 1


def _run(copy: Path, tests: Sequence[str]) -> int:
    import pytest

    os.chdir(copy)
    sys.path[:] = [str(copy), *(p for p in sys.path if Path(p or ".").resolve() != ROOT)]
    sys.dont_write_bytecode = True  # a file changed twice within a second would be taken for unchanged
    os.environ["PYTHONPATH"] = str(copy)
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    for name in [n for n in sys.modules if n.split(".")[0] == "tests"]:
        del sys.modules[name]
    return int(pytest.main(["-x", "-q", "--no-header", "-p", "no:cacheprovider", *tests]))


def preload() -> None:
    """Import the libraries that every trial needs."""
    for name in PRELOADED:
        with contextlib.suppress(ImportError), contextlib.redirect_stdout(io.StringIO()):
            __import__(name)


def trials(faults: Sequence[Fault], *, processes: int = 1) -> Iterator[tuple[Fault, Fate]]:
    """Plant every fault and say what became of it.

    The tests of all faults are run once on sources without any: what fails there kills nothing.

    ``faults``: what to plant. ``processes``: copies of the sources that are tried side by side, each with the
    faults of some tests. Raises ValueError if a fault fits no place in the sources, or several. Raises
    RuntimeError if pytest cannot run a test that is named.
    """
    groups: dict[tuple[str, ...], list[Fault]] = {}
    for fault in faults:
        groups.setdefault(fault.tests, []).append(fault)
    if processes == 1:
        preload()
        with copied_sources() as copy:
            for group in groups.values():
                yield from tried(copy, group)
        return
    # What takes longest is begun first: the tests with the most faults.
    longest = sorted(groups.values(), key=len, reverse=True)
    with get_context("spawn").Pool(processes, initializer=_own_copy) as pool:
        for found in pool.imap_unordered(_tried_here, longest):
            yield from found
        pool.close()
        pool.join()


def tried(copy: Path, faults: Sequence[Fault]) -> Iterator[tuple[Fault, Fate]]:
    """Plant faults that have the same tests in a copy of the sources, one after the other."""
    sound = not tests_fail(copy, faults[0].tests)
    for fault in faults:
        if not sound:
            yield fault, Fate.BROKEN
            continue
        place = sources(copy).place(fault)
        path = copy / place.module.file
        path.write_text(place.planted(fault), "utf-8")
        try:
            killed = tests_fail(copy, fault.tests)
        finally:
            path.write_text(place.module.source, "utf-8")
        yield fault, Fate.KILLED if killed else Fate.SURVIVED


COPIES: list[Path] = []  # the copy of the sources of a process that shares the trials


def _own_copy() -> None:
    kept = contextlib.ExitStack()
    COPIES.append(kept.enter_context(copied_sources()))
    Finalize(None, kept.close, exitpriority=1)  # at the end of a process of a pool
    preload()


def _tried_here(faults: Sequence[Fault]) -> list[tuple[Fault, Fate]]:
    return list(tried(COPIES[0], faults))
