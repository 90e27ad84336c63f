"""A coverage study with truths of another program: `python -m populations.other_program --out FOLDER`.

DOLFINx simulates experiments of `populations.coverage_problem`, two of each group
(`tests/reference/M_dolfinx.py`, run by the interpreter of `--python`). They are identified as in
`populations.coverage`. The folder stores every truth and every answer, so an interrupted study can be
continued. `--truths` makes truths only. `--answers` identifies the existing truths only. `--compare` compares
truths with those of this package's solver. `--csv` prints a truth with fewer frames.
"""

import json
import os
import platform
import subprocess
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from populations import coverage_problem as problem
from populations.coverage import Study, answer, answer_file, line, summary, truth_file
from populations.driver import add_meshes, answers, command, hold, write
from populations.truth_meshes import COARSE, STEPS

SCRIPT = Path(__file__).resolve().parents[1] / "tests" / "reference" / "M_dolfinx.py"
ELEMENTS = (24, 16)
"""Elements across the radius and along half the length."""
STEP = 0.5
"""Time step of the other program [us]."""
OWN_MESH = (96, 129)
"""Mesh of this package's truths in `--compare`."""
EACH = 2
"""Number of experiments of each group."""
BIN = 16
"""Number of force samples that are averaged for the comparison: about one frame."""
EVERY = 8
"""Number of frames from row to row in the output of `--csv`."""
UNUSED = ("friction", "force_sigma", "flyer_sigma", "outline_sigma", "curve_sigma")
"""Parameters without effect on the exact histories of a bonded test."""


def numbers_of(groups: int) -> list[int]:
    """Numbers of the experiments: the first of every group, then the second. An incomplete study then has all
    groups."""
    return [problem.GROUP * group + i for i in range(EACH) for group in range(groups)]


def described(setup: problem.Setup, truth: problem.Truth) -> dict[str, Any]:
    """Input of the other program, in SI units."""
    return {
        **{key: value for key, value in asdict(truth).items() if key not in UNUSED},
        "diameter": setup.diameter,
        "length": setup.length,
        "density": setup.density,
        "heights": problem.HEIGHTS.tolist(),
        "frames": setup.frames[setup.frames > 0.0].tolist(),
        "samples": setup.samples.tolist(),
    }


def make_truth(study: Study, folder: Path, number: int, python: str) -> None:
    """Simulate one experiment with the other program, unless its truth exists."""
    place = truth_file(study, folder, number)
    if not place.exists():
        simulate_elsewhere(place, *problem.drawn(number, study.seed), python)
        print(f"truth {number}", flush=True)


def simulate_elsewhere(place: Path, setup: problem.Setup, truth: problem.Truth, python: str) -> None:
    """Write the file of an experiment's exact force and outline by the other program."""
    place.parent.mkdir(parents=True, exist_ok=True)
    asked, partial = place.with_suffix(".json"), place.with_suffix(".part.npz")
    asked.write_text(json.dumps(described(setup, truth)) + "\n")
    options = ["--elements", str(ELEMENTS[0]), str(ELEMENTS[1]), "--step", str(STEP)]
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([python, str(SCRIPT), str(asked), str(partial), *options], check=True, env=one_thread)
    partial.replace(place)


def slopes(number: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Derivatives of force and outline by m, nu and beta on a coarse mesh, each of shape [k, 3]."""
    setup, truth = problem.drawn(number, seed)
    seen = problem.simulate(
        setup, problem.moved(truth, STEPS), mesh=COARSE, device="cpu", element="one_point"
    )
    force, outline = ([part.ravel() for part in parts] for parts in zip(*seen, strict=True))
    return problem.differences(force, STEPS), problem.differences(outline, STEPS)


def binned(force: FloatArray) -> FloatArray:
    """Means of `BIN` samples each, along the first axis. An incomplete last bin is left out."""
    n = len(force) // BIN
    return np.asarray(force[: n * BIN].reshape(n, BIN, *force.shape[1:]).mean(1))


def apart(
    one: tuple[FloatArray, FloatArray],
    other: tuple[FloatArray, FloatArray],
    slope: tuple[FloatArray, FloatArray],
    truth: problem.Truth,
) -> dict[str, float]:
    """Differences of force [N] at the samples and radii [m], and their equivalent in m, nu and beta by
    weighted least squares.

    ``slope``: their derivatives by the three parameters. ``truth``: the experiment whose noise gives the
    weights.
    """
    force, outline = binned(one[0]) - binned(other[0]), (one[1] - other[1]).ravel()
    weights = np.sqrt(BIN) / truth.force_sigma, 1.0 / truth.outline_sigma
    A = np.vstack([weights[0] * binned(slope[0]), weights[1] * slope[1]])
    b = np.concatenate([weights[0] * force, weights[1] * outline])
    size = np.linalg.norm(A, axis=0)
    found = np.linalg.lstsq(A / size, b, rcond=None)[0] / size
    return {
        "force rms over sigma": float(np.sqrt(np.mean(force**2)) / truth.force_sigma),
        "outline rms (um)": float(1e6 * np.sqrt(np.mean(outline**2))),
        **dict(zip(STEPS, found.tolist(), strict=True)),
    }


def thinned(force: FloatArray, Z: FloatArray) -> FloatArray:
    """A truth at every eighth frame: mean force since the previous row [N], radii at `HEIGHTS` [m]."""
    radii = Z.reshape(-1, len(problem.HEIGHTS))[EVERY - 1 :: EVERY]
    means = force[1:].reshape(len(radii), -1).mean(1)
    return np.column_stack([means, radii])


def compare(study: Study, folder: Path, number: int) -> dict[str, float]:
    """Difference between a truth and that of this package's solver; the result is stored."""
    place = folder / f"compared-{number:04d}.json"
    if not place.exists():
        setup, truth = problem.drawn(number, study.seed)
        options: dict[str, Any] = {"mesh": OWN_MESH, "device": "cpu", "grading": problem.TRUTH_GRADING}
        own = problem.middle(
            *(problem.simulate(setup, [truth], element=e, **options)[0] for e in problem.TRUTH_ELEMENTS)
        )
        with np.load(truth_file(study, folder, number)) as stored:
            said = apart((stored["force"], stored["Z"]), own, slopes(number, study.seed), truth)
        write(place, {"number": number, "speed": truth.speed, **said})
    kept: dict[str, float] = json.loads(place.read_text())
    return kept


def record(study: Study, folder: Path, numbers: list[int]) -> dict[str, Any]:
    """Summary of all answers in the folder, and all comparisons."""
    there = [answer_file(folder, n) for n in sorted(numbers) if answer_file(folder, n).exists()]
    each = [json.loads(place.read_text()) for place in there]
    of = {
        **asdict(study),
        "truth_mesh": [ELEMENTS[0], 2 * ELEMENTS[1]],
        "truth": f"DOLFINx, Q2 / DPC1, generalised alpha, {STEP} us",
    }
    return {
        "machine": {"processor": platform.machine(), "cores": os.cpu_count() or 1},
        "study": of,
        "asked": len(numbers),
        "seconds": {"each": float(np.mean([one["seconds"] for one in each]))},
        **summary(each),
        "compared": [json.loads(place.read_text()) for place in sorted(folder.glob("compared-*.json"))],
        "each": each,
    }


def main() -> None:
    """Run or continue the study and write its summary."""
    parser = command(__doc__, seed=61)
    add_meshes(parser)
    parser.add_argument("--groups", type=int, default=10, help="of two experiments each")
    parser.add_argument("--python", default="/usr/bin/python3", help="an interpreter that has DOLFINx 0.5")
    parser.add_argument("--truths", action="store_true", help="make the truths, identify nothing")
    parser.add_argument("--answers", action="store_true", help="identify what has a truth, make none")
    parser.add_argument("--compare", type=int, nargs="*", default=[], help="experiments, minutes each")
    parser.add_argument("--csv", type=int, help="print this experiment, thinned, and do nothing else")
    given = parser.parse_args()
    study = Study.of(given, free=tuple(STEPS))
    # Truths are stored in --out, next to the answers' folder, separate from those of `populations.coverage`.
    folder, numbers = given.out / "answers", numbers_of(given.groups)
    hold(study, folder)
    if given.csv is not None:
        make_truth(study, folder, given.csv, given.python)
        with np.load(truth_file(study, folder, given.csv)) as stored:
            rows = thinned(stored["force"], stored["Z"])
        print("\n".join(",".join(f"{x:.7g}" for x in row) for row in rows))
        return
    if not given.answers:
        for number in numbers:
            make_truth(study, folder, number, given.python)
    for number in given.compare:
        print(json.dumps(compare(study, folder, number)), flush=True)
    if given.truths:
        return
    jobs = {
        answer_file(folder, n): (study, folder, n) for n in numbers if truth_file(study, folder, n).exists()
    }
    answers(answer, jobs, workers=given.workers, line=line)
    whole = record(study, folder, numbers)
    write(given.out / "summary.json", whole, indent=1)
    print(json.dumps({key: value for key, value in whole.items() if key != "each"}, indent=2))


if __name__ == "__main__":
    main()
