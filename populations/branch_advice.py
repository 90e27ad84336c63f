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
from kolsky.material.relaxation.rate_fit import SIGNIFICANT
from kolsky.shot.load import load_shot
from kolsky.virtual.make import Place, make_places
from populations import driver
from populations.coverage import ANSWERS, Each
from populations.joint_coverage import Study, specified, truth

ADVICE = "--relaxation prony"
"""Text of a recommendation."""
TWINS = {"relaxing": False, "elastic": True}
"""Whether the material is elastic, by kind of shot."""
ROWS = (
    ("recommended to try a branch", "advised"),
    ("by the linear test", "by the linear test"),
    ("by the search for a strong branch", "by the search"),
    ("nothing said, and called identified", "called identified"),
    ("nothing said, no answer either", "withheld"),
    ("refused", "refused"),
)


def place_of(study: Study, folder: Path, kind: str, number: int) -> Place:
    """The shot of a draw: the first of its shots in `populations.joint_coverage`."""
    return specified(replace(study, elastic=TWINS[kind]), folder / kind, number)[0]


def answer(study: Study, folder: Path, kind: str, number: int) -> dict[str, Any]:
    """Identify a shot as elastic; returns the statements of the output on a branch."""
    started = time.perf_counter()
    asked = driver.settings(study, seed=study.seed + number)
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
    return driver.answers(answer, jobs, workers=workers, line=line)


def summary(each: Each) -> dict[str, Any]:
    """Numbers of shots of each kind by recommendation, and number of all shots."""
    kinds = {kind: _kind([one for one in each if one["kind"] == kind]) for kind in TWINS}
    return {"kinds": kinds, "each": list(each)}


def _kind(each: Each) -> dict[str, Any]:
    silent = [one for one in each if not one["advised"] and not one["error"]]
    linear = [one for one in each if one["advised"] and by_linear_test(one)]
    identified = sum(all(v in ANSWERS for v in one["verdicts"].values()) for one in silent)
    counts = {
        "advised": sum(one["advised"] for one in each),
        "by the linear test": len(linear),
        "by the search": sum(one["advised"] for one in each) - len(linear),
        "called identified": identified,
        "withheld": len(silent) - identified,
        "refused": sum(bool(one["error"]) for one in each),
    }
    return {"shots": len(each), **{name: driver.share(count, len(each)) for name, count in counts.items()}}


def by_linear_test(one: dict[str, Any]) -> bool:
    """Whether the linear test was sufficient for a shot. Then no branch was fitted."""
    return float(one["branch"].get("branch_probability", 1.0)) < SIGNIFICANT


def table(said: dict[str, Any]) -> str:
    """A study's `summary.json` as a Markdown table with one column for each kind of shot."""
    study = said["study"]
    shots = ", ".join(f"{said['kinds'][kind]['shots']} {kind}" for kind in TWINS)
    rows = ([words, *(driver.counted(said["kinds"][kind][key]) for kind in TWINS)] for words, key in ROWS)
    made = f"{shots} shots of seed {study['seed']} ({driver.on_meshes(study)})."
    return f"{made}\n\n{driver.markdown(['', *TWINS], rows)}"


def main() -> None:
    """Run or continue the study and write its summary."""
    parser = driver.command(__doc__, seed=1, table=table)
    driver.add_meshes(parser, truth=Study.truth_mesh)
    parser.add_argument("--draws", type=int, default=20, help="two shots each")
    parser.add_argument("--rows", type=driver.numbers, help="FIRST:STOP, a part of the draws")
    given = parser.parse_args()
    study = Study.of(given)
    driver.hold(study, given.out)
    started = time.perf_counter()
    each = run(study, given.out, given.rows or range(given.draws), given.workers)
    said = driver.about(study, given) | {"seconds": time.perf_counter() - started} | summary(each)
    print(table(said))
    driver.write(given.out / "summary.json", said, indent=1)


if __name__ == "__main__":
    main()
