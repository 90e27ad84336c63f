"""Single viscoelastic shots and their elastic counterparts: `python -m populations.branch_advice --out
FOLDER`.

The study tests whether a branch is recommended for the viscoelastic shots only. Each draw of
`populations.joint_coverage` gives two shots at one speed: one of its material with the branch, one without
it. `kolsky.identification.identify` identifies both as elastic, with default settings. The study counts how
often the output recommends `--relaxation prony`. It stores the basis of the decision: the p-value of the
linear test, and the strength, time, share and criterion of the fitted branch.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kolsky.identification import identify
from kolsky.shot.load import load_shot
from kolsky.virtual.make import Place, make_places
from populations.branch_advice_counts import TWINS, summary, table
from populations.driver import about, add_meshes, answers, command, hold, numbers, settings, write
from populations.joint_coverage import Study, specified, truth

ADVICE = "--relaxation prony"
"""Text of a recommendation."""


def place_of(study: Study, folder: Path, kind: str, number: int) -> Place:
    """The shot of a draw: the first of its shots in `populations.joint_coverage`."""
    return specified(replace(study, elastic=TWINS[kind]), folder / kind, number)[0]


def answer(study: Study, folder: Path, kind: str, number: int) -> dict[str, Any]:
    """Identify a shot as elastic; returns the statements of the output on a branch."""
    started = time.perf_counter()
    asked = settings(study, 1 if study.device == "cpu" else None, seed=study.seed + number)
    shot, place = place_of(study, folder, kind, number)
    said: dict[str, Any] = {"number": number, "kind": kind, "truth": truth(study, number)}
    said["speed"] = shot.quantities.motion.speed
    try:
        found = identify(replace(load_shot(place / "shot.toml"), relaxation=None), asked)
        said |= {
            "advised": any(ADVICE in words for words in found.warnings),
            "verdicts": {name: e.outcome.value for name, e in found.estimates.items()},
            "values": {name: e.value for name, e in found.estimates.items()},
            "branch": {name: x for name, x in found.surrogate.items() if name.startswith("branch_")},
            "error": "",
        }
    except ValueError as error:
        said |= {"advised": False, "verdicts": {}, "values": {}, "branch": {}, "error": str(error)}
    said["seconds"] = time.perf_counter() - started
    return said


def line(one: dict[str, Any]) -> str:
    """One line of text for an answer."""
    outcome = one["error"] or ("advised" if one["advised"] else "no advice")
    return f"{one['kind']} {one['number']}: {outcome} {one['branch']}; {one['seconds']:.0f} s"


def run(study: Study, folder: Path, numbers: Sequence[int], workers: int) -> list[dict[str, Any]]:
    """Answers of all shots of both kinds. Stored answers are read from the folder."""
    jobs = {
        folder / f"{kind}-{number:03d}.json": (study, folder, kind, number)
        for kind in TWINS
        for number in numbers
    }
    places = [place_of(*job) for path, job in jobs.items() if not path.exists()]
    threads = 1 if study.truth_device == "cpu" else None
    make_places(places, device=study.truth_device, threads=threads, workers=workers)
    return answers(answer, jobs, workers=workers, line=line)


def main() -> None:
    """Run or continue the study and write its summary."""
    parser = command(__doc__, seed=1)
    add_meshes(parser, truth=Study.truth_mesh)
    parser.add_argument("--draws", type=int, default=20, help="two shots each")
    parser.add_argument("--rows", type=numbers, help="FIRST:STOP, a part of the draws")
    parser.add_argument("--truth-device", help="of the truths; that of the identifications if left out")
    given = parser.parse_args()
    study = Study(
        mesh=given.mesh,
        refined_mesh=given.refined_mesh,
        truth_mesh=given.truth_mesh,
        device=given.device,
        truth_device=given.truth_device or given.device,
        seed=given.seed,
    )
    hold(study, given.out)
    started = time.perf_counter()
    each = run(study, given.out, given.rows or range(given.draws), given.workers)
    said = about(study, given) | {"seconds": time.perf_counter() - started} | summary(each)
    print(table(said))
    write(given.out / "summary.json", said, indent=1)


if __name__ == "__main__":
    main()
