"""Forty random shots, from pictures and voltages to m: `python -m populations.forty --out FOLDER`.

Each shot of a population is made, identified automatically as by `kolsky identify`, and compared with its
truth. The result is answered and correct, rejected with a reason, or confidently wrong. The rejected shots
are tried again with the remedies of `populations.forty_cures.CURES`; these are counted separately. The folder
stores the shots, one file per answer, and the table of the finished shots. An interrupted study can therefore
be continued. With `--exports` the outline and the flyer come from tables instead of pictures. With
`--true-inputs` length, diameter, density and sensitivity are declared with their true values, in a separate
folder. The difference shows the effect of errors in the declared inputs.

`--workers` processes share the shots, the cores, and with `--device cuda` the GPUs.
"""

import json
import math
import statistics
import time
from collections.abc import Iterator
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import write_table
from kolsky.cli.texts import whole_numbers
from kolsky.virtual.make import TRUTH, make
from kolsky.virtual.specification import Series
from populations.ablation import OF_PICTURES
from populations.driver import add_meshes, command, mesh, population, results
from populations.driver import write as write_json
from populations.forty_shots import KINDS, RIGHT, Answer, Study, available, one, shares

SPEC = Path(__file__).parents[1] / "runs" / "virtual" / "forty.toml"
MAKING = "making.json"
"""File with the wall times for making shots, one for each call that made some."""


def series_of(study: Study) -> Series:
    """The population with the changes of the study."""
    written = {"cameras": {"write": not study.exports}, "exports": {"write": study.exports}}
    truth = {} if study.truth_mesh is None else {"truth": {"mesh": list(study.truth_mesh)}}
    return population(study.spec, seed=study.seed, **written, **truth)


def made(study: Study, numbers: list[int], workers: int) -> tuple[list[str], str]:
    """Make the missing shots. Returns the names of the existing shots, and the reason why others are
    missing."""
    series, place = series_of(study), Path(study.out) / "shots"
    started, why, fresh = time.perf_counter(), "", 0

    def count(shot: Any) -> None:
        nonlocal fresh
        fresh += shot.fresh
        print(f"{shot.name}  {'made' if shot.fresh else 'there already'}", flush=True)

    try:
        make(
            series,
            place,
            numbers=numbers,
            progress=count,
            device=study.device,
            threads=study.threads,
            workers=workers,
        )
    except InputError as error:
        why = str(error)
    if fresh:
        kept = Path(study.out) / MAKING
        before = json.loads(kept.read_text("utf-8")) if kept.exists() else []
        call = {"shots": fresh, "seconds": round(time.perf_counter() - started, 1)}
        write_json(kept, [*before, call])
    names = [series.shot(number).name for number in numbers]
    return [name for name in names if (place / name / TRUTH).exists()], why


def attempts(study: Study, names: list[str], workers: int) -> Iterator[list[Answer]]:
    """All answers so far, in order, after each finished answer: first of every shot, then with remedies."""
    found: dict[str, Answer] = {}
    for cures in (False, True) if study.cures else (False,):
        todo = names if not cures else [name for name in names if found[name].kind == "refused"]
        asked = replace(study, cures=cures)
        for answer in results(one, [(asked, name) for name in todo], workers):
            found[answer.name] = answer
            error = "" if answer.error is None else f"{100.0 * answer.error:+.3f} %"
            cure = f"  {answer.end.cure}: {answer.end.kind}" if answer.cured else ""
            print(f"{answer.name}  {answer.kind}  {error}  {answer.seconds:.0f} s{cure}", flush=True)
            yield [found[name] for name in sorted(found)]


def write(study: Study, answers: list[Answer], missing: str) -> dict[str, Any]:
    """Write the present table and forty.json. Returns the content of forty.json."""
    write_table(Path(study.out) / "forty.csv", table(answers))
    found = summary(study, answers, missing)
    write_json(Path(study.out) / "forty.json", found, indent=1)
    return found


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
        "time of the pictures (s)": [f"{a.pictures:.1f}" for a in answers],
        "time (s)": [f"{a.seconds:.1f}" for a in answers],
        "reason": [a.reason.splitlines()[0][:200] if a.reason else "" for a in answers],
        "cure": [a.end.cure for a in answers],
        "with the cure": [a.end.kind if a.cured else "" for a in answers],
    }


def summary(study: Study, answers: list[Answer], missing: str) -> dict[str, Any]:
    """Content of forty.json."""
    kinds = [answer.kind for answer in answers]
    refused = [answer for answer in answers if answer.kind == "refused"]
    kept = Path(study.out) / MAKING
    return {
        "seed": series_of(study).declared.seed,
        "shots": len(answers),
        **{kind: kinds.count(kind) for kind in KINDS},
        "share right": kinds.count("right") / len(answers) if answers else None,
        **spread(answers),
        "refused, right with a cure": sum(answer.end.kind == "right" for answer in refused),
        "median time": statistics.median(answer.seconds for answer in answers) if answers else None,
        "making": json.loads(kept.read_text("utf-8")) if kept.exists() else [],
        "not made": missing,
        "mesh": list(study.mesh),
        "refined mesh": list(study.refined_mesh),
        "from": "tables" if study.exports else "pictures",
        "answers": [{**asdict(answer), "kind": answer.kind} for answer in answers],
    }


def kept_answers(path: Path) -> list[Answer]:
    """The answers of a forty.json, without their remedies."""
    names = {field.name for field in fields(Answer)} - {"cured"}
    content = json.loads(path.read_text("utf-8"))["answers"]
    return [Answer(**{name: one[name] for name in names}) for one in content]


SPREAD = ("scatter", "largest", "inside k = 2", "median error", "mean uncertainty", "expected beyond 1 %")


def spread(answers: list[Answer]) -> dict[str, float | None]:
    """Statistics of the errors of the answered shots.

    For errors of m over their standard uncertainties: root mean square, largest, and number up to 2. Relative
    to the true m: median absolute error and mean standard uncertainty.
    """
    given = [(a.value, a.truth, a.sigma) for a in answers if a.answered and a.value is not None and a.sigma]
    if not given:
        return dict.fromkeys(SPREAD)
    z = [(value - truth) / sigma for value, truth, sigma in given]
    return {
        "scatter": statistics.fmean(one * one for one in z) ** 0.5,
        "largest": max(abs(one) for one in z),
        "inside k = 2": sum(abs(one) <= 2.0 for one in z),
        "median error": statistics.median(abs(value / truth - 1.0) for value, truth, _ in given),
        "mean uncertainty": statistics.fmean(sigma / truth for _, truth, sigma in given),
        "expected beyond 1 %": expected_beyond(answers),
    }


def expected_beyond(answers: list[Answer]) -> float:
    """Expected number of answered shots with an error above 1 % if their uncertainties are correct.

    Each shot contributes the probability 1 - erf(0.01 m / (sqrt 2 u)) of a normal error. The number shows how
    many answers beyond 1 % come from the tests' uncertainty without a fault of the program.
    """
    given = [a for a in answers if a.answered and a.sigma]
    return sum(math.erfc(RIGHT * abs(a.truth) / (2.0**0.5 * (a.sigma or 1.0))) for a in given)


def main() -> None:
    """Run the missing shots and print the table."""
    parser = command(__doc__, out=False)
    add_meshes(parser)
    place = parser.add_mutually_exclusive_group(required=True)
    place.add_argument("--out", help="folder of the shots and answers; a study that it holds is continued")
    place.add_argument("--of", help="print the spread of a forty.json, and do nothing else")
    parser.add_argument("--spec", default=str(SPEC))
    parser.add_argument("--only", default="", help="numbers and ranges, e.g. 1-8,12")
    parser.add_argument("--seed", type=int, default=None, help="of the population, instead of its own")
    parser.add_argument("--exports", action="store_true", help="tables instead of pictures")
    parser.add_argument(
        "--true-inputs", action="store_true", help="declare the inputs that a laboratory measures as they are"
    )
    parser.add_argument("--no-cures", action="store_true", help="leave refused shots alone")
    parser.add_argument(
        "--off", choices=("all", *OF_PICTURES), default="all", help="mechanism that is switched off"
    )
    parser.add_argument("--truth-mesh", type=mesh, metavar="96x129")
    parser.add_argument("--threads", type=int, default=None)
    given = parser.parse_args()
    if given.of:
        print(json.dumps(spread(kept_answers(Path(given.of)))))
        return
    study = Study.of(
        given,
        threads=given.threads or (1 if given.workers > 1 else None),
        cures=not given.no_cures and not given.true_inputs,
        cores=shares(available(), given.workers) if given.workers > 1 else (),
    )
    Path(given.out).mkdir(parents=True, exist_ok=True)
    numbers = whole_numbers("--only", given.only) if given.only else list(series_of(study).numbers)
    names, missing = made(study, numbers, given.workers)
    if missing:
        print(missing, flush=True)
    found = write(study, [], missing)
    for answers in attempts(study, names, given.workers):
        found = write(study, answers, missing)
    print(json.dumps({key: value for key, value in found.items() if key not in ("answers", "making")}))


if __name__ == "__main__":
    main()
