"""One shot of the study of forty: it is identified and compared with its truth. A rejected shot is tried
again."""

import json
import os
import re
import shutil
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.base.process import WORKER
from kolsky.identification import identify
from kolsky.shot.load import load_shot
from kolsky.virtual.make import TRUTH
from populations.ablation import SWITCHES
from populations.driver import ShotStudy, settings, write
from populations.forty_cures import CURES, FINER_MESH, true_inputs

FINER = (32, 43)
"""Mesh of the search if the remedy is a finer mesh."""
RIGHT = 0.01
"""Largest relative error of an answer that counts as correct [-]."""
COVERED = 3.0
"""An answer is confidently wrong if its distance from the truth exceeds this number of standard uncertainties
[-]."""
KINDS = ("right", "answered, beyond 1 %", "refused", "confidently wrong", "stopped by a fault")


@dataclass(frozen=True, kw_only=True)
class Study(ShotStudy):
    """Settings of all shots."""

    spec: str
    out: str
    seed: int | None = None  # type: ignore[assignment]
    """Seed of the population; None: the specification's seed."""
    exports: bool = False
    truth_mesh: tuple[int, int] | None = None
    cures: bool = True
    true_inputs: bool = False
    """Whether the true length, diameter, density and sensitivity of a shot are declared."""
    off: str = "all"
    """Mechanism that is switched off, a name of `populations.ablation.OF_PICTURES`; "all": none."""
    cores: tuple[tuple[int, ...], ...] = ()
    """Cores of each worker; empty: all cores of the machine."""


@dataclass(frozen=True)
class Answer:
    """Result of one attempt at a shot; numbers are None without an answer."""

    name: str
    truth: float
    value: float | None
    sigma: float | None
    verdict: str
    """The verdict on m, "refused", or "fault"."""
    answered: bool
    """Whether m is reported as identified."""
    reason: str
    """Reason for a missing answer, or the warnings, one per line."""
    pictures: float
    """Time from the files to outline and flyer [s]."""
    seconds: float
    """Time from the files to m [s]."""
    cure: str = ""
    """Remedy that was applied; empty for the automatic attempt."""
    cured: list["Answer"] = field(default_factory=list)
    """Attempts with remedies for a rejected shot, until one gives an answer."""

    @property
    def error(self) -> float | None:
        """Relative error of m [-]."""
        return None if self.value is None else self.value / self.truth - 1.0

    @property
    def kind(self) -> str:
        """Category of the attempt."""
        if self.verdict == "fault":
            return "stopped by a fault"
        if not self.answered or self.value is None or self.sigma is None:
            return "refused"
        if abs(self.value - self.truth) > COVERED * self.sigma:
            return "confidently wrong"
        return "right" if abs(self.value / self.truth - 1.0) <= RIGHT else "answered, beyond 1 %"

    @property
    def end(self) -> "Answer":
        """The last attempt."""
        return self.cured[-1] if self.cured else self

    @classmethod
    def read(cls, path: Path) -> "Answer":
        """A stored answer."""
        content = json.loads(path.read_text("utf-8"))
        return cls(**{**content, "cured": [cls(**one) for one in content["cured"]]})


def one(study: Study, name: str) -> Answer:
    """Identify a synthetic shot and compare it with its truth. A stored answer is only read.

    The answer is stored when it is finished and after each remedy. An interrupted study therefore loses at
    most one attempt.
    """
    keep_to(study.cores)
    kept = Path(study.out) / f"{name}.json"
    folder = Path(study.out) / "shots" / name
    if study.true_inputs and not kept.exists():
        made, folder = folder, Path(study.out) / "true-inputs" / name
        cured_copy(made, folder, true_inputs)
    answer = Answer.read(kept) if kept.exists() else keep(attempt(study, name, folder), kept)
    if not study.cures or answer.kind != "refused" or answer.end.answered:
        return answer
    tried = {one.cure for one in answer.cured}
    for words in cures_for(answer):
        if words in tried:
            continue
        place, asked = folder, replace(study, mesh=FINER)
        if words in CURES:
            place, asked = Path(study.out) / "cured" / f"{name}-{re.sub('[^a-z]+', '-', words)}", study
            if not cured_copy(folder, place, CURES[words]):
                continue
        answer.cured.append(attempt(asked, name, place, words))
        keep(answer, kept)
        if answer.end.answered:
            break
    return answer


def cures_for(answer: Answer) -> list[str]:
    """Remedies for a rejected shot. If there is a value, a finer mesh is the first one."""
    return [FINER_MESH, *CURES] if answer.value is not None else list(CURES)


def available() -> list[int]:
    """Indices of the cores that this process may use."""
    if sys.platform == "linux":
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def shares(cores: Sequence[int], workers: int) -> tuple[tuple[int, ...], ...]:
    """Cores divided among workers in contiguous groups. With more workers than cores, several workers share a
    core.

    The correlation of pictures uses all cores that its process may use. Without this division each of eight
    workers on sixteen cores would start sixteen threads.
    """
    n = len(cores)
    if workers >= n:
        return tuple((cores[i % n],) for i in range(workers))
    ends = [i * n // workers for i in range(workers + 1)]
    return tuple(tuple(cores[low:high]) for low, high in pairwise(ends))


def keep_to(cores: tuple[tuple[int, ...], ...]) -> None:
    """Restrict this worker to its share of the cores, if the system supports this."""
    if cores and sys.platform == "linux":
        os.sched_setaffinity(0, cores[int(os.environ.get(WORKER, "0")) % len(cores)])


def keep(answer: Answer, place: Path) -> Answer:
    """Write an answer completely or not at all, and return it."""
    write(place, asdict(answer), indent=1)
    return answer


def attempt(study: Study, name: str, folder: Path, cure: str = "") -> Answer:
    """Identify m from the files of a folder as `kolsky identify` does."""
    truth = float(json.loads((folder / TRUTH).read_text("utf-8"))["m"])
    started, seen = time.perf_counter(), 0.0
    try:
        with SWITCHES[study.off].off():
            shot = load_shot(folder)
            seen = time.perf_counter() - started
            found = identify(shot, settings(study))
    except (InputError, ValueError, RuntimeError) as error:
        verdict = "refused" if said_on_purpose(error) else "fault"
        seconds = time.perf_counter() - started
        return Answer(name, truth, None, None, verdict, False, str(error), seen or seconds, seconds, cure)
    m = found.estimates["stiffness_factor"]
    seconds = time.perf_counter() - started
    said = "\n".join(found.warnings)
    return Answer(
        name, truth, m.value, m.sigma, str(m.outcome), m.outcome.identified, said, seen, seconds, cure
    )


def said_on_purpose(error: Exception) -> bool:
    """Whether an error comes from a `raise` statement, and not from a failure inside a computation."""
    if isinstance(error, InputError):
        return True
    lines = traceback.extract_tb(error.__traceback__)
    return bool(lines) and (lines[-1].line or "").lstrip().startswith("raise ")


def cured_copy(folder: Path, place: Path, cure: Callable[[str, Path], str | None]) -> bool:
    """Copy a shot with a changed shot.toml; False if the remedy does not apply."""
    text = cure((folder / "shot.toml").read_text("utf-8"), folder)
    if text is None:
        return False
    if place.exists():
        shutil.rmtree(place)
    shutil.copytree(folder, place, ignore=shutil.ignore_patterns("results"), copy_function=os.link)
    (place / "shot.toml").unlink()
    (place / "shot.toml").write_text(text, encoding="utf-8")
    return True
