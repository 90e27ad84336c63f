"""Does the interval cover the truth as often as it says? `python -m benchmarks.coverage --out FOLDER`.

Every experiment is identified by `kolsky.identification.identify` itself, as a laboratory would, from its own
noisy force, outline, flyer and curve. Counted is how often the k = 2 interval holds the true value. The
folder keeps every answer, a file an experiment, and a folder beside it every truth: called again, the study
goes on where it stopped.
"""

import argparse
import json
import os
import platform
import time
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage_counts import summary
from benchmarks.coverage_problem import (
    BONDED,
    GROUP,
    SLIDING,
    TRUTH_ELEMENTS,
    TRUTH_GRADING,
    FloatArray,
    drawn,
    experiment,
    middle,
    simulate,
)
from kolsky.base.process import process_pool
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings

NAMES = {
    "m": "stiffness_factor",
    "f": "friction",
    "beta": "damping",
    "nu": "poisson",
    **{name: name for name in ("stiffness_factor", "friction", "damping", "poisson")},
}
USUAL = Settings()
"""Meshes and replicates of a laboratory that changes nothing."""


@dataclass(frozen=True)
class Study:
    """What is asked; two studies that are equal here have the same experiments and the same answers."""

    free: tuple[str, ...]
    """Free parameters; the others are held at their true values."""
    mesh: tuple[int, int] = USUAL.numerics.mesh
    """The surrogate's mesh."""
    refined_mesh: tuple[int, int] = USUAL.refined_mesh
    """The mesh of the answer."""
    truth_mesh: tuple[int, int] = (128, 172)
    """Mesh of the truth, which is the middle of both elements on it, see `TRUTH_GRADING`."""
    device: str = "cpu"
    """Where the identifications are run; one process a core on a CPU, each with one thread."""
    truth_device: str = "cpu"
    """Where the truths are run, ten of them as one batch."""
    seed: int = 1
    """Of the truths and of all noise."""

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
        return SLIDING if "friction" in self.free else BONDED


@dataclass(frozen=True)
class Found:
    """One experiment and its answer; NaN where there is none."""

    number: int
    truth: dict[str, float]
    value: dict[str, float]
    sigma: dict[str, float]
    """Combined standard uncertainty."""
    correction: dict[str, float]
    """What the extrapolation to an infinitely fine mesh has added to the value."""
    parts: dict[str, dict[str, float]]
    """Standard uncertainties of each parameter by source, of the noise and of the numerics."""
    routes: dict[str, dict[str, list[float]]]
    """Value and standard uncertainty of each parameter by the force and the outline alone."""
    profile: dict[str, list[float]]
    """95 % interval of the profile likelihood, on the refined mesh."""
    outcome: str
    """Verdicts, or why there is no answer."""
    warnings: list[str]
    figures: dict[str, float]
    """Of the search, as `Identification.surrogate` has them: how far the path was moved, the next valley."""
    seconds: float


def identified(study: Study, number: int, force: FloatArray, Z: FloatArray) -> Found:
    """Identify one experiment."""
    started = time.perf_counter()
    setup, truth = drawn(number, study.seed)
    rng = np.random.default_rng([study.seed, 1, number])
    shot = experiment(number, setup, truth, (force, Z), study.interface, rng)
    threads = 1 if study.device == "cpu" else None
    settings = Settings(
        free=dict.fromkeys(study.free),
        numerics=Numerics(mesh=study.mesh, device=study.device, threads=threads),
        refined_mesh=study.refined_mesh,
        seed=study.seed + number,
    )
    true = {name: float(getattr(truth, name)) for name in study.free}
    nothing = dict.fromkeys(study.free, float("nan"))
    try:
        result = identify(shot, settings)
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
    """Simulate the exact force and outline of some experiments of one group, and keep them."""
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
        place = _truth_file(study, folder, number)
        place.parent.mkdir(parents=True, exist_ok=True)
        partial = place.with_suffix(".part.npz")
        np.savez_compressed(partial, force=force, Z=Z)
        partial.replace(place)
    return f"truths {numbers[0]} to {numbers[-1]}: {time.perf_counter() - started:.0f} s"


def answer(study: Study, folder: Path, number: int) -> str:
    """Identify one experiment whose truth is kept, and keep the answer."""
    with np.load(_truth_file(study, folder, number)) as stored:
        found = identified(study, number, stored["force"], stored["Z"])
    place = _answer_file(folder, number)
    partial = place.with_suffix(".part")
    partial.write_text(json.dumps(asdict(found)) + "\n")
    partial.replace(place)
    errors = [f"{name} {found.value[name] - true:+.2g}" for name, true in found.truth.items()]
    limits = [f"{2.0 * found.sigma[name]:.2g}" for name in found.truth]
    said = ", ".join(f"{error} ({limit})" for error, limit in zip(errors, limits, strict=True))
    return f"experiment {number}: {said}; {found.outcome}; {found.seconds:.0f} s"


def run(
    study: Study, folder: Path, numbers: list[int], *, workers: int, truths_only: bool = False
) -> list[dict[str, Any]]:
    """Answers of the experiments, in their order; those that the folder holds are read.

    With `truths_only` what is missing of the truths is made, and there are no answers.

    Raises
    ------
    ValueError
        If the folder holds another study.
    """
    _hold_study(study, folder)
    missing = [n for n in numbers if not _answer_file(folder, n).exists()]
    without = [n for n in missing if not _truth_file(study, folder, n).exists()]
    groups = [[n for n in without if n // GROUP == group] for group in sorted({n // GROUP for n in without})]
    if truths_only:
        missing = []
    if workers == 1:
        for group in groups:
            print(make_truths(study, folder, group), flush=True)
        for number in missing:
            print(answer(study, folder, number), flush=True)
    else:
        # Processes that each take all cores for their linear algebra would wait for each other.
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        with process_pool(workers) as pool:
            for done in as_completed([pool.submit(make_truths, study, folder, group) for group in groups]):
                print(done.result(), flush=True)
            for done in as_completed([pool.submit(answer, study, folder, n) for n in missing]):
                print(done.result(), flush=True)
    if truths_only:
        return []
    return [json.loads(_answer_file(folder, n).read_text()) for n in numbers]


def main() -> None:
    """Run a study, or what is left of it, and sum it up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--free", default="m", help="m, or m,beta or m,poisson,beta or m,f,beta")
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--mesh", default=_written(Study.mesh), help="of the surrogate")
    parser.add_argument("--refined-mesh", default=_written(Study.refined_mesh), help="of the answer")
    parser.add_argument("--truth-mesh", default=_written(Study.truth_mesh), help="of the truth")
    parser.add_argument("--device", default="cpu", help="of the identifications")
    parser.add_argument("--truth-device", help="of the truths; that of the identifications if left out")
    parser.add_argument("--workers", type=int, default=1, help="processes that identify")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--truths", action="store_true", help="make the truths, identify nothing")
    parser.add_argument("--rows", help="FIRST:STOP, a part of the experiments")
    parser.add_argument("--out", type=Path, required=True, help="folder; a study that it holds is continued")
    given = parser.parse_args()
    study = Study(
        free=_free(given.free),
        mesh=_mesh(given.mesh),
        refined_mesh=_mesh(given.refined_mesh),
        truth_mesh=_mesh(given.truth_mesh),
        device=given.device,
        truth_device=given.truth_device or given.device,
        seed=given.seed,
    )
    first, stop = map(int, (given.rows or f"0:{given.experiments}").split(":"))
    started = time.perf_counter()
    each = run(study, given.out, list(range(first, stop)), workers=given.workers, truths_only=given.truths)
    if given.truths:
        return
    machine = {"device": given.device, "processor": platform.machine(), "cores": os.cpu_count() or 1}
    seconds = {
        "this call": time.perf_counter() - started,
        "each": float(np.mean([e["seconds"] for e in each])),
    }
    said = {"machine": machine, "study": asdict(study), "workers": given.workers, "seconds": seconds}
    whole = {**said, **summary(each)}
    print(json.dumps(whole, indent=2))
    (given.out / "summary.json").write_text(json.dumps({**whole, "each": each}, indent=1) + "\n")


def _free(text: str) -> tuple[str, ...]:
    """Parameters by their names or symbols.

    Raises
    ------
    SystemExit
        If there is no such parameter, or one is named twice.
    """
    unknown = [name for name in text.split(",") if name not in NAMES]
    found = tuple(NAMES[name] for name in text.split(",") if name in NAMES)
    if unknown or len(set(found)) < len(found):
        raise SystemExit(f"--free {text}: each of {', '.join(NAMES)} at most once, with commas between")
    return found


def _hold_study(study: Study, folder: Path) -> None:
    """Write what the folder is of, or refuse a folder of something else; the device may change."""
    folder.mkdir(parents=True, exist_ok=True)
    said = json.loads(json.dumps({key: value for key, value in asdict(study).items() if "device" not in key}))
    place = folder / "study.json"
    if place.exists() and json.loads(place.read_text()) != said:
        raise ValueError(f"{place} is of another study: {place.read_text().strip()}; give another --out")
    place.write_text(json.dumps(said) + "\n")


def _answer_file(folder: Path, number: int) -> Path:
    return folder / f"answer-{number:04d}.json"


def _truth_file(study: Study, folder: Path, number: int) -> Path:
    """Truths do not depend on what is free, but on the interface: studies beside each other share them."""
    mesh = _written(study.truth_mesh)
    return folder.parent / f"truths-{study.seed}-{mesh}-both-{study.interface}" / f"truth-{number:04d}.npz"


def _mesh(text: str) -> tuple[int, int]:
    across, along = text.split("x")
    return int(across), int(along)


def _written(mesh: tuple[int, int]) -> str:
    return f"{mesh[0]}x{mesh[1]}"


if __name__ == "__main__":
    main()
