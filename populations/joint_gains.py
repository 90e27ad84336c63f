"""Sets of three shots, one with a wrong sensitivity: `python -m populations.joint_gains --out FOLDER`.

The virtual laboratory makes three elastic shots of each draw (`populations.joint_coverage`). `identify_shots`
identifies them as they are, with the force of one shot 10 % too large, 10 % too small, and too large by the
error that the answer of the correct shots states as noticeable. The study counts how often correct shots are
withheld, how often a wrong sensitivity is noticed, and how often its shot is named. The folder stores every
answer, so an interrupted study can be continued.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.inverse.joint_result import JointResult
from kolsky.inverse.settings import JointSettings
from kolsky.joint_identification import identify_shots
from kolsky.shot.load import load_shot
from populations.driver import add_meshes, answers, command, hold, markdown, numbers, settings, write
from populations.joint_coverage import SHOTS, make_truths
from populations.joint_coverage import Study as Draws

ERRORS = {"correct": 0.0, "more": 0.1, "less": -0.1}
"""Case -> relative error of one shot's sensitivity [-]."""
NOTICEABLE = "noticeable"
"""The case with the error that is stated as noticeable."""


@dataclass(frozen=True, kw_only=True)
class Study(Draws):
    """Settings of a study: those of the draws, and the error."""

    elastic: bool = True
    slow: bool = False


def answer(study: Study, folder: Path, number: int) -> list[dict[str, Any]]:
    """Identify a draw's shots in all cases."""
    rows = [identified(study, folder, number, case, error) for case, error in ERRORS.items()]
    correct = rows[0]["found"]
    stated = correct and correct["agreement"]["noticeable"][number % SHOTS]
    if stated and stated < 1.0:
        rows.append(identified(study, folder, number, NOTICEABLE, stated))
    return rows


def identified(study: Study, folder: Path, number: int, case: str, error: float) -> dict[str, Any]:
    """Identify a draw's shots together, the force of one of them in error."""
    places = sorted((folder / f"draw-{number:03d}" / "shots").glob("*/shot.toml"))
    shots = [replace(load_shot(one), name=str(k)) for k, one in enumerate(places)]
    wrong = number % SHOTS
    force: Any = shots[wrong].force
    declared = replace(force.transducer, sensitivity=force.transducer.sensitivity / (1.0 + error))
    shots[wrong] = replace(shots[wrong], force=replace(force, transducer=declared))
    asked = settings(study, JointSettings, seed=study.seed + number)
    said: dict[str, Any] = {"number": number, "case": case, "wrong": str(wrong), "error": error}
    try:
        return said | {"found": short(identify_shots(shots, asked)), "lost": ""}
    except ValueError as lost:
        return said | {"found": None, "lost": str(lost)}


def short(found: JointResult) -> dict[str, Any]:
    """The verdict and the agreement of the shots."""
    return {
        "verdict": found.verdict,
        "agreement": None if found.agreement is None else asdict(found.agreement),
        "own": [None if one.own is None else asdict(one.own) for one in found.shots],
    }


def counts(each: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """For each case: answers, withheld answers, and answers that name the shot."""
    cases = {}
    for case in (*ERRORS, NOTICEABLE):
        rows = [one for one in each if one["case"] == case and one["found"] is not None]
        if rows:
            withheld = sum(one["found"]["verdict"] != "explained" for one in rows)
            cases[case] = {
                "answers": len(rows),
                "withheld": withheld,
                "shot named": sum(one["found"]["agreement"]["shots"] == [one["wrong"]] for one in rows),
                "error, median": float(np.median([abs(one["error"]) for one in rows])),
            }
    return cases


def line(rows: list[dict[str, Any]]) -> str:
    """One line of text for a draw."""
    said = [f"{100.0 * one['error']:+.1f} %: {one['lost'] or one['found']['verdict']}" for one in rows]
    return f"draw {rows[0]['number']}, shot {rows[0]['wrong']}: {'; '.join(said)}"


def table(recorded: dict[str, Any]) -> str:
    """The counts as a Markdown table with one row for each case."""
    heads = ("sensitivity of one shot", "sets", "error, median", "withheld", "its shot named")
    rows = []
    for case, row in recorded["counts"].items():
        named = "" if case == "correct" else row["shot named"]
        rows.append((case, row["answers"], f"{100.0 * row['error, median']:.2g} %", row["withheld"], named))
    return markdown(heads, rows)


def main() -> None:
    """Run or continue a study, print it and write its summary."""
    parser = command(__doc__, seed=1, table=table)
    add_meshes(parser, truth=Draws.truth_mesh)
    parser.add_argument("--draws", type=numbers, default=list(range(20)), help="FIRST:STOP")
    given = parser.parse_args()
    study = Study.of(given)
    hold(study, given.out)
    jobs = {given.out / f"{n:03d}.json": (study, given.out, n) for n in given.draws}
    make_truths(study, given.out, [job[-1] for path, job in jobs.items() if not path.exists()], given.workers)
    each = [one for rows in answers(answer, jobs, workers=given.workers, line=line) for one in rows]
    said = {"study": asdict(study), "counts": counts(each), "each": each}
    print(table(said))
    write(given.out / "summary.json", said, indent=1)


if __name__ == "__main__":
    main()
