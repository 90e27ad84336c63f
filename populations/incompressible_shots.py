"""m of incompressible shots by another program: `python -m populations.incompressible_shots --out FOLDER`.

DOLFINx simulates experiments of `populations.coverage_problem` with nu = 0.49998, one of each group
(`populations.other_program`). The shot declares nu = 0.499 as a first guess. It is identified with default
options, with the incompressible limit as the model, and with nu held on its other side (`--ask`).
In all of them m and the damping are free. The study counts how often the k = 2 interval contains the true m,
and how much m depends on the held ratio. With `--drawn`, this package makes the truths, with the drawn ratios
of the population. They show how far the data reject the limit. The folder stores every answer and the
summary, so an interrupted study can be continued.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.apparatus import INCOMPRESSIBLE
from kolsky.identification import identify
from populations import coverage_problem as problem
from populations.driver import Study, add_meshes, answers, command, hold, numbers, settings, write
from populations.other_program import simulate_elsewhere

M = "stiffness_factor"
DECLARED = 0.499
"""Poisson's ratio in the shot, a first guess [-]."""
HELD = {"nothing": None, "incompressible": INCOMPRESSIBLE, "0.49999": 0.49999}
"""What is asked for -> the ratio that is held."""


@dataclass(frozen=True, kw_only=True)
class LimitStudy(Study):
    """Settings of this study."""

    drawn: bool = False
    """True for truths of this package with the drawn ratios."""


OWN_MESH = (36, 49)
"""Elements of this package's truths."""


def described(study: LimitStudy, number: int) -> tuple[problem.Setup, problem.Truth]:
    """Setup and truth of a shot: those of the first experiment of a group, with the limit's ratio or the
    drawn ratio."""
    setup, truth = problem.drawn(problem.GROUP * number, study.seed)
    return setup, truth if study.drawn else replace(truth, poisson=INCOMPRESSIBLE)


def make_truth(study: LimitStudy, number: int, place: Path, python: str) -> None:
    """Write the file of a shot's exact force and outline."""
    setup, truth = described(study, number)
    if not study.drawn:
        simulate_elsewhere(place, setup, truth, python)
        return
    runs = [
        problem.simulate(
            setup, [truth], mesh=OWN_MESH, device="cpu", element=element, grading=problem.TRUTH_GRADING
        )[0]
        for element in problem.TRUTH_ELEMENTS
    ]
    force, Z = problem.middle(runs[0], runs[1])
    np.savez_compressed(place, force=force, Z=Z)


def answer(study: LimitStudy, truth_file: Path, number: int, asked: str) -> dict[str, Any]:
    """Identify a shot with default options, or with a held Poisson's ratio."""
    setup, truth = described(study, number)
    with np.load(truth_file) as stored:
        exact = stored["force"], stored["Z"]
    rng = np.random.default_rng([study.seed, 1, number])
    shot = problem.experiment(number, setup, replace(truth, poisson=DECLARED), exact, problem.BONDED, rng)
    ratio = HELD[asked]
    held = {} if ratio is None else {"poisson": ratio}
    options = settings(study, held=held, seed=study.seed + number)
    found = identify(shot, options)
    free = {name: e.value for name, e in found.estimates.items()}
    return {
        "number": number,
        "asked": asked,
        "speed": truth.speed,
        "true": truth.stiffness_factor,
        "poisson": {**found.fixed, **free}["poisson"],
        "value": found.estimates[M].value,
        "sigma": found.estimates[M].sigma,
        "limit rise": found.surrogate.get("limit_rise"),
        "verdict": found.estimates[M].outcome.value,
        "of poisson": [
            f"{e.outcome.value}, ± {2.0 * e.sigma:.2g}"
            for e in found.estimates.values()
            if e.name == "poisson"
        ],
        "excess": {fit.channel: fit.excess for fit in found.fit},
        "warnings": list(found.warnings),
    }


def line(one: dict[str, Any]) -> str:
    """One row of the table for an answer."""
    error, U = 100.0 * (one["value"] / one["true"] - 1.0), 200.0 * one["sigma"] / one["true"]
    limit = [*one["of poisson"], *(words for words in one["warnings"] if words.startswith("nu is held at"))]
    rise = "" if one["limit rise"] is None else f"{one['limit rise']:.0f}"
    return (
        f"| {one['number']} | {one['speed']:.1f} | {one['asked']} | {rise} | {one['poisson']:.6g} | "
        f"{error:+.2f} ± {U:.2f} | {'yes' if abs(error) <= U else 'no'} | {one['verdict']} | "
        f"{'; '.join(limit)} |"
    )


def table(each: list[dict[str, Any]]) -> str:
    """The answers as a Markdown table with one row for each."""
    head = "| shot | m/s | asked for | rise at the limit | ν | m found minus true (%), k = 2 | inside "
    return "\n".join([head + "| verdict | said of ν |", "| --- " * 9 + "|", *map(line, each)])


def counts(each: list[dict[str, Any]]) -> dict[str, Any]:
    """Answers inside their intervals, and the largest change of m by another held ratio."""
    by = {(one["number"], one["asked"]): one for one in each}
    pairs = [(by[n, "nothing"], one) for (n, asked), one in by.items() if asked != "nothing"]
    return {
        "answers": len(each),
        "inside": sum(abs(one["value"] - one["true"]) <= 2.0 * one["sigma"] for one in each),
        "identified": sum(one["verdict"].startswith("identified") for one in each),
        "held at the limit": sum(
            one["poisson"] == INCOMPRESSIBLE for one in each if one["asked"] == "nothing"
        ),
        "largest change over sigma": max(
            (abs(one["value"] - first["value"]) / first["sigma"] for first, one in pairs), default=0.0
        ),
    }


def main() -> None:
    """Run or continue the study, print it and write its results."""
    parser = command(__doc__, seed=36187)
    add_meshes(parser)
    parser.add_argument("--shots", type=numbers, default=list(range(4)), help="FIRST:STOP")
    parser.add_argument("--ask", nargs="+", choices=HELD, default=list(HELD), help="what is asked for")
    parser.add_argument("--python", default="/usr/bin/python3", help="an interpreter that has DOLFINx 0.5")
    parser.add_argument("--drawn", action="store_true", help="truths of this package with the drawn ratios")
    parser.add_argument("--truths", action="store_true", help="make the truths, identify nothing")
    given = parser.parse_args()
    study = LimitStudy.of(given)
    hold(study, given.out)
    jobs: dict[Path, tuple[Any, ...]] = {}
    for number in given.shots:
        exact = given.out / f"truth-{number:02d}.npz"
        if not exact.exists():
            make_truth(study, number, exact, given.python)
            print(exact.stem, flush=True)
        jobs |= {given.out / f"{number:02d}-{a}.json": (study, exact, number, a) for a in given.ask}
    if given.truths:
        return
    each = answers(answer, jobs, workers=given.workers, line=line)
    print(table(each))
    print(counts(each))
    write(
        given.out / "summary.json", {"study": asdict(study), "counts": counts(each), "each": each}, indent=1
    )


if __name__ == "__main__":
    main()
