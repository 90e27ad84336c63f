"""Forty drawn shots, from pictures and volts only to m: `python -m benchmarks.forty --out FOLDER`.

Each shot of a population is made, identified unattended as `kolsky identify` does it, and set beside its
truth: answered and right, refused with a reason, or confidently wrong. The folder keeps an answer a file:
called again, the study goes on where it stopped. With `--exports` the outline and the flyer come from tables
instead of pictures.
"""

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import write_table
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.settings import Settings
from kolsky.shot.load import load_shot
from kolsky.virtual.make import TRUTH, make
from kolsky.virtual.specification import Series, SpecificationFile, read_specification

SPEC = Path(__file__).parents[1] / "runs" / "virtual" / "forty.toml"
RIGHT = 0.01
"""Largest relative error of an answer that counts as right [-]."""
KINDS = ("right", "answered, beyond 1 %", "refused", "confidently wrong")
COVERED = 3.0
"""An answer further from the truth than so many of its standard uncertainties is confidently wrong."""


@dataclass(frozen=True)
class Study:
    """What is asked of every shot."""

    spec: str
    out: str
    exports: bool = False
    mesh: tuple[int, int] = (24, 32)
    refined_mesh: tuple[int, int] = (64, 86)
    truth_mesh: tuple[int, int] | None = None
    device: str = "cpu"
    threads: int | None = None


@dataclass(frozen=True)
class Answer:
    """One shot and what came of it; numbers are None where there is no answer."""

    name: str
    truth: float
    value: float | None
    sigma: float | None
    verdict: str
    """The verdict on m, or "refused"."""
    answered: bool
    """Whether m is given as identified."""
    reason: str
    """Why there is no answer, or the warnings, one a line."""
    making: float
    """Time to make the shot [s]."""
    seconds: float
    """Time from pictures and volts to m [s]."""

    @property
    def error(self) -> float | None:
        """Relative error of m [-]."""
        return None if self.value is None else self.value / self.truth - 1.0

    @property
    def kind(self) -> str:
        """What the shot counts as."""
        if not self.answered or self.value is None or self.sigma is None:
            return "refused"
        if abs(self.value - self.truth) > COVERED * self.sigma:
            return "confidently wrong"
        return "right" if abs(self.value / self.truth - 1.0) <= RIGHT else "answered, beyond 1 %"


def series_of(study: Study) -> Series:
    """The population, with what the study changes of it."""
    series = read_specification(study.spec)
    content = dict(series.file.content)
    if study.truth_mesh is not None:
        content["truth"] = {**content.get("truth", {}), "mesh": list(study.truth_mesh)}
    content["cameras"] = {**content.get("cameras", {}), "write": not study.exports}
    content["exports"] = {**content.get("exports", {}), "write": study.exports}
    file = replace(series.file, content=content)
    return Series(file, file.validated(SpecificationFile))


def one(study: Study, number: int) -> Answer:
    """Make a shot, identify it, and set it beside its truth; found again if it is there."""
    series = series_of(study)
    shot = series.shot(number)
    kept = Path(study.out) / f"{shot.name}.json"
    if kept.exists():
        return Answer(**json.loads(kept.read_text("utf-8")))
    started = time.perf_counter()
    folders = Path(study.out) / "shots"
    folder = make(series, folders, numbers=[number], device=study.device, threads=study.threads)[0].folder
    made = time.perf_counter()
    answer = _answered(study, shot.name, folder, made - started)
    kept.write_text(json.dumps(asdict(answer), indent=1), encoding="utf-8")
    return answer


def _answered(study: Study, name: str, folder: Path, making: float) -> Answer:
    truth = float(json.loads((folder / TRUTH).read_text("utf-8"))["m"])
    started = time.perf_counter()
    numerics = Numerics(mesh=study.mesh, device=study.device, threads=study.threads)
    try:
        found = identify(load_shot(folder), Settings(numerics=numerics, refined_mesh=study.refined_mesh))
    except (InputError, ValueError, RuntimeError) as error:
        seconds = time.perf_counter() - started
        return Answer(name, truth, None, None, "refused", False, str(error), making, seconds)
    m = found.estimates["stiffness_factor"]
    seconds = time.perf_counter() - started
    said = "\n".join(found.warnings)
    return Answer(name, truth, m.value, m.sigma, str(m.outcome), m.outcome.identified, said, making, seconds)


def table(answers: list[Answer]) -> dict[str, list[Any]]:
    """The answers as named columns."""
    return {
        "shot": [a.name for a in answers],
        "true m (1)": [a.truth for a in answers],
        "m (1)": ["" if a.value is None else f"{a.value:.5f}" for a in answers],
        "U (1)": ["" if a.sigma is None else f"{2.0 * a.sigma:.5f}" for a in answers],
        "error (%)": ["" if a.error is None else f"{100.0 * a.error:.3f}" for a in answers],
        "verdict": [a.verdict for a in answers],
        "counts as": [a.kind for a in answers],
        "time (s)": [f"{a.seconds:.1f}" for a in answers],
        "reason": [a.reason.splitlines()[0][:200] if a.reason else "" for a in answers],
    }


def main() -> None:
    """Run what is not there yet, and print the table."""
    parser = argparse.ArgumentParser(description="From pictures and volts only to m, on a drawn population.")
    parser.add_argument("--spec", default=str(SPEC))
    parser.add_argument("--out", required=True)
    parser.add_argument("--only", default="", help="numbers and ranges, e.g. 1-8,12")
    parser.add_argument("--exports", action="store_true", help="tables instead of pictures")
    parser.add_argument("--mesh", default="24x32")
    parser.add_argument("--refined-mesh", default="64x86")
    parser.add_argument("--truth-mesh", default="")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--threads", type=int, default=None)
    given = parser.parse_args()
    from kolsky.cli import texts

    study = Study(
        spec=given.spec,
        out=given.out,
        exports=given.exports,
        mesh=texts.mesh("--mesh", given.mesh),
        refined_mesh=texts.mesh("--refined-mesh", given.refined_mesh),
        truth_mesh=texts.mesh("--truth-mesh", given.truth_mesh) if given.truth_mesh else None,
        device=given.device,
        threads=given.threads or (1 if given.workers > 1 else None),
    )
    Path(given.out).mkdir(parents=True, exist_ok=True)
    numbers = texts.whole_numbers("--only", given.only) if given.only else list(series_of(study).numbers)
    answers: list[Answer] = []

    def keep(answer: Answer) -> None:
        answers.append(answer)
        error = "" if answer.error is None else f"{100.0 * answer.error:+.3f} %"
        print(f"{answer.name}  {answer.kind}  {error}  {answer.verdict}  {answer.seconds:.0f} s", flush=True)

    if given.workers == 1:
        for number in numbers:
            keep(one(study, number))
    else:
        with ProcessPoolExecutor(given.workers, mp_context=get_context("spawn")) as pool:
            for future in as_completed([pool.submit(one, study, number) for number in numbers]):
                keep(future.result())
    answers.sort(key=lambda answer: answer.name)
    write_table(Path(given.out) / "forty.csv", table(answers))
    kinds = [answer.kind for answer in answers]
    counts = {
        kind: kinds.count(kind) for kind in ("right", "answered, beyond 1 %", "refused", "confidently wrong")
    }
    summary = {"shots": len(answers), **counts, "answers": [asdict(answer) for answer in answers]}
    (Path(given.out) / "forty.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    print(json.dumps({"shots": len(answers), **counts}))


if __name__ == "__main__":
    main()
