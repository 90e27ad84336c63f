"""The study of wrong inputs: correct shots of the virtual laboratory, identified with one wrong input per
row.

    python -m populations.wrong_inputs --out FOLDER [--population SPEC.toml] [--seed N] [--device cuda]
        [--workers N] [--shots N] [--right N] [--rows WORD,...] [--pairs] [--table FILE.json] [--truth felupe]

Every identification is one file in FOLDER/jobs; existing files are not recomputed. The page
docs/validation/wrong_inputs.md is made from the table that --table writes. With `--truth felupe` another
program simulates the truths (`populations.felupe_impact`). Everything else of the shots is the same.
"""

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.virtual.make import make, place_of, write_shot
from kolsky.virtual.specification import Series, ShotSpecification
from kolsky.virtual.truth import TruthError
from populations.driver import answers, command, mesh, population, results, write
from populations.wrong_input_rows import BY_NAME, CURVE, MODEL, PAIRS, RIGHT, ROWS, Row

POPULATION = Path(__file__).with_suffix(".toml")
CAUSE = ("key", "value", "sigma", "explained", "evidence", "probability", "named", "within", "alike")
"""Stored fields of a cause."""


@dataclass(frozen=True)
class Job:
    """One identification."""

    row: str
    """Name of its row."""
    shot: Path
    """Folder of the correct shot."""
    device: str
    """Device of the solver."""
    threads: int | None
    """Number of threads of the solver."""
    meshes: tuple[tuple[int, int], tuple[int, int]] | None
    """Meshes of the surrogate and of the answer; None: the defaults."""

    def file(self, out: Path) -> Path:
        """File of its result."""
        word = "".join(c if c.isalnum() else "-" for c in self.row)
        return out / "jobs" / f"{self.shot.name}_{word}.json"


def run(job: Job) -> dict[str, Any]:
    """Identify one shot with its wrong input; returns the result and the messages of the package."""
    from kolsky.identification import identify
    from kolsky.inverse.settings import Numerics, Settings

    row = BY_NAME[job.row]
    truth = json.loads((job.shot / "truth.json").read_text("utf-8"))
    said: dict[str, Any] = {"row": row.name, "shot": job.shot.name, "truth": truth["m"]}
    started = time.perf_counter()
    numerics = Numerics(device=job.device, threads=job.threads)
    settings = Settings(free=None if row.free else dict.fromkeys(MODEL), numerics=numerics)
    if job.meshes is not None:
        coarse, fine = job.meshes
        settings = replace(settings, numerics=numerics.with_mesh(coarse), refined_mesh=fine)
    try:
        found = identify(row.wrong(job.shot), settings)
    except (InputError, ValueError) as error:
        return {**said, "refused": str(error), "seconds": time.perf_counter() - started}
    m = found.estimates["stiffness_factor"]
    return {
        **said,
        "refused": "",
        "value": m.value,
        "sigma": m.sigma,
        "outcome": m.outcome.value,
        "identified": m.outcome.identified,
        "causes": [
            {key: getattr(c, key) for key in CAUSE} | {"m": c.parameters.get("stiffness_factor")}
            for c in found.causes
        ],
        "curve_visible": next((p.visible for p in found.systematic if p.key == "curve_scale"), None),
        "fit": [{"channel": q.channel, "excess": q.excess, "explained": q.explained} for q in found.fit],
        "warnings": list(found.warnings),
        "seconds": time.perf_counter() - started,
    }


CONFIDENT = 0.01
"""An answer without a warning is confidently wrong if its interval excludes the truth and its relative error
of m exceeds this. Below this error the wrong input has no significant effect."""


def judged(row: Row, said: dict[str, Any]) -> str:
    """Outcome of a job.

    A correct shot is "quiet" or "alarm". The curve's scale is "said" or "silent". For all others "first" or
    "second" is the rank of the correct cause among the likely ones. "refused" is a rejection with the correct
    key in its message. With "other" or "none" the value is withheld, and another cause or no cause is
    reported. "harmless" is an answer whose interval contains the truth, "confident" a wrong answer. A pair is
    "first" if both inputs are among the first three likely causes, of which two may be twins, and "second" if
    only one of them is.
    """
    right = {row.key, *row.names} - {""}
    if said["refused"]:
        known = not right or any(key in said["refused"] for key in right)
        return "refused" if known else "other"
    named = [cause["key"] for cause in said["causes"] if cause["named"]]
    if row.name.startswith(RIGHT):
        return "alarm" if named or not said["identified"] else "quiet"
    if row.name == CURVE:
        visible = said["curve_visible"]
        return "said" if visible is not None and visible < 0.05 else "silent"
    if row.second:
        count = sum(not keys.isdisjoint(named[:3]) for keys in (right, {*row.second}))
        if count:
            return "first" if count == 2 else "second"
    for place, word in enumerate(("first", "second")):
        if right & set(named[place : place + 1]):
            return word
    if not said["identified"]:
        return "other" if named else "none"
    error = said["value"] / said["truth"] - 1.0
    beyond = abs(error) > max(CONFIDENT, 2.0 * said["sigma"] / said["truth"])
    return "confident" if beyond and not named else "other" if beyond else "harmless"


def summary(jobs: list[dict[str, Any]]) -> dict[str, float]:
    """Shares of the relevant wrong shots, and counts.

    "first", "first two": shares with the correct cause at this rank, including rejections that report it;
    "confident": wrong answers without a reported cause; "harmless": shots that are excluded from the shares;
    "right": number of correct shots; "alarms": number of these with an alarm; "inside": number of these with
    the truth inside k = 2.
    """
    ends = [(BY_NAME[said["row"]], judged(BY_NAME[said["row"]], said)) for said in jobs]
    right = [end for row, end in ends if row.name.startswith(RIGHT)]
    wrong = [end for row, end in ends if not row.name.startswith(RIGHT) and row.name != CURVE]
    counted = [end for end in wrong if end != "harmless"]
    n = max(len(counted), 1)
    first = sum(end in ("first", "refused") for end in counted)
    return {
        "wrong": len(counted),
        "first": first / n,
        "first two": (first + counted.count("second")) / n,
        "confident": wrong.count("confident"),
        "harmless": wrong.count("harmless"),
        "right": len(right),
        "alarms": right.count("alarm"),
        "inside": sum(
            abs(said["value"] - said["truth"]) <= 2.0 * said["sigma"]
            for said in jobs
            if said["row"].startswith(RIGHT) and not said["refused"]
        ),
    }


def table(jobs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One entry for each row: outcomes of its jobs, error of m, estimated value of the correct cause."""
    found = []
    for row in BY_NAME.values():
        mine = [said for said in jobs if said["row"] == row.name]
        if not mine:
            continue
        ends = [judged(row, said) for said in mine]
        errors = [said["value"] / said["truth"] - 1.0 for said in mine if not said["refused"]]
        right = [
            (cause, said["truth"])
            for said in mine
            if not said["refused"]
            for cause in said["causes"]
            if cause["key"] == row.key
        ]
        corrected = [None if cause["m"] is None else cause["m"] / truth - 1.0 for cause, truth in right]
        others = [
            max((c["evidence"] for c in said["causes"] if not c.get("within", False)), default=0.0)
            for said in mine
            if not said["refused"]
        ]
        found.append(
            {
                "row": row.name,
                "right cause": row.key,
                "shots": len(mine),
                "ends": {end: ends.count(end) for end in sorted(set(ends))},
                "identified": sum(bool(said.get("identified")) for said in mine),
                "corrected errors": corrected,
                "errors": errors,
                "values": [cause["value"] for cause, _ in right],
                "evidence": others,
                "seconds": sum(said["seconds"] for said in mine) / len(mine),
            }
        )
    return found


def finite(value: Any) -> Any:
    """A JSON value in which numbers that are not finite are null."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def jobs_of(args: argparse.Namespace, shots: list[Path]) -> Iterator[Job]:
    """Jobs for all correct shots, and for each wrong input the requested number of shots. Each row has other
    shots."""
    words = [word for word in args.rows.split(",") if word]
    meshes = None if args.mesh is None else (args.mesh, args.refined_mesh)
    first = 0
    for row in PAIRS if args.pairs else ROWS:
        if words and not any(word in row.name for word in words):
            continue
        many = args.right if row.name.startswith(RIGHT) else args.shots
        chosen = [shots[(first + i) % len(shots)] for i in range(min(many, len(shots)))]
        first += 0 if row.name.startswith(RIGHT) else many
        yield from (Job(row.name, shot, args.device, args.threads, meshes) for shot in chosen)


def asked(args: argparse.Namespace) -> tuple[Series, list[int]]:
    """The population, and the numbers of its correct shots."""
    series = population(args.population, seed=args.seed)
    return series, list(series.numbers)[: max(args.right, args.shots, args.least)]


def made(args: argparse.Namespace) -> list[Path]:
    """Folders of the correct shots; missing ones are made."""
    series, numbers = asked(args)
    found = make(
        series,
        args.out / "shots",
        numbers=numbers,
        device=args.device,
        threads=args.threads,
        workers=args.workers,
        progress=lambda one: print(one.folder, flush=True),
    )
    return [one.folder for one in found]


def made_by_felupe(args: argparse.Namespace) -> list[Path]:
    """Folders of the correct shots with truths of FElupe; missing ones are made.

    Shots with a failed simulation are printed and left out.
    """
    series, numbers = asked(args)
    shots = {n: series.shot(n) for n in numbers}
    places = {n: place_of(series, shot, args.out / "shots") for n, shot in shots.items()}
    missing = [(shots[n], place) for n, place in places.items() if not place.exists()]
    for text in results(write_felupe_shot, missing, args.workers):
        print(text, flush=True)
    there = [n for n, place in places.items() if place.exists()]
    return [one.folder for one in make(series, args.out / "shots", numbers=there)]  # only checks them


def write_felupe_shot(shot: ShotSpecification, folder: Path) -> str:
    """Write one shot with a truth of FElupe; returns the folder, or the reason why it cannot be made."""
    from populations.felupe_impact import truth

    try:
        write_shot(shot, truth(shot.quantities), folder)
    except TruthError as error:
        return f"{shot.name} cannot be made: {error}"
    return str(folder)


def attempt(job: Job) -> dict[str, Any]:
    """Result of `run`, or the error of a job that failed."""
    try:
        return finite(run(job))  # type: ignore[no-any-return]
    except Exception as error:  # counted and excluded: the other jobs continue
        return {"broke": f"{job.row} of {job.shot.name} broke: {type(error).__name__}: {error}"}


def line(one: dict[str, Any]) -> str:
    """One line of text with the outcome of a job."""
    if "broke" in one:
        return str(one["broke"])
    return f"{one['shot']} {one['row']}: {judged(BY_NAME[one['row']], one)}"


def main() -> int:
    """Make the shots, run the missing jobs, print the table; returns 1 if a job failed."""
    parser = command(__doc__)
    parser.add_argument("--population", type=Path, default=POPULATION)
    parser.add_argument("--seed", type=int, help="another population of the same kind")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--shots", type=int, default=6, help="of each wrong input")
    parser.add_argument("--right", type=int, default=40, help="right shots, of each of their rows")
    parser.add_argument("--least", type=int, default=0, help="shots that are made at least")
    parser.add_argument("--rows", default="", help="only rows whose names hold one of these words")
    parser.add_argument("--mesh", type=mesh, metavar="16x22", help="surrogate's mesh, for a trial")
    parser.add_argument("--refined-mesh", type=mesh, metavar="32x44", default=(32, 44))
    parser.add_argument("--pairs", action="store_true", help="the rows with two wrong inputs each")
    words = "program of the truths; give each its own --out"
    parser.add_argument("--truth", choices=("own", "felupe"), default="own", help=words)
    parser.add_argument("--table", type=Path, help="where the table is written, as JSON")
    args = parser.parse_args()
    shots = made_by_felupe(args) if args.truth == "felupe" else made(args)
    jobs = {job.file(args.out): (job,) for job in jobs_of(args, shots)}
    print(f"{sum(not path.exists() for path in jobs)} of {len(jobs)} jobs to do", flush=True)
    each = answers(attempt, jobs, workers=args.workers, line=line)
    for path, one in zip(jobs, each, strict=True):
        if "broke" in one:
            path.unlink()  # repeated by the next call
    broken = sum("broke" in one for one in each)
    rows = table([one for one in each if "broke" not in one])
    for entry in rows:
        ends = ", ".join(f"{n} {end}" for end, n in entry["ends"].items())
        strongest = sorted(round(x) for x in entry["evidence"] if x is not None)
        print(f"{entry['row']:38} {entry['shots']:3} {ends:40} evidence {strongest}")
    kept = [one for one in each if "broke" not in one]
    total = summary(kept)
    print(", ".join(f"{word} {value:.3g}" for word, value in total.items()))
    if args.table is not None:
        about = {"population": Path(args.population).name, "seed": args.seed, "device": args.device}
        about["truth"] = args.truth
        write(args.table, finite({"about": about, "summary": total, "rows": rows}), indent=1)
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
