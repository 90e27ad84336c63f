"""Coverage of the intervals of single shots: `python -m populations.coverage --out FOLDER`.

`kolsky.identification.identify` identifies every experiment from its noisy force, outline, flyer and curve,
as in a laboratory. The study counts how often the k = 2 interval contains the true value. The folder stores
one file for each answer; a folder next to it stores the truths.
"""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.identification import identify
from populations.coverage_counts import summary
from populations.coverage_problem import (
    BONDED,
    GROUP,
    SLIDING,
    SURFACES,
    TRUTH_ELEMENTS,
    TRUTH_GRADING,
    FloatArray,
    drawn,
    experiment,
    middle,
    simulate,
)
from populations.driver import (
    USUAL,
    about,
    add_meshes,
    answers,
    command,
    hold,
    numbers,
    results,
    settings,
    write,
)

PARAMETERS = {
    "m": "stiffness_factor",
    "f": "friction",
    "beta": "damping",
    "nu": "poisson",
    **{name: name for name in ("stiffness_factor", "friction", "damping", "poisson")},
}


@dataclass(frozen=True)
class Study:
    """Settings of a study. Studies with equal settings have the same experiments and the same answers."""

    free: tuple[str, ...]
    """Free parameters; the others are held at their true values."""
    mesh: tuple[int, int] = USUAL.numerics.mesh
    """The surrogate's mesh."""
    refined_mesh: tuple[int, int] = USUAL.refined_mesh
    """The mesh of the answer."""
    truth_mesh: tuple[int, int] = (128, 172)
    """Mesh of the truth, which is the mean of both elements on it, see `TRUTH_GRADING`."""
    device: str = "cpu"
    """Device of the identifications; on a CPU one process per core, each with one thread."""
    truth_device: str = "cpu"
    """Device of the truths, which are simulated in batches of ten."""
    seed: int = 1
    """Seed of the truths and of all noise."""
    surface: str = ""
    """Contact law of faces and side. Empty: coulomb if the friction is free, otherwise bonded."""

    def __post_init__(self) -> None:
        finest = max(self.mesh[0], self.refined_mesh[0])
        if self.truth_mesh[0] < 1.5 * finest:
            raise ValueError(
                f"the truth's mesh has {self.truth_mesh[0]} elements across the radius, must have 1.5 times "
                f"the {finest} of the identification: a truth as coarse as the answer flatters it"
            )

    @property
    def interface(self) -> str:
        """Contact law of faces and side."""
        return self.surface or (SLIDING if "friction" in self.free else BONDED)


@dataclass(frozen=True)
class Found:
    """One experiment and its answer; NaN where there is none."""

    number: int
    truth: dict[str, float]
    value: dict[str, float]
    sigma: dict[str, float]
    """Combined standard uncertainty."""
    correction: dict[str, float]
    """Correction of the value by extrapolation to an infinitely fine mesh."""
    parts: dict[str, dict[str, float]]
    """Standard uncertainties of each parameter by source, of the noise and of the numerics."""
    routes: dict[str, dict[str, list[float]]]
    """Value and standard uncertainty of each parameter from the force only and from the outline only."""
    profile: dict[str, list[float]]
    """95 % interval of the profile likelihood, on the refined mesh."""
    outcome: str
    """Verdicts, or the reason for a missing answer."""
    warnings: list[str]
    figures: dict[str, float]
    """Results of the search from `Identification.surrogate`: shift of the flyer's path, next local
    minimum."""
    seconds: float


def identified(study: Study, number: int, force: FloatArray, Z: FloatArray) -> Found:
    """Identify one experiment."""
    started = time.perf_counter()
    setup, truth = drawn(number, study.seed)
    rng = np.random.default_rng([study.seed, 1, number])
    shot = experiment(number, setup, truth, (force, Z), study.interface, rng)
    asked = settings(
        study,
        1 if study.device == "cpu" else None,
        free=dict.fromkeys(study.free),
        seed=study.seed + number,
    )
    true = {name: float(getattr(truth, name)) for name in study.free}
    nothing = dict.fromkeys(study.free, float("nan"))
    try:
        result = identify(shot, asked)
    except ValueError as error:
        parts: dict[str, dict[str, float]] = {name: {} for name in study.free}
        lost = (nothing, nothing, nothing, parts, {}, {}, str(error), [], {})
        return Found(number, true, *lost, time.perf_counter() - started)
    e = result.estimates
    return Found(
        number=number,
        truth=true,
        value={name: e[name].value for name in study.free},
        sigma={name: e[name].sigma for name in study.free},
        correction={name: e[name].mesh_correction for name in study.free},
        parts={name: {**e[name].noise_parts, **e[name].numerical_parts} for name in study.free},
        routes={
            route.name: {name: [route.parameters[name], route.sigma[name]] for name in study.free}
            for route in result.routes
            if route.sigma
        },
        profile={profile.name: list(profile.interval) for profile in result.profiles},
        outcome="; ".join(sorted({estimate.outcome.value for estimate in e.values()})),
        warnings=list(result.warnings),
        figures=dict(result.surrogate),
        seconds=time.perf_counter() - started,
    )


def make_truths(study: Study, folder: Path, numbers: list[int]) -> str:
    """Simulate and store the exact force and outline of some experiments of one group."""
    started = time.perf_counter()
    pairs = [drawn(number, study.seed) for number in numbers]
    one, other = (
        simulate(
            pairs[0][0],
            [truth for _, truth in pairs],
            mesh=study.truth_mesh,
            device=study.truth_device,
            element=element,
            interface=study.interface,
            grading=TRUTH_GRADING,
        )
        for element in TRUTH_ELEMENTS
    )
    seen = [middle(*both) for both in zip(one, other, strict=True)]
    for number, (force, Z) in zip(numbers, seen, strict=True):
        place = truth_file(study, folder, number)
        place.parent.mkdir(parents=True, exist_ok=True)
        partial = place.with_suffix(".part.npz")
        np.savez_compressed(partial, force=force, Z=Z)
        partial.replace(place)
    return f"truths {numbers[0]} to {numbers[-1]}: {time.perf_counter() - started:.0f} s"


def answer(study: Study, folder: Path, number: int) -> dict[str, Any]:
    """Identify one experiment whose truth is stored; returns the fields of `Found`."""
    with np.load(truth_file(study, folder, number)) as stored:
        return asdict(identified(study, number, stored["force"], stored["Z"]))


def line(one: dict[str, Any]) -> str:
    """One line of text for an answer."""
    errors = ", ".join(
        f"{name} {one['value'][name] - true:+.2g} ({2.0 * one['sigma'][name]:.2g})"
        for name, true in one["truth"].items()
    )
    return f"experiment {one['number']}: {errors}; {one['outcome']}; {one['seconds']:.0f} s"


def answer_file(folder: Path, number: int) -> Path:
    """File of an answer."""
    return folder / f"answer-{number:04d}.json"


def truth_file(study: Study, folder: Path, number: int) -> Path:
    """File of a truth. Truths depend on the interface but not on the free parameters, so studies in one
    folder share them."""
    mesh = "x".join(map(str, study.truth_mesh))
    return folder.parent / f"truths-{study.seed}-{mesh}-both-{study.interface}" / f"truth-{number:04d}.npz"


def run(
    study: Study, folder: Path, numbers: Sequence[int], *, workers: int, truths_only: bool = False
) -> list[dict[str, Any]]:
    """Answers of the experiments in order. With `truths_only` only the missing truths are made, and no answer
    is returned."""
    hold(study, folder)
    missing = [
        n for n in numbers
        if not (answer_file(folder, n).exists() or truth_file(study, folder, n).exists())
    ]  # fmt: skip
    groups = [(study, folder, list(group)) for _, group in groupby(sorted(missing), lambda n: n // GROUP)]
    for words in results(make_truths, groups, workers):
        print(words, flush=True)
    if truths_only:
        return []
    jobs = {answer_file(folder, n): (study, folder, n) for n in numbers}
    return answers(answer, jobs, workers=workers, line=line)


def main() -> None:
    """Run or continue a study and write its summary."""
    parser = command(__doc__, seed=1)
    add_meshes(parser, truth=Study.truth_mesh)
    parser.add_argument(
        "--free", type=_free, default=("stiffness_factor",), help="m, or m,beta or m,poisson,beta or m,f,beta"
    )
    words = "contact law of faces and side; coulomb where the friction is free, else bonded"
    parser.add_argument("--surface", choices=SURFACES, default="", help=words)
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--rows", type=numbers, help="FIRST:STOP, a part of the experiments")
    parser.add_argument("--truth-device", help="of the truths; that of the identifications if left out")
    parser.add_argument("--truths", action="store_true", help="make the truths, identify nothing")
    given = parser.parse_args()
    study = Study(
        free=given.free,
        surface=given.surface,
        mesh=given.mesh,
        refined_mesh=given.refined_mesh,
        truth_mesh=given.truth_mesh,
        device=given.device,
        truth_device=given.truth_device or given.device,
        seed=given.seed,
    )
    started = time.perf_counter()
    rows = given.rows or range(given.experiments)
    each = run(study, given.out, rows, workers=given.workers, truths_only=given.truths)
    if given.truths:
        return
    seconds = {
        "this call": time.perf_counter() - started,
        "each": float(np.mean([e["seconds"] for e in each])),
    }
    whole = {**about(study, given), "seconds": seconds, **summary(each)}
    print(json.dumps(whole, indent=2))
    write(given.out / "summary.json", {**whole, "each": each}, indent=1)


def _free(text: str) -> tuple[str, ...]:
    """Parameters from their names or symbols; SystemExit for an unknown or repeated one."""
    unknown = [name for name in text.split(",") if name not in PARAMETERS]
    found = tuple(PARAMETERS[name] for name in text.split(",") if name in PARAMETERS)
    if unknown or len(set(found)) < len(found):
        raise SystemExit(f"--free {text}: each of {', '.join(PARAMETERS)} at most once, with commas between")
    return found


if __name__ == "__main__":
    main()
