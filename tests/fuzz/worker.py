"""Damaged files are read in a separate process, which may end, hang or grow."""

import contextlib
import io
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from tests.fuzz.cases import Case, make
from tests.fuzz.hostile import Trap, harm, spoil
from tests.fuzz.judge import LARGEST, LONGEST, REFUSALS, Answer, Verdict, of_content, of_refusal
from tests.fuzz.targets import all_targets

PATIENCE = 60.0
"""Time after which a process that says nothing is ended [s]; its case is slow, however long it would take."""
STARTING = 300.0  # time that a process has to import everything [s]
MOST_MEMORY = 6_000_000_000
"""Address space of a process, where the system can limit it [bytes]: a flood must not stop the machine."""


def memory() -> float:
    """Largest resident memory since `forget` [bytes]; 0 where the system does not tell."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return 1024.0 * float(line.split()[1])
    return 0.0


def forget() -> None:
    """Count the largest resident memory anew."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def answered(name: str, read: Callable[[], Any], path: Path, judge: Callable[[Any], str]) -> Answer:
    """Read a file and judge the answer.

    ``judge``: what is silently wrong with a content; empty if nothing.
    """
    forget()
    before, started = memory(), time.process_time()  # other work on the machine does not count
    content: Any = None
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            content = read()
        verdict, said = Verdict.ACCEPTED, ""
    except REFUSALS as error:
        verdict, said = of_refusal(error, path)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-3:]
        places = " < ".join(f"{Path(p.filename).name}:{p.lineno}" for p in reversed(last))
        verdict, said = Verdict.TRACEBACK, f"{type(error).__name__}: {str(error)[:200]!r} at {places}"
    seconds, grown = time.process_time() - started, memory() - before
    if verdict is Verdict.ACCEPTED and (wrong := judge(content)):
        verdict, said = Verdict.WRONG, wrong
    if seconds > LONGEST:
        verdict = Verdict.SLOW
    elif grown > LARGEST and verdict is not Verdict.ACCEPTED:
        verdict = Verdict.LARGE
    return Answer(name, verdict, said, seconds, grown)


def serve(there: Connection) -> None:
    """Answer the cases and traps that come until there are none."""
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    targets, sound = all_targets(), {}
    with tempfile.TemporaryDirectory() as base:
        there.send(None)
        while (case := there.recv()) is not None:
            target = targets[case.target]
            if isinstance(case, Trap):
                with tempfile.TemporaryDirectory(dir=base) as place:
                    spoilt = spoil(case, target, Path(place))
                    judge = partial(harm, case, target)
                    there.send(answered(str(case), partial(target.read, spoilt), spoilt, judge))
                continue
            if case.target not in sound:
                folder = Path(base) / f"sound-{len(sound)}"
                folder.mkdir()
                path = target.write(folder)
                sound[case.target] = (path, target.read(path))
            path, content = sound[case.target]
            with tempfile.TemporaryDirectory(dir=base) as place:
                damaged = make(case, target, path, Path(place) / "damaged")
                judge = partial(
                    of_content, sound=content, cut=case.kind == "cut", told_length=target.told_length,
                    told_values=target.told_values,
                )  # fmt: skip
                there.send(answered(str(case), partial(target.read, damaged), damaged, judge))


class Reader:
    """A process that reads, replaced when it ends or says nothing."""

    def __init__(self, serving: Callable[[Connection], None]) -> None:
        self.serving = serving
        self._start()

    def _start(self) -> None:
        context = get_context("spawn")
        self.here, there = context.Pipe()
        self.process = context.Process(target=self.serving, args=(there,), daemon=True)
        self.process.start()
        there.close()
        self.case: object = None
        self.since = time.monotonic() + STARTING

    def give(self, case: object) -> None:
        """Have a case answered, or with None end."""
        self.case, self.since = case, time.monotonic()
        self.here.send(case)

    def ended(self, how: Verdict, said: str) -> Answer:
        """The answer for a process that gave none; another takes its place."""
        self.process.kill()
        self.process.join()
        self.here.close()
        lost = self.case
        if lost is None:
            raise RuntimeError(f"the reading process ended before its first case: {said}")
        self._start()
        return Answer(str(lost), how, said, time.monotonic() - self.since, 0.0)


def answers(
    cases: Sequence[Case | Trap], *, workers: int = 2, serving: Callable[[Connection], None] = serve
) -> Iterator[Answer]:
    """The answers to some cases, as they come.

    ``cases``: what the processes are given. ``workers``: number of processes. ``serving``: what they do.
    """
    waiting = list(reversed(cases))
    readers = [Reader(serving) for _ in range(min(workers, max(1, len(cases))))]
    busy = list(readers)
    try:
        while busy:
            ready = wait([reader.here for reader in busy], timeout=1.0)
            for reader in list(busy):
                answer = None
                if reader.here in ready:
                    try:
                        answer = reader.here.recv()
                    except EOFError:
                        reader.process.join()
                        answer = reader.ended(Verdict.DIED, f"exit code {reader.process.exitcode}")
                elif time.monotonic() - reader.since > PATIENCE:
                    answer = reader.ended(Verdict.SLOW, f"nothing after {PATIENCE:g} s")
                else:
                    continue
                if answer is not None:
                    yield answer
                    if answer.verdict in (Verdict.DIED, Verdict.SLOW) and reader.case is None:
                        continue  # the new process says first that it is there
                if waiting:
                    reader.give(waiting.pop())
                else:
                    reader.here.send(None)
                    busy.remove(reader)
    finally:
        for reader in readers:
            reader.process.join(timeout=5.0)
            reader.process.kill()


if __name__ == "__main__":
    sys.exit("run python -m tests.fuzz")
