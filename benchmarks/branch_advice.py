"""One relaxing shot alone, and its elastic twin: `python -m benchmarks.branch_advice --out FOLDER`.

Is a branch recommended for the first and not for the second? Each draw of `benchmarks.joint_coverage` gives
two shots at one speed: of its material with the branch, and without. Both are identified by
`kolsky.identification.identify` as elastic ones, with everything at its defaults. Counted is how often the
output recommends `--relaxation prony`. What it is decided by is kept: the chance of the linear test, and the
strength, time, share and criterion of the branch that was searched for.
The folder keeps every answer: called again, the study goes on where it stopped.
"""

import argparse
import json
import os
import platform
import time
from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmarks.branch_advice_counts import summary, table
from benchmarks.joint_coverage import Study, hold, specified, truth
from kolsky.base.process import process_pool
from kolsky.cli.texts import mesh
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings
from kolsky.shot.load import load_shot
from kolsky.virtual.make import Place, make_places

TWINS = {"relaxing": False, "elastic": True}
"""Folder of each kind of shot -> whether nothing relaxes."""
ADVICE = "--relaxation prony"
"""What a recommendation says."""


def place_of(study: Study, folder: Path, kind: str, number: int) -> Place:
    """The shot of a draw: the first of those that `benchmarks.joint_coverage` makes of it."""
    return specified(replace(study, elastic=TWINS[kind]), folder / kind, number)[0]


def answer(study: Study, folder: Path, kind: str, number: int) -> str:
    """Identify a shot as an elastic one, keep what is said of a branch."""
    started = time.perf_counter()
    threads = 1 if study.device == "cpu" else None
    settings = Settings(
        numerics=Numerics(mesh=study.mesh, device=study.device, threads=threads),
        refined_mesh=study.refined_mesh,
        seed=study.seed + number,
    )
    shot, place = place_of(study, folder, kind, number)
    said: dict[str, Any] = {"number": number, "kind": kind, "truth": truth(study, number)}
    said["speed"] = shot.quantities.motion.speed
    try:
        found = identify(replace(load_shot(place / "shot.toml"), relaxation=None), settings)
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
    path = _answer_file(folder, kind, number)
    partial = path.with_suffix(".part")
    partial.write_text(json.dumps(said) + "\n")
    partial.replace(path)
    outcome = said["error"] or ("advised" if said["advised"] else "no advice")
    return f"{kind} {number}: {outcome} {said['branch']}; {said['seconds']:.0f} s"


def run(study: Study, folder: Path, numbers: Sequence[int], workers: int) -> list[dict[str, Any]]:
    """Answers of all shots, both kinds; those that the folder holds are read."""
    jobs = [(kind, n) for kind in TWINS for n in numbers]
    missing = [(kind, n) for kind, n in jobs if not _answer_file(folder, kind, n).exists()]
    threads = 1 if study.truth_device == "cpu" else None
    places = [place_of(study, folder, kind, n) for kind, n in missing]
    make_places(places, device=study.truth_device, threads=threads, workers=workers)
    if workers == 1:
        for kind, n in missing:
            print(answer(study, folder, kind, n), flush=True)
    else:
        with process_pool(workers) as pool:
            for done in as_completed([pool.submit(answer, study, folder, *job) for job in missing]):
                print(done.result(), flush=True)
    return [json.loads(_answer_file(folder, kind, n).read_text()) for kind, n in jobs]


def main() -> None:
    """Run the study, or what is left of it, and sum it up."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=20, help="two shots each")
    parser.add_argument("--mesh", default="24x32", help="of the surrogate")
    parser.add_argument("--refined-mesh", default="64x86", help="of the answer")
    parser.add_argument("--truth-mesh", default="96x129", help="of the truth, the middle of both elements")
    parser.add_argument("--device", default="cpu", help="of the identifications")
    parser.add_argument("--truth-device", help="of the truths; that of the identifications if left out")
    parser.add_argument("--workers", type=int, default=1, help="processes that share the shots")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", help="FIRST:STOP, a part of the draws")
    parser.add_argument("--out", type=Path, required=True, help="folder; a study that it holds is continued")
    given = parser.parse_args()
    study = Study(
        mesh=mesh("--mesh", given.mesh),
        refined_mesh=mesh("--refined-mesh", given.refined_mesh),
        truth_mesh=mesh("--truth-mesh", given.truth_mesh),
        device=given.device,
        truth_device=given.truth_device or given.device,
        seed=given.seed,
    )
    first, stop = map(int, (given.rows or f"0:{given.draws}").split(":"))
    hold(study, given.out)
    started = time.perf_counter()
    each = run(study, given.out, list(range(first, stop)), given.workers)
    said = {
        "machine": {"device": given.device, "processor": platform.machine(), "cores": os.cpu_count() or 1},
        "study": {name: x for name, x in asdict(study).items() if name not in ("elastic", "slow")},
        "workers": given.workers,
        "seconds": time.perf_counter() - started,
        **summary(each),
    }
    print(table(said))
    (given.out / "summary.json").write_text(json.dumps(said, indent=1) + "\n")


def _answer_file(folder: Path, kind: str, number: int) -> Path:
    return folder / f"{kind}-{number:03d}.json"


if __name__ == "__main__":
    main()
